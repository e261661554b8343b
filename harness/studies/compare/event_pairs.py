"""Matching of events of two trajectories by kind and nearest time."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...simulation.signals import ModeChanges

MAX_LISTED = 3  # unmatched events listed in the summary
SAME_TIME = 1e-9  # of the time of an event: a smaller difference is not stated
START, END = 1.0, 0.0  # of a slip, in place of a mode


@dataclass(frozen=True)
class EventPairs:
    """Matched changes of mode, or starts and ends of slips.

    Attributes
    ----------
    one, two : numpy.ndarray
        Time in s, new mode and number of the contact (k, 3) on both sides, with the same event in each row.
    unmatched : (numpy.ndarray, numpy.ndarray)
        The other events (m, 3) of each side.
    contacts : tuple of str
        Names of the contacts by number; empty for a single contact.
    has_slips : bool
        Whether the events are starts and ends of slips, with START or END in place of a mode.
    """

    one: np.ndarray
    two: np.ndarray
    unmatched: tuple[np.ndarray, np.ndarray]
    contacts: tuple[str, ...] = ()
    has_slips: bool = False

    @property
    def shift(self) -> float:
        """Return the largest time difference in s; NaN if some events are unmatched."""
        return self.largest_shift if not any(map(len, self.unmatched)) else np.nan

    @property
    def largest_shift(self) -> float:
        """Return the largest time difference in s of the matched events."""
        return float(np.abs(self.one[:, 0] - self.two[:, 0]).max()) if len(self.one) else 0.0

    @property
    def intervals(self) -> np.ndarray:
        """Return the interval (k, 2) in s between the two times of each matched event."""
        return np.sort(np.column_stack([self.one[:, 0], self.two[:, 0]]), axis=1)

    def is_isolated(self, times: np.ndarray) -> np.ndarray:
        """Return for each pair (k,) whether none of the sorted `times` lies between its two times."""
        begin, end = self.intervals.T
        return np.searchsorted(times, end, "left") <= np.searchsorted(times, begin, "right")

    def summary(self, names: tuple[str, str]) -> str:
        """Return a summary of matched and unmatched events."""
        plural = "s" * (len(self.one) != 1)
        events = (
            f"start{plural} and end{plural} of slips, at the speed of the driver,"
            if self.has_slips
            else f"change{plural} of mode"
        )
        count = f"{len(self.one)} {events} in both"
        parts = [f"{count}, at most {self.largest_shift:.3g} s apart" if len(self.one) else count]
        for name, rows in zip(names, self.unmatched, strict=True):
            descriptions = [f"{self.state(mode, contact)} at t = {t:.6g} s" for t, mode, contact in rows[:MAX_LISTED]]
            remainder = [f"{len(rows) - MAX_LISTED} more"] * (len(rows) > MAX_LISTED)
            parts += [f"only in {name}: {', '.join(descriptions + remainder)}"] if descriptions else []
        return "; ".join(parts)

    def describe_first_difference(self, names: tuple[str, str]) -> str:
        """Return the first matched event whose times differ; empty if there is none."""
        indices = np.flatnonzero(np.abs(self.one[:, 0] - self.two[:, 0]) > SAME_TIME * np.abs(self.one[:, 0]))
        if not len(indices):
            return ""
        (t, mode, contact), (other, *_) = self.one[indices[0]], self.two[indices[0]]
        return (
            f"the first that differs is {self.state(mode, contact)} at t = {t:.6g} s in {names[0]} and "
            f"{other:.6g} s in {names[1]}"
        )

    def state(self, mode: float, contact: float) -> str:
        """Return the mode after an event, with the name of the contact if there are several, or the part of a slip."""
        if self.has_slips:
            return "the start" if mode == START else "the end"
        return f"{self.contacts[int(contact)]} to {mode:g}" if self.contacts else f"to {mode:g}"

    def list_rows(self, rows: np.ndarray) -> list[list[float | str]]:
        """Return time in s and new mode of events (k, 3), and the name of the contact if there are several."""
        names = [[self.contacts[int(contact)]] if self.contacts else [] for contact in rows[:, 2]]
        return [[*row, *name] for row, name in zip(rows[:, :2].tolist(), names, strict=True)]


def stack_events(changes: ModeChanges, contacts: Sequence[str], begin: float, end: float) -> np.ndarray:
    """Return the changes of mode between two times as rows of time in s, mode and number of the contact, by time."""
    rows = np.empty((0, 3))
    for contact in changes.modes:
        number = contacts.index(contact) if contacts else 0
        times, modes = (column[1:] for column in changes.changes(contact))
        rows = np.vstack([rows, np.column_stack([times, modes, np.full(len(times), number)])])
    rows = rows[(rows[:, 0] >= begin) & (rows[:, 0] <= end)]
    return rows[np.argsort(rows[:, 0], kind="stable")]


def match_events(
    first: np.ndarray, second: np.ndarray, contacts: Sequence[str] = (), has_slips: bool = False
) -> EventPairs:
    """Match the events of two trajectories, (n, 3) and (m, 3), sorted by time.

    If both sequences of modes are equal, events are matched in order. Otherwise mutual nearest neighbours of the same
    kind (contact and new mode) are matched.
    """
    names = tuple(contacts)
    if len(first) == len(second) and (first[:, 1:] == second[:, 1:]).all():
        return EventPairs(first, second, (first[:0], second[:0]), names, has_slips)
    matches: list[tuple[int, int]] = []
    for kind in np.unique(first[:, 1:], axis=0):
        i, j = (np.flatnonzero((rows[:, 1:] == kind).all(axis=1)) for rows in (first, second))
        if not len(j):
            continue
        in_second, in_first = find_nearest(first[i, 0], second[j, 0]), find_nearest(second[j, 0], first[i, 0])
        mutual = np.flatnonzero(in_first[in_second] == np.arange(len(i)))
        matches += zip(i[mutual].tolist(), j[in_second[mutual]].tolist(), strict=True)
    left, right = np.array(sorted(matches), int).reshape(-1, 2).T
    others = np.delete(first, left, axis=0), np.delete(second, right, axis=0)
    return EventPairs(first[left], second[right], others, names, has_slips)


def find_nearest(times: np.ndarray, candidates: np.ndarray) -> np.ndarray:
    """Return for each time the index of the nearest one in the sorted array `candidates`."""
    after = np.clip(np.searchsorted(candidates, times), 1, max(len(candidates) - 1, 1))
    before = after - 1
    after = np.minimum(after, len(candidates) - 1)
    return np.where(np.abs(candidates[after] - times) < np.abs(candidates[before] - times), after, before)
