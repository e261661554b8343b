"""Sketches of a motion for the report: small curves with few points, which it draws in its own colours."""

import numpy as np

from ...results.summary import SKETCH_SIZE, Sketch
from ...running.trajectory import Trajectory

MARGIN = 6  # around the curve
COLUMNS = 400  # horizontal resolution to which a curve is reduced


def draw_sketches(run: Trajectory) -> tuple[Sketch, ...]:
    """Return position over time and speed over position, the first two outputs; nothing without them."""
    if len(run.columns) < 2:
        return ()
    t, (x, v, *_) = run.time, run.columns.values()
    stuck, name = find_stuck_samples(run), run.spec.model
    return (
        draw_sketch(t, x, f"{name}: position over time", stuck),
        draw_sketch(x, v, f"{name}: speed over position", stuck),
    )


def find_stuck_samples(run: Trajectory) -> np.ndarray:
    """Return whether the first contact sticks at the times of a run (n,); without events nothing is stuck."""
    if not run.events:
        return np.zeros(len(run.time), dtype=bool)
    modes = next(iter(run.events.modes.values()))
    stuck: np.ndarray = modes[np.searchsorted(run.events.t, run.time, side="right") - 1] == 0
    return stuck


def draw_sketch(x: np.ndarray, y: np.ndarray, text: str, stuck: np.ndarray) -> Sketch:
    """Return the sketch of y (n,) over x (n,) with the text alternative `text` and the parts that are `stuck` (n,)."""
    width, height = SKETCH_SIZE
    points = np.column_stack(
        [MARGIN + normalize(values) * (size - 2 * MARGIN) for values, size in ((x, width), (-y, height))]
    )
    zero = MARGIN + (y.max() / (np.ptp(y) or 1.0)) * (height - 2 * MARGIN) if y.min() <= 0 <= y.max() else None
    parts = tuple(format_points(points[ends]) for ends in find_intervals(stuck))
    return Sketch(text, format_points(points[decimate(points[:, 0])]), parts, zero and round(float(zero), 1))


def format_points(points: np.ndarray) -> str:
    """Return points (n, 2) in the notation of SVG."""
    return " ".join(f"{x:.1f},{y:.1f}" for x, y in points)


def find_intervals(selected: np.ndarray) -> np.ndarray:
    """Return the indices (m, 2) of the first and the last sample of each interval that is selected (n,)."""
    changes = np.flatnonzero(np.diff(selected, prepend=False, append=False))
    return changes.reshape(-1, 2) - [0, 1]


def normalize(values: np.ndarray) -> np.ndarray:
    """Scale values (n,) linearly to 0 ... 1."""
    return (values - values.min()) / (np.ptp(values) or 1.0)


def decimate(x: np.ndarray) -> np.ndarray:
    """Return the indices (m,) of the first and last point in each of COLUMNS columns."""
    column = np.floor(COLUMNS * normalize(x))
    turns = np.flatnonzero(np.diff(column))
    return np.unique(np.concatenate([[0], turns, turns + 1, [len(x) - 1]]))
