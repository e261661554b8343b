"""Losses from the turning points alone, for comparison with the fit of the whole signal.

From all turning points: their positions x_i = rest +- a_i, fitted by the return map of the law (for a spring without
drag a_(i+1) = e a_i - (1 + e) r: B. F. Feeny, J. W. Liang, Journal of Sound and Vibration 195 (1996)).

From the first and the last one: the single loss that leads from the first amplitude to the last.  For a spring this is
the textbook's logarithmic decrement or linear envelope; for a pendulum it comes from the same return map.
"""

from dataclasses import replace

import numpy as np
from scipy import optimize

from ...records.record import Record
from ..estimation.estimate import Estimate
from .decrement import damping_ratio, friction_from_envelope
from .estimates import KnownParameters, force_estimates, to_record_units
from .extrema import Extrema
from .fit_problem import FitProblem, column_norms, least_squares
from .intervals import confidence_interval, to_correlation
from .law import AMPLITUDE, OMEGA, REST, TERMS, UNKNOWNS, ZETA, B, R
from .model_selection import FittedLaw
from .return_map import iterate_return_map
from .signal_model import LAW

PRECISION = 1e-12  # relative to a small loss, of the single loss
BRACKET = (2.0, 4.0, 8.0)  # times a small loss, where the single loss is sought
STOPPED = 1e-6  # of the first amplitude: a root that misses the last amplitude by more is none


def estimate_from_extrema(
    record: Record, problem: FitProblem, extrema: Extrema, law: FittedLaw, parameters: KnownParameters, omega: Estimate
) -> tuple[tuple[Estimate, ...], str]:
    """Return estimates of the law from all turning points, and the reason if there are none."""
    if record.order:
        return (), f"a record of {record.quantity} shows no turning points of the position"
    if problem.drift:
        return (), "the rest position drifts, and turning points alone do not show how"
    unknowns = np.array([AMPLITUDE, REST, *(UNKNOWNS.index(term) for term in law.terms)])
    if len(extrema.x) <= len(unknowns):
        return (), f"{len(extrema.x)} turning points leave no degrees of freedom for {len(unknowns)} values"
    positions = (extrema.x - problem.offset) / problem.scale
    start = law.p.copy()
    amplitudes, _ = problem.half_cycles(start, max_count=len(cycles_before_first_extremum(problem, extrema, start)))
    model = problem.model
    before = len(amplitudes) - 1
    start[AMPLITUDE] = amplitudes[-1]
    model = replace(model, initial_sign=model.initial_sign * (-1) ** before)

    def residuals(p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        laws, changed, changes = model.perturbed_laws(p, unknowns)
        sequence = iterate_return_map(laws, model.is_pendulum, model.min_amplitude, len(positions) - 1)
        sizes = np.pad(sequence.amplitudes, ((0, len(positions) - len(sequence.amplitudes)), (0, 0)), mode="edge")
        sign = model.initial_sign * (-1.0) ** np.arange(len(positions))
        jacobian = np.ones((len(positions), len(unknowns)))
        for i, unknown in enumerate(changed.tolist()):
            slope = sign * (sizes[:, 1 + i] - sizes[:, 0]) / changes[i]
            jacobian[:, np.flatnonzero(unknowns == unknown)[0]] = slope
        return p[REST] + sign * sizes[:, 0] - positions, jacobian

    p, cost = least_squares(residuals, start, unknowns)
    _, jacobian = residuals(p)
    degrees_of_freedom = len(positions) - len(unknowns)
    scale = column_norms(jacobian)
    covariance = np.linalg.pinv((jacobian / scale).T @ (jacobian / scale)) * cost / degrees_of_freedom
    estimates = {}
    errors, correlation = np.sqrt(np.diag(covariance)) / scale, to_correlation(covariance)
    for i, unknown in enumerate(unknowns.tolist()):
        if unknown != AMPLITUDE:
            low, high = confidence_interval(i, unknowns, p[unknowns], errors, correlation, degrees_of_freedom)
            estimates[unknown] = to_record_units(
                record, problem, unknown, float(p[unknown]), float(errors[i]), low, high
            )
    return (*estimates.values(), *force_estimates(record, omega, estimates, parameters)), ""


def cycles_before_first_extremum(problem: FitProblem, extrema: Extrema, p: np.ndarray) -> np.ndarray:
    """Return the end times of the fitted half cycles that end at about the first turning point, or before it."""
    _, starts = problem.half_cycles(p)
    return starts[1:][starts[1:] < extrema.t[0] - problem.time_origin + extrema.half_period / 2]


def estimate_from_two_peaks(
    record: Record, problem: FitProblem, extrema: Extrema, law: FittedLaw, parameters: KnownParameters, omega: Estimate
) -> tuple[tuple[Estimate, ...], str]:
    """Return each single loss that leads from the first to the last turning point, and the reason if there is none."""
    if record.order:
        return (), f"a record of {record.quantity} shows no turning points of the position"
    rest = float(law.p[REST]) * problem.scale + problem.offset
    amplitudes = np.sign(extrema.x[0] - rest) * (-1.0) ** np.arange(len(extrema.x)) * (extrema.x - rest)
    count = int(np.flatnonzero(amplitudes > 0)[-1])  # the last half cycle may end on the side where it started
    first, last = float(amplitudes[0]), float(amplitudes[count])
    if problem.drift:
        return (), "the rest position drifts"
    if not first > last:
        return (), "the last turning point is no smaller than the first"
    estimates = {}
    for term in TERMS:
        unknown = UNKNOWNS.index(term)
        value = solve_single_loss(
            unknown, first / problem.scale, last / problem.scale, count, problem.model.is_pendulum
        )
        if np.isfinite(value):
            estimates[unknown] = to_record_units(record, problem, unknown, value, np.nan, np.nan, np.nan)
    return (*estimates.values(), *force_estimates(record, omega, estimates, parameters)), ""


def solve_single_loss(unknown: int, first: float, last: float, count: int, is_pendulum: bool) -> float:
    """Return the single loss that leads from one amplitude to another in `count` half cycles; NaN if none does.

    For a spring with damping or friction it has a closed form; otherwise the search starts from that of a small loss.

    Parameters
    ----------
    unknown : index in UNKNOWNS of the loss: ZETA, R or B
    first, last : amplitudes
    """
    small_loss = {
        ZETA: damping_ratio(first, last, count / 2),
        R: friction_from_envelope(first, last, count / 2, 1.0),
        B: 0.75 * (1 / last - 1 / first) / count,
    }[unknown]
    if unknown != B and not is_pendulum:
        return small_loss
    p = np.zeros(len(UNKNOWNS))
    p[[AMPLITUDE, OMEGA]] = first, 1.0

    def excess(loss: float) -> float:
        """Return how much larger the last amplitude is with this loss; it is zero if the motion stops before."""
        p[unknown] = loss
        amplitudes = iterate_return_map(p[None, LAW], is_pendulum, 0.0, count).amplitudes[:, 0]
        return float(amplitudes[-1]) - last if len(amplitudes) > count else -last

    for factor in BRACKET:
        if excess(factor * small_loss) < 0:
            loss = float(optimize.brentq(excess, 0.0, factor * small_loss, xtol=PRECISION * small_loss))
            # the amplitude falls suddenly to zero at a loss with which the motion stops before
            return loss if abs(excess(loss)) < STOPPED * first else np.nan
    return np.nan
