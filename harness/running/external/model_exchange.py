"""One pass of model exchange, by fmpy's CVode: BDF, with Jacobians by differences."""

from collections.abc import Callable
from math import inf
from typing import Any

from fmpy.simulation import Input
from fmpy.sundials import CVodeSolver

from ...errors import HarnessError
from ..inputs import InputSignals
from .refinement_run import TerminatedError, TimeGrid

MAX_CVODE_STEPS = 100_000  # of CVode from one point to the next
MAX_EVENTS = 1000  # at one time
TIME_TOLERANCE = 1e-9  # share of a communication step: times this close are one


class CheckedCVode(CVodeSolver):
    """The same, which ends where a call of the FMU fails, and says so now and then."""

    error: Exception | None = None

    def __init__(self, heed: Callable[[], Any], **options: Any) -> None:
        self.report_progress = heed
        super().__init__(**options)

    def f(self, t: float, *arguments: Any) -> int:
        self.input.apply(t)  # fmpy sets inputs at the ends of its steps only
        return self.call_checked(super().f, t, *arguments)

    def g(self, *arguments: Any) -> int:
        return self.call_checked(super().g, *arguments)

    def call_checked(self, call: Callable[..., int], *arguments: Any) -> int:
        """What ctypes would print and swallow is kept."""
        try:
            self.report_progress()
            return call(*arguments)
        except Exception as error:
            self.error = error
            return -1

    def step(self, t: float, target: float) -> tuple[bool, Any, float]:
        """To the target or to the next event, times in s."""
        try:
            return super().step(t, target)
        except (RuntimeError, TypeError) as error:  # the path of CVode's source stands before its sentence
            raise self.error or HarnessError(f"fmpy's CVode: {str(error).rpartition(': ')[2]}") from None


def integrate(
    fmu: Any,
    found: Any,
    span: TimeGrid,
    rtol: float,
    sample: Callable[[float], None],
    heed: Callable[..., Any],
    signals: InputSignals | None = None,
) -> None:
    """Integrate and sample at even points, and before and after each event; Ended if the FMU ends itself."""
    start, stop, h = span.start, span.stop, span.h
    old = found.fmiVersion == "2.0"
    if signals:
        signals.apply(start, after_event=True)
    update = fmu.newDiscreteStates if old else fmu.updateDiscreteStates
    upcoming = update_discrete_states(update, start)
    fmu.enterContinuousTimeMode()
    solver = CheckedCVode(
        heed,
        nx=found.numberOfContinuousStates,
        nz=found.numberOfEventIndicators,
        get_x=fmu.getContinuousStates,
        set_x=fmu.setContinuousStates,
        get_dx=fmu.getDerivatives if old else fmu.getContinuousStateDerivatives,
        get_z=fmu.getEventIndicators,
        get_nominals=fmu.getNominalsOfContinuousStates,
        set_time=fmu.setTime,
        input=signals or Input(fmu, found, None),
        startTime=start,
        maxStep=(stop - start) / 50,
        relativeTolerance=rtol,
        maxNumSteps=MAX_CVODE_STEPS,
    )
    t, point, count, still = start, 1, max(1, round((stop - start) / h)), 0
    near = TIME_TOLERANCE * h
    sample(t)
    while t < stop:
        target = stop if point >= count else start + point * h
        jump = signals.next_jump(t) if signals else inf
        goal = min(target, upcoming, jump)
        event, _, reached = solver.step(t, goal)
        before, t = t, goal if abs(reached - goal) <= near else reached
        fmu.setTime(t)
        if signals:
            signals.apply(t)
        heed(span.progress(t))
        stepped = ended = False
        if found.modelExchange.needsCompletedIntegratorStep:
            stepped, ended = fmu.completedIntegratorStep()
        sample(t)
        if ended:
            raise TerminatedError(t, "it answered terminateSimulation to a completed step")
        if event or stepped or t >= min(upcoming, jump):
            fmu.enterEventMode()
            if signals:
                signals.apply(t, after_event=True)
            upcoming = update_discrete_states(update, t)
            fmu.enterContinuousTimeMode()
            solver.reset(t)
            sample(t)
        still = 0 if t > before else still + 1
        if still > MAX_EVENTS:
            raise HarnessError(f"{MAX_EVENTS} events in a row at t = {t:.9g} s")
        point += t >= target


def update_discrete_states(update: Callable[[], tuple[bool, bool, bool, bool, bool, float]], t: float) -> float:
    """The time of the next event in s, inf if there is none, after all that happens at an event."""
    for _ in range(MAX_EVENTS):
        again, ended, _, _, defined, upcoming = update()
        if ended:
            raise TerminatedError(t, "it answered terminateSimulation to an event")
        if defined and not upcoming >= t:
            raise HarnessError(f"it tells its next event for {upcoming:.9g} s, at t = {t:.9g} s")
        if not again and not (defined and upcoming == t):
            return upcoming if defined else inf
    raise HarnessError(f"its discrete states do not settle at t = {t:.9g} s")
