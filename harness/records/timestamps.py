"""Times in s from what data loggers write: numbers, times of day, time stamps, rounded times."""

import re
from collections.abc import Sequence
from datetime import datetime

import numpy as np

from ..errors import SceneError

DAY = 86400.0
# dates as in 21.11.2026 are dropped; passing midnight starts the next day
DATE_PREFIX = re.compile(r"^\d{1,4}[./]\d{1,2}[./]\d{1,4}[T ]\s*")
HALF_OF_DAY = re.compile(r"\s*([AP])M$", re.I)  # 12-hour clock
COLON_MILLISECONDS = re.compile(r"(:\d\d:\d\d):")  # milliseconds after a third colon
MAX_ROUNDING_ERROR = 0.51  # of the rounding unit
MAX_UNEVENNESS = 0.02  # of a step; smaller variations are not rounding


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

    Rounded times are multiples of a unit, have only a few different steps, and lie within half a unit of a line.

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
