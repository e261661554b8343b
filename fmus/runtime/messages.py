"""Messages of an FMU, by status code.  The native FMU gets the same texts (packaging/native).

Fields of the templates:

    t, h            start (s) and size (s) of the requested communication step
    now, t0         current time, start of the current internal step (s)
    start, stop     start and stop time of the experiment (s)
    name, value     variable and the value that was set
    text, unit, allowed     description, unit and range that the variable declares
    function, reference     FMI function and value reference of a call
    word            subject of a call: a type, an argument, the allowed phases
    phase           present phase of the instance

Numbers are formatted by repr.
"""

from __future__ import annotations

from typing import Any

from . import codes
from .integrator import MAX_EVALUATIONS, MAX_STEPS
from .run_state import RunState
from .variable_declarations import VariableDeclaration

RUN_MESSAGES = {
    codes.DIVERGED: "the solution diverges after t = {t0!r} s, or an equation has no finite value there, such as the "
    "square root of a negative number; reduce the excitation or check the parameters",
    codes.STALLED: "the solver stalls after t = {t0!r} s: its step has shrunk to 4e-15 of the time since "
    "the start of the run; raise solver.rtol, or choose another solver.method if the FMU has one",
    codes.TOO_MANY_STEPS: f"more than {MAX_STEPS} internal steps or {MAX_EVALUATIONS} right-hand sides within one "
    "communication step after t = {now!r} s; take shorter communication steps, raise solver.rtol, or choose another "
    "solver.method if the FMU has one",
    codes.CHATTERING: "a condition of choose() changes again and again at t = {t0!r} s, because the motion returns to "
    "it from both sides; declare dry friction as a Contact, or make the transition continuous",
    codes.BAD_STEP: "a communication step of {h!r} s from t = {t!r} s is refused: it must be positive, start at the "
    "current time, t = {now!r} s, and end by the stop time, t = {stop!r} s",
    codes.BAD_START: "start time = {start!r} s is refused: it must be a finite number",
    codes.BAD_STOP: "stop time = {stop!r} s is refused: it must be above the start time, {start!r} s",
    codes.INTERRUPTED: "the run was interrupted after t = {now!r} s; reset the FMU to run again",
}
VALUE_MESSAGES = {
    codes.CALCULATED: "{name} = {value} is refused: {text} is calculated and cannot be set",
    codes.FIXED: "{name} = {value} is refused: {text} is fixed and must be set before initialisation ends; reset the "
    "FMU to change it",
    codes.OUT_OF_RANGE: "{name} = {value}{unit} is refused: {text} must be {allowed}",
}
CALL_MESSAGES = {
    codes.UNKNOWN_REFERENCE: "value reference {reference} is refused: this FMU has no such variable of type {word}; "
    "see its modelDescription.xml",
    codes.INVALID_STATE: "a saved state is refused: another FMU wrote it or it has been changed; save the state again "
    "and pass it on unchanged",
    codes.OUT_OF_ORDER: "{function} is refused: the FMU is {phase}, but the call is allowed only when it is {word}",
    codes.NULL_POINTER: "{function} is refused: {word} is NULL",
    codes.NO_MEMORY: "{function} failed: out of memory",
    codes.NOT_SUPPORTED: "{function} is refused: this FMU does not support it, see its modelDescription.xml",
    codes.BUFFER_TOO_SMALL: "{function} is refused: the buffer is too small for a state",
    codes.WRONG_TOKEN: "{function} is refused: the GUID or instantiation token must be {word}, as in "
    "modelDescription.xml",
    codes.NO_PARTIAL_DERIVATIVE: "{function} is refused: value reference {reference} has no such partial derivative; "
    "knowns are Real states, inputs and parameters, unknowns are Real outputs and derivatives",
    codes.NO_OUTPUT_DERIVATIVE: "{function} is refused: value reference {reference} has no such derivative; outputs "
    "have derivatives of order 1",
    codes.NO_INPUT_DERIVATIVE: "{function} is refused: value reference {reference} accepts no such derivative; an "
    "input without a range and without a declared rate accepts a finite derivative of order 1; leave out the others "
    "and take shorter communication steps",
    codes.WRONG_LENGTH: "{function} is refused: {word} is wrong",
}
INCONSISTENT_RATE = (
    "{name} jumps at one communication point after another, now at t = {now!r} s, and its rate {rate} does not explain "
    "it, so that contacts slip at each of them; set {rate} to the time derivative of {name}"
)
PHASE_NAMES = {
    codes.INSTANTIATED: "instantiated",
    codes.INITIALISING: "in initialisation mode",
    codes.RUNNING: "running",
    codes.TERMINATED: "terminated",
    codes.EVENT: "in event mode",
    codes.CONTINUOUS: "in continuous-time mode",
    codes.INTERMEDIATE: "in intermediate update mode",
}


def run_message(status: int, run: RunState, model: Any, t: float, h: float) -> str:
    """Return the message for a failed run, or for the rule of the model that the values violate."""
    if status not in RUN_MESSAGES:
        return rule_message(status, run, model)
    solver = run.solver
    now, t0 = solver.start_time + solver.t, solver.start_time + solver.step.t0
    return RUN_MESSAGES[status].format(t=t, h=h, now=now, t0=t0, start=run.start_time, stop=run.stop_time)


def rule_message(status: int, run: RunState, model: Any) -> str:
    """Return the message for a rule that the values violate, or that the run has violated."""
    values = vars(model)
    if "violation_time" in values:
        values = {**values, "violation_time": run.solver.start_time + model.violation_time}
    return str(model.rules[status]).format_map(values)


def inconsistent_rate_message(run: RunState, model: Any) -> str:
    """Return the warning about an input that jumps against its rate."""
    name, rate = model.prescribed_inputs[model.inconsistent_input - 1]
    return INCONSISTENT_RATE.format(name=name, rate=rate, now=run.solver.start_time + run.solver.t)


def value_message(reason: int, name: str, declaration: VariableDeclaration, value: float) -> str:
    """Return the message for a value that the declared variable `name` rejects."""
    return VALUE_MESSAGES[reason].format(
        name=name,
        value=repr(value),
        unit=declaration.unit_suffix,
        text=declaration.text,
        allowed=declaration.allowed_range,
    )
