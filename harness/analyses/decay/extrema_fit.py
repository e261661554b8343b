"""What the turning points alone say of the losses, beside the fit of the whole signal.

By all of them: their positions x_i = rest +- a_i fitted by the chain of half swings of the law (a_(i+1) = e a_i -
(1 + e) r for a spring without drag: B. F. Feeny, J. W. Liang, Journal of Sound and Vibration 195 (1996)).  By the first
and the last: the one loss that alone leads from the one amplitude to the other, of a spring the textbook's logarithmic
decrement or linear envelope; of a pendulum by the same chain.
"""

from dataclasses import replace

import numpy as np

from ...records.record import Record
from .decrement import damping_ratio, friction_from_envelope
from .estimates import Estimate, KnownParameters, force_estimates, to_record_units
from .extrema import Extrema
from .fit_problem import FitProblem
from .intervals import correlated, interval
from .law import AMPLITUDE, OMEGA, REST, TERMS, UNKNOWNS, ZETA, B, R
from .least_squares import column_norms, least_squares
from .model_selection import FittedLaw
from .return_map import chain
from .signal_model import SignalModel

CLOSE = 1e-9  # share of a loss that a step changes
STEPS = 20


def estimate_from_extrema(
    record: Record, problem: FitProblem, turns: Extrema, law: FittedLaw, known: KnownParameters, omega: Estimate
) -> tuple[tuple[Estimate, ...], str]:
    """The law's values by the turning points alone, and why there are none."""
    if record.order:
        return (), f"a record of {record.quantity} shows no turning points of the position"
    if problem.drift:
        return (), "the rest position drifts, and turning points alone do not tell how"
    unknowns = np.array([AMPLITUDE, REST, *(UNKNOWNS.index(term) for term in law.terms)])
    if len(turns.x) <= len(unknowns):
        return (), f"{len(turns.x)} turning points leave no freedom for {len(unknowns)} values"
    places = (turns.x - problem.offset) / problem.scale
    start = law.p.copy()
    amplitudes, _ = problem.half_cycles(start, most=len(cycles_before_first_extremum(problem, turns, start)))
    model = problem.model
    before = len(amplitudes) - 1
    start[AMPLITUDE] = amplitudes[-1]
    model = replace(model, side=model.side * (-1) ** before)

    def off(p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        laws, at, changes = model.perturbed_laws(p, unknowns)
        rows = chain(laws, model.is_pendulum, model.floor, len(places) - 1).amplitudes
        rows = np.pad(rows, ((0, len(places) - len(rows)), (0, 0)), mode="edge")
        way = model.side * (-1.0) ** np.arange(len(places))
        jacobian = np.ones((len(places), len(unknowns)))
        for i, place in enumerate(at.tolist()):
            slope = way * (rows[:, 1 + i] - rows[:, 0]) / changes[i]
            jacobian[:, np.flatnonzero(unknowns == place)[0]] = slope
        return p[REST] + way * rows[:, 0] - places, jacobian

    p, cost, _, jacobian = least_squares(off, start, unknowns)
    freedom = len(places) - len(unknowns)
    scale = column_norms(jacobian)
    covariance = np.linalg.pinv((jacobian / scale).T @ (jacobian / scale)) * cost / freedom
    found = {}
    errors, correlation = np.sqrt(np.diag(covariance)) / scale, correlated(covariance)
    for i, place in enumerate(unknowns.tolist()):
        if place != AMPLITUDE:
            low, high = interval(i, unknowns, p[unknowns], errors, correlation, freedom)
            found[place] = to_record_units(record, problem, place, float(p[place]), float(errors[i]), low, high)
    return (*found.values(), *force_estimates(record, omega, found, known)), ""


def cycles_before_first_extremum(problem: FitProblem, turns: Extrema, p: np.ndarray) -> np.ndarray:
    """The half swings of the fit that have ended about the first turning point seen."""
    _, begins = problem.half_cycles(p)
    return begins[1:][begins[1:] < turns.t[0] - problem.time_origin + turns.half / 2]


def estimate_from_two_peaks(
    record: Record, problem: FitProblem, turns: Extrema, law: FittedLaw, known: KnownParameters, omega: Estimate
) -> tuple[tuple[Estimate, ...], str]:
    """Each loss that alone leads from the first to the last turning point; or why there is none."""
    if record.order:
        return (), f"a record of {record.quantity} shows no turning points of the position"
    rest = float(law.p[REST]) * problem.scale + problem.offset
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
        value = solve_single_loss(place, first / problem.scale, last / problem.scale, count, problem.model.is_pendulum)
        if np.isfinite(value):
            found[place] = to_record_units(record, problem, place, value, np.nan, np.nan, np.nan)
    return (*found.values(), *force_estimates(record, omega, found, known)), ""


def solve_single_loss(place: int, first: float, last: float, count: int, is_pendulum: bool) -> float:
    """The one loss that leads from the amplitude `first` to `last` in `count` half swings; NaN where none does.

    Of a spring in closed form but for drag; elsewhere that of a small loss is where Newton's method begins.
    """
    small = {
        ZETA: damping_ratio(first, last, count / 2),
        R: friction_from_envelope(first, last, count / 2, 1.0),
        B: 0.75 * (1 / last - 1 / first) / count,
    }[place]
    if place != B and not is_pendulum:
        return small
    p = np.zeros(len(UNKNOWNS))
    p[[AMPLITUDE, OMEGA, place]] = first, 1.0, small
    model, unknowns = SignalModel(1.0, 0, is_pendulum, 0.0, 0.0), np.array([place])

    for _ in range(STEPS):
        laws, _, changes = model.perturbed_laws(p, unknowns)
        ends = chain(laws, is_pendulum, 0.0, count).amplitudes[-1]
        step = changes[0] * (last - ends[0]) / (ends[1] - ends[0])
        if not np.isfinite(step):
            break
        p[place] = np.clip(p[place] + step, p[place] / 4, 4 * p[place])
        if abs(step) < CLOSE * p[place]:
            return float(p[place])
    return np.nan
