"""The noise of a record, and what is left when it is smoothed away."""

from dataclasses import replace

import numpy as np

from ...records.record import MIN_SAMPLES, Record

FAR = 8.0  # times the noise of a stray sample
SPIKE = 0.02  # of the range: no smaller one hides a turning point
LONGEST = 40  # rounds: a run of so many samples, too, is taken away from its ends
MOST = 0.05  # share of the samples


def estimate_noise(t: np.ndarray, x: np.ndarray) -> tuple[float, float]:
    """Standard deviation of the noise of x (n,), and the step of a quantiser that stands out of it, or 0.

    The noise is what is left of a sample by the cubic through its four neighbours, robustly by the median; also the
    curvature that sampling is too coarse for counts.  A quantiser of step q adds at least q/sqrt(12).  What repeats
    itself before the first change, or after the last, is no sign of a quiet sensor.
    """
    changes = np.flatnonzero(np.diff(x))
    if len(changes) and changes[-1] - changes[0] > 2 * MIN_SAMPLES:
        moving = slice(changes[0], changes[-1] + 2)
        t, x = t[moving], x[moving]
    noise = robust_std(interpolation_residuals(t, x))
    rungs = np.diff(np.unique(x))
    rungs = rungs[rungs > 1e-9 * np.ptp(x)]  # the same value, computed twice
    step = float(rungs.min()) if len(rungs) else 0.0
    coarse = step > 1.5 * noise or noise < step / 3
    return max(noise, step / np.sqrt(12)), step if coarse else 0.0


def interpolation_residuals(t: np.ndarray, x: np.ndarray) -> np.ndarray:
    """How far each inner sample of x (n,) lies beside the cubic through its four neighbours (n - 4,), scaled so that
    white noise keeps its size."""
    n = len(t) - 4
    near = np.array([t[i : i + n] for i in (0, 1, 3, 4)])
    weights = np.ones((4, n))
    for i in range(4):
        for j in range(4):
            if i != j:
                weights[i] *= (t[2:-2] - near[j]) / (near[i] - near[j])
    left = x[2:-2] - sum(weight * x[i : i + n] for weight, i in zip(weights, (0, 1, 3, 4), strict=True))
    return np.asarray(np.abs(left) / np.sqrt(1 + (weights**2).sum(axis=0)))


def robust_std(e: np.ndarray) -> float:
    """The standard deviation of residuals (n,) as their median tells it."""
    return 1.4826 * float(np.median(np.abs(e)))


def remove_spikes(record: Record) -> Record:
    """The record without the samples that lie far beside their neighbours; whole where such samples are many."""
    t, x = record.t, record.x
    for _ in range(LONGEST):
        e = interpolation_residuals(t, x)
        beyond = np.pad(np.where(e > max(FAR * robust_std(e), SPIKE * np.ptp(x)), e, 0.0), 2)
        alone = beyond[2:-2] >= np.max([beyond[i : len(x) - 4 + i] for i in range(5)], axis=0)
        spikes = 2 + np.flatnonzero(alone & (beyond[2:-2] > 0))
        t, x = np.delete(t, spikes), np.delete(x, spikes)
        if not len(spikes) or len(x) < (1 - MOST) * len(record.x):
            break
    lost = len(record.x) - len(x)
    if not 0 < lost <= MOST * len(record.x):
        return record
    return replace(record, t=t, x=x, notes=(*record.notes, f"Left out as stray: {lost} of {len(record.x)} samples."))


def savitzky_golay(x: np.ndarray, width: int, degree: int) -> np.ndarray:
    """x (n,) through the polynomials of least squares over `width` samples (odd) about each, those at the ends over
    the first and the last `width` (A. Savitzky, M. J. E. Golay, Analytical Chemistry 36 (1964))."""
    half = width // 2
    powers = np.vander(np.linspace(-1, 1, width), degree + 1, increasing=True)
    project = powers @ np.linalg.pinv(powers)
    inner = np.convolve(x, project[half][::-1], "valid")
    return np.concatenate([project[:half] @ x[:width], inner, project[half + 1 :] @ x[-width:]])


def find_reversals(x: np.ndarray, least: float) -> np.ndarray:
    """Samples at which x (n,) turns back by `least` or more, the first extreme included."""
    found: list[int] = []
    low = high = 0
    rising = None
    values = x.tolist()
    for i, value in enumerate(values):
        if value > values[high]:
            high = i
        if value < values[low]:
            low = i
        if rising is not False and values[high] - value >= least:
            found.append(high)
            rising, low = False, i
        elif rising is not True and value - values[low] >= least:
            found.append(low)
            rising, high = True, i
    return np.array(found, int)
