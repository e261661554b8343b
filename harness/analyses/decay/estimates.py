"""What is told of a fit: values with errors and intervals, in the units of the record and in newtons where k or m is
known.

The values are those of the chosen law; errors and intervals are those of the full law, for which terms are present is
not known but found: the intervals of the chosen law alone are too narrow wherever the choice is not clear.
"""

from dataclasses import dataclass

import numpy as np

from ...records.record import Record
from .fit_problem import FitProblem
from .intervals import SIDE, FitUncertainty, interval
from .law import DRIFT, OMEGA, REST, UNKNOWNS, ZETA, B, R
from .model_selection import FittedLaw


@dataclass(frozen=True)
class KnownParameters:
    """What is known beforehand: stiffness `k` or mass `m` (SI; of a rotation N.m/rad, kg.m2), and whether the
    restoring torque is that of a pendulum, k sin(theta)."""

    k: float | None = None
    m: float | None = None
    pendulum: bool = False


@dataclass(frozen=True)
class Estimate:
    """A value with its standard error and the bounds of its 95 % interval; NaN where the data leave no freedom."""

    name: str
    value: float
    error: float
    low: float
    high: float
    unit: str
    text: str

    def times(self, size: float, name: str, unit: str, text: str, share: float = 0.0) -> "Estimate":
        """The estimate `size` times this one, where `size` has the relative standard error `share`."""
        value, more = size * self.value, SIDE * share * size * self.value
        low, high = (value - np.hypot(value - size * self.low, more), value + np.hypot(size * self.high - value, more))
        error = float(np.hypot(size * self.error, more / SIDE))
        return Estimate(name, value, error, float(max(low, 0.0)), float(high), unit, text)


def quantity_labels(record: Record) -> dict[int, tuple[str, str, str]]:
    """Name, unit and words of each unknown that is told."""
    base, turning = record.base, record.base == "rad"
    rest, drift = "rest position", "drift of the rest position"
    if record.order:
        rest, drift = f"offset of the {record.quantity}", "drift of the offset"
    return {
        OMEGA: ("omega", "rad/s", "natural frequency"),
        ZETA: ("zeta", "1", "damping ratio"),
        R: ("r", base, "friction over stiffness, T_f/k" if turning else "friction over stiffness, f/k"),
        B: ("b", f"1/{base}", "drag over inertia" if turning else "drag over mass, q/m"),
        REST: ("rest", record.unit, rest),
        DRIFT: ("drift", f"{record.unit}/s", drift),
    }


def sizes(problem: FitProblem) -> dict[int, float]:
    """The unit of each unknown of the problem in that of the record."""
    unit = problem.scale
    return {OMEGA: 1.0, ZETA: 1.0, R: unit, B: 1 / unit, REST: unit, DRIFT: unit}


def to_record_units(
    record: Record, problem: FitProblem, place: int, value: float, error: float, low: float, high: float
) -> Estimate:
    """An estimate of the problem in the record's units."""
    size, level = sizes(problem)[place], problem.offset if place == REST else 0.0
    name, unit, text = quantity_labels(record)[place]
    return Estimate(name, size * value + level, size * error, size * low + level, size * high + level, unit, text)


def estimates(
    record: Record, problem: FitProblem, law: FittedLaw, full: FittedLaw, spread: FitUncertainty, known: KnownParameters
) -> tuple[Estimate, ...]:
    """Everything that is told: of terms that the law has not, the largest value that the record allows."""
    found = {}
    bound = any(full.p[UNKNOWNS.index(term)] <= 0 for term in full.terms)  # elsewhere the fit is where it would be
    free = spread.free if bound else full.p[spread.unknowns]
    ends = {
        int(place): interval(i, spread.unknowns, free, spread.errors, spread.correlation, spread.freedom)
        for i, place in enumerate(spread.unknowns)
    }
    if any(not low <= law.p[place] <= high for place, (low, high) in ends.items()):
        law = full
    errors = dict(zip(ends, spread.errors.tolist(), strict=True))
    for place in quantity_labels(record):
        if place in ends:  # elsewhere it was not to be tried
            value, (low, high) = float(law.p[place]), ends[place]
            bounds = min(low, value), max(high, value)
            found[place] = to_record_units(record, problem, place, value, errors[place], *bounds)
    return (*found.values(), *force_estimates(record, found[OMEGA], found, known))


def force_estimates(
    record: Record, omega: Estimate, found: dict[int, Estimate], known: KnownParameters
) -> tuple[Estimate, ...]:
    """Friction force, damping and drag constants from k or m: f = k r, c = 2 zeta k/omega, q = b k/omega^2."""
    if known.k is None and known.m is None:
        return ()
    share = omega.error / omega.value
    k, k_share = (known.k, 0.0) if known.k is not None else (known.m * omega.value**2, 2 * share)  # type: ignore[operator]
    m, m_share = (known.m, 0.0) if known.m is not None else (k / omega.value**2, 2 * share)
    turning = record.base == "rad"
    force, per = ("N.m", "rad") if turning else ("N", "m")
    rows: tuple[tuple[int, float, str, str, str, float], ...] = (
        (R, k, "T_f" if turning else "f", force, "friction torque" if turning else "friction force", k_share),
        (ZETA, 2 * m * omega.value, "c", f"{force}.s/{per}", "damping constant", share),
        (B, m, "q", f"{force}.s2/{per}2", "drag constant", m_share),
    )
    return tuple(found[row[0]].times(*row[1:]) for row in rows if row[0] in found)
