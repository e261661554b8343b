"""Values that stand for a missing sample, such as -9999, in place of an empty cell."""

import re

import numpy as np

NINES = re.compile(r"9{3,}(\.9+)?")
MAX_SENTINELS = 3  # different ones in a column
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
