"""Which events of two motions are the same ones: matched by kind and time."""

from dataclasses import dataclass

import numpy as np

MOST = 3  # events that are told one by one


@dataclass(frozen=True)
class EventPairs:
    """Changes of mode as (time in s, new mode): `one`, `two` (k, 2), row by row the same event in both; `only` those
    that one alone has, and those that the other alone has."""

    one: np.ndarray
    two: np.ndarray
    unmatched: tuple[np.ndarray, np.ndarray]

    @property
    def shift(self) -> float:
        """The largest difference of times in s; NaN if an event is in one alone."""
        return self.largest_shift if not any(map(len, self.unmatched)) else np.nan

    @property
    def largest_shift(self) -> float:
        """The largest difference of times in s of those in both."""
        return float(np.abs(self.one[:, 0] - self.two[:, 0]).max()) if len(self.one) else 0.0

    @property
    def intervals(self) -> np.ndarray:
        """The times (k, 2) in s between which a matched event happens, from the earlier to the later."""
        return np.sort(np.column_stack([self.one[:, 0], self.two[:, 0]]), axis=1)

    def is_isolated(self, times: np.ndarray) -> np.ndarray:
        """Of which pairs (k,) both happen before any other of these times, in their order."""
        begin, end = self.intervals.T
        return np.searchsorted(times, end, "left") <= np.searchsorted(times, begin, "right")

    def summary(self, names: tuple[str, str]) -> str:
        """What is to be said of them."""
        count = f"{len(self.one)} change{'s' * (len(self.one) != 1)} of mode in both"
        said = [f"{count}, at most {self.largest_shift:.3g} s apart" if len(self.one) else count]
        for name, rows in zip(names, self.unmatched, strict=True):
            told = [f"to {mode:g} at t = {t:.6g} s" for t, mode in rows[:MOST]]
            more = [f"{len(rows) - MOST} more"] * (len(rows) > MOST)
            said += [f"only in {name}: {', '.join(told + more)}"] if told else []
        return "; ".join(said)


def match_events(one: np.ndarray, two: np.ndarray) -> EventPairs:
    """The events of two motions, (n, 2) and (m, 2) in the order of their times: in pairs one after the other if all are
    of the same kinds, otherwise each with the nearest of its kind, if it is the nearest of that one too."""
    if len(one) == len(two) and (one[:, 1] == two[:, 1]).all():
        return EventPairs(one, two, (one[:0], two[:0]))
    chosen: list[tuple[int, int]] = []
    for kind in np.intersect1d(one[:, 1], two[:, 1]):
        i, j = (np.flatnonzero(rows[:, 1] == kind) for rows in (one, two))
        to, back = nearest(one[i, 0], two[j, 0]), nearest(two[j, 0], one[i, 0])
        mutual = np.flatnonzero(back[to] == np.arange(len(i)))
        chosen += zip(i[mutual].tolist(), j[to[mutual]].tolist(), strict=True)
    left, right = np.array(sorted(chosen), int).reshape(-1, 2).T
    return EventPairs(one[left], two[right], (np.delete(one, left, axis=0), np.delete(two, right, axis=0)))


def nearest(times: np.ndarray, among: np.ndarray) -> np.ndarray:
    """The number of the nearest of some times, in their order, to each."""
    after = np.clip(np.searchsorted(among, times), 1, max(len(among) - 1, 1))
    before = after - 1
    after = np.minimum(after, len(among) - 1)
    return np.where(np.abs(among[after] - times) < np.abs(among[before] - times), after, before)
