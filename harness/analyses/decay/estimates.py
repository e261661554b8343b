"""Estimates of damping and friction by three methods, in the units of the record and, with k or m, in newtons.

From the whole signal: the values are those of the selected law; errors and intervals are those of the full law, because
the selection itself is uncertain: the intervals of the selected law alone are too narrow wherever the choice is not
clear.

From all turning points, for comparison: their positions x_i = rest +- a_i, fitted by the return map of the law (for a
spring without drag a_(i+1) = e a_i - (1 + e) r: B. F. Feeny, J. W. Liang, Journal of Sound and Vibration 195 (1996)).

From the first and the last turning point: the single loss that leads from the first amplitude to the last, by the
textbook's logarithmic decrement or linear envelope.  A pendulum is taken for the spring with the same energies, whose
amplitude is 2 sin(a/2), and the loss by drag for a small one.
"""

from dataclasses import dataclass

import numpy as np

from ...records.motion import Motion
from ..estimation.estimate import Estimate
from .decay_problem import DecayProblem, column_norms, least_squares
from .intervals import FitUncertainty, confidence_interval, extend_interval, to_correlation
from .law import (
    AMPLITUDE,
    DRIFT,
    OMEGA,
    REST,
    UNKNOWNS,
    ZETA,
    B,
    R,
    damping_ratio,
    friction_from_envelope,
    unit_scales,
)
from .model_selection import FittedLaw
from .samples import Extrema


@dataclass(frozen=True)
class KnownParameters:
    """Parameters of the oscillator that the user knows.

    Attributes
    ----------
    k : float or None
        Stiffness in N/m, or N.m/rad for a rotation.
    m : float or None
        Mass in kg, or moment of inertia in kg.m2.
    pendulum : bool
        Whether the restoring torque is that of a pendulum, k sin(theta).
    """

    k: float | None = None
    m: float | None = None
    pendulum: bool = False


def quantity_labels(record: Motion) -> dict[int, tuple[str, str, str]]:
    """Return name, unit and text of each unknown that is reported, by its index in UNKNOWNS."""
    base, is_rotation = record.base, record.base == "rad"
    rest, drift = "rest position", "drift of the rest position"
    if record.order:
        rest, drift = f"offset of the {record.quantity}", "drift of the offset"
    return {
        OMEGA: ("omega", "rad/s", "natural frequency"),
        ZETA: ("zeta", "1", "damping ratio"),
        R: ("r", base, "friction over stiffness, T_f/k" if is_rotation else "friction over stiffness, f/k"),
        B: ("b", f"1/{base}", "drag over inertia" if is_rotation else "drag over mass, q/m"),
        REST: ("rest", record.unit, rest),
        DRIFT: ("drift", f"{record.unit}/s", drift),
    }


def to_record_units(
    record: Motion, problem: DecayProblem, unknown: int, value: float, error: float, low: float, high: float
) -> Estimate:
    """Return an estimate of one of the UNKNOWNS, converted from the units of the problem to those of the record."""
    scale, offset = unit_scales(problem.scale)[unknown], problem.offset if unknown == REST else 0.0
    name, unit, text = quantity_labels(record)[unknown]
    return Estimate(
        name, scale * value + offset, scale * error, scale * low + offset, scale * high + offset, unit, text
    )


def make_estimates(
    record: Motion,
    problem: DecayProblem,
    law: FittedLaw,
    full: FittedLaw,
    uncertainty: FitUncertainty,
) -> dict[int, Estimate]:
    """Return the estimates by index in UNKNOWNS; for a term that is not in the law, `high` is the upper limit.

    Parameters
    ----------
    law : FittedLaw
        Law whose values are reported.
    full : FittedLaw
        Law with all terms.
    uncertainty : FitUncertainty
        Uncertainty of the full law.
    """
    estimates: dict[int, Estimate] = {}
    at_bound = any(full.p[UNKNOWNS.index(term)] <= 0 for term in full.terms)  # elsewhere the bounds have no effect
    center = uncertainty.unconstrained_values if at_bound else full.p[uncertainty.unknowns]
    intervals = {
        int(unknown): confidence_interval(
            i,
            uncertainty.unknowns,
            center,
            uncertainty.standard_errors,
            uncertainty.correlation,
            uncertainty.degrees_of_freedom,
        )
        for i, unknown in enumerate(uncertainty.unknowns)
    }
    if any(not low <= law.p[unknown] <= high for unknown, (low, high) in intervals.items()):
        law = full
    errors = dict(zip(intervals, uncertainty.standard_errors.tolist(), strict=True))
    for unknown in quantity_labels(record):
        if unknown in intervals:  # otherwise it was not fitted
            value, ends = float(law.p[unknown]), extend_interval(float(law.p[unknown]), *intervals[unknown])
            estimates[unknown] = to_record_units(record, problem, unknown, value, errors[unknown], *ends)
    return estimates


def force_estimates(
    record: Motion, omega: Estimate, estimates: dict[int, Estimate], parameters: KnownParameters
) -> tuple[Estimate, ...]:
    """Return friction force, damping and drag constants if k or m is known.

    f = k r, c = 2 zeta k/omega, q = b k/omega^2, for those of r, zeta and b that are in `estimates`, if the position is
    in m or rad.
    """
    if (parameters.k is None and parameters.m is None) or record.base not in ("m", "rad"):
        return ()
    omega_error = omega.error / omega.value
    k, k_error = (parameters.k, 0.0) if parameters.k is not None else (parameters.m * omega.value**2, 2 * omega_error)  # type: ignore[operator]
    m, m_error = (parameters.m, 0.0) if parameters.m is not None else (k / omega.value**2, 2 * omega_error)
    is_rotation = record.base == "rad"
    force, per = ("N.m", "rad") if is_rotation else ("N", "m")
    rows: tuple[tuple[int, float, str, str, str, float], ...] = (
        (R, k, "T_f" if is_rotation else "f", force, "friction torque" if is_rotation else "friction force", k_error),
        (ZETA, 2 * m * omega.value, "c", f"{force}.s/{per}", "damping constant", omega_error),
        (B, m, "q", f"{force}.s2/{per}2", "drag constant", m_error),
    )
    return tuple(estimates[row[0]].multiply(*row[1:]) for row in rows if row[0] in estimates)


def estimate_from_extrema(
    record: Motion,
    problem: DecayProblem,
    extrema: Extrema,
    law: FittedLaw,
    parameters: KnownParameters,
    omega: Estimate,
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
    later, start = problem.start_near(law.p, float(extrema.t[0]) - problem.time_origin)
    sign = later.model.initial_sign * (-1.0) ** np.arange(len(positions))

    def residuals(p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        sizes, jacobian = later.model.predict_amplitudes(p, unknowns, len(positions) - 1)
        jacobian = sign[:, None] * jacobian
        jacobian[:, 1] = 1.0  # of the rest position
        return p[REST] + sign * sizes - positions, jacobian

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


def estimate_from_two_peaks(
    record: Motion,
    problem: DecayProblem,
    extrema: Extrema,
    law: FittedLaw,
    parameters: KnownParameters,
    omega: Estimate,
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
    if problem.model.is_pendulum:
        first, last = (2 * float(np.sin(amplitude / 2)) for amplitude in (first, last))
    losses = {
        ZETA: damping_ratio(first, last, count / 2),
        R: friction_from_envelope(first, last, count / 2, 1.0) / problem.scale,
        B: 0.75 * (1 / last - 1 / first) / count * problem.scale,
    }
    estimates = {
        unknown: to_record_units(record, problem, unknown, value, np.nan, np.nan, np.nan)
        for unknown, value in losses.items()
    }
    return (*estimates.values(), *force_estimates(record, omega, estimates, parameters)), ""
