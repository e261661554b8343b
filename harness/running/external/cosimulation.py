"""One pass of co-simulation: equal communication steps from start to stop."""

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
    sample: Callable[[float], None],
    heed: Callable[..., Any],
    signals: InputSignals | None = None,
) -> None:
    """Step and sample; Ended if the FMU ends itself, Refused if it does not take a step."""
    step = step_fmi2 if version == "2.0" else step_fmi3
    start, stop, h = span.start, span.stop, span.h
    count = max(1, round((stop - start) / h))
    even = abs(start + count * h - stop) < 1e-6 * h  # else the last step is a shorter one
    count += start + count * h < stop and not even
    t = start
    if signals:
        signals.apply(t, after_event=True)
    sample(t)
    for i in range(1, count + 1):
        target = stop if i == count else start + i * h
        heed(span.progress(t))
        if signals:
            signals.apply(0.5 * (t + target))
        try:
            step(fmu, t, h if even else target - t)  # who takes even steps only may look at the last bit
        except TerminatedError as end:
            if end.t is not None and t < end.t < target + 1e-6 * h:  # what it tells may be anything
                sample(end.t)
            raise
        t = target
        if signals:
            signals.apply(t, after_event=True)
        sample(t)


def step_fmi2(fmu: Any, t: float, h: float) -> None:
    """fmi2DoStep."""
    try:
        fmu.doStep(t, h)
    except FMICallException as error:
        if error.status != fmi2Discard:
            raise
        ended, last = False, None
        with suppress(FMICallException):  # it need not tell
            ended = fmu.getBooleanStatus(fmi2Terminated)
            last = fmu.getRealStatus(fmi2LastSuccessfulTime)
        if ended:
            raise TerminatedError(last, "fmi2DoStep answered Discard, and fmi2Terminated is true") from None
        raise StepRefusedError(f"fmi2DoStep answered Discard to a step of {h:.4g} s at t = {t:.9g} s") from None


def step_fmi3(fmu: Any, t: float, h: float) -> None:
    """fmi3DoStep."""
    try:
        _, terminate, early, last = fmu.doStep(t, h)
    except FMICallException as error:
        if error.status != fmi2Discard:
            raise
        raise StepRefusedError(f"fmi3DoStep answered Discard to a step of {h:.4g} s at t = {t:.9g} s") from None
    if terminate:
        raise TerminatedError(last if early else t + h, "fmi3DoStep answered terminateSimulation")
    if early:
        raise HarnessError("fmi3DoStep returned early, which it was not allowed")
