"""Model exchange of an external FMU with fmpy's CVode: BDF with finite-difference Jacobians."""

from collections.abc import Callable
from math import inf
from typing import Any

from fmpy.simulation import Input
from fmpy.sundials import CVodeSolver

from ...errors import HarnessError
from ..inputs import InputSignals
from .refinement_run import TerminatedError, TimeGrid

MAX_CVODE_STEPS = 100_000  # between two output points
MAX_EVENTS = 1000  # at one time
TIME_TOLERANCE = 1e-9  # relative to the communication step


class CheckedCVode(CVodeSolver):
    """CVode that reports progress and stops at a failed FMI call."""

    error: Exception | None = None

    def __init__(self, report_progress: Callable[[], Any], **options: Any) -> None:
        self.report_progress = report_progress
        super().__init__(**options)

    def f(self, t: float, *arguments: Any) -> int:
        self.input.apply(t)  # fmpy sets inputs at the ends of its steps only
        return self.call_checked(super().f, t, *arguments)

    def g(self, *arguments: Any) -> int:
        return self.call_checked(super().g, *arguments)

    def call_checked(self, call: Callable[..., int], *arguments: Any) -> int:
        """Call the FMU and keep its exception, which ctypes would print and swallow."""
        try:
            self.report_progress()
            return call(*arguments)
        except Exception as error:
            self.error = error
            return -1

    def step(self, t: float, target: float) -> tuple[bool, Any, float]:
        """Integrate from t to the target or to the next event; times in s."""
        try:
            return super().step(t, target)
        except (RuntimeError, TypeError) as error:  # the path of CVode's source precedes its message
            raise self.error or HarnessError(f"fmpy's CVode: {str(error).rpartition(': ')[2]}") from None


def integrate(
    fmu: Any,
    description: Any,
    span: TimeGrid,
    rtol: float,
    record: Callable[[float], None],
    report_progress: Callable[..., Any],
    signals: InputSignals | None = None,
) -> None:
    """Integrate and record rows at equidistant points, and before and after each event.

    Raises
    ------
    TerminatedError
        If the FMU terminates the simulation.
    """
    start, stop, h = span.start, span.stop, span.h
    is_fmi2 = description.fmiVersion == "2.0"
    if signals:
        signals.apply(start, after_event=True)
    update = fmu.newDiscreteStates if is_fmi2 else fmu.updateDiscreteStates
    next_event = update_discrete_states(update, start)
    fmu.enterContinuousTimeMode()
    solver = CheckedCVode(
        report_progress,
        nx=description.numberOfContinuousStates,
        nz=description.numberOfEventIndicators,
        get_x=fmu.getContinuousStates,
        set_x=fmu.setContinuousStates,
        get_dx=fmu.getDerivatives if is_fmi2 else fmu.getContinuousStateDerivatives,
        get_z=fmu.getEventIndicators,
        get_nominals=fmu.getNominalsOfContinuousStates,
        set_time=fmu.setTime,
        input=signals or Input(fmu, description, None),
        startTime=start,
        maxStep=(stop - start) / 50,
        relativeTolerance=rtol,
        maxNumSteps=MAX_CVODE_STEPS,
    )
    t, point, count, n_stalled = start, 1, max(1, round((stop - start) / h)), 0
    tolerance = TIME_TOLERANCE * h
    record(t)
    while t < stop:
        target = stop if point >= count else start + point * h
        jump = signals.next_jump(t) if signals else inf
        goal = min(target, next_event, jump)
        event, _, reached = solver.step(t, goal)
        previous, t = t, goal if abs(reached - goal) <= tolerance else reached
        fmu.setTime(t)
        if signals:
            signals.apply(t)
        report_progress(span.progress(t))
        stepped = terminated = False
        if description.modelExchange.needsCompletedIntegratorStep:
            stepped, terminated = fmu.completedIntegratorStep()
        record(t)
        if terminated:
            raise TerminatedError(t, "it returned terminateSimulation from a completed step")
        if event or stepped or t >= min(next_event, jump):
            fmu.enterEventMode()
            if signals:
                signals.apply(t, after_event=True)
            next_event = update_discrete_states(update, t)
            fmu.enterContinuousTimeMode()
            solver.reset(t)
            record(t)
        n_stalled = 0 if t > previous else n_stalled + 1
        if n_stalled > MAX_EVENTS:
            raise HarnessError(f"{MAX_EVENTS} events in a row at t = {t:.9g} s")
        point += t >= target


def update_discrete_states(update: Callable[[], tuple[bool, bool, bool, bool, bool, float]], t: float) -> float:
    """Iterate the discrete states at an event; return the time of the next event in s, inf if there is none."""
    for _ in range(MAX_EVENTS):
        needs_update, terminated, _, _, is_defined, next_event = update()
        if terminated:
            raise TerminatedError(t, "it returned terminateSimulation from an event")
        if is_defined and not next_event >= t:
            raise HarnessError(f"it sets its next event to {next_event:.9g} s, at t = {t:.9g} s")
        if not needs_update and not (is_defined and next_event == t):
            return next_event if is_defined else inf
    raise HarnessError(f"its discrete states do not settle at t = {t:.9g} s")
