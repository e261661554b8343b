"""Samples that are no measurements: values such as -9999 that stand for a missing sample, and a saturated sensor."""

import re
from dataclasses import replace

import numpy as np

from .record import Record

NINES = re.compile(r"9{3,}(\.9+)?")
MAX_SENTINELS = 3  # different ones in a column
MIN_LEVELS = 50  # different values of a signal whose values seldom repeat
MIN_DOMINANCE = 5  # times as often as any other value
MIN_JUMPS, JUMP = 3, 0.1  # times that a value is away from its neighbours, by this share of the range of the others
MIN_JUMP_SHARE = 0.2  # of the times that the value occurs
MIN_OTHERS = 3  # different values of the signal
MIN_STAY = 3  # samples at the largest value, in a peak
MIN_DWELL = 4.0  # times the samples at the level before the last; 1/(sqrt(2) - 1) = 2.4 at a rounded turning point


def mark_sentinels(values: np.ndarray, name: str) -> list[str]:
    """Replace values (n,) that mark missing samples by NaN, in place, and return a sentence about each.

    Such a value is the smallest or largest of all, occurs several times or is written in nines only, and is farther
    from the others than these are from each other.
    """
    notes: list[str] = []
    for _ in range(MAX_SENTINELS):
        levels = np.unique(values[np.isfinite(values)])
        if len(levels) <= MIN_OTHERS:
            break
        below, above = levels[1] - levels[0], levels[-1] - levels[-2]
        sentinel, distance = (levels[0], below) if below > above else (levels[-1], above)
        is_sentinel = values == sentinel
        count = int(is_sentinel.sum())
        is_isolated = distance > levels[-1] - levels[0] - distance
        if not is_isolated or (count < 2 and not NINES.fullmatch(f"{abs(sentinel):g}")):
            break
        values[is_sentinel] = np.nan
        notes.append(
            f"{count} of {len(values)} values of {name} are {sentinel:.15g}, far from all others: they mark missing "
            "samples and are left out."
        )
    return notes


def mark_dropouts(values: np.ndarray, name: str) -> list[str]:
    """Replace a value within the range of a signal (n,) that marks missing samples, such as 0, by NaN, in place.

    Such a value is by far the most frequent one, and several times far from the samples before and after it.  Return a
    sentence about it.
    """
    finite = np.flatnonzero(np.isfinite(values))
    x = values[finite]
    levels, counts = np.unique(x, return_counts=True)
    if len(levels) < MIN_LEVELS:
        return []
    mark, second = levels[np.argmax(counts)], int(np.sort(counts)[-2])
    is_mark = x == mark
    edges = np.flatnonzero(np.diff(np.concatenate([[0], is_mark.astype(int), [0]])))
    before, after = edges[::2] - 1, edges[1::2]
    inner = (before >= 0) & (after < len(x))
    jumps = np.abs((x[before[inner]] + x[after[inner]]) / 2 - mark) > JUMP * np.ptp(x[~is_mark])
    is_dropout = jumps.sum() >= max(MIN_JUMPS, MIN_JUMP_SHARE * len(before))
    if counts.max() <= MIN_DOMINANCE * second or not is_dropout:
        return []
    values[finite[is_mark]] = np.nan
    return [
        f"{int(is_mark.sum())} of {len(values)} values of {name} are {mark:.15g}, several times far from the samples "
        "beside them: they mark missing samples and are left out."
    ]


def leave_out_saturated(record: Record) -> Record:
    """Return a record without the samples at which the sensor was saturated, and with a note on them."""
    x = record.x
    if not len(x):
        return record
    is_saturated, levels, peaks = np.zeros(len(x), bool), [], 0
    for sign in (1.0, -1.0):
        side, count = find_saturated(sign * x)
        if count:
            levels.append(f"{x[side][0]:.6g}")
            is_saturated, peaks = is_saturated | side, peaks + count
    if not levels:
        return record
    note = (
        f"The sensor was saturated: {int(is_saturated.sum())} of {len(x)} samples, in {peaks} peaks, are exactly "
        f"{' or '.join(levels)} {record.unit}. They are left out; --from selects the record after them."
    )
    return replace(record, t=record.t[~is_saturated], x=x[~is_saturated], notes=(*record.notes, note))


def find_saturated(x: np.ndarray) -> tuple[np.ndarray, int]:
    """Return which samples of x (n,) are cut off at the largest value, and in how many peaks; none if it is not.

    A motion that is cut off stays at its largest value in several peaks, and is rarely near it otherwise.  A motion
    that is only rounded passes the level before the last nearly as long; one that is held before its release is at
    rest in one peak, so the longest stay does not count.
    """
    none = np.zeros(len(x), bool), 0
    is_highest, is_low = x == x.max(), x < (x.max() + x.min()) / 2
    if not is_low.any():
        return none
    peak = np.cumsum(np.diff(is_low.astype(int), prepend=0) < 0)  # number of the peak; the motion is low between two
    stays = np.bincount(peak[is_highest])
    stays = np.sort(stays[stays >= MIN_STAY])[:-1]
    second = x[~is_highest].max()
    near = int(((x >= second - (x.max() - second) / 2) & ~is_highest).sum())
    return (is_highest, len(stays) + 1) if stays.sum() > MIN_DWELL * near else none
