"""Which samples are free motion: from a hold or a push before it, to a rest or a hand after it.

The fit begins with the sure turning points, and grows from there as long as the record follows the law.
"""

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from ...records.record import MIN_SAMPLES, Record
from .law import OMEGA, T0, TERMS, UNKNOWNS, Terms
from .noise import FAR, scatter, typical
from .problem import LEAST_NOISE, Fitted, Problem, prepare
from .turning import Turns

SWINGS = 2.0  # steps of a quantiser that a swing spans at least
PUSHED = 2.0  # times the noise: what the first half swing may be off
STRAY = 0.001  # share of the samples, beside two, that may stray
PARTS = (0.6, 0.35)  # shares of the turning points that may be free of what disturbs the rest
LOST = 4.0  # times the noise: where a half swing leaves the law
PARTLY = 0.05  # of the samples of the half swing before it
LEAST = 6  # turning points before that
ROUNDS = 6  # of going on from there


Part = tuple[Problem, np.ndarray, float]  # some of the samples, the values of UNKNOWNS, and the squares they leave


@dataclass(frozen=True)
class Window:
    """The `problem` of the samples used, the values `p` of the full law and the `squares` they leave; what was done is
    told in `notes`."""

    problem: Problem
    p: np.ndarray
    squares: float
    notes: tuple[str, ...]


def free_motion(record: Record, turns: Turns, terms: Terms, pendulum: bool, drift: bool) -> Window:
    """The free motion of a record, from the values that its turning points agree with."""
    problem, seed = begun(record, turns, terms, pendulum, drift)
    notes = []
    if turns.start > record.t[0]:
        notes.append(
            f"Before the gap that ends at t = {record.format_time(turns.start)} s are too few swings; they are left out."
        )
    begin = max(turns.start - problem.origin, seed[T0])
    later = problem.only(problem.t >= begin)
    sure = later.only(later.t <= turns.t[-1] - problem.origin + 0.6 * turns.half)
    p, squares = fitted(sure, seed, terms)

    used, p, squares = until_stop(later, p, squares, terms, sure)
    used, p, squares, strayed = without_strays(used, p, squares, terms)
    pushed = after_push(used, p, squares, terms)
    if pushed is not None:
        used, p, squares = pushed
        used, p, squares = until_stop(used, p, squares, terms, used)
        notes.append(
            f"The motion is free from t = {record.format_time(used.t[0] + used.origin)} s on; what is before is left out."
        )

    if used.rough(squares) and squares > len(used.t) * (2 * used.noise) ** 2:
        broken = until_disturbed(record, turns, used, squares, terms)
        if broken is not None:
            used, p, squares, strayed = without_strays(*broken, terms)
            at = record.format_time(used.t[-1] + used.origin)
            notes.append(
                f"The record follows the law until t = {at} s, and then departs from it; it is used until there."
            )
    if len(strayed):
        notes.append(f"Left out as stray: {len(strayed)} of {len(problem.t)} samples.")
    noise, _ = scatter(used.t, used.x)  # without what was held or stuck
    used = replace(used, noise=max(noise, LEAST_NOISE))
    return Window(used, p, squares, tuple(notes))


def begun(record: Record, turns: Turns, terms: Terms, pendulum: bool, drift: bool) -> tuple[Problem, np.ndarray]:
    """The problem, and the values of a law of these terms with which its turning points agree."""
    problem, seed = prepare(record, turns, pendulum, drift)
    seed[[UNKNOWNS.index(term) for term in TERMS if term not in terms]] = 0.0
    return problem, seed


def fitted(problem: Problem, p: np.ndarray, terms: Terms) -> Fitted:
    """The full law, at once where that succeeds, otherwise by growing windows; the better of both."""
    found = problem.fit(p, terms)
    if not problem.rough(found[1]):
        return found
    return min(found, problem.fit(problem.grown(p, terms), terms), key=lambda fit: fit[1])


def until_stop(problem: Problem, p: np.ndarray, squares: float, terms: Terms, fit_to: Problem) -> Part:
    """The problem until the motion stops, with its fit; p leaves `squares` of the samples `fit_to`."""
    used = problem.only(problem.t <= end(problem, p))
    return (used, p, squares) if len(used.t) == len(fit_to.t) else (used, *fitted(used, p, terms))


def end(problem: Problem, p: np.ndarray) -> float:
    """In s: half a swing before the motion stops, or where its swings are lost in the steps of a quantiser.

    A tail that is stuck repeats one sample, and its end makes kinks.
    """
    amplitudes, begins = problem.half_swings(p)
    spans = (amplitudes[:-1] + amplitudes[1:]) * p[OMEGA] ** problem.model.order
    lost = np.flatnonzero(spans < SWINGS * problem.step / problem.unit)
    stop = len(begins) - (1 if begins[-1] > problem.t[-1] else 2)
    last = min(int(lost[0]), stop) if len(lost) else stop
    return float(begins[max(last, min(3, len(begins) - 1))])


def without_strays(
    problem: Problem, p: np.ndarray, squares: float, terms: Terms
) -> tuple[Problem, np.ndarray, float, np.ndarray]:
    """The problem without the samples that are far off where all others are not, and their times; whole where such
    samples are many."""
    most, q = 2 + int(STRAY * len(problem.t)), p
    for _ in range(2):  # one that strays bends the fit away from the others
        e, _ = problem.off(q, terms)
        far = np.abs(e) > FAR * max(typical(e), problem.noise, problem.exact)
        if not far.any():
            break
        farthest = far & (np.abs(e) >= np.sort(np.abs(e))[-most])
        rest = problem.only(~farthest)
        q, less = fitted(rest, q, terms)
        if far.sum() <= most:
            return rest, q, less, problem.t[far]
    return problem, p, squares, problem.t[:0]


def after_push(problem: Problem, p: np.ndarray, squares: float, terms: Terms) -> Part | None:
    """The problem from its first turning point on, where the half swing before that is no free motion."""
    e, _ = problem.off(p, terms)
    _, begins = problem.half_swings(p, most=1)
    first = problem.t < begins[-1]
    if len(begins) < 2 or not 3 <= first.sum() < len(e) - 12:
        return None
    rest = float(np.sqrt(np.mean(e[~first] ** 2)))
    if not np.sqrt(np.mean(e[first] ** 2)) > PUSHED * max(problem.noise, rest, problem.exact):
        return None
    turned, q = problem.turned(p, 1)
    turned = turned.only(~first)
    q, less = fitted(turned, q, terms)
    return (turned, q, less) if less / len(turned.t) < 0.5 * squares / len(e) else None


def until_disturbed(record: Record, turns: Turns, used: Problem, squares: float, terms: Terms) -> Part | None:
    """The problem up to where the record leaves the law that it followed until then; None where it follows none."""
    begin, unfit = used.t[0] + used.origin, float(np.sqrt(squares / len(used.t))) * used.unit
    for share in PARTS:
        count = int(share * len(turns.t))
        if count < LEAST:
            return None
        first = replace(turns, t=turns.t[:count], x=turns.x[:count])
        problem, p = begun(record, first, terms, used.model.sine, used.drift)
        problem = problem.only(problem.t >= begin - problem.origin)
        early, last = problem, float(first.t[-1] - problem.origin)
        if np.searchsorted(problem.t, last, "right") < MIN_SAMPLES:
            return None
        for _ in range(ROUNDS):  # what is fitted reaches farther than what was
            early = problem.only(problem.t <= last)
            noise, _ = scatter(early.t, early.x)  # what disturbs the rest may be quieter
            p, cost = fitted(replace(early, noise=max(noise, early.noise)), p, terms)
            level = max(noise, early.noise, typical(early.off(p, terms)[0]))
            leaves = leaving(problem, p, terms, last - turns.half / 2, LOST * level)
            if leaves < last + turns.half / 2 or leaves >= problem.t[-1]:
                break
            last = leaves
        if level * problem.unit < unfit / LOST and leaves < problem.t[-1]:
            return early, p, cost
    return None


def leaving(problem: Problem, p: np.ndarray, terms: Terms, after: float, far: float) -> float:
    """When the first half swing begins, later than `after` in s, most of which is `far` off, or the one before it
    where that is partly; the end where none is."""
    e, _ = problem.off(p, terms)
    _, begins = problem.half_swings(p)
    edges = np.searchsorted(problem.t, [*begins, problem.t[-1]]).tolist()
    for i, (low, high) in enumerate(pairwise(edges)):
        if begins[i] >= after and high > low and typical(e[low:high]) > far:
            before = np.abs(e[edges[max(i - 1, 0)] : low]) > far
            return float(begins[i - 1] if before.any() and before.mean() > PARTLY else begins[i])
    return float(problem.t[-1])
