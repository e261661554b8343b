"""Turning points of a decay, which number and locate its half cycles for the fits that follow."""

from dataclasses import dataclass, replace

import numpy as np

from ...errors import HarnessError
from ...records.motion import Motion
from . import thresholds
from .sample_noise import estimate_noise
from .smooth_motion import SmoothMotion, are_regular, find_reversals_above_noise, smooth_segments


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
        turns = (
            f"{record.name} has {count} turning point{'s' * (count != 1)} above the noise ({noise:.3g} {record.unit})"
        )
        if count < thresholds.MIN_TURNING_POINTS:
            least = thresholds.MIN_TURNING_POINTS
            raise HarnessError(f"{turns}, its start among them, and {least} or more are needed: make a longer record")
        raise HarnessError(f"{turns}, and too few samples or gaps between them: sample faster, or select a part")
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
