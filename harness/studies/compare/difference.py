"""How far two trajectories are apart: largest and root-mean-square difference of each variable, and event times."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from math import isnan

import numpy as np

from ...errors import HarnessError
from ...running.signals import Signals
from .event_pairs import EventPairs, match_events
from .interpolation import Interpolant, ValueBounds
from .trajectory_sources import common_span
from .units import conversion_factor

ENOUGH = 0.5  # share of the coarser one's times that are common, which makes interpolation needless
SAME = 1e-9  # share of the stretch: times this close are one


@dataclass(frozen=True)
class Difference:
    """One variable: the `largest` difference and where it is (`at`, s), the root mean square, in `unit`; `relative`:
    the largest over the largest value of either, the `size`.  `left`, `right` (n,): the two at the times compared; of
    texts 0, and 1 where they differ.  Where one is not a finite number, which is then at `at`, all is NaN."""

    name: str
    unit: str
    largest: float
    at: float
    rms: float
    relative: float
    size: float
    left: np.ndarray
    right: np.ndarray


@dataclass(frozen=True)
class Comparison:
    """Two trajectories at the `time` (n,) of comparison, with the `pairs` of their events, None where they are not
    known."""

    one: Signals
    two: Signals
    time: np.ndarray
    interpolated: bool
    differences: tuple[Difference, ...]
    left_out: tuple[str, ...]
    pairs: EventPairs | None

    @property
    def worst(self) -> float:
        """The largest relative difference; NaN if any is."""
        return float(np.max([each.relative for each in self.differences]))

    def violations(self, rtol: float, atol: float) -> list[str]:
        """What differs by more than atol, in the unit of each, and rtol of its largest value together; a sentence each,
        and one about events that do not match."""
        said = [
            f"{each.name} differs by {each.largest:.3g}{f' {each.unit}' if each.unit else ''} at t = {each.at:.6g} s, "
            f"more than {atol + rtol * each.size:.3g}"
            for each in self.differences
            if not isnan(each.largest) and each.largest > atol + rtol * each.size
        ]
        lost = [each.name for each in self.differences if isnan(each.largest)]
        said += [f"{name} holds what is not a finite number, which is in no bound" for name in lost]
        if self.pairs and isnan(self.pairs.shift):
            said.append(f"their events do not match: {self.events}")
        return said

    @property
    def events(self) -> str:
        """What is to be said of them; nothing where they are not known."""
        return self.pairs.summary((self.one.name, self.two.name)) if self.pairs else ""


def compare(one: Signals, two: Signals) -> Comparison:
    """Compare what both have, over the time that both cover; HarnessError if that is nothing."""
    shared = [name for name in one.columns if name in two.columns]
    if not shared:
        has = [f"{each.name} ({', '.join(each.columns)})" for each in (one, two)]
        raise HarnessError(f"{' and '.join(has)} have no variable in common")
    begin, end = common_span(one, two)
    time, interpolated = times(one, two, begin, end)
    pairs, jumps = events(one, two, begin, end)
    motions, differences, left_out = tuple(coded(one, two)), [], []
    for name in shared:
        unit, factor, differs = units(one, two, name)
        left_out += [differs] if differs else []
        if unit is not None:
            ours, theirs = (each.bounds_at(name, time, at) for each, at in zip(motions, jumps, strict=True))
            left, right = nearest(ours, ValueBounds(factor * theirs.low, factor * theirs.high))
            if textual(one, name):
                left, right = np.zeros(len(time)), (left != right).astype(float)
            differences.append(difference(name, unit, time, left, right))
    if not differences:
        raise HarnessError(f"nothing to compare: {'; '.join(left_out)}")
    for each, other in ((one, two), (two, one)):
        is_isolated = [name for name in each.columns if name not in other.columns]
        left_out += [f"only in {each.name}: {', '.join(is_isolated)}"] if is_isolated else []
    return Comparison(one, two, time, interpolated, tuple(differences), tuple(left_out), pairs)


def units(one: Signals, two: Signals, name: str) -> tuple[str | None, float, str]:
    """The unit in which a variable is compared, None where that cannot be, how large the other's is in it, and what is
    to be said of that."""
    left, right = (each.units[name] for each in (one, two))
    if textual(one, name) != textual(two, name):
        text, number = (one, two) if textual(one, name) else (two, one)
        return None, 1.0, f"{name} is a text in {text.name} and a number in {number.name}, and is left out"
    if bool(left) != bool(right):
        lacks = (two if left else one).name
        return left or right, 1.0, f"{name} has no unit in {lacks}; it is taken to be in {left or right}"
    factor = conversion_factor(right, left)
    if factor is None:
        return None, 1.0, f"{name} is in {left} in {one.name} and in {right} in {two.name}, and is left out"
    return left, factor, "" if factor == 1.0 else f"{name} is in {right} in {two.name}; it is compared in {left}"


def textual(path: Signals, name: str) -> bool:
    return path.columns[name].dtype.kind == "U"


def coded(one: Signals, two: Signals) -> Iterator[Interpolant]:
    """Both motions, of a text in both the place among all that either says."""
    texts = [name for name in one.columns if name in two.columns and textual(one, name) and textual(two, name)]
    known = {name: np.unique(np.concatenate([each.columns[name] for each in (one, two)])) for name in texts}
    for each in (one, two):
        places = {name: np.searchsorted(known[name], each.columns[name]).astype(float) for name in texts}
        yield Interpolant(replace(each, columns=each.columns | places))


def nearest(left: ValueBounds, right: ValueBounds) -> tuple[np.ndarray, np.ndarray]:
    """Of all values (n,) that either side may have, the two that are nearest to each other."""
    one = np.clip(np.maximum(left.low, right.low), left.low, left.high)
    return one, np.clip(one, right.low, right.high)


def difference(name: str, unit: str, time: np.ndarray, left: np.ndarray, right: np.ndarray) -> Difference:
    """The difference of one variable; reckoned in shares of the largest value, which near 1e308 has no square."""
    lost = ~(np.isfinite(left) & np.isfinite(right))
    if lost.any():
        at = float(time[int(np.argmax(lost))])
        return Difference(name, unit, np.nan, at, np.nan, np.nan, np.nan, left, right)
    size = float(max(np.abs(left).max(), np.abs(right).max()))
    off = np.abs(left / size - right / size) if size else np.zeros(len(time))
    i, rms = int(np.argmax(off)), float(np.sqrt(np.mean(off * off)))
    relative = float(off[i])
    return Difference(name, unit, relative * size, float(time[i]), rms * size, relative, size, left, right)


def times(one: Signals, two: Signals, begin: float, end: float) -> tuple[np.ndarray, bool]:
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
    one: Signals, two: Signals, begin: float, end: float
) -> tuple[EventPairs | None, tuple[np.ndarray, np.ndarray]]:
    """The events of both in pairs, and the stretches of time in s in which each of the two jumps (k, 2): from the
    earlier to the later of a pair, and where one alone has an event."""
    known = [np.zeros((1, 2)) if each.events is None else each.events for each in (one, two)]
    first, second = (rows[1:][(rows[1:, 0] >= begin) & (rows[1:, 0] <= end)] for rows in known)
    if one.events is None or two.events is None:
        return None, (first[:, [0, 0]], second[:, [0, 0]])
    pairs = match_events(first, second)
    near = pairs.intervals[pairs.is_isolated(np.sort(np.concatenate([first[:, 0], second[:, 0]])))]
    own = [rows[~np.isin(rows[:, 0], near)][:, [0, 0]] for rows in (first, second)]
    left, right = (np.vstack([near, rows]) for rows in own)
    return pairs, (left, right)
