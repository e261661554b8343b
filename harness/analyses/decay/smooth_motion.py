"""Smoothed position of a record, noisy or clean, evenly sampled or not, with its reversals about any rest position.

For a velocity it is the integral; for an acceleration it is -a/omega^2, which is the position except for the small
contribution of the losses.  A reversal is one that exceeds the noise.  The window of the decay and the numbers of its
half cycles follow from them; the fits do not.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from ...records.motion import Motion
from ..estimation.reversals import find_reversals
from . import thresholds


@dataclass(frozen=True)
class SmoothMotion:
    """Smoothed position on even times in a part of a record without gaps, whatever its quantity.

    Attributes
    ----------
    t, y : numpy.ndarray
        Times (n,) in s and smoothed positions (n,).
    width : int
        Samples of the smoothing window.
    threshold : float
        Size of the smallest reversal that exceeds the noise.
    reversals : numpy.ndarray
        Samples (k,) at which the position reverses.
    begin, end : float
        Times in s of the first and the last sample of the part.
    """

    t: np.ndarray
    y: np.ndarray
    width: int
    threshold: float
    reversals: np.ndarray
    begin: float
    end: float

    @property
    def interval(self) -> float:
        """Interval between the samples in s."""
        return float(self.t[-1] - self.t[0]) / (len(self.t) - 1)

    def refine(self, i: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return times (k,) in s and positions (k,) of the reversals at the samples i (k,), from parabolas."""
        y = self.y
        distance = max(1, min(self.width // 4, int(min(i[0], len(y) - 1 - i[-1]))))
        before, top, after = y[i - distance], y[i], y[np.minimum(i + distance, len(y) - 1)]
        curvature = before - 2 * top + after
        shift = np.clip(0.5 * (before - after) / np.where(curvature == 0, 1, curvature), -1, 1)
        return self.t[i] + shift * distance * self.interval, top - 0.25 * (before - after) * shift

    def position_error(self, positions: np.ndarray) -> float:
        """Return the standard error of the positions (k,) of reversals."""
        return max(1.5 * self.threshold / thresholds.MIN_SMOOTH_REVERSAL, 2e-4 * float(np.ptp(positions)) / 2)


def half_periods(record: Motion, noise: float) -> list[float]:
    """Return different half periods in s that the record may have: of its reversals, and of slow and fast spectra."""
    at = find_reversals_above_noise(record, noise)
    result = [float(np.median(np.diff(record.t[at[1:]])))] if len(at) >= thresholds.MIN_REVERSALS else []
    n = min(len(record.t), thresholds.SPECTRUM_SAMPLES)
    t = np.linspace(record.t[0], record.t[-1], n)
    x = np.interp(t, record.t, record.x)
    x = (x - np.polyval(np.polyfit(t - t[0], x, 1), t - t[0])) * np.hanning(n)
    frequencies, power = np.fft.rfftfreq(4 * n, t[1] - t[0]), np.abs(np.fft.rfft(x, 4 * n)) ** 2
    power[frequencies < 2 / (t[-1] - t[0])] = 0.0
    for derivative in range(3):
        peak = float(frequencies[np.argmax(power * frequencies ** (2 * derivative))])
        if (
            thresholds.MIN_SAMPLES_PER_PERIOD * peak * (t[-1] - t[0]) < len(record.t)
            and peak > 0
            and all(abs(2 * peak * other - 1) > thresholds.SAME_PERIOD for other in result)
        ):
            result.append(0.5 / peak)
    return result or [0.5 * float(np.ptp(record.t))]


def find_reversals_above_noise(record: Motion, noise: float) -> np.ndarray:
    """Return the samples at which a record reverses by more than its noise, with the first extremum."""
    smallest = max(thresholds.MIN_REVERSAL * noise, thresholds.MIN_RELATIVE_REVERSAL * float(np.ptp(record.x)))
    return find_reversals(record.x, smallest)


def smooth_segments(record: Motion, half_period: float, noise: float, pendulum: bool) -> list[SmoothMotion]:
    """Return the smoothed position between the gaps of a record, where there are enough samples and reversals."""
    intervals = np.diff(record.t)
    longest = max(thresholds.GAP * half_period, thresholds.MIN_GAP_SAMPLES * float(np.median(intervals)))
    ends = [0, *(np.flatnonzero(intervals > longest) + 1).tolist(), len(record.t)]
    parts = [slice(low, high) for low, high in pairwise(ends) if high - low >= thresholds.MIN_SEGMENT]
    motions = (smooth(record, part, half_period, noise, pendulum) for part in parts)
    return [motion for motion in motions if motion and len(motion.reversals) >= thresholds.MIN_TURNING_POINTS]


def smooth(record: Motion, part: slice, half_period: float, noise: float, pendulum: bool) -> SmoothMotion | None:
    """Return the smoothed position in a part of a record; None if it has too few samples."""
    t, x = record.t[part], record.x[part]
    dt = (t[-1] - t[0]) / (len(t) - 1)
    block = max(1, int(half_period / dt / thresholds.MAX_SAMPLES_PER_HALF_PERIOD))
    even = np.interp(t[0] + dt * np.arange(len(t)), t, x)
    u = even[: len(even) // block * block].reshape(-1, block).mean(axis=1)
    grid = t[0] + dt * (block * np.arange(len(u)) + (block - 1) / 2)
    dt, block_noise = dt * block, noise / np.sqrt(block)
    span = float(np.ptp(record.x))
    width = max(int(thresholds.SMOOTHING_WINDOW * half_period / dt) // 2 * 2 + 1, 5)
    if width >= len(u) // 2:
        return None
    y = savitzky_golay(u, width, 4 if width > 5 else 3) if width > 5 or noise > thresholds.CLEAN * span else u
    threshold = max(
        thresholds.MIN_SMOOTH_REVERSAL * block_noise / np.sqrt(width), thresholds.MIN_RELATIVE_REVERSAL * span
    )
    if record.order:
        y, threshold = integrate_to_position(y, dt, half_period, record.order, threshold, pendulum)
    return SmoothMotion(grid, y, width, threshold, find_reversals(y, threshold), float(t[0]), float(t[-1]))


def are_regular(durations: np.ndarray) -> np.ndarray:
    """Return whether each of the durations (n,) of half cycles but the first is about as long as the one before."""
    ratio = durations[1:] / durations[:-1]
    return np.concatenate([[True], (ratio > thresholds.MIN_SPACING) & (ratio < thresholds.MAX_SPACING)])


def integrate_to_position(
    y: np.ndarray, dt: float, half_period: float, order: int, threshold: float, pendulum: bool
) -> tuple[np.ndarray, float]:
    """Return the approximate position from a smoothed velocity or acceleration, and its reversal threshold."""
    i = find_reversals(y, threshold)[1:]
    middle = float(np.median((y[i[:-2]] + 2 * y[i[1:-1]] + y[i[2:]]) / 4)) if len(i) > 2 else float(np.mean(y))
    omega = np.pi / half_period
    if order == 1:
        return np.concatenate([[0.0], np.cumsum((y[1:] + y[:-1]) / 2 - middle) * dt]), threshold / omega
    y = (middle - y) / omega**2
    return np.arcsin(np.clip(y, -1, 1)) if pendulum else y, threshold / omega**2


def savitzky_golay(x: np.ndarray, width: int, degree: int) -> np.ndarray:
    """Smooth x (n,) by least-squares polynomials over `width` (odd) samples.

    The polynomials at the ends are those of the first and the last `width` samples.

    References
    ----------
    A. Savitzky, M. J. E. Golay, Analytical Chemistry 36 (1964)
    """
    half = width // 2
    powers = np.vander(np.linspace(-1, 1, width), degree + 1, increasing=True)
    project = powers @ np.linalg.pinv(powers)
    inner = np.convolve(x, project[half][::-1], "valid")
    return np.concatenate([project[:half] @ x[:width], inner, project[half + 1 :] @ x[-width:]])
