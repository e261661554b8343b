"""Selection of the free motion: without a hold or a push at its beginning, and a rest or a disturbance at its end.

The fit starts with the turning points that are certain, and extends as long as the record follows the law.
"""

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from ...records.record import MIN_SAMPLES, Record
from .extrema import Extrema
from .fit_problem import MIN_NOISE, FitProblem, FitResult, prepare_problem
from .law import OMEGA, T0, TERMS, UNKNOWNS, Terms
from .noise import OUTLIER, estimate_noise, robust_std

MIN_QUANTISER_STEPS = 2.0  # between the turning points of a half cycle
DISTURBED_START = 2.0  # times the noise: residual of a first half cycle that is no free motion
MAX_OUTLIERS = 0.001  # fraction of the samples, in addition to two samples
UNDISTURBED_PARTS = (0.6, 0.35)  # fractions of the turning points that are tried as undisturbed
DEPARTED = 4.0  # times the noise: residual of a half cycle that departs from the law
PARTLY_DEPARTED = 0.05  # fraction of departed samples in the half cycle before it
MIN_TURNING_POINTS = 6  # before a disturbance
MAX_EXTENSIONS = 6  # of the samples used before a disturbance


FittedPart = tuple[FitProblem, np.ndarray, float]  # some of the samples, the values of UNKNOWNS, and the sum of squares


@dataclass(frozen=True)
class FreeMotion:
    """The free motion of a record: the `problem` with its samples, the values `p` of the full law, the sum of squares,
    and `notes` on what was left out."""

    problem: FitProblem
    p: np.ndarray
    sum_of_squares: float
    notes: tuple[str, ...]


def select_free_motion(record: Record, extrema: Extrema, terms: Terms, pendulum: bool, drift: bool) -> FreeMotion:
    """Return the free motion of a record with the given turning points, fitted by the law with these terms."""
    problem, p = initial_problem(record, extrema, terms, pendulum, drift)
    notes = []
    if extrema.segment_start > record.t[0]:
        notes.append(
            f"The record before the gap that ends at t = {record.format_time(extrema.segment_start)} s has too few "
            "cycles and is left out."
        )
    start = max(extrema.segment_start - problem.time_origin, p[T0])
    released = problem.subset(problem.t >= start)
    certain = released.subset(released.t <= extrema.t[-1] - problem.time_origin + 0.6 * extrema.half_period)
    p, squares = fit_with_fallback(certain, p, terms)

    used, p, squares = truncate_at_stop(released, p, squares, terms, certain)
    used, p, squares, outliers = remove_outliers(used, p, squares, terms)
    undisturbed = skip_disturbed_start(used, p, squares, terms)
    if undisturbed is not None:
        used, p, squares = undisturbed
        used, p, squares = truncate_at_stop(used, p, squares, terms, used)
        notes.append(
            f"The motion is free from t = {record.format_time(used.t[0] + used.time_origin)} s on; earlier samples are "
            "left out."
        )

    if used.exceeds_noise(squares) and squares > len(used.t) * (2 * used.noise) ** 2:
        truncated = truncate_at_disturbance(record, extrema, used, squares, terms)
        if truncated is not None:
            used, p, squares, outliers = remove_outliers(*truncated, terms)
            at = record.format_time(used.t[-1] + used.time_origin)
            notes.append(f"The record follows the law until t = {at} s and then departs from it; the rest is left out.")
    if len(outliers):
        notes.append(f"{len(outliers)} of {len(problem.t)} samples are outliers and are left out.")
    noise, _ = estimate_noise(used.t, used.x)  # without samples at rest
    used = replace(used, noise=max(noise, MIN_NOISE))
    return FreeMotion(used, p, squares, tuple(notes))


def initial_problem(
    record: Record, extrema: Extrema, terms: Terms, pendulum: bool, drift: bool
) -> tuple[FitProblem, np.ndarray]:
    """Return the fit problem, and the values of a law with these terms that fit its turning points."""
    problem, p = prepare_problem(record, extrema, pendulum, drift)
    p[[UNKNOWNS.index(term) for term in TERMS if term not in terms]] = 0.0
    return problem, p


def fit_with_fallback(problem: FitProblem, p: np.ndarray, terms: Terms) -> FitResult:
    """Fit the law to all samples, and also by growing windows if that leaves more than noise; return the better fit."""
    fit = problem.fit(p, terms)
    if not problem.exceeds_noise(fit[1]):
        return fit
    return min(fit, problem.fit(problem.fit_growing_windows(p, terms), terms), key=lambda fit: fit[1])


def truncate_at_stop(
    problem: FitProblem, p: np.ndarray, squares: float, terms: Terms, fitted_to: FitProblem
) -> FittedPart:
    """Return the problem up to the stop of the motion, with its fit.

    Parameters
    ----------
    p, squares : fit to the samples of `fitted_to`
    """
    used = problem.subset(problem.t <= last_usable_time(problem, p))
    return (used, p, squares) if len(used.t) == len(fitted_to.t) else (used, *fit_with_fallback(used, p, terms))


def last_usable_time(problem: FitProblem, p: np.ndarray) -> float:
    """Return the time in s up to which to fit: one half cycle before the motion stops or is lost in quantisation.

    A record at rest repeats one sample, and the stop itself makes a kink.
    """
    amplitudes, starts = problem.half_cycles(p)
    spans = (amplitudes[:-1] + amplitudes[1:]) * p[OMEGA] ** problem.model.order
    lost = np.flatnonzero(spans < MIN_QUANTISER_STEPS * problem.quantiser_step / problem.scale)
    stop = len(starts) - (1 if starts[-1] > problem.t[-1] else 2)
    last = min(int(lost[0]), stop) if len(lost) else stop
    return float(starts[max(last, min(3, len(starts) - 1))])


def remove_outliers(
    problem: FitProblem, p: np.ndarray, squares: float, terms: Terms
) -> tuple[FitProblem, np.ndarray, float, np.ndarray]:
    """Return the problem without its outliers, with its fit and their times; unchanged if there are many of them."""
    limit, q = 2 + int(MAX_OUTLIERS * len(problem.t)), p
    for _ in range(2):  # an outlier bends the fit away from the other samples
        e, _ = problem.residuals(q, terms)
        far = np.abs(e) > OUTLIER * max(robust_std(e), problem.noise, problem.residual_floor)
        if not far.any():
            break
        farthest = far & (np.abs(e) >= np.sort(np.abs(e))[-limit])
        rest = problem.subset(~farthest)
        q, less = fit_with_fallback(rest, q, terms)
        if far.sum() <= limit:
            return rest, q, less, problem.t[far]
    return problem, p, squares, problem.t[:0]


def skip_disturbed_start(problem: FitProblem, p: np.ndarray, squares: float, terms: Terms) -> FittedPart | None:
    """Return the problem from its first turning point on if the half cycle before it is no free motion."""
    e, _ = problem.residuals(p, terms)
    _, starts = problem.half_cycles(p, max_count=1)
    first = problem.t < starts[-1]
    if len(starts) < 2 or not 3 <= first.sum() < len(e) - 12:
        return None
    rest = float(np.sqrt(np.mean(e[~first] ** 2)))
    if not np.sqrt(np.mean(e[first] ** 2)) > DISTURBED_START * max(problem.noise, rest, problem.residual_floor):
        return None
    later, q = problem.skip_half_cycles(p, 1)
    later = later.subset(~first)
    q, less = fit_with_fallback(later, q, terms)
    return (later, q, less) if less / len(later.t) < 0.5 * squares / len(e) else None


def truncate_at_disturbance(
    record: Record, extrema: Extrema, used: FitProblem, squares: float, terms: Terms
) -> FittedPart | None:
    """Return the problem up to where the record departs from the law that it follows until then; None if it does not.

    Parameters
    ----------
    used, squares : the problem so far, and the sum of squares of its fit
    """
    start, rms = used.t[0] + used.time_origin, float(np.sqrt(squares / len(used.t))) * used.scale
    for share in UNDISTURBED_PARTS:
        count = int(share * len(extrema.t))
        if count < MIN_TURNING_POINTS:
            return None
        first = replace(extrema, t=extrema.t[:count], x=extrema.x[:count])
        problem, p = initial_problem(record, first, terms, used.model.is_pendulum, used.drift)
        problem = problem.subset(problem.t >= start - problem.time_origin)
        early, last = problem, float(first.t[-1] - problem.time_origin)
        if np.searchsorted(problem.t, last, "right") < MIN_SAMPLES:
            return None
        for _ in range(MAX_EXTENSIONS):  # each fit is valid a little farther than its samples
            early = problem.subset(problem.t <= last)
            noise, _ = estimate_noise(early.t, early.x)  # may be less than after the disturbance
            p, cost = fit_with_fallback(replace(early, noise=max(noise, early.noise)), p, terms)
            level = max(noise, early.noise, robust_std(early.residuals(p, terms)[0]))
            departure = departure_time(problem, p, terms, last - extrema.half_period / 2, DEPARTED * level)
            if departure < last + extrema.half_period / 2 or departure >= problem.t[-1]:
                break
            last = departure
        if level * problem.scale < rms / DEPARTED and departure < problem.t[-1]:
            return early, p, cost
    return None


def departure_time(problem: FitProblem, p: np.ndarray, terms: Terms, after: float, limit: float) -> float:
    """Return the start time in s of the first half cycle after `after` most of whose residuals exceed `limit`.

    If the half cycle before it has departed partly, its start counts.  Without a departure it is the last sample.
    """
    e, _ = problem.residuals(p, terms)
    _, starts = problem.half_cycles(p)
    edges = np.searchsorted(problem.t, [*starts, problem.t[-1]]).tolist()
    for i, (low, high) in enumerate(pairwise(edges)):
        if starts[i] >= after and high > low and robust_std(e[low:high]) > limit:
            before = np.abs(e[edges[max(i - 1, 0)] : low]) > limit
            return float(starts[i - 1] if before.any() and before.mean() > PARTLY_DEPARTED else starts[i])
    return float(problem.t[-1])
