"""The free decay within a record: rest, motion by hand, release, decay, rest, and perhaps a second release.

A decay is the longest series of regular turning points whose swings, the distances between neighbouring turning points,
do not grow.  A swing does not depend on the rest position, so this may drift.  Motions that are no decay are refused by
what was measured of their swings: they grow, are constant, rise and fall again, or are no waves.
"""

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Self

import numpy as np

from ...errors import HarnessError, command_text
from ...records.motion import Motion, selection_text
from . import thresholds
from .samples import are_regular, estimate_noise, half_periods, remove_spikes, smooth_segments


@dataclass(frozen=True)
class Swings:
    """Swings between neighbouring turning points of a record.

    Attributes
    ----------
    t : numpy.ndarray
        Times (n + 1,) in s of the turning points.
    size : numpy.ndarray
        Sizes (n,) of the swings.
    error : float
        Standard error of a size.
    half_period : float
        Half period in s.
    shape_error : numpy.ndarray
        Share (n + 1,) of the power about each turning point that no wave explains; NaN at the ends of the record.
    is_hidden : numpy.ndarray
        Whether a gap of the record hides a swing (n,), or several; its size is the mean of its neighbours.
    """

    t: np.ndarray
    size: np.ndarray
    error: float
    half_period: float
    shape_error: np.ndarray
    is_hidden: np.ndarray

    @property
    def duration(self) -> np.ndarray:
        return np.where(self.is_hidden, self.half_period, np.diff(self.t))

    @property
    def is_regular(self) -> np.ndarray:
        """Whether each swing (n,) but the first takes about as long as the one before."""
        return are_regular(self.duration)

    def reverse(self) -> Self:
        """Return the swings in the opposite order of time."""
        names = ("size", "shape_error", "is_hidden")
        return replace(self, t=-self.t[::-1], **{name: getattr(self, name)[::-1] for name in names})

    def loss(self, first: int, last: int) -> tuple[float, float]:
        """Return the share that the swings lose from the first to the last, and its standard error."""
        size = self.size[first : last + 1]
        k = np.arange(len(size)) - (len(size) - 1) / 2
        slope = float(k @ size / (k @ k))
        scatter = size - size.mean() - slope * k
        error = max(float(np.sqrt(scatter @ scatter / max(len(size) - 2, 1))), self.error) / np.sqrt(float(k @ k))
        scale = (len(size) - 1) / float(size.mean())
        return -slope * scale, error * scale


@dataclass(frozen=True)
class Decay:
    """Swings `first` to `last` of a record, which decay."""

    swings: Swings
    first: int
    last: int

    @property
    def count(self) -> int:
        return self.last - self.first + 1

    @property
    def begin(self) -> float:
        return float(self.swings.t[self.first])

    @property
    def end(self) -> float:
        return float(self.swings.t[self.last + 1])

    @property
    def half_period(self) -> float:
        """Half period in s."""
        return float(np.median(self.swings.duration[self.first : self.last + 1]))

    @property
    def weight(self) -> float:
        """How much the decay says about the losses: long, large and deep decays say most."""
        first, last = float(self.swings.size[self.first]), float(self.swings.size[self.last])
        return (self.end - self.begin) * float(np.sqrt(first * max(first - last, 0.0)))

    @property
    def is_proven(self) -> bool:
        """Whether both halves are decays if the decay is one of many like it: some swings fall by chance."""
        size, middle = self.swings.size, (self.first + self.last) // 2
        is_large = size[self.first] > thresholds.LARGE_FIRST * float(np.median(size))
        if is_large or self.count >= thresholds.SMALL_PART * len(size):
            return True
        return has_loss(self.swings, self.first, middle) and has_loss(self.swings, middle, self.last)


def select_decay(record: Motion, pendulum: bool) -> tuple[Motion, float, int]:
    """Return the part of a record that holds its free decay, its half period in s, and of how many decays it is one.

    It is the record itself, one of one, if this holds little else.

    Raises
    ------
    HarnessError
        If the record does not move, or its turning points are those of another motion.
    """
    if not np.ptp(record.x) > 0:
        raise HarnessError(f"{record.name} does not move: every value is {record.x[0]:.6g} {record.unit}")
    clean_record = remove_spikes(record)
    noise, _ = estimate_noise(clean_record.t, clean_record.x)
    periods = half_periods(clean_record, noise)
    # the angular acceleration of a pendulum has two peaks per half cycle at large amplitudes: no window is searched
    if pendulum and record.order == 2:
        return record, periods[0], 1
    best: Decay | None = None
    motions: list[Swings] = []
    for period in periods:
        swings = measure_swings(clean_record, period, noise, pendulum)
        if swings is None:
            continue
        motions.append(swings)
        proven_decays = [decay for decay in find_decays(swings) if decay.is_proven]
        best = max([*([best] if best else []), *proven_decays], key=lambda decay: decay.weight, default=None)
        if best is not None and best.end - best.begin > thresholds.LARGE_PART * (record.t[-1] - record.t[0]):
            break
    if motions:
        check_motion(record, motions[0] if best is None else best.swings, best, pendulum)
    if best is None:
        return record, periods[0], 1
    decays = find_decays(best.swings)
    part = crop(record, best, decays)
    return part, best.half_period, 1 if part is record else len(decays)


def measure_swings(record: Motion, half_period: float, noise: float, pendulum: bool) -> Swings | None:
    """Return the swings of a record with this half period; None if it has too few turning points."""
    motions = []
    for motion in smooth_segments(record, half_period, noise, pendulum):
        i, edge = motion.reversals, motion.width // 2  # at a gap, a swing is cut
        is_after = (i > edge) | (motion.begin == record.t[0])
        is_before = (i < len(motion.y) - 1 - edge) | (motion.end == record.t[-1])
        if (is_after & is_before).sum() > 1:
            motions.append(replace(motion, reversals=i[is_after & is_before]))
    if sum(len(motion.reversals) for motion in motions) < thresholds.MIN_SELECTED_TURNS:
        return None
    turns = [motion.refine(motion.reversals) for motion in motions]
    t = np.concatenate([t for t, _ in turns])
    half_period = float(np.median(np.diff(t)))
    error = max(motion.position_error(x) for motion, (_, x) in zip(motions, turns, strict=True))
    shape_error = np.concatenate(
        [wave_residuals(motion.y, motion.reversals, half_period / motion.interval) for motion in motions]
    )
    size = np.concatenate([np.append(np.abs(np.diff(x)), np.nan) for _, x in turns])[:-1]
    is_hidden = np.isnan(size)
    at = np.flatnonzero(is_hidden)
    size[at] = (size[at - 1] + size[at + 1]) / 2
    return Swings(t, size, error * np.sqrt(2), half_period, shape_error, is_hidden)


def wave_residuals(y: np.ndarray, i: np.ndarray, half_period: float) -> np.ndarray:
    """Return the share of the power of y (n,) within a period about the samples i (k,) that no wave explains.

    The wave may drift, decay and change its frequency.  NaN where the period exceeds the samples.
    """
    half = max(int(half_period), 4)
    share = np.full(len(i), np.nan)
    inner = (i >= half) & (i + half < len(y))
    if inner.any():
        u = np.arange(-half, half + 1) / half
        wave = np.stack([np.cos(np.pi * u), np.sin(np.pi * u)])
        basis, _ = np.linalg.qr(np.concatenate([np.ones((1, len(u))), u[None], wave, u * wave]).T)
        parts = np.lib.stride_tricks.sliding_window_view(y, 2 * half + 1)[i[inner] - half]
        parts = parts - parts.mean(axis=1, keepdims=True)
        total = (parts**2).sum(axis=1)
        share[inner] = 1 - ((parts @ basis) ** 2).sum(axis=1) / np.where(total > 0, total, 1.0)
    return share


def find_decays(swings: Swings) -> list[Decay]:
    """Return all series of regular swings that do not grow, and that lose more than their scatter explains."""
    size, margin = swings.size, thresholds.GROWTH_ERRORS * swings.error
    is_continued = swings.is_regular[1:] & (size[1:] < size[:-1] * thresholds.SMALL_GROWTH + margin)
    ends = np.flatnonzero(~is_continued).tolist()
    decays = []
    for before, last in zip([-1, *ends], [*ends, len(size) - 1], strict=True):
        first = skip_steady_swings(swings, before + 1, last)
        if has_loss(swings, first, last):
            decays.append(Decay(swings, first, last))
    return decays


def has_loss(swings: Swings, first: int, last: int) -> bool:
    """Return whether swings are enough, and lose more than their scatter explains."""
    if last - first + 1 < thresholds.MIN_SWINGS:
        return False
    loss, error = swings.loss(first, last)
    return loss > thresholds.SIGNIFICANT_LOSS * error


def skip_steady_swings(swings: Swings, first: int, last: int) -> int:
    """Return the swing at which the decay starts, after swings kept up by a drive that is then switched off.

    The loss per swing of a decay never rises, whatever the law.
    """
    size = swings.size[first : last + 1]
    n = len(size)
    if n < 2 * thresholds.MIN_STEADY_SWINGS:
        return first
    largest = float(size.max())
    steady = int(np.flatnonzero(size > (1 - thresholds.STEADY) * largest - 3 * swings.error)[-1])
    if steady < thresholds.MIN_STEADY_SWINGS:
        return first
    after = min(steady, n - 1 - steady)
    if after < 2:
        return first
    loss_before = (size[0] - size[steady]) / steady
    loss_after = (size[steady] - size[steady + after]) / after
    return first + steady if loss_before < thresholds.STEADY_LOSS * loss_after else first


def check_motion(record: Motion, swings: Swings, best: Decay | None, pendulum: bool) -> None:
    """Raise HarnessError if the swings are those of a motion that is no free decay."""
    if best is None:
        at = longest_regular(swings)
        if at.stop - at.start < thresholds.MIN_SWINGS:
            at = slice(0, len(swings.size))
        first, last = at.start + 1, at.stop - 1  # the first swing may be cut
    else:
        first, last = best.first, best.last
    name, unit, size = record.name, record.base, swings.size
    regular = size[first : last + 1]
    is_large_pendulum = (pendulum or unit == "rad") and regular.max() > 2 * thresholds.LARGE_SWING
    shape = float(np.nanmedian(shape)) if np.isfinite(shape := swings.shape_error[first : last + 2]).any() else 0.0
    if shape > thresholds.NO_WAVE and not is_large_pendulum:
        raise HarnessError(
            f"{name} is no free decay: {100 * shape:.0f} % of the power of its cycles is no wave, as in stick-slip, "
            f"noise, relaxation oscillations or several modes; use {command_text('fit', 'stickslip')} for a driven "
            f"motion, filter noise, or select a free decay with {selection_text()}"
        )
    if best is not None:
        if growth := find_regrowth(swings, thresholds.RIVAL * best.weight):
            raise HarnessError(
                f"{name} beats: its swings fall to {growth.swings.size[growth.last]:.3g} {unit} at "
                f"t = {record.format_time(-growth.end)} s and rise again to "
                f"{growth.swings.size[growth.first]:.3g} {unit} at t = {record.format_time(-growth.begin)} s, as those "
                f"of two modes or of a drive do; fit a model with both by {command_text('fit')}, or select a decay of "
                f"one mode with {selection_text()}"
            )
        return
    if len(regular) < thresholds.MANY_SWINGS:
        return
    loss, error = swings.loss(first, last)
    if loss < -thresholds.SIGNIFICANT_LOSS * error:
        raise HarnessError(
            f"{name} grows, from {regular[0]:.4g} to {regular[-1]:.4g} {unit} peak to peak: it is driven or "
            f"gains energy, and has no decay to measure; fit a model with its drive by {command_text('fit')}"
        )
    if abs(loss) < thresholds.SIGNIFICANT_LOSS * error and error < thresholds.CONSTANT:
        raise HarnessError(
            f"{name} has a constant amplitude: over {len(regular)} half cycles its swings change by "
            f"{-100 * loss:+.2g} % +- {200 * error:.1g} %, so it is driven or loses less than that; make a longer "
            f"record, or fit a model with its drive by {command_text('fit')}"
        )


def longest_regular(swings: Swings) -> slice:
    """Return the longest series of regular swings."""
    starts = np.flatnonzero(~swings.is_regular)
    edges = [0, *starts.tolist(), len(swings.size)]
    first, last = max(pairwise(edges), key=lambda pair: pair[1] - pair[0])
    return slice(first, last)


def find_regrowth(swings: Swings, min_weight: float) -> Decay | None:
    """Return a growth soon after a decay of such a weight, as a decay of the reversed swings; None without one.

    A hand or a second release makes the swings grow at once; a beat, a drive or a wandering amplitude take several
    cycles.
    """
    decays = [decay for decay in find_decays(swings) if decay.weight >= min_weight]
    growths = [growth for growth in find_decays(swings.reverse()) if growth.weight >= thresholds.RIVAL * min_weight]
    ends = len(swings.size) - 1 - np.array([decay.last for decay in decays])
    pauses = ((growth, ends - growth.last) for growth in growths)
    return next((growth for growth, n in pauses if ((n >= -1) & (n <= thresholds.MAX_NODE_SWINGS)).any()), None)


def crop(record: Motion, best: Decay, decays: list[Decay]) -> Motion:
    """Return the record of the best of decays, with a note; unchanged if only a rest or a cycle is around it."""
    swings = best.swings
    before, after = swings.size[: best.first], swings.size[best.last + 1 :]
    begin, end, reasons = float(record.t[0]), float(record.t[-1]), []
    if best.begin - begin > thresholds.LONG_REST * swings.half_period:
        if (before > thresholds.SMALL_BEFORE * swings.size[best.first]).any():
            begin = best.begin
            reasons.append("before it the motion is not free")
        else:
            begin = best.begin - thresholds.BEFORE_FIRST_TURN * swings.half_period
            reasons.append("before it is a rest")
    if len(after) and after.max() > thresholds.LARGE_AFTER * swings.size[best.last]:
        end = float(swings.t[best.last + (best.count < thresholds.MANY_SWINGS)])
        reasons.append(f"after it the swings grow to {after.max():.3g} {record.base}")
    if not reasons:
        return record
    t = record.format_time
    choice = f", one of {len(decays)}, and the intervals are widened by the choice" if len(decays) > 1 else ""
    note = (
        f"The free decay from t = {t(begin)} to {t(end)} s is taken, {best.count} half cycles{choice}: "
        f"{' and '.join(reasons)}."
    )
    others = [other for other in decays if other.first > best.last or other.last < best.first]
    if rivals := [other for other in others if other.weight > thresholds.RIVAL * best.weight]:
        spans = ", ".join(f"{t(other.begin)} to {t(other.end)}" for other in rivals)
        note += f" The record also decays from t = {spans} s: select a part with {selection_text()}."
    part = record.select(begin, end)
    return replace(part, notes=(*record.notes, note))
