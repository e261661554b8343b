"""Co-simulation of an external FMU with equal communication steps."""

from collections.abc import Callable
from contextlib import suppress
from typing import Any

from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import fmi2Discard, fmi2LastSuccessfulTime, fmi2Terminated

from ...errors import HarnessError
from ..inputs import InputSignals
from .refinement_run import StepRefusedError, TerminatedError, TimeGrid


def cosimulate(
    fmu: Any,
    version: str,
    span: TimeGrid,
    record: Callable[[float], None],
    report_progress: Callable[..., Any],
    signals: InputSignals | None = None,
) -> None:
    """Step from start to stop and record rows.

    Raises
    ------
    TerminatedError
        If the FMU terminates the simulation.
    StepRefusedError
        If the FMU rejects a step.
    """
    step = step_fmi2 if version == "2.0" else step_fmi3
    start, stop, h = span.start, span.stop, span.h
    count = max(1, round((stop - start) / h))
    is_even = abs(start + count * h - stop) < 1e-6 * h  # otherwise the last step is shorter
    count += start + count * h < stop and not is_even
    t = start
    if signals:
        signals.apply(t, after_event=True)
    record(t)
    for i in range(1, count + 1):
        target = stop if i == count else start + i * h
        report_progress(span.progress(t))
        if signals:
            signals.apply(0.5 * (t + target))
        try:
            step(fmu, t, h if is_even else target - t)  # an FMU with a fixed step may compare the step exactly
        except TerminatedError as error:
            if error.t is not None and t < error.t < target + 1e-6 * h:  # an FMU may report any time
                record(error.t)
            raise
        t = target
        if signals:
            signals.apply(t, after_event=True)
        record(t)


def step_fmi2(fmu: Any, t: float, h: float) -> None:
    """Call fmi2DoStep."""
    try:
        fmu.doStep(t, h)
    except FMICallException as error:
        if error.status != fmi2Discard:
            raise
        terminated, last_time = False, None
        with suppress(FMICallException):  # these queries are optional
            terminated = fmu.getBooleanStatus(fmi2Terminated)
            last_time = fmu.getRealStatus(fmi2LastSuccessfulTime)
        if terminated:
            raise TerminatedError(last_time, "fmi2DoStep returned Discard with fmi2Terminated") from None
        raise StepRefusedError(f"fmi2DoStep returned Discard for a step of {h:.4g} s at t = {t:.9g} s") from None


def step_fmi3(fmu: Any, t: float, h: float) -> None:
    """Call fmi3DoStep."""
    try:
        _, terminate, early, last_time = fmu.doStep(t, h)
    except FMICallException as error:
        if error.status != fmi2Discard:
            raise
        raise StepRefusedError(f"fmi3DoStep returned Discard for a step of {h:.4g} s at t = {t:.9g} s") from None
    if terminate:
        raise TerminatedError(last_time if early else t + h, "fmi3DoStep returned terminateSimulation")
    if early:
        raise HarnessError("fmi3DoStep returned early without permission")
