"""Times in s from what loggers write: numbers, times of day, time stamps; also rounded ones."""

import re
from collections.abc import Sequence
from datetime import datetime

import numpy as np

from ..errors import SceneError

DAY = 86400.0
DATE_PREFIX = re.compile(r"^\d{1,4}[./]\d{1,2}[./]\d{1,4}[T ]\s*")  # days as 21.11.2026; midnight tells the next one
HALF_OF_DAY = re.compile(r"\s*([AP])M$", re.I)  # of a day
COLON_MILLISECONDS = re.compile(r"(:\d\d:\d\d):")  # of a second after a third colon
MAX_ROUNDING_ERROR = 0.51  # of the unit in the last place: how far a rounded time is off
MAX_UNEVENNESS = 0.02  # of a step: uneven by less, times are what they are


def parse_timestamps(cells: Sequence[str], name: str) -> np.ndarray:
    """Seconds (n,) from the first of time stamps (ISO 8601) or times of day; NaN for a missing one."""
    found = np.array([parse_timestamp(cell.strip(), name) for cell in cells])
    first = found[np.isfinite(found)][:1]
    found = found - (first if len(first) else 0.0)
    if not any("-" in cell for cell in cells[:1]):  # a time of day passes midnight
        found = found + DAY * np.concatenate([[0], np.cumsum(np.diff(np.nan_to_num(found)) < -DAY / 2)])
    return found


def parse_timestamp(cell: str, name: str) -> float:
    """One time stamp in seconds."""
    if not cell:
        return np.nan
    try:
        cell = DATE_PREFIX.sub("", cell)
        half, cell = HALF_OF_DAY.search(cell), HALF_OF_DAY.sub("", cell)
        if "-" in cell[:8] or len(cell) > 16:
            stamp = datetime.fromisoformat(cell.replace(",", "."))
            naive = stamp.replace(tzinfo=None) - (stamp.utcoffset() or datetime.min - datetime.min)
            return (naive - datetime(2000, 1, 1)).total_seconds()
        total = 0.0
        for part in COLON_MILLISECONDS.sub(r"\1.", cell).replace(",", ".").split(":"):
            total = 60 * total + float(part)
        return total if half is None else total % (DAY / 2) + DAY / 2 * (half[1] in "Pp")
    except (ValueError, OverflowError):
        raise SceneError(
            f"{name}: '{cell}' is no time stamp; ISO 8601 is read, as in 2026-11-21T15:18:03.125"
        ) from None


def undo_time_rounding(t: np.ndarray) -> tuple[np.ndarray, str]:
    """Even times (n,) where these are even ones that a logger has rounded, and the sentence that says so.

    Rounded times are multiples of some unit, take only few different steps, and lie within half a unit of a line.
    """
    if len(t) < 4 or not np.isfinite(t).all():
        return t, ""
    steps = np.diff(t)
    usual = float(np.median(steps))
    sizes = np.unique(np.round(steps, 9))
    if (steps < 0).any() or not t[-1] > t[0] or not 2 <= len(sizes) <= 3 or np.ptp(sizes) <= MAX_UNEVENNESS * usual:
        return t, ""
    unit = float(np.min(np.diff(sizes)))
    line = np.polyval(np.polyfit(np.arange(len(t)), t - t[0], 1), np.arange(len(t))) + t[0]
    off = t - line
    if np.ptp(off) > 2 * MAX_ROUNDING_ERROR * unit or np.abs(np.round(sizes / unit) * unit - sizes).max() > 1e-3 * unit:
        return t, ""
    step = (line[-1] - line[0]) / (len(t) - 1)
    share = unit / (float(np.ptp(t)) * np.sqrt(len(t)))  # the standard error of a slope
    return line, (
        f"The times are rounded to {unit:.3g} s; they are spread evenly, one each {step:.6g} s, which is sure to about "
        f"{share:.0e} of it, and no frequency is surer."
    )
