"""How far two trajectories are apart: largest and root-mean-square difference of each variable, and event times."""

from dataclasses import dataclass

import numpy as np

from ...analyses.decay.units import plain
from ...errors import HarnessError
from ...running.trajectory import Trajectory
from .between import Sides, sides
from .trajectory import common

ENOUGH = 0.5  # share of the coarser one's times that are common, which makes interpolation needless
SAME = 1e-9  # share of the stretch: times this close are one


@dataclass(frozen=True)
class Difference:
    """One variable: the `largest` difference and where it is (`at`, s), the root mean square, in `unit`; `relative`:
    the largest over the largest value of either.  `left`, `right` (n,): the two at the times compared.  Where one of
    them is not a finite number, which is then at `at`, the differences are NaN."""

    name: str
    unit: str
    largest: float
    at: float
    rms: float
    relative: float
    left: np.ndarray
    right: np.ndarray


@dataclass(frozen=True)
class Comparison:
    """Two trajectories at the `time` (n,) of comparison; `events`: the sentence about their events, and the largest
    difference of event times in s, NaN where events cannot be paired and None where they are not known."""

    one: Trajectory
    two: Trajectory
    time: np.ndarray
    interpolated: bool
    differences: tuple[Difference, ...]
    left_out: tuple[str, ...]
    events: str
    shift: float | None

    @property
    def worst(self) -> float:
        """The largest relative difference; NaN if any is."""
        return float(np.max([each.relative for each in self.differences]))


def compare(one: Trajectory, two: Trajectory) -> Comparison:
    """Compare what both have, over the time that both cover; HarnessError if that is nothing."""
    shared = [name for name in one.columns if name in two.columns]
    if not shared:
        has = [f"{each.name} ({', '.join(each.columns)})" for each in (one, two)]
        raise HarnessError(f"{' and '.join(has)} have no variable in common")
    begin, end = common(one, two)
    time, interpolated = times(one, two, begin, end)
    said, shift, jumps = events(one, two, begin, end)
    differences, left_out = [], []
    for name in shared:
        unit, differs = units(one, two, name)
        left_out += [differs] if differs else []
        if unit is not None:
            left, right = nearest(*(sides(each, name, time, at) for each, at in zip((one, two), jumps, strict=True)))
            differences.append(difference(name, unit, time, left, right))
    if not differences:
        raise HarnessError(f"nothing to compare: {'; '.join(left_out)}")
    for each, other in ((one, two), (two, one)):
        alone = [name for name in each.columns if name not in other.columns]
        left_out += [f"only in {each.name}: {', '.join(alone)}"] if alone else []
    return Comparison(one, two, time, interpolated, tuple(differences), tuple(left_out), said, shift)


def units(one: Trajectory, two: Trajectory, name: str) -> tuple[str | None, str]:
    """The unit in which a variable is compared, None where that cannot be, and what is to be said of it."""
    left, right = (each.units[name] for each in (one, two))
    if plain(left) == plain(right):
        return left, ""
    if left and right:
        return None, f"{name} is in {left} in {one.name} and in {right} in {two.name}, and is left out"
    return left or right, f"{name} has no unit in {(two if left else one).name}; it is taken to be in {left or right}"


def nearest(left: Sides, right: Sides) -> tuple[np.ndarray, np.ndarray]:
    """Of all values (n,) that either side may have, the two that are nearest to each other."""
    one = np.clip(np.maximum(left.low, right.low), left.low, left.high)
    return one, np.clip(one, right.low, right.high)


def difference(name: str, unit: str, time: np.ndarray, left: np.ndarray, right: np.ndarray) -> Difference:
    """The difference of one variable; reckoned in shares of the largest value, which near 1e308 has no square."""
    lost = ~(np.isfinite(left) & np.isfinite(right))
    if lost.any():
        at = float(time[int(np.argmax(lost))])
        return Difference(name, unit, np.nan, at, np.nan, np.nan, left, right)
    size = float(max(np.abs(left).max(), np.abs(right).max()))
    off = np.abs(left / size - right / size) if size else np.zeros(len(time))
    i, rms = int(np.argmax(off)), float(np.sqrt(np.mean(off * off)))
    relative = float(off[i])
    return Difference(name, unit, relative * size, float(time[i]), rms * size, relative, left, right)


def times(one: Trajectory, two: Trajectory, begin: float, end: float) -> tuple[np.ndarray, bool]:
    """The times of comparison (n,), and whether one is interpolated: those that are common if there are enough of them,
    else those of the coarser one."""
    near = SAME * (end - begin)
    grids = [np.unique(each.time[(each.time >= begin) & (each.time <= end)]) for each in (one, two)]
    coarser, finer = sorted(grids, key=len)
    at = np.clip(np.searchsorted(finer, coarser - near), 0, len(finer) - 1)
    same = coarser[np.abs(finer[at] - coarser) <= near]
    if len(same) >= ENOUGH * len(coarser):
        return same, False
    return coarser, True


def events(
    one: Trajectory, two: Trajectory, begin: float, end: float
) -> tuple[str, float | None, tuple[np.ndarray, np.ndarray]]:
    """A sentence about the changes of mode, the largest difference of their times in s, and the stretches of time in
    which each of the two jumps (k, 2): where events are of one kind, from the earlier to the later of a pair."""
    known = [np.zeros((1, 2)) if each.events is None else each.events for each in (one, two)]
    first, second = (rows[1:][(rows[1:, 0] >= begin) & (rows[1:, 0] <= end)] for rows in known)
    jumps = np.column_stack([first[:, 0], first[:, 0]]), np.column_stack([second[:, 0], second[:, 0]])
    if one.events is None or two.events is None:
        return "", None, jumps
    if len(first) != len(second):
        return f"{len(first)} changes of mode in {one.name}, {len(second)} in {two.name}", np.nan, jumps
    if not (first[:, 1] == second[:, 1]).all():
        i = int(np.argmax(first[:, 1] != second[:, 1]))
        text = f"change of mode {i + 1} is to {first[i, 1]:g} in {one.name} and to {second[i, 1]:g} in {two.name}"
        return text, np.nan, jumps
    shift = float(np.abs(first[:, 0] - second[:, 0]).max()) if len(first) else 0.0
    pairs = np.sort(np.column_stack([first[:, 0], second[:, 0]]), axis=1)
    return f"{len(first)} changes of mode in both, at most {shift:.3g} s apart", shift, (pairs, pairs)
