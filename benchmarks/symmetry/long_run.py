"""Events of a long run from 0 s: in a periodic motion, each period must have the events of the one before."""

from collections.abc import Mapping
from math import isfinite, ulp
from typing import Any

import numpy as np

from harness.errors import HarnessError
from harness.simulation.fmu_instance import CALL_FAILURES
from harness.simulation.recorder import Recorder
from harness.simulation.variable_values import convert_value

from .motion import FmuRuns

DURATION = 1e5  # s
EARLY = 0.1  # part of the run in which the period is determined, in its second half
MAX_PERIOD = 400  # events
MAX_LONG_STEPS = 20_000_000
SLACK = 100.0  # tolerance of a period relative to that of the method


def record_events(runs: FmuRuns, values: Mapping[str, Any], duration: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the times (n,) in s of the changes of mode in a run from 0 s, and the modes (n, contacts) after them.

    Raises
    ------
    HarnessError
        If the run fails.
    """
    instance = runs.open()
    settings = [(runs.variables[name], convert_value(runs.variables[name], value)) for name, value in values.items()]
    rows: list[tuple[float, ...]] = []
    names = ["solver.t_next", "events.t_last", *runs.modes]
    recorder = Recorder(instance, [(runs.variables[name], ()) for name in names], lambda row: None)
    t_next, t_last = recorder.cell("solver.t_next"), recorder.cell("events.t_last")
    t, last, n_steps = 0.0, None, 0
    try:
        instance.initialize(settings, 0.0, duration)
        recorder.record(t)
        last = t_last.value
        while t < duration:
            end = min(t_next.value, duration) if isfinite(t_next.value) else duration  # where the next step fails
            instance.step(t, end - t)
            t = end
            recorder.record(t)
            n_steps += 1
            if t_last.value != last:
                last = t_last.value
                rows.append((last, *(instance.get(name) for name in runs.modes)))
            if n_steps > MAX_LONG_STEPS:
                raise HarnessError(f"it needs more than {MAX_LONG_STEPS} steps: {t:.6g} s are done")
    except CALL_FAILURES as error:
        runs.close()
        raise HarnessError(instance.log.error_message or str(error)) from None
    table = np.array(rows).reshape(-1, 1 + len(runs.modes))
    return table[:, 0], table[:, 1:]


def find_period(times: np.ndarray, modes: np.ndarray, duration: float, tolerance: float) -> int:
    """Return the number of events in a period, by the second half of the early part of a run; 0 if there is none."""
    early = np.flatnonzero((times > 0.5 * EARLY * duration) & (times < EARLY * duration))
    for period in range(1, min(MAX_PERIOD, len(early) // 3) + 1):
        first, later = early[:-period], early[period:]
        gaps = times[later] - times[first]
        if (modes[later] == modes[first]).all() and np.ptp(gaps) <= tolerance * gaps.mean():
            return period
    return 0


def find_irregular_period(times: np.ndarray, modes: np.ndarray, duration: float, rtol: float) -> tuple[str, bool]:
    """Return the first event that differs from the one a period before, and whether the motion has a period.

    A motion that comes to rest has no events after the early part.
    """
    tolerance = SLACK * rtol
    late_events = np.flatnonzero(times >= EARLY * duration)
    if not (times > 0.5 * EARLY * duration).any():
        return "", True
    period = find_period(times, modes, duration, tolerance)
    if period == 0:
        return "", False
    first = np.flatnonzero(times > 0.5 * EARLY * duration)[0]
    usual = float(times[first + period] - times[first])
    for k in late_events:
        gap = times[k] - times[k - period]
        if (modes[k] != modes[k - period]).any():
            return f"event {k} at {times[k]:.9g} s: another mode than a period before", True
        if abs(gap - usual) > tolerance * usual + 8 * ulp(times[k]):
            return (
                f"event {k} at {times[k]:.9g} s: {gap:.9g} s after that of the period before, not {usual:.9g} s",
                True,
            )
    if duration - times[-1] > usual + tolerance * usual:
        return f"no event after {times[-1]:.9g} s", True
    return "", True
