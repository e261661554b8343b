"""The answer by a second route, for any values: what the stability table compares with.

Closed forms in 120 digits, or scipy's methods at 1e-11 and less, restarted at every change of mode or value: as the
file of the model in models/ has it.  Nothing is shared with the FMUs.  Of others two methods may agree: certified.py.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from importlib.util import find_spec
from itertools import pairwise

import numpy as np

from ..errors import HarnessError
from .models import MODEL_MODULES
from .segments import ParameterSpan, Segment


@dataclass(frozen=True)
class ReferenceTrajectory:
    """`x`, `v` (n,) at `times` (n,) in s; `events` are (time, new mode), the start left out."""

    times: np.ndarray
    x: np.ndarray
    v: np.ndarray
    events: tuple[tuple[float, int], ...]

    def error(self, x: np.ndarray, v: np.ndarray) -> float:
        """The largest error of positions and speeds (n,); NaN if there is one.

        Position counts in its largest value; speed in its largest, or in what covers the largest distance in the run.
        """
        far = max_abs(self.x)
        fast = max(max_abs(self.v), far / (self.times[-1] - self.times[0]))
        return max_or_nan(max_abs(x - self.x) / (far or 1.0), max_abs(v - self.v) / (fast or 1.0))


def max_abs(values: np.ndarray) -> float:
    """The largest size among values (n,); NaN if there is one."""
    return float(np.abs(values).max())


def max_or_nan(*errors: float) -> float:
    """The largest of some errors; NaN if there is one, which Python's own max may lose."""
    return float(np.max(errors))


@dataclass(frozen=True)
class CommunicationGrid:
    """Communication points from `start` to `stop` (s): evenly `points` steps, and where values change or modes do."""

    start: float
    stop: float
    points: int
    changes: tuple[float, ...] = ()
    at_events: bool = False

    def times(self, events: Iterable[float]) -> list[float]:
        run = self.stop - self.start
        even = [self.start + run * i / self.points for i in range(self.points)]
        return sorted({*even, self.stop, *self.changes, *(events if self.at_events else ())})


def compute_reference(model: str, spans: list[ParameterSpan], grid: CommunicationGrid) -> ReferenceTrajectory:
    """The motion over the spans, at the points of the grid."""
    pieces = list(MODEL_MODULES[model].pieces(spans))
    events = mode_changes(pieces)
    times = grid.times(t for t, _ in events)
    x, v = sample_segments(pieces, times).T
    return ReferenceTrajectory(np.array(times), x, v, tuple(events))


def mode_changes(pieces: list[Segment]) -> list[tuple[float, int]]:
    """The changes of mode: times in s, and the modes that hold from there on."""
    return [(float(new.start), new.mode) for old, new in pairwise(pieces) if new.mode != old.mode]


def sample_segments(pieces: list[Segment], times: list[float]) -> np.ndarray:
    """Positions and speeds (n, 2) at n rising times in s."""
    rows, i = [], 0
    for t in times:
        while i + 1 < len(pieces) and pieces[i + 1].start <= t:
            i += 1
        x, v = pieces[i].at(t)
        rows.append((float(x), float(v)))
    return np.array(rows)


def require_reference_packages() -> None:
    """HarnessError if what the answers are made with is not installed."""
    missing = [name for name in ("mpmath", "scipy") if find_spec(name) is None]
    if missing:
        names = " and ".join(missing)
        raise HarnessError(f"the answers to compare with need {names}: try `pip install {' '.join(missing)}`")
