"""Slips of a measured force: the force before and after each one, and the time of waiting before it.

The slips of real surfaces are irregular, so that no single pair of static and sliding friction describes them.
"""

from collections.abc import Sequence

import numpy as np

from ...records.extraction import Samples
from ..estimation.estimate import find_reversals, interpolation_residuals, robust_std
from .parameter_fit import Slips

FORCES = ("N", "N.m")
NOISES, SHARE = 8.0, 0.1  # smallest slip: times the noise, and of the range
MIN_SLIPS = 5
SLOW = 3.0  # ratio of the times of loading and of slip
IRREGULAR = 0.1  # standard deviation of the drops, relative to their mean


def irregular_slips(records: Sequence[Samples], columns: Sequence[tuple[str, str]]) -> tuple[Slips, ...]:
    """Return the irregular slips of each force in the records.

    Parameters
    ----------
    columns : sequence of (str, str)
        Name and unit of each column of the records.
    """
    all_slips = (
        measure_slips(record, y, name, unit)
        for record in records
        for y, (name, unit) in zip(record.y.T, columns, strict=True)
        if unit in FORCES
    )
    return tuple(slips for slips in all_slips if slips and slips.drop.std(ddof=1) > IRREGULAR * slips.drop.mean())


def measure_slips(record: Samples, y: np.ndarray, column: str, unit: str) -> Slips | None:
    """Return the slips of a force y (n,) that loads slowly and falls fast; None if it has too few of them."""
    threshold = max(NOISES * robust_std(interpolation_residuals(record.t, y)), SHARE * float(np.ptp(y)))
    at = find_reversals(y, threshold)
    if len(at) < 2 * MIN_SLIPS + 1:
        return None
    times, forces = record.t[at], y[at]
    duration, rises = np.diff(times), np.diff(forces) > 0
    up, down = np.median(duration[rises]), np.median(duration[~rises])
    if max(up, down) < SLOW * min(up, down):
        return None
    slips = 1 + np.flatnonzero(rises[1:] == (up < down))  # after a slow loading
    return Slips(record.name, column, unit, times[slips], forces[slips], forces[slips + 1], duration[slips - 1])
