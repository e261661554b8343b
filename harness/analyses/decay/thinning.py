"""Thinning of dense records: means of neighbouring samples, as many as the bandwidth of the motion allows.

A mean over a block of samples is that of the signal at the mean time, plus x'' var(t)/2 for the variance of the times
in the block.  With x'' from differences of the means, four blocks wide, an error of (omega h)^4/72 of the amplitude
remains for blocks of length h, where the acceleration does not jump.
"""

from dataclasses import replace

import numpy as np

from ...records.motion import Motion
from . import thresholds

REACH = 2  # blocks to each side, for the second derivative: their noise enters by 1/(24 REACH^2)


def block_size(record: Motion, half_period: float) -> int:
    """Return the number of samples per block that a record with this half period (s) allows; 1 leaves it unchanged."""
    n = len(record.t)
    if n <= thresholds.MAX_DENSE_SAMPLES:
        return 1
    interval = float(np.median(np.diff(record.t)))
    per_period = 2 * half_period / interval / thresholds.MIN_THINNED_PER_PERIOD
    return max(int(min(n / thresholds.MIN_THINNED_SAMPLES, per_period)), 1)


def thinning_error(record: Motion, half_period: float, size: int) -> float:
    """Return the largest shift of a sample by thinning, relative to the amplitude of a sine with this half period.

    At uneven times it is that of the mean itself, without the correction by the second derivative.
    """
    intervals = np.diff(record.t)
    phase = np.pi * size * float(np.median(intervals)) / half_period
    if np.percentile(intervals, 90) < thresholds.EVEN_INTERVALS * np.percentile(intervals, 10):
        return float(phase**4 / 72)
    times = record.t[: len(record.t) // size * size].reshape(-1, size)
    return float((np.pi / half_period) ** 2 * np.percentile(times.var(axis=1), 99) / 2)


def thin(record: Motion, size: int) -> Motion:
    """Return the record with one sample per block of `size` samples; without blocks next to gaps."""
    count = len(record.t) // size
    if size < 2 or count <= 2 * REACH:
        return record
    times = record.t[: count * size].reshape(count, size)
    t, x = times.mean(axis=1), record.x[: count * size].reshape(count, size).mean(axis=1)
    variance = ((times - t[:, None]) ** 2).mean(axis=1)
    before, inner, after = slice(None, -2 * REACH), slice(REACH, -REACH), slice(2 * REACH, None)
    slope_before = (x[inner] - x[before]) / (t[inner] - t[before])
    slope_after = (x[after] - x[inner]) / (t[after] - t[inner])
    span = t[after] - t[before]
    curvature = 2 * (slope_after - slope_before) / span
    is_even = span < thresholds.MAX_BLOCK_SPAN * float(np.median(span))
    return replace(record, t=t[inner][is_even], x=(x[inner] - curvature * variance[inner] / 2)[is_even])
