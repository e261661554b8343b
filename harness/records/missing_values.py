"""Values that stand for a missing sample, such as -9999, in place of an empty cell."""

import re

import numpy as np

NINES = re.compile(r"9{3,}(\.9+)?")
MAX_SENTINELS = 3  # different ones in a column
MIN_LEVELS = 50  # different values of a signal whose values seldom repeat
MIN_DOMINANCE = 5  # times as often as any other value
MIN_JUMPS, JUMP = 3, 0.1  # times that a value is away from its neighbours, by this share of the range of the others
MIN_JUMP_SHARE = 0.2  # of the times that the value occurs
MIN_OTHERS = 3  # different values of the signal


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
