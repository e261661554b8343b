"""Noise of the samples of a record, and samples that are no measurements.

Smoothed position of a record, noisy or clean, evenly sampled or not, with its reversals about any rest position.

For a velocity it is the integral; for an acceleration it is -a/omega^2, which is the position except for the small
contribution of the losses.  A reversal is one that exceeds the noise.  The window of the decay and the numbers of its
half cycles follow from them; the fits do not.

Turning points of a decay, which number and locate its half cycles for the fits that follow.

Thinning of dense records: means of neighbouring samples, as many as the bandwidth of the motion allows.

A mean over a block of samples is that of the signal at the mean time, plus x'' var(t)/2 for the variance of the times
in the block.  With x'' from differences of the means, four blocks wide, an error of (omega h)^4/72 of the amplitude
remains for blocks of length h, where the acceleration does not jump.
"""

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Self

import numpy as np

from ...errors import HarnessError
from ...records.motion import MIN_SAMPLES, Motion
from ..estimation.estimate import find_reversals, interpolation_residuals, robust_std
from . import thresholds


def estimate_noise(t: np.ndarray, x: np.ndarray) -> tuple[float, float]:
    """Return the standard deviation of the noise of x (n,), and the quantisation step if it exceeds the noise, or 0.

    The noise is the median distance of a sample from the cubic through its four neighbours, so it includes curvature
    that is too fast for the sampling.  A quantiser of step q adds at least q/sqrt(12).  Constant samples before the
    first change and after the last one do not count.
    """
    changes = np.flatnonzero(np.diff(x))
    if len(changes) and changes[-1] - changes[0] > 2 * MIN_SAMPLES:
        moving_part = slice(changes[0], changes[-1] + 2)
        t, x = t[moving_part], x[moving_part]
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
    n_removed = len(record.x) - len(x)
    if not 0 < n_removed <= thresholds.MAX_SPIKES * len(record.x):
        return record
    note = f"{n_removed} of {len(record.x)} samples are outliers and are left out."
    return replace(record, t=t, x=x, notes=(*record.notes, note))


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


@dataclass(frozen=True)
class Extrema:
    """Turning points of a record.

    Attributes
    ----------
    t, x : numpy.ndarray
        Times (n,) in s and positions (n,) of the turning points after the start.
    t_start : float
        Time in s of the turning point at which the motion starts.
    half_period : float
        Half period in s.
    noise : float
        Standard deviation of a sample, in the unit of the record.
    quantiser_step : float
        Step of the quantiser in the unit of the record; 0 if it does not exceed the noise.
    segment_start : float
        Time in s from which on the record has no gap.
    error : float
        Standard error of the positions.
    """

    t: np.ndarray
    x: np.ndarray
    t_start: float
    half_period: float
    noise: float
    quantiser_step: float
    segment_start: float
    error: float

    def skip(self, count: int) -> Self:
        """Return the turning points without the first ones."""
        return replace(self, t=self.t[count:], x=self.x[count:], t_start=float(self.t[count - 1]))

    def rest_positions(self, may_drift: bool) -> np.ndarray:
        """Return the rest position at each turning point (n,): one for all, or on a straight line if it may drift."""
        t, x = self.t, self.x
        if len(x) < 3:
            return np.full(len(x), np.mean(x))
        middles = (x[:-2] + 2 * x[1:-1] + x[2:]) / 4
        if not may_drift or len(middles) < 3:
            return np.full(len(x), np.median(middles))
        return np.polyval(np.polyfit(t[1:-1] - t[0], middles, 1), t - t[0])


def find_extrema(record: Motion, half_period: float, quantiser_step: float, pendulum: bool) -> Extrema:
    """Return the turning points of a decay with this half period in s; HarnessError if there are too few."""
    noise, _ = estimate_noise(record.t, record.x)
    motions = [cut_to_decay(motion, half_period) for motion in smooth_segments(record, half_period, noise, pendulum)]
    sufficient = (motion for motion in motions if len(motion.reversals) > thresholds.ENOUGH_TURNING_POINTS)
    best = next(sufficient, max(motions, key=lambda motion: len(motion.reversals), default=None))
    if best is None or len(best.reversals) < thresholds.MIN_TURNING_POINTS:
        count = len(find_reversals_above_noise(record, noise) if best is None else best.reversals)
        span = float(np.ptp(record.x))
        if span < thresholds.MIN_NOISY_RANGE * noise:
            raise HarnessError(
                f"{record.name} is all noise: its range is {span:.3g} {record.unit}, its noise {noise:.3g}; "
                "filter it, or take at least 10 samples per cycle"
            )
        raise HarnessError(
            f"{record.name} has {count} turning point{'s' * (count != 1)} above the noise ({noise:.3g} {record.unit}), "
            f"its start among them, and {thresholds.MIN_TURNING_POINTS} or more are needed without gaps and with "
            "samples between them: make a longer record, sample faster, or select a part"
        )
    t_start, i = locate_start(best)
    t, x = best.refine(i)
    error = best.position_error(x)
    if pendulum and len(x) > thresholds.ENOUGH_TURNING_POINTS and abs(x[0] - x[1]) > 2 * thresholds.MIN_EXTRAPOLATED:
        # near pi an extrapolated start would be unreliable: start at the first turning point recorded
        t_start, t, x = t[0], t[1:], x[1:]
    return Extrema(t, x, t_start, half_period, noise, quantiser_step, best.begin, error)


def cut_to_decay(motion: SmoothMotion, half_period: float) -> SmoothMotion:
    """Return the motion with the reversals of a decay with this half period in s, and the one before them.

    Faster reversals at the beginning are ringing of the smoothed copy at a release.  Where the reversals become
    irregular, the motion is lost in noise or disturbed.
    """
    i = motion.reversals
    is_long = np.diff(i) > thresholds.MIN_HALF_PERIOD * half_period / motion.interval
    i = i[int(np.argmax(is_long[:-1] & is_long[1:])) :]
    irregular = np.flatnonzero(~are_regular(np.diff(i[1:])))
    i = i[: irregular[0] + 2] if len(irregular) else i
    is_inside = i < len(motion.y) - 1 - motion.width // 2
    return replace(motion, reversals=i[is_inside | (np.arange(len(i)) < 4)])


def locate_start(motion: SmoothMotion) -> tuple[float, np.ndarray]:
    """Return the time at which the motion starts from rest, or would have, and the reversals after it.

    The first reversal is the start of the record, a release from a hold, or a turning point.
    """
    y, t, i = motion.y, motion.t, motion.reversals
    gap = t[i[2]] - t[i[1]]
    share = (t[i[1]] - t[i[0]]) / gap
    # held before, released, or recorded from after a turning point on
    if share > thresholds.LATE_RELEASE or i[0] <= motion.width // 4:
        is_release = thresholds.EARLY_RELEASE < share <= thresholds.LATE_RELEASE
        return float(t[i[0]] if is_release else t[i[1]] - gap), i[1:]
    # recorded from within the free motion on
    if abs(y[0] - y[i[0]]) > thresholds.PARTIAL_SWING * abs(y[i[1]] - y[i[0]]):
        return float(2 * t[i[0]] - t[i[1]]), i
    return float(t[i[0]]), i[1:]  # recorded from near a turning point on, or released after a short time


REACH = 2  # blocks to each side, for the second derivative: their noise enters by 1/(24 REACH^2)


def block_size(record: Motion, half_period: float) -> int:
    """Return the number of samples per block that a record with this half period (s) allows; 1 leaves it unchanged."""
    n = len(record.t)
    if n <= thresholds.MAX_DENSE_SAMPLES:
        return 1
    interval = float(np.median(np.diff(record.t)))
    per_period = 2 * half_period / interval / thresholds.MIN_THINNED_PER_PERIOD
    return max(int(min(n / thresholds.MIN_THINNED_SAMPLES, per_period)), 1)


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
