"""Estimates of a fit: values with standard errors and confidence intervals, in the units of the record and in newtons.

The values are those of the selected law; errors and intervals are those of the full law, because the selection itself
is uncertain: the intervals of the selected law alone are too narrow wherever the choice is not clear.
"""

from dataclasses import dataclass

from ...records.record import Record
from ..estimation.estimate import Estimate
from .fit_problem import FitProblem
from .intervals import FitUncertainty, confidence_interval
from .law import DRIFT, OMEGA, REST, UNKNOWNS, ZETA, B, R
from .model_selection import FittedLaw


@dataclass(frozen=True)
class KnownParameters:
    """What the user knows about the oscillator: stiffness `k` or mass `m` (SI; for a rotation N.m/rad, kg.m2), and
    whether the restoring torque is that of a pendulum, k sin(theta)."""

    k: float | None = None
    m: float | None = None
    pendulum: bool = False


def quantity_labels(record: Record) -> dict[int, tuple[str, str, str]]:
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


def unit_scales(problem: FitProblem) -> dict[int, float]:
    """Return the unit of each unknown of the problem, in units of the record, by its index in UNKNOWNS."""
    scale = problem.scale
    return {OMEGA: 1.0, ZETA: 1.0, R: scale, B: 1 / scale, REST: scale, DRIFT: scale}


def to_record_units(
    record: Record, problem: FitProblem, unknown: int, value: float, error: float, low: float, high: float
) -> Estimate:
    """Return an estimate of one of the UNKNOWNS, converted from the units of the problem to those of the record."""
    scale, offset = unit_scales(problem)[unknown], problem.offset if unknown == REST else 0.0
    name, unit, text = quantity_labels(record)[unknown]
    return Estimate(
        name, scale * value + offset, scale * error, scale * low + offset, scale * high + offset, unit, text
    )


def make_estimates(
    record: Record,
    problem: FitProblem,
    law: FittedLaw,
    full: FittedLaw,
    uncertainty: FitUncertainty,
    parameters: KnownParameters,
) -> tuple[Estimate, ...]:
    """Return the estimates of all quantities; for a term that is not in the law, `high` is the upper limit.

    Parameters
    ----------
    law : the law whose values are reported
    full : the full law
    uncertainty : of the full law
    """
    estimates = {}
    at_bound = any(full.p[UNKNOWNS.index(term)] <= 0 for term in full.terms)  # elsewhere the bounds have no effect
    center = uncertainty.unconstrained if at_bound else full.p[uncertainty.unknowns]
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
            value, (low, high) = float(law.p[unknown]), intervals[unknown]
            bounds = min(low, value), max(high, value)
            estimates[unknown] = to_record_units(record, problem, unknown, value, errors[unknown], *bounds)
    return (*estimates.values(), *force_estimates(record, estimates[OMEGA], estimates, parameters))


def force_estimates(
    record: Record, omega: Estimate, estimates: dict[int, Estimate], parameters: KnownParameters
) -> tuple[Estimate, ...]:
    """Return friction force, damping and drag constants if k or m is known.

    f = k r, c = 2 zeta k/omega, q = b k/omega^2, for the `estimates` of r, zeta and b that are there, if the position
    is in m or rad.
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
