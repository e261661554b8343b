"""What the turning points alone say of the losses, beside the fit of the whole signal.

By all of them: their positions x_i = rest +- a_i fitted by the chain of half swings of the law (a_(i+1) = e a_i -
(1 + e) r for a spring without drag: B. F. Feeny, J. W. Liang, Journal of Sound and Vibration 195 (1996)).  By the first
and the last: the one loss that alone leads from the one amplitude to the other, of a spring the textbook's logarithmic
decrement or linear envelope; of a pendulum by the same chain.
"""

from dataclasses import replace

import numpy as np

from ...records.record import Record
from .chain import chain
from .choice import Law
from .decrement import damping_ratio, friction
from .figures import Estimate, Known, forces, in_record
from .intervals import correlated, interval
from .law import AMPLITUDE, OMEGA, REST, TERMS, UNKNOWNS, ZETA, B, R
from .model import Model
from .problem import Problem
from .squares import least_squares, scales
from .turning import Turns

CLOSE = 1e-9  # share of a loss that a step changes
STEPS = 20


def by_turning_points(
    record: Record, problem: Problem, turns: Turns, law: Law, known: Known, omega: Estimate
) -> tuple[tuple[Estimate, ...], str]:
    """The law's values by the turning points alone, and why there are none."""
    if record.order:
        return (), f"a record of {record.quantity} shows no turning points of the position"
    if problem.drift:
        return (), "the rest position drifts, and turning points alone do not tell how"
    unknowns = np.array([AMPLITUDE, REST, *(UNKNOWNS.index(term) for term in law.terms)])
    if len(turns.x) <= len(unknowns):
        return (), f"{len(turns.x)} turning points leave no freedom for {len(unknowns)} values"
    places = (turns.x - problem.level) / problem.unit
    start = law.p.copy()
    amplitudes, _ = problem.half_swings(start, most=len(begins_before(problem, turns, start)))
    model = problem.model
    before = len(amplitudes) - 1
    start[AMPLITUDE] = amplitudes[-1]
    model = replace(model, side=model.side * (-1) ** before)

    def off(p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        laws, at, changes = model.varied(p, unknowns)
        rows = chain(laws, model.sine, model.floor, len(places) - 1).amplitudes
        rows = np.pad(rows, ((0, len(places) - len(rows)), (0, 0)), mode="edge")
        way = model.side * (-1.0) ** np.arange(len(places))
        jacobian = np.ones((len(places), len(unknowns)))
        for i, place in enumerate(at.tolist()):
            slope = way * (rows[:, 1 + i] - rows[:, 0]) / changes[i]
            jacobian[:, np.flatnonzero(unknowns == place)[0]] = slope
        return p[REST] + way * rows[:, 0] - places, jacobian

    p, cost, _, jacobian = least_squares(off, start, unknowns)
    freedom = len(places) - len(unknowns)
    scale = scales(jacobian)
    covariance = np.linalg.pinv((jacobian / scale).T @ (jacobian / scale)) * cost / freedom
    found = {}
    errors, correlation = np.sqrt(np.diag(covariance)) / scale, correlated(covariance)
    for i, place in enumerate(unknowns.tolist()):
        if place != AMPLITUDE:
            low, high = interval(i, unknowns, p[unknowns], errors, correlation, freedom)
            found[place] = in_record(record, problem, place, float(p[place]), float(errors[i]), low, high)
    return (*found.values(), *forces(record, omega, found, known)), ""


def begins_before(problem: Problem, turns: Turns, p: np.ndarray) -> np.ndarray:
    """The half swings of the fit that have ended about the first turning point seen."""
    _, begins = problem.half_swings(p)
    return begins[1:][begins[1:] < turns.t[0] - problem.origin + turns.half / 2]


def by_two_peaks(
    record: Record, problem: Problem, turns: Turns, law: Law, known: Known, omega: Estimate
) -> tuple[tuple[Estimate, ...], str]:
    """Each loss that alone leads from the first to the last turning point; or why there is none."""
    if record.order:
        return (), f"a record of {record.quantity} shows no turning points of the position"
    rest = float(law.p[REST]) * problem.unit + problem.level
    sizes = np.sign(turns.x[0] - rest) * (-1.0) ** np.arange(len(turns.x)) * (turns.x - rest)
    count = int(np.flatnonzero(sizes > 0)[-1])  # the end may be on the side it came from
    first, last = float(sizes[0]), float(sizes[count])
    if problem.drift:
        return (), "the rest position drifts"
    if not first > last:
        return (), "the last turning point is no smaller than the first"
    found = {}
    for term in TERMS:
        place = UNKNOWNS.index(term)
        value = alone(place, first / problem.unit, last / problem.unit, count, problem.model.sine)
        if np.isfinite(value):
            found[place] = in_record(record, problem, place, value, np.nan, np.nan, np.nan)
    return (*found.values(), *forces(record, omega, found, known)), ""


def alone(place: int, first: float, last: float, count: int, sine: bool) -> float:
    """The one loss that leads from the amplitude `first` to `last` in `count` half swings; NaN where none does.

    Of a spring in closed form but for drag; elsewhere that of a small loss is where Newton's method begins.
    """
    small = {
        ZETA: damping_ratio(first, last, count / 2),
        R: friction(first, last, count / 2, 1.0),
        B: 0.75 * (1 / last - 1 / first) / count,
    }[place]
    if place != B and not sine:
        return small
    p = np.zeros(len(UNKNOWNS))
    p[[AMPLITUDE, OMEGA, place]] = first, 1.0, small
    model, unknowns = Model(1.0, 0, sine, 0.0, 0.0), np.array([place])

    for _ in range(STEPS):
        laws, _, changes = model.varied(p, unknowns)
        ends = chain(laws, sine, 0.0, count).amplitudes[-1]
        step = changes[0] * (last - ends[0]) / (ends[1] - ends[0])
        if not np.isfinite(step):
            break
        p[place] = np.clip(p[place] + step, p[place] / 4, 4 * p[place])
        if abs(step) < CLOSE * p[place]:
            return float(p[place])
    return np.nan
