"""Which samples are free motion: from a hold or a push before it, to a rest or a hand after it.

The fit begins with the sure turning points, and grows from there as long as the record follows the law.
"""

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from ...records.record import MIN_SAMPLES, Record
from .extrema import Extrema
from .fit_problem import LEAST_NOISE, FitProblem, FitResult, prepare_problem
from .law import OMEGA, T0, TERMS, UNKNOWNS, Terms
from .noise import FAR, estimate_noise, robust_std

SWINGS = 2.0  # steps of a quantiser that a swing spans at least
PUSHED = 2.0  # times the noise: what the first half swing may be off
STRAY = 0.001  # share of the samples, beside two, that may stray
PARTS = (0.6, 0.35)  # shares of the turning points that may be free of what disturbs the rest
LOST = 4.0  # times the noise: where a half swing leaves the law
PARTLY = 0.05  # of the samples of the half swing before it
LEAST = 6  # turning points before that
ROUNDS = 6  # of going on from there


Part = tuple[FitProblem, np.ndarray, float]  # some of the samples, the values of UNKNOWNS, and the squares they leave


@dataclass(frozen=True)
class FreeMotion:
    """The `problem` of the samples used, the values `p` of the full law and the `squares` they leave; what was done is
    told in `notes`."""

    problem: FitProblem
    p: np.ndarray
    sum_of_squares: float
    notes: tuple[str, ...]


def select_free_motion(record: Record, turns: Extrema, terms: Terms, pendulum: bool, drift: bool) -> FreeMotion:
    """The free motion of a record, from the values that its turning points agree with."""
    problem, seed = initial_problem(record, turns, terms, pendulum, drift)
    notes = []
    if turns.start > record.t[0]:
        notes.append(
            f"Before the gap that ends at t = {record.format_time(turns.start)} s are too few swings; they are left out."
        )
    begin = max(turns.start - problem.time_origin, seed[T0])
    later = problem.only(problem.t >= begin)
    sure = later.only(later.t <= turns.t[-1] - problem.time_origin + 0.6 * turns.half)
    p, squares = fit_with_fallback(sure, seed, terms)

    used, p, squares = truncate_at_stop(later, p, squares, terms, sure)
    used, p, squares, strayed = remove_outliers(used, p, squares, terms)
    pushed = skip_disturbed_start(used, p, squares, terms)
    if pushed is not None:
        used, p, squares = pushed
        used, p, squares = truncate_at_stop(used, p, squares, terms, used)
        notes.append(
            f"The motion is free from t = {record.format_time(used.t[0] + used.time_origin)} s on; what is before is left out."
        )

    if used.rough(squares) and squares > len(used.t) * (2 * used.noise) ** 2:
        broken = truncate_at_disturbance(record, turns, used, squares, terms)
        if broken is not None:
            used, p, squares, strayed = remove_outliers(*broken, terms)
            at = record.format_time(used.t[-1] + used.time_origin)
            notes.append(
                f"The record follows the law until t = {at} s, and then departs from it; it is used until there."
            )
    if len(strayed):
        notes.append(f"Left out as stray: {len(strayed)} of {len(problem.t)} samples.")
    noise, _ = estimate_noise(used.t, used.x)  # without what was held or stuck
    used = replace(used, noise=max(noise, LEAST_NOISE))
    return FreeMotion(used, p, squares, tuple(notes))


def initial_problem(
    record: Record, turns: Extrema, terms: Terms, pendulum: bool, drift: bool
) -> tuple[FitProblem, np.ndarray]:
    """The problem, and the values of a law of these terms with which its turning points agree."""
    problem, seed = prepare_problem(record, turns, pendulum, drift)
    seed[[UNKNOWNS.index(term) for term in TERMS if term not in terms]] = 0.0
    return problem, seed


def fit_with_fallback(problem: FitProblem, p: np.ndarray, terms: Terms) -> FitResult:
    """The full law, at once where that succeeds, otherwise by growing windows; the better of both."""
    found = problem.fit(p, terms)
    if not problem.rough(found[1]):
        return found
    return min(found, problem.fit(problem.fit_growing_windows(p, terms), terms), key=lambda fit: fit[1])


def truncate_at_stop(problem: FitProblem, p: np.ndarray, squares: float, terms: Terms, fit_to: FitProblem) -> Part:
    """The problem until the motion stops, with its fit; p leaves `squares` of the samples `fit_to`."""
    used = problem.only(problem.t <= end(problem, p))
    return (used, p, squares) if len(used.t) == len(fit_to.t) else (used, *fit_with_fallback(used, p, terms))


def end(problem: FitProblem, p: np.ndarray) -> float:
    """In s: half a swing before the motion stops, or where its swings are lost in the steps of a quantiser.

    A tail that is stuck repeats one sample, and its end makes kinks.
    """
    amplitudes, begins = problem.half_cycles(p)
    spans = (amplitudes[:-1] + amplitudes[1:]) * p[OMEGA] ** problem.model.order
    lost = np.flatnonzero(spans < SWINGS * problem.step / problem.scale)
    stop = len(begins) - (1 if begins[-1] > problem.t[-1] else 2)
    last = min(int(lost[0]), stop) if len(lost) else stop
    return float(begins[max(last, min(3, len(begins) - 1))])


def remove_outliers(
    problem: FitProblem, p: np.ndarray, squares: float, terms: Terms
) -> tuple[FitProblem, np.ndarray, float, np.ndarray]:
    """The problem without the samples that are far off where all others are not, and their times; whole where such
    samples are many."""
    most, q = 2 + int(STRAY * len(problem.t)), p
    for _ in range(2):  # one that strays bends the fit away from the others
        e, _ = problem.off(q, terms)
        far = np.abs(e) > FAR * max(robust_std(e), problem.noise, problem.exact)
        if not far.any():
            break
        farthest = far & (np.abs(e) >= np.sort(np.abs(e))[-most])
        rest = problem.only(~farthest)
        q, less = fit_with_fallback(rest, q, terms)
        if far.sum() <= most:
            return rest, q, less, problem.t[far]
    return problem, p, squares, problem.t[:0]


def skip_disturbed_start(problem: FitProblem, p: np.ndarray, squares: float, terms: Terms) -> Part | None:
    """The problem from its first turning point on, where the half swing before that is no free motion."""
    e, _ = problem.off(p, terms)
    _, begins = problem.half_cycles(p, most=1)
    first = problem.t < begins[-1]
    if len(begins) < 2 or not 3 <= first.sum() < len(e) - 12:
        return None
    rest = float(np.sqrt(np.mean(e[~first] ** 2)))
    if not np.sqrt(np.mean(e[first] ** 2)) > PUSHED * max(problem.noise, rest, problem.exact):
        return None
    turned, q = problem.turned(p, 1)
    turned = turned.only(~first)
    q, less = fit_with_fallback(turned, q, terms)
    return (turned, q, less) if less / len(turned.t) < 0.5 * squares / len(e) else None


def truncate_at_disturbance(
    record: Record, turns: Extrema, used: FitProblem, squares: float, terms: Terms
) -> Part | None:
    """The problem up to where the record leaves the law that it followed until then; None where it follows none."""
    begin, unfit = used.t[0] + used.time_origin, float(np.sqrt(squares / len(used.t))) * used.scale
    for share in PARTS:
        count = int(share * len(turns.t))
        if count < LEAST:
            return None
        first = replace(turns, t=turns.t[:count], x=turns.x[:count])
        problem, p = initial_problem(record, first, terms, used.model.is_pendulum, used.drift)
        problem = problem.only(problem.t >= begin - problem.time_origin)
        early, last = problem, float(first.t[-1] - problem.time_origin)
        if np.searchsorted(problem.t, last, "right") < MIN_SAMPLES:
            return None
        for _ in range(ROUNDS):  # what is fitted reaches farther than what was
            early = problem.only(problem.t <= last)
            noise, _ = estimate_noise(early.t, early.x)  # what disturbs the rest may be quieter
            p, cost = fit_with_fallback(replace(early, noise=max(noise, early.noise)), p, terms)
            level = max(noise, early.noise, robust_std(early.off(p, terms)[0]))
            leaves = departure_time(problem, p, terms, last - turns.half / 2, LOST * level)
            if leaves < last + turns.half / 2 or leaves >= problem.t[-1]:
                break
            last = leaves
        if level * problem.scale < unfit / LOST and leaves < problem.t[-1]:
            return early, p, cost
    return None


def departure_time(problem: FitProblem, p: np.ndarray, terms: Terms, after: float, far: float) -> float:
    """When the first half swing begins, later than `after` in s, most of which is `far` off, or the one before it
    where that is partly; the end where none is."""
    e, _ = problem.off(p, terms)
    _, begins = problem.half_cycles(p)
    edges = np.searchsorted(problem.t, [*begins, problem.t[-1]]).tolist()
    for i, (low, high) in enumerate(pairwise(edges)):
        if begins[i] >= after and high > low and robust_std(e[low:high]) > far:
            before = np.abs(e[edges[max(i - 1, 0)] : low]) > far
            return float(begins[i - 1] if before.any() and before.mean() > PARTLY else begins[i])
    return float(problem.t[-1])
