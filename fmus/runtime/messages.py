"""All that an FMU says, by its code; the native kind gets these very words.

Fields: t, h are the communication step that is asked for; now, t_end the present point and where the run ends; t0 is
the beginning of the internal step in force; start, stop are the experiment; text, unit and allowed are declared of the
variable `name`.  Of a call: word is what it is about, a type, an address, phases.  Numbers stand as repr writes them.
"""

from __future__ import annotations

from typing import Any

from . import codes
from .call_sequence import RunState
from .integrator import MAX_EVALUATIONS, MAX_STEPS
from .variable_declarations import VariableDeclaration

RUN_MESSAGES = {
    codes.DIVERGED: "the motion leaves the range of numbers after t = {t0!r} s; lower what drives it or check the "
    "parameters",
    codes.STALLED: "the solver makes no headway after t = {t0!r} s, its step is as small as the time axis can hold; "
    "raise solver.rtol or choose another solver.method",
    codes.TOO_MANY_STEPS: f"more than {MAX_STEPS} internal steps or {MAX_EVALUATIONS} right-hand sides within one "
    "communication step, from t = {now!r} s on; choose another solver.method, raise solver.rtol or take "
    "shorter communication steps",
    codes.BAD_STEP: "a communication step of {h!r} s from t = {t!r} s is refused: it must be above zero, begin at the "
    "present point, t = {now!r} s, and end by the stop time, t = {t_end!r} s",
    codes.BAD_START: "start time = {start!r} s is refused: it must be a finite number",
    codes.BAD_STOP: "stop time = {stop!r} s is refused: it must be above the start time, {start!r} s",
    codes.INTERRUPTED: "the run was interrupted after t = {now!r} s; reset the FMU to run again",
}
VALUE_MESSAGES = {
    codes.CALCULATED: "{name} = {value} is refused: {text} is calculated, not set",
    codes.FIXED: "{name} = {value} is refused: {text} is fixed, it must be set before initialisation ends; reset the "
    "FMU to change it",
    codes.OUT_OF_RANGE: "{name} = {value}{unit} is refused: {text} must be {allowed}",
}
CALL_MESSAGES = {
    codes.UNKNOWN_REFERENCE: "value reference {reference} is refused: it is not that of a variable of type "
    "{word}; the model description of this very FMU has those that are",
    codes.INVALID_STATE: "a saved state is refused: it is not, to the last bit, one that this very FMU wrote; save a "
    "state anew and pass it on unchanged",
    codes.OUT_OF_ORDER: "{function} is refused: the FMU is {phase}, the call is allowed when it is {word}",
    codes.NULL_POINTER: "{function} is refused: an address is missing, {word} is NULL",
    codes.NO_MEMORY: "{function} failed: no memory is left",
    codes.NOT_SUPPORTED: "{function} is refused: this FMU does not offer it, see its description",
    codes.BUFFER_TOO_SMALL: "{function} is refused: a state does not fit into so few bytes",
    codes.WRONG_TOKEN: "{function} is refused: the GUID or token must be {word}, that of modelDescription.xml",
    codes.NO_PARTIAL_DERIVATIVE: "{function} is refused: value reference {reference} is not that of a state or an "
    "input, or of what follows from them",
    codes.NO_OUTPUT_DERIVATIVE: "{function} is refused: value reference {reference} has no such derivative; those "
    "told are of outputs, and of the order 1",
    codes.NO_INPUT_DERIVATIVE: "{function} is refused: value reference {reference} takes no such derivative; an "
    f"input without a range takes finite ones of the orders 1 to {codes.MAX_INPUT_ORDER}, so leave out those "
    "above and take shorter communication steps",
    codes.WRONG_LENGTH: "{function} is refused: {word} is another number than there are",
}
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
    """The sentence about a run, or about the rule of the model that its values break."""
    if status not in RUN_MESSAGES:
        return str(model.rules[status - codes.FIRST_RULE - 1]).format_map(vars(model))
    solver = model.solver
    present = {"now": solver.t, "t0": solver.step.t0, "t_end": solver.step.t_end}
    return RUN_MESSAGES[status].format(t=t, h=h, start=run.start_time, stop=run.stop_time, **present)


def value_message(reason: int, name: str, declared: VariableDeclaration, value: float) -> str:
    """The sentence about a value that cannot be used, of a declared variable."""
    return VALUE_MESSAGES[reason].format(
        name=name, value=repr(value), unit=declared.unit_suffix, text=declared.text, allowed=declared.allowed
    )
