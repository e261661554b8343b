"""Selection of the free motion: without a hold or a push at its beginning, and a rest or a disturbance at its end.

The fit starts with the turning points that are certain, and extends as long as the record follows the law.  Each step
takes a `FreeMotion` and returns it with other samples and their fit, or unchanged.
"""

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Self

import numpy as np

from ...records.motion import MIN_SAMPLES, Motion
from ..estimation.estimate import robust_std
from . import thresholds
from .decay_problem import DecayProblem, prepare_problem
from .law import OMEGA, T0, TERMS, UNKNOWNS, Terms
from .samples import Extrema, estimate_noise


@dataclass(frozen=True)
class FreeMotion:
    """Free motion of a record after some steps of its selection.

    Attributes
    ----------
    record, extrema : Motion, Extrema
        The record and its turning points.
    terms : tuple of str
        Terms of the law that is fitted.
    available : DecayProblem
        Samples from which the next step may select.
    problem : DecayProblem
        Samples that are selected.
    p : numpy.ndarray
        Values (8,) of UNKNOWNS that fit these samples.
    sum_of_squares : float
        Sum of squares of their residuals.
    outliers : int
        Number of samples left out as outliers.
    notes : tuple of str
        Sentences on other samples left out.
    """

    record: Motion
    extrema: Extrema
    terms: Terms
    available: DecayProblem
    problem: DecayProblem
    p: np.ndarray
    sum_of_squares: float = np.inf
    outliers: int = 0
    notes: tuple[str, ...] = ()

    def fit(self, problem: DecayProblem, p: np.ndarray | None = None) -> Self:
        """Return the motion with the samples of another problem and their fit, from the starting values p."""
        p, squares = problem.fit(self.p if p is None else p, self.terms)
        return replace(self, problem=problem, p=p, sum_of_squares=squares)

    def search(self, problem: DecayProblem, p: np.ndarray | None = None) -> Self:
        """Fit as `fit` does, and also by growing windows if that leaves more than noise; return the better fit."""
        motion = self.fit(problem, p)
        if not problem.exceeds_noise(motion.sum_of_squares):
            return motion
        start = problem.fit_growing_windows(self.p if p is None else p, self.terms)
        return min(motion, self.fit(problem, start), key=lambda motion: motion.sum_of_squares)

    def residuals(self) -> np.ndarray:
        """Return the residuals (n,) of the selected samples."""
        return self.problem.residuals(self.p, self.terms)[0]

    def add_note(self, note: str) -> Self:
        return replace(self, notes=(*self.notes, note))

    def format_time(self, t: float) -> str:
        """Return a time of the problem as a time of the record."""
        return self.record.format_time(t + self.problem.time_origin)


def select_free_motion(record: Motion, extrema: Extrema, terms: Terms, pendulum: bool, drift: bool) -> FreeMotion:
    """Return the free motion of a record with the given turning points, fitted by the law with these terms."""
    problem, p = initial_problem(record, extrema, terms, pendulum, drift)
    motion = FreeMotion(record, extrema, terms, problem, problem, p)
    for step in (
        skip_before_start,
        fit_certain_samples,
        truncate_at_stop,
        remove_outliers,
        skip_disturbed_start,
        truncate_at_disturbance,
        estimate_final_noise,
    ):
        motion = step(motion)
    if motion.outliers:
        motion = motion.add_note(f"{motion.outliers} of {len(record.t)} samples are outliers and are left out.")
    return motion


def initial_problem(
    record: Motion, extrema: Extrema, terms: Terms, pendulum: bool, drift: bool
) -> tuple[DecayProblem, np.ndarray]:
    """Return the fit problem, and the values of a law with these terms that fit its turning points."""
    problem, p = prepare_problem(record, extrema, pendulum, drift)
    p[[UNKNOWNS.index(term) for term in TERMS if term not in terms]] = 0.0
    return problem, p


def skip_before_start(motion: FreeMotion) -> FreeMotion:
    """Leave out the samples before the start of the motion, or before a gap near its beginning."""
    problem, segment_start = motion.problem, motion.extrema.segment_start
    start = max(segment_start - problem.time_origin, motion.p[T0])
    part = problem.subset(problem.t >= start)
    if segment_start > motion.record.t[0]:
        motion = motion.add_note(
            f"The record before the gap that ends at t = {motion.record.format_time(segment_start)} s has too few "
            "cycles and is left out."
        )
    return replace(motion, available=part, problem=part)


def fit_certain_samples(motion: FreeMotion) -> FreeMotion:
    """Fit the samples up to the last turning point, with a search if the fit leaves more than noise."""
    problem, extrema = motion.available, motion.extrema
    last = extrema.t[-1] - problem.time_origin + thresholds.CERTAIN_TIME * extrema.half_period
    return motion.search(problem.subset(problem.t <= last))


def truncate_at_stop(motion: FreeMotion) -> FreeMotion:
    """Select the available samples up to the stop of the motion."""
    available = motion.available
    selection = available.subset(available.t <= last_usable_time(available, motion.p))
    return replace(motion, problem=selection) if len(selection.t) == len(motion.problem.t) else motion.fit(selection)


def last_usable_time(problem: DecayProblem, p: np.ndarray) -> float:
    """Return the time in s up to which to fit: one half cycle before the motion stops or is lost in quantisation.

    A record at rest repeats one sample, and the stop itself makes a kink.
    """
    amplitudes, starts = problem.half_cycles(p)
    spans = (amplitudes[:-1] + amplitudes[1:]) * p[OMEGA] ** problem.model.order
    unusable = np.flatnonzero(spans < thresholds.MIN_QUANTISER_STEPS * problem.quantiser_step / problem.scale)
    stop = len(starts) - (1 if starts[-1] > problem.t[-1] else 2)
    last = min(int(unusable[0]), stop) if len(unusable) else stop
    return float(starts[max(last, min(3, len(starts) - 1))])


def remove_outliers(motion: FreeMotion) -> FreeMotion:
    """Leave out the outliers, unless there are many of them."""
    problem, trial = motion.problem, motion
    limit = 2 + int(thresholds.MAX_OUTLIERS * len(problem.t))
    for _ in range(2):  # an outlier bends the fit away from the other samples
        e, _ = problem.residuals(trial.p, motion.terms)
        far = np.abs(e) > thresholds.OUTLIER * max(robust_std(e), problem.noise, problem.residual_floor)
        if not far.any():
            break
        farthest = far & (np.abs(e) >= np.sort(np.abs(e))[-limit])
        trial = trial.fit(problem.subset(~farthest))
        if far.sum() <= limit:
            return replace(trial, outliers=int(far.sum()))
    return replace(motion, outliers=0)


def skip_disturbed_start(motion: FreeMotion) -> FreeMotion:
    """Start at the first or the second turning point if a motion before it is not free, or bends the whole fit."""
    problem, extrema, e = motion.problem, motion.extrema, motion.residuals()
    mean_square = motion.sum_of_squares / len(e)
    is_first = problem.t < problem.half_cycles(motion.p, max_count=1)[1][-1]
    expected = max(problem.noise, problem.residual_floor)
    if 3 <= is_first.sum() < len(e):
        rest = max(expected, float(np.sqrt(np.mean(e[~is_first] ** 2))))
        is_disturbed = bool(np.sqrt(np.mean(e[is_first] ** 2)) > thresholds.DISTURBANCE_RATIO * rest)
    else:
        is_disturbed = False
    if not is_disturbed and mean_square <= (thresholds.DISTURBANCE_RATIO * expected) ** 2:
        return motion
    for count in (1, 2):
        if len(extrema.t) < thresholds.MIN_UNDISTURBED + count:
            break
        later, p = problem.skip_half_cycles(motion.p, count)
        later = later.subset(later.t >= p[T0])
        later_motion = remove_outliers(truncate_at_stop(replace(motion.search(later, p), available=later)))
        if later_motion.sum_of_squares / len(later_motion.problem.t) < thresholds.BETTER_START * mean_square:
            return replace(later_motion, extrema=extrema.skip(count)).add_note(
                f"The motion is free from t = {motion.format_time(later.t[0])} s on; earlier samples are left out."
            )
    return motion


def truncate_at_disturbance(motion: FreeMotion) -> FreeMotion:
    """Select the samples before the time at which the record departs from the law, if it does."""
    selection, extrema, terms = motion.problem, motion.extrema, motion.terms
    rms = float(np.sqrt(motion.sum_of_squares / len(selection.t)))
    if rms <= thresholds.DISTURBANCE_RATIO * selection.noise:
        return motion
    start, rms = selection.t[0] + selection.time_origin, rms * selection.scale
    for share in thresholds.UNDISTURBED_PARTS:
        count = int(share * len(extrema.t))
        if count < thresholds.MIN_UNDISTURBED:
            return motion
        first = replace(extrema, t=extrema.t[:count], x=extrema.x[:count])
        problem, p = initial_problem(motion.record, first, terms, selection.model.is_pendulum, selection.drift)
        problem = problem.subset(problem.t >= start - problem.time_origin)
        last = float(first.t[-1] - problem.time_origin)
        if np.searchsorted(problem.t, last, "right") < MIN_SAMPLES:
            return motion
        early, level, departure = extend_to_departure(replace(motion, available=problem, p=p), last)
        noise, _ = estimate_noise(early.problem.t, early.problem.x)
        better = thresholds.BETTER_PART if level < thresholds.ROUGH * noise else thresholds.BETTER_ROUGH_PART
        if better * level * problem.scale < rms and departure < problem.t[-1]:
            early = remove_outliers(early)
            at = early.format_time(early.problem.t[-1])
            return early.add_note(
                f"The record follows the law until t = {at} s and then departs from it; the rest is left out."
            )
    return motion


def extend_to_departure(motion: FreeMotion, last: float) -> tuple[FreeMotion, float, float]:
    """Return the motion up to `last` or as long as it follows the law, its noise, and when it departs, in s."""
    problem, half_period = motion.available, motion.extrema.half_period
    for _ in range(thresholds.MAX_EXTENSIONS):  # each fit is valid a little farther than its samples
        early = problem.subset(problem.t <= last)
        noise, _ = estimate_noise(early.t, early.x)  # may be less than after the disturbance
        motion = replace(motion.fit(replace(early, noise=max(noise, early.noise))), problem=early)
        level = max(noise, early.noise, robust_std(motion.residuals()))
        departure = departure_time(
            problem, motion.p, motion.terms, last - half_period / 2, thresholds.DEPARTURE_RATIO * level
        )
        if departure < last + half_period / 2 or departure >= problem.t[-1]:
            break
        last = departure
    return motion, level, departure


def departure_time(problem: DecayProblem, p: np.ndarray, terms: Terms, after: float, limit: float) -> float:
    """Return the start time in s of the first half cycle after `after` most of whose residuals exceed `limit`.

    If the half cycle before it has departed partly, its start counts.  Without a departure it is the last sample.
    """
    e, _ = problem.residuals(p, terms)
    _, starts = problem.half_cycles(p)
    edges = np.searchsorted(problem.t, [*starts, problem.t[-1]]).tolist()
    for i, (low, high) in enumerate(pairwise(edges)):
        if starts[i] >= after and high > low and robust_std(e[low:high]) > limit:
            before = np.abs(e[edges[max(i - 1, 0)] : low]) > limit
            is_partly_departed = before.any() and before.mean() > thresholds.DEPARTURE_SHARE
            return float(starts[i - 1] if is_partly_departed else starts[i])
    return float(problem.t[-1])


def estimate_final_noise(motion: FreeMotion) -> FreeMotion:
    """Estimate the noise of the selected samples, without those at rest."""
    noise, _ = estimate_noise(motion.problem.t, motion.problem.x)
    return replace(motion, problem=replace(motion.problem, noise=max(noise, thresholds.MIN_NOISE)))
