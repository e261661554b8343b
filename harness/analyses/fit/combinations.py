"""Combinations of two parameters that a record determines although it determines neither of them."""

import numpy as np

from ..estimation.estimate import Estimate
from .uncertainty import INDETERMINATE, Uncertainty
from .unknowns import Unknown

MAX_ERROR = INDETERMINATE / 3  # relative standard error of a combination
MIN_GAIN = 5.0  # times less uncertain than either parameter
COMPARABLE = 10.0  # ratio of two parameters whose sum or difference is meaningful


def determined_combinations(
    unknowns: tuple[Unknown, ...], values: np.ndarray, uncertainty: Uncertainty, indeterminate: list[int]
) -> tuple[Estimate, ...]:
    """Return the best known products, quotients, sums and differences of pairs of indeterminate unknowns.

    None of them follows from the others.

    Parameters
    ----------
    unknowns : tuple of Unknown
        The k unknowns of the fit.
    values : numpy.ndarray
        Fitted values (k,).
    uncertainty : Uncertainty
        Uncertainty of their coordinates.
    indeterminate : list of int
        Indices of the unknowns that the record does not determine.
    """
    covariance = uncertainty.covariance * uncertainty.inflation.max()
    pairs = [(i, j) for i in indeterminate for j in indeterminate if i < j and unknowns[i].sign and unknowns[j].sign]
    combinations: list[tuple[Estimate, np.ndarray]] = []
    for i, j in pairs:
        candidates = list_combinations(unknowns[i], unknowns[j], float(values[i]), float(values[j]))
        block = covariance[np.ix_([i, j], [i, j])]
        errors = [float(np.sqrt(weights @ block @ weights)) for *_, weights in candidates]
        best = int(np.argmin(errors))
        name, unit, value, weights = candidates[best]
        if errors[best] < min(MAX_ERROR, float(np.sqrt(np.diag(block)).min()) / MIN_GAIN):
            margin = uncertainty.quantile * errors[best] * abs(value)
            estimate = Estimate(name, value, errors[best] * abs(value), value - margin, value + margin, unit, "")
            row = np.zeros(len(unknowns))
            row[[i, j]] = weights
            combinations.append((estimate, row))
    independent: list[tuple[Estimate, np.ndarray]] = []
    for estimate, row in sorted(combinations, key=lambda pair: pair[0].error / abs(pair[0].value)):
        if np.linalg.matrix_rank([*(other for _, other in independent), row], tol=1e-6) > len(independent):
            independent.append((estimate, row))
    return tuple(estimate for estimate, _ in independent)


def list_combinations(a: Unknown, b: Unknown, p: float, q: float) -> list[tuple[str, str, float, np.ndarray]]:
    """Return name, unit, value and the relative change (2,) with the logarithms of the two values p and q."""
    quotients = [
        (f"{a.name}*{b.name}", combine_units(a.unit, 1, b.unit, 1), p * q, (1, 1)),
        (f"{a.name}/{b.name}", combine_units(a.unit, 1, b.unit, -1), p / q, (1, -1)),
        (f"{a.name}^2/{b.name}", combine_units(a.unit, 2, b.unit, -1), p * p / q, (2, -1)),
        (f"{a.name}/{b.name}^2", combine_units(a.unit, 1, b.unit, -2), p / q / q, (1, -2)),
    ]
    combinations = [(name, unit, value, np.array(weights, dtype=float)) for name, unit, value, weights in quotients]
    if a.unit == b.unit and 1 / COMPARABLE < p / q < COMPARABLE:
        for sign, symbol in ((1, "+"), (-1, "-")):
            value = p + sign * q
            if value:
                combinations.append((f"{a.name} {symbol} {b.name}", a.unit, value, np.array([p, sign * q]) / value))
    return combinations


def combine_units(a: str, power_a: int, b: str, power_b: int) -> str:
    """Return the unit of a product of powers."""
    if a == b:
        power = power_a + power_b
        return "" if not power else unit_power(a, power)
    if power_b > 0:
        return ".".join(filter(None, (unit_power(a, power_a), unit_power(b, power_b))))
    below = unit_power(b, -power_b)
    return "/".join((unit_power(a, power_a) or "1", below)) if below else unit_power(a, power_a)


def unit_power(unit: str, power: int) -> str:
    """Return the power of a unit."""
    is_compound = any(mark in unit for mark in "./")
    base = f"({unit})" if is_compound else unit
    return base if power == 1 or not unit else f"{base}{power}"
