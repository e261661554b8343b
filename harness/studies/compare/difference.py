"""How far two trajectories are apart: largest and root-mean-square difference of each variable, and event times."""

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from ...errors import HarnessError
from ...running.trajectory import Trajectory
from .trajectory import common

FEWEST = 10  # common times that make interpolation needless
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
    time, first, second, interpolated = aligned(one, two, begin, end)
    differences, left_out = [], []
    for name in shared:
        units = one.units[name], two.units[name]
        if all(units) and units[0] != units[1]:
            left_out.append(f"{name} is in {units[0]} in {one.name} and in {units[1]} in {two.name}")
            continue
        left, right = first(one.columns[name]), second(two.columns[name])
        differences.append(difference(name, max(units), time, left, right))
    if not differences:
        raise HarnessError(f"nothing to compare: {'; '.join(left_out)}")
    said, shift = events(one, two, begin, end)
    return Comparison(one, two, time, interpolated, tuple(differences), tuple(left_out), said, shift)


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


def aligned(one: Trajectory, two: Trajectory, begin: float, end: float):  # type: ignore[no-untyped-def]
    """The times of comparison (n,), what takes a column of each there, and whether that interpolates.

    Common times if there are enough of them; else the coarser one's, the other one by its cubic spline.
    """
    near = SAME * (end - begin)
    at = np.clip(np.searchsorted(two.time, one.time - near), 0, len(two.time) - 1)
    same = np.flatnonzero(np.abs(two.time[at] - one.time) <= near)
    if len(same) >= min(FEWEST, len(one.time), len(two.time)):
        return one.time[same], lambda y: y[same], lambda y: y[at[same]], False
    grids = [each.time[(each.time >= begin) & (each.time <= end)] for each in (one, two)]
    time = min(grids, key=len)
    return (
        time,
        lambda y: y[np.isin(one.time, time)] if time is grids[0] else between(one.time, y, time),
        lambda y: y[np.isin(two.time, time)] if time is grids[1] else between(two.time, y, time),
        True,
    )


def between(t: np.ndarray, y: np.ndarray, at: np.ndarray) -> np.ndarray:
    """The values y (n,) over t (n,) at other times; whole numbers, as modes, hold until the next."""
    if not np.isfinite(y).all():
        return np.full(len(at), np.nan)  # no spline knows what lies between
    if (y == np.rint(y)).all():
        return y[np.searchsorted(t, at, "right") - 1]
    return CubicSpline(t, y)(at)


def events(one: Trajectory, two: Trajectory, begin: float, end: float) -> tuple[str, float | None]:
    """A sentence about the changes of mode, and the largest difference of their times in s."""
    if one.events is None or two.events is None:
        return "", None
    first, second = (each.events[1:] for each in (one, two) if each.events is not None)
    first, second = (rows[(rows[:, 0] >= begin) & (rows[:, 0] <= end)] for rows in (first, second))
    if len(first) != len(second):
        return f"{len(first)} changes of mode in {one.name}, {len(second)} in {two.name}", np.nan
    if not (first[:, 1] == second[:, 1]).all():
        i = int(np.argmax(first[:, 1] != second[:, 1]))
        return (
            f"change of mode {i + 1} is to {first[i, 1]:g} in {one.name} and to {second[i, 1]:g} in {two.name}",
            np.nan,
        )
    shift = float(np.abs(first[:, 0] - second[:, 0]).max()) if len(first) else 0.0
    return f"{len(first)} changes of mode in both, at most {shift:.3g} s apart", shift
