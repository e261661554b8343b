"""Turning points of a record, noisy or clean, evenly sampled or not, about any rest position; and its noise.

They are located in a smoothed copy of the record. The fits that follow use them only to number and locate half cycles.
For a velocity the copy is its integral; for an acceleration it is -a/omega^2, which is the position except for the
small contribution of the losses.  A turning point is a reversal that exceeds the noise.
"""

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from ...errors import HarnessError
from ...records.record import MIN_SAMPLES, Record
from ..estimation.noise import interpolation_residuals, robust_std
from ..estimation.reversals import find_reversals
from . import thresholds


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


def find_extrema(record: Record, pendulum: bool) -> Extrema:
    """Return the turning points of a record; HarnessError if it shows no decay."""
    span = float(np.ptp(record.x))
    if not span > 0:
        raise HarnessError(f"{record.name} does not move: every value is {record.x[0]:.6g} {record.unit}")
    noise, step = estimate_noise(record.t, record.x)
    half_period = estimate_half_period(record, noise, span)
    slices = gapless_slices(record, half_period)
    candidates = [extrema_in_slice(record, part, half_period, noise, step, span, pendulum) for part in slices]
    sufficient = [
        extrema for extrema in candidates if extrema is not None and len(extrema.t) >= thresholds.ENOUGH_TURNING_POINTS
    ]
    longest = max(filter(None, candidates), key=lambda extrema: len(extrema.t), default=None)
    best = sufficient[0] if sufficient else longest
    if best is None or len(best.t) < thresholds.MIN_TURNING_POINTS - 1:
        count = 0 if best is None else len(best.t) + 1
        if span < thresholds.MIN_NOISY_RANGE * noise:
            raise HarnessError(
                f"{record.name} is all noise: its range is {span:.3g} {record.unit}, its noise {noise:.3g}; "
                "filter it, or take at least 10 samples per cycle"
            )
        raise HarnessError(
            f"{record.name} has {count} turning points above the noise ({noise:.3g} {record.unit}), and "
            f"{thresholds.MIN_TURNING_POINTS} or more are needed: make a longer record"
        )
    check_decay(record, best)
    return best


def estimate_half_period(record: Record, noise: float, span: float) -> float:
    """Return the half period in s, from the reversals of the record or, if noise hides them, from its spectrum."""
    at = find_reversals(record.x, max(thresholds.MIN_REVERSAL * noise, thresholds.MIN_RELATIVE_REVERSAL * span))
    if len(at) >= 4:
        return float(np.median(np.diff(record.t[at[1:]])))
    step = (record.t[-1] - record.t[0]) / (len(record.t) - 1)
    even = np.interp(record.t[0] + step * np.arange(len(record.t)), record.t, record.x)
    size = 1 << int(np.ceil(np.log2(8 * len(even))))
    peak = int(np.argmax(np.abs(np.fft.rfft(even - even.mean(), size))))
    return 0.5 * size * step / max(peak, 1)


def gapless_slices(record: Record, half_period: float) -> list[slice]:
    """Return the segments of the record between its gaps."""
    intervals = np.diff(record.t)
    gaps = (
        np.flatnonzero(
            intervals > max(thresholds.GAP * half_period, thresholds.MIN_GAP_SAMPLES * float(np.median(intervals)))
        )
        + 1
    )
    ends = [0, *gaps.tolist(), len(record.t)]
    slices = [slice(low, high) for low, high in pairwise(ends) if high - low >= 8]
    return slices or [slice(0, len(record.t))]


def extrema_in_slice(
    record: Record, part: slice, half_period: float, noise: float, step: float, span: float, pendulum: bool
) -> Extrema | None:
    """Return the turning points in one segment of the record; None if it has too few."""
    motion = smooth_motion(record, part, half_period, noise, span, pendulum)
    if motion is None:
        return None
    y, grid, width = motion.y, motion.t, motion.width
    i = select_regular_reversals(motion.reversals, half_period / motion.interval)
    i = i[(i < len(y) - 1 - width // 2) | (np.arange(len(i)) < 4)]
    if len(i) < thresholds.MIN_TURNING_POINTS:
        return None
    t_start, i = locate_start(y, grid, i, width)
    times, positions = motion.refine(i)
    error = motion.position_error(positions)
    if pendulum and len(positions) > 6 and abs(positions[0] - positions[1]) > 2 * thresholds.MIN_EXTRAPOLATED:
        # near pi an extrapolated start would be unreliable: start at the first turning point recorded
        t_start, times, positions = times[0], times[1:], positions[1:]
    return Extrema(times, positions, t_start, half_period, noise, step, float(record.t[part][0]), error)


@dataclass(frozen=True)
class SmoothMotion:
    """Smoothed position on even times, whatever the quantity of the record.

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
    """

    t: np.ndarray
    y: np.ndarray
    width: int
    threshold: float
    reversals: np.ndarray

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


def smooth_motion(
    record: Record, part: slice, half_period: float, noise: float, span: float, pendulum: bool
) -> SmoothMotion | None:
    """Return the smoothed position in one segment of the record; None if it has too few turning points."""
    t, x = record.t[part], record.x[part]
    dt = (t[-1] - t[0]) / (len(t) - 1)
    block = max(1, int(half_period / dt / thresholds.MAX_SAMPLES_PER_HALF_PERIOD))
    even = np.interp(t[0] + dt * np.arange(len(t)), t, x)
    u = even[: len(even) // block * block].reshape(-1, block).mean(axis=1)
    grid = t[0] + dt * (block * np.arange(len(u)) + (block - 1) / 2)
    dt, block_noise = dt * block, noise / np.sqrt(block)
    width = max(int(thresholds.SMOOTHING_WINDOW * half_period / dt) // 2 * 2 + 1, 5)
    if width >= len(u) // 2:
        return None
    y = savitzky_golay(u, width, 4 if width > 5 else 3) if width > 5 or noise > thresholds.CLEAN * span else u
    threshold = max(
        thresholds.MIN_SMOOTH_REVERSAL * block_noise / np.sqrt(width), thresholds.MIN_RELATIVE_REVERSAL * span
    )
    if record.order:
        y, threshold = integrate_to_position(y, dt, half_period, record.order, threshold, pendulum)
    i = find_reversals(y, threshold)
    if len(i) < thresholds.MIN_TURNING_POINTS:
        return None
    return SmoothMotion(grid, y, width, threshold, i)


def select_regular_reversals(i: np.ndarray, half_period: float) -> np.ndarray:
    """Return the reversals i (samples) of a free motion with a half period in samples, and the one before them.

    Faster reversals at the beginning are ringing of the smoothed copy at a release.  Where the reversals become
    irregular, the motion is lost in noise or disturbed.
    """
    gaps = np.diff(i)
    long = gaps > thresholds.MIN_HALF_PERIOD * half_period
    regular = np.flatnonzero(long[:-1] & long[1:])
    first = int(regular[0]) if len(regular) else 0
    i, gaps = i[first:], gaps[first + 1 :]
    irregular = np.flatnonzero(
        (gaps[1:] > thresholds.MAX_SPACING * gaps[:-1]) | (gaps[1:] < thresholds.MIN_SPACING * gaps[:-1])
    )
    return i[: irregular[0] + 3] if len(irregular) else i


def locate_start(y: np.ndarray, grid: np.ndarray, i: np.ndarray, width: int) -> tuple[float, np.ndarray]:
    """Return the time at which the motion starts from rest, or would have, and the turning points i after it.

    The first reversal is the start of the record, a release from a hold, or a turning point.
    """
    gap = grid[i[2]] - grid[i[1]]
    share = (grid[i[1]] - grid[i[0]]) / gap
    if (
        share > thresholds.LATE_RELEASE or i[0] <= width // 4
    ):  # held before, released, or recorded from after a turning point on
        return float(
            grid[i[0]] if thresholds.EARLY_RELEASE < share <= thresholds.LATE_RELEASE else grid[i[1]] - gap
        ), i[1:]
    if abs(y[0] - y[i[0]]) > thresholds.PARTIAL_SWING * abs(
        y[i[1]] - y[i[0]]
    ):  # recorded from within the free motion on
        return float(2 * grid[i[0]] - grid[i[1]]), i
    return float(grid[i[0]]), i[1:]  # recorded from near a turning point on, or released after a short time


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


def check_decay(record: Record, extrema: Extrema) -> None:
    """Raise HarnessError if the oscillation grows."""
    sizes = np.abs(np.diff(extrema.x))  # peak to peak
    if sizes[-1] > sizes[0] + thresholds.GROWTH_ERRORS * extrema.error and sizes[-1] > thresholds.GROWTH * sizes[0]:
        raise HarnessError(
            f"{record.name} grows, from {sizes[0]:.4g} to {sizes[-1]:.4g} {record.base} peak to peak: it is driven or "
            "gains energy, and has no decay to measure"
        )


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


def remove_spikes(record: Record) -> Record:
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
