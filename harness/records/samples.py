"""Times and values as data loggers write them.

Times are numbers, times of day or time stamps, and may be rounded. Some values are not measurements: marks of missing
samples, such as -9999, and the values of a saturated sensor.
"""

import re
from collections.abc import Sequence
from dataclasses import replace
from datetime import datetime
from itertools import pairwise

import numpy as np

from ..errors import SceneError, option_text
from .motion import Motion

DAY = 86400.0
# dates as in 21.11.2026 are dropped; passing midnight starts the next day
DATE_PREFIX = re.compile(r"^\d{1,4}[./]\d{1,2}[./]\d{1,4}[T ]\s*")
HALF_OF_DAY = re.compile(r"\s*([AP])M$", re.I)  # 12-hour clock
COLON_MILLISECONDS = re.compile(r"(:\d\d:\d\d):")  # milliseconds after a third colon
MAX_ROUNDING_ERROR = 0.51  # of the rounding unit
MAX_UNEVENNESS = 0.02  # of a step; smaller variations are not rounding
NINES = re.compile(r"9{3,}(\.9+)?")
MAX_LISTED_TIMES = 5  # repeated times in a message
MAX_SENTINELS = 3  # different ones in a column
MIN_LEVELS = 50  # different values of a signal whose values seldom repeat
MIN_DOMINANCE = 5  # times as often as any other value
MIN_JUMPS, JUMP = 3, 0.1  # times that a value differs from its neighbours by this share of the range of the others
MIN_JUMP_SHARE = 0.2  # of the times that the value occurs
MIN_OTHERS = 3  # different values of the signal
MIN_STAY = 3  # samples at the largest value, in a peak
MIN_RARE_STEPS = 3  # of rounded times: a single step of another size is a repeated or a missing sample
MAX_RARE_SPREAD = 2  # samples by which the distances between them differ
MAX_REPEATED_SHARE = 0.2  # of the times
MAX_LATE_SHARE = 0.01  # of the rows, out of order or with a repeated time: more are several runs
MIN_RUN = 4  # samples on average of runs in one table whose times overlap: shorter ones are rows in no order
MIN_DWELL = 4.0  # times the samples at the level before the last; 1/(sqrt(2) - 1) = 2.4 at a rounded turning point


def parse_timestamps(cells: Sequence[str], name: str) -> np.ndarray:
    """Return the seconds (n,) since the first of time stamps (ISO 8601) or times of day; NaN for missing ones."""
    times = np.array([parse_timestamp(cell.strip(), name) for cell in cells])
    first = times[np.isfinite(times)][:1]
    times = times - (first if len(first) else 0.0)
    if not any("-" in cell for cell in cells[:1]):  # times of day restart at midnight
        times = times + DAY * np.concatenate([[0], np.cumsum(np.diff(np.nan_to_num(times)) < -DAY / 2)])
    return times


def parse_timestamp(cell: str, name: str) -> float:
    """Return one time stamp in seconds."""
    if not cell:
        return np.nan
    try:
        cell = DATE_PREFIX.sub("", cell)
        half_of_day, cell = HALF_OF_DAY.search(cell), HALF_OF_DAY.sub("", cell)
        if "-" in cell[:8] or len(cell) > 16:
            stamp = datetime.fromisoformat(cell.replace(",", "."))
            naive = stamp.replace(tzinfo=None) - (stamp.utcoffset() or datetime.min - datetime.min)
            return (naive - datetime(2000, 1, 1)).total_seconds()
        total = 0.0
        for part in COLON_MILLISECONDS.sub(r"\1.", cell).replace(",", ".").split(":"):
            total = 60 * total + float(part)
        return total if half_of_day is None else total % (DAY / 2) + DAY / 2 * (half_of_day[1] in "Pp")
    except (ValueError, OverflowError):
        raise SceneError(f"{name}: '{cell}' is not a time stamp; use ISO 8601, as in 2026-11-21T15:18:03.125") from None


def undo_time_rounding(t: np.ndarray) -> tuple[np.ndarray, str]:
    """Replace equidistant times that a logger has rounded by exactly equidistant ones.

    Rounded times are multiples of a unit, have only a few different steps, and lie within half a unit of a line. If
    there are two steps, the rarer one occurs at even distances.

    Returns
    -------
    t : numpy.ndarray
        Times (n,) in s; the original ones if they are not rounded.
    note : str
        Sentence about the rounding; empty if there is none.
    """
    if len(t) < 4 or not np.isfinite(t).all():
        return t, ""
    steps = np.diff(t)
    typical = float(np.median(steps))
    sizes = np.unique(np.round(steps, 9))
    if (steps < 0).any() or not t[-1] > t[0] or not 2 <= len(sizes) <= 3 or np.ptp(sizes) <= MAX_UNEVENNESS * typical:
        return t, ""
    if not is_rounding_pattern(steps, sizes):
        return t, ""
    unit = float(np.min(np.diff(sizes)))
    even_times = np.polyval(np.polyfit(np.arange(len(t)), t - t[0], 1), np.arange(len(t))) + t[0]
    deviation = t - even_times
    if (
        np.ptp(deviation) > 2 * MAX_ROUNDING_ERROR * unit
        or np.abs(np.round(sizes / unit) * unit - sizes).max() > 1e-3 * unit
    ):
        return t, ""
    step = (even_times[-1] - even_times[0]) / (len(t) - 1)
    relative_error = unit / (float(np.ptp(t)) * np.sqrt(len(t)))  # the standard error of a slope
    return even_times, (
        f"The times are rounded to {unit:.3g} s and replaced by equidistant ones, {step:.6g} s apart. This step, and "
        f"any frequency, has a relative uncertainty of about {relative_error:.0e}."
    )


def is_rounding_pattern(steps: np.ndarray, sizes: np.ndarray) -> bool:
    """Return whether rounding can cause the sequence of the steps (n,) in s, which have two or three different sizes.

    Rounding of equidistant times repeats the rarer of two steps every k or k + 1 samples; rounding of halves to even
    moves it by one sample. A repeated or a missing sample is a single step of another size.
    """
    kinds = np.searchsorted(sizes, np.round(steps, 9))
    rare = np.flatnonzero(kinds != np.argmax(np.bincount(kinds)))
    return len(rare) >= MIN_RARE_STEPS and (len(sizes) > 2 or int(np.ptp(np.diff(rare))) <= MAX_RARE_SPREAD)


def sort_times(t: np.ndarray) -> tuple[np.ndarray, str]:
    """Return the order of samples (n,) by time, and a sentence if it is not that of the rows.

    Rows of several runs, whose times overlap, keep their order, and so do rows with equal times.
    """
    unchanged_order = np.arange(len(t))
    falls = np.flatnonzero(np.diff(t) < 0)
    if not len(falls) or len(t) - len(np.unique(t)) > MAX_LATE_SHARE * len(t):
        return unchanged_order, ""
    parts = np.split(t, falls + 1)
    spans = sorted((float(part[0]), float(part[-1])) for part in parts)
    is_overlapping = any(later < end for (_, end), (later, _) in pairwise(spans))
    n_late = int((t < np.maximum.accumulate(t)).sum())  # rows that come after a row with a later time
    if is_overlapping and len(t) > MIN_RUN * len(parts) and n_late > MAX_LATE_SHARE * len(t):
        return unchanged_order, ""
    verb = "time falls" if len(falls) == 1 else "times fall"
    note = f"The rows are not in the order of time ({len(falls)} {verb}): they are sorted."
    return np.argsort(t, kind="stable"), note


def find_repeated_times(t: np.ndarray) -> tuple[np.ndarray, str]:
    """Return a mask (n,) of the samples whose time is that of the sample before, and a sentence that names them.

    There are none if many times are repeated, which a single sentence would not explain.
    """
    is_repeated = np.append(False, np.diff(t) == 0)[: len(t)]  # none of no samples
    times = np.unique(t[is_repeated])
    if not len(times) or is_repeated.sum() > MAX_REPEATED_SHARE * len(t):
        return np.zeros(len(t), bool), ""
    times_text = ", ".join(f"{time:.6g} s" for time in times[:MAX_LISTED_TIMES])
    ending = f" and {len(times) - MAX_LISTED_TIMES} more" if len(times) > MAX_LISTED_TIMES else ""
    verb = "occurs" if len(times) == 1 else "occur"
    return is_repeated, (
        f"The time{'s' * (len(times) > 1)} {times_text}{ending} {verb} more than once; the first sample is used, and "
        f"{int(is_repeated.sum())} of {len(t)} samples are left out."
    )


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
        "before and after: they mark missing samples and are left out."
    ]


def leave_out_saturated(record: Motion) -> Motion:
    """Return a record without the samples at which the sensor was saturated, and with a note on them."""
    x = record.x
    is_saturated, levels, peaks = np.zeros(len(x), bool), [], 0
    for sign in (1.0, -1.0):
        side, count = find_saturation(sign * x)
        if count:
            levels.append(f"{x[side][0]:.6g}")
            is_saturated, peaks = is_saturated | side, peaks + count
    if not levels:
        return record
    note = (
        f"The sensor was saturated: {int(is_saturated.sum())} of {len(x)} samples, in {peaks} peaks, are exactly "
        f"{' or '.join(levels)} {record.unit}. They are left out; {option_text('begin')} selects the record after "
        "them."
    )
    return replace(record, t=record.t[~is_saturated], x=x[~is_saturated], notes=(*record.notes, note))


def find_saturation(x: np.ndarray) -> tuple[np.ndarray, int]:
    """Return a mask of the samples of x (n,) that are cut off at the largest value, and the number of their peaks.

    A motion that is cut off stays at its largest value in several peaks, and is rarely near it otherwise.  A motion
    that is only rounded stays nearly as long at the next lower level; one that is held before its release is at rest
    in one peak, so the longest stay does not count.
    """
    no_saturation = np.zeros(len(x), bool), 0
    is_highest, is_low = x == x.max(), x < (x.max() + x.min()) / 2
    if not is_low.any():
        return no_saturation
    peak = np.cumsum(np.diff(is_low.astype(int), prepend=0) < 0)  # number of the peak; the motion is low between two
    stays = np.bincount(peak[is_highest])
    stays = np.sort(stays[stays >= MIN_STAY])[:-1]
    second = x[~is_highest].max()
    near = int(((x >= second - (x.max() - second) / 2) & ~is_highest).sum())
    return (is_highest, len(stays) + 1) if stays.sum() > MIN_DWELL * near else no_saturation
