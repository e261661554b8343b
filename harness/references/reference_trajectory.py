"""References for any parameter values, for the stability table and the benchmarks.

The module of a model in models/ defines its reference: a closed form in 120 digits, or a run of a method of scipy at a
tolerance of at most 1e-11, restarted at every change of mode or value.  References share no code with the FMUs.  For a
model without such a module, certification.py compares two methods of its FMU.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from ..simulation.solution import Solution
from .models import MODEL_MODULES
from .segments import ParameterSpan, Segment


def motion_error(reference: Solution, x: np.ndarray, v: np.ndarray) -> float:
    """Return the largest relative error of positions and velocities (n,); NaN if one of them is NaN.

    Positions are relative to the largest position; velocities to the largest velocity, or to the one that covers the
    largest position within the run if that is larger.
    """
    true_x, true_v = reference.states.T
    x_max = max_abs(true_x)
    v_max = max(max_abs(true_v), x_max / (reference.times[-1] - reference.times[0]))
    return max_or_nan(max_abs(x - true_x) / (x_max or 1.0), max_abs(v - true_v) / (v_max or 1.0))


def max_abs(values: np.ndarray) -> float:
    """Return the largest magnitude among values (n,); NaN if one of them is NaN."""
    return float(np.abs(values).max())


def max_or_nan(*errors: float) -> float:
    """Return the largest error; NaN if one of them is NaN, which Python's own max may not return."""
    return float(np.max(errors))


@dataclass(frozen=True)
class CommunicationGrid:
    """Communication points of a run.

    Attributes
    ----------
    start, stop : float
        Start and stop in s.
    intervals : int
        Number of equal communication steps.
    changes : tuple of float
        Times in s at which values change.
    at_events : bool
        Whether there is a point at each event.
    """

    start: float
    stop: float
    intervals: int
    changes: tuple[float, ...] = ()
    at_events: bool = False

    def times(self, events: Iterable[float]) -> list[float]:
        """Return the points in s, given the times of the events."""
        duration = self.stop - self.start
        points = [self.start + duration * i / self.intervals for i in range(self.intervals)]
        return sorted({*points, self.stop, *self.changes, *(events if self.at_events else ())})


def compute_reference(model: str, spans: list[ParameterSpan], grid: CommunicationGrid) -> Solution:
    """Return the reference of a model over the spans, at the points of the grid."""
    segments = list(MODEL_MODULES[model].solve_segments(spans))
    events = mode_changes(segments)
    times = grid.times(t for t, _ in events)
    return Solution(np.array(times), sample_segments(segments, times), events, start_mode=segments[0].mode)


def mode_changes(segments: list[Segment]) -> list[tuple[float, int]]:
    """Return the changes of mode: times in s and new modes."""
    return [(float(new.start), new.mode) for old, new in pairwise(segments) if new.mode != old.mode]


def sample_segments(segments: list[Segment], times: list[float]) -> np.ndarray:
    """Return positions and velocities (n, 2) at n rising times in s."""
    rows, i = [], 0
    for t in times:
        while i + 1 < len(segments) and segments[i + 1].start <= t:
            i += 1
        x, v = segments[i].at(t)
        rows.append((float(x), float(v)))
    return np.array(rows)
