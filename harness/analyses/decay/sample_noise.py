"""Noise of the samples of a record, and samples that are no measurements."""

from dataclasses import replace

import numpy as np

from ...records.motion import MIN_SAMPLES, Motion
from ..estimation.noise import interpolation_residuals, robust_std
from . import thresholds


def estimate_noise(t: np.ndarray, x: np.ndarray) -> tuple[float, float]:
    """Return the standard deviation of the noise of x (n,), and the quantisation step if it exceeds the noise, or 0.

    The noise is the median distance of a sample from the cubic through its four neighbours, so it includes curvature
    that is too fast for the sampling.  A quantiser of step q adds at least q/sqrt(12).  Constant samples before the
    first change and after the last one do not count.
    """
    changes = np.flatnonzero(np.diff(x))
    if len(changes) and changes[-1] - changes[0] > 2 * MIN_SAMPLES:
        moving = slice(changes[0], changes[-1] + 2)
        t, x = t[moving], x[moving]
    noise = robust_std(interpolation_residuals(t, x))
    differences = np.diff(np.unique(x))
    differences = differences[differences > 1e-9 * np.ptp(x)]  # smaller ones are rounding errors
    step = float(differences.min()) if len(differences) else 0.0
    is_coarse = step > thresholds.COARSE_STEP * noise or noise < thresholds.FINE_NOISE * step
    return max(noise, step / np.sqrt(12)), step if is_coarse else 0.0


def remove_spikes(record: Motion) -> Motion:
    """Return the record without samples far from their neighbours; unchanged if there are many of them."""
    t, x = record.t, record.x
    for _ in range(thresholds.MAX_SPIKE_ROUNDS):
        e = interpolation_residuals(t, x)
        excess = np.pad(
            np.where(e > max(thresholds.OUTLIER * robust_std(e), thresholds.MIN_SPIKE * np.ptp(x)), e, 0.0), 2
        )
        is_largest = excess[2:-2] >= np.max([excess[i : len(x) - 4 + i] for i in range(5)], axis=0)
        spikes = 2 + np.flatnonzero(is_largest & (excess[2:-2] > 0))
        t, x = np.delete(t, spikes), np.delete(x, spikes)
        if not len(spikes) or len(x) < (1 - thresholds.MAX_SPIKES) * len(record.x):
            break
    removed = len(record.x) - len(x)
    if not 0 < removed <= thresholds.MAX_SPIKES * len(record.x):
        return record
    note = f"{removed} of {len(record.x)} samples are outliers and are left out."
    return replace(record, t=t, x=x, notes=(*record.notes, note))
