"""Estimates of `decay` and of `fit`: values with 95 % intervals and their JSON; noise and reversals of a record."""

from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from scipy import special

UPPER = 0.975  # probability below the upper end of a 95 % interval
NORMAL_QUANTILE = float(special.ndtri(UPPER))


@dataclass(frozen=True)
class Estimate:
    """Estimate of a quantity; its error and interval are NaN if the data leave no degrees of freedom.

    Attributes
    ----------
    name : str
        Name of the quantity.
    value : float
        Estimated value, in `unit`.
    error : float
        Standard error, in `unit`.
    low, high : float
        Ends of the 95 % interval, in `unit`.
    unit : str
        Unit of the quantity.
    text : str
        Description of the quantity.
    """

    name: str
    value: float
    error: float
    low: float
    high: float
    unit: str
    text: str

    def multiply(self, factor: float, name: str, unit: str, text: str, relative_error: float = 0.0) -> "Estimate":
        """Return this estimate multiplied by a `factor` that has a relative standard error of its own."""
        value, margin = factor * self.value, NORMAL_QUANTILE * relative_error * factor * self.value
        low = value - np.hypot(value - factor * self.low, margin)
        high = value + np.hypot(factor * self.high - value, margin)
        error = float(np.hypot(factor * self.error, margin / NORMAL_QUANTILE))
        return Estimate(name, value, error, float(max(low, 0.0)), float(high), unit, text)


def student_quantile(degrees_of_freedom: int) -> float:
    """Return Student's t at 97.5 %; NaN without degrees of freedom.  scipy.stats has it too, but imports slowly."""
    return float(special.stdtrit(degrees_of_freedom, UPPER))


@dataclass(frozen=True)
class UsedSamples:
    """Fitted samples of a record.

    Attributes
    ----------
    record : str
        Name of the record.
    t : numpy.ndarray
        Their times (n,) in s.
    n_record : int
        Number of samples in the record.
    averaged : int
        Number of neighbouring samples whose mean was fitted.
    """

    record: str
    t: np.ndarray
    n_record: int
    averaged: int = 1

    def as_json(self) -> dict[str, Any]:
        """Return the samples for JSON output."""
        return {
            "record": self.record,
            "from": float(self.t[0]),
            "until": float(self.t[-1]),
            "samples": len(self.t),
            "of": self.n_record,
            "averaged": self.averaged,
            "time_unit": "s",
        }


@dataclass(frozen=True)
class ColumnResiduals:
    """Residuals of a measured column.

    Attributes
    ----------
    record, name : str
        Names of the record and of the column.
    unit : str
        Unit of the numbers below.
    residual : float
        Root mean square of the residuals.
    noise : float
        Standard deviation of the noise.
    range : float
        Range of the samples.
    """

    record: str
    name: str
    unit: str
    residual: float
    noise: float
    range: float


def shared_json(
    samples: Sequence[UsedSamples],
    columns: Sequence[ColumnResiduals],
    estimates: Sequence[Estimate],
    remarks: Sequence[str],
) -> dict[str, Any]:
    """Return the JSON keys that the results of `decay` and `fit` share."""
    return {
        "record": ", ".join(part.record for part in samples),
        "records": [part.as_json() for part in samples],
        "columns": [asdict(column) for column in columns],
        "fit": [asdict(estimate) for estimate in estimates],
        "remarks": [*remarks],
    }


SIGNIFICANT_CORRELATION = 4.5  # standard deviations of the correlation of white residuals: one record of 1e5
SIGNIFICANT_SUMS = 5.0  # standard deviations of the variance of sums of white residuals


def interpolation_residuals(t: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Return the distances (n - 4,) of the inner samples of x (n,) from the cubic through their four neighbours.

    They are scaled so that white noise keeps its standard deviation.
    """
    n = len(t) - 4
    near = np.array([t[i : i + n] for i in (0, 1, 3, 4)])
    weights = np.ones((4, n))
    for i in range(4):
        for j in range(4):
            if i != j:
                weights[i] *= (t[2:-2] - near[j]) / (near[i] - near[j])
    residuals = x[2:-2] - sum(weight * x[i : i + n] for weight, i in zip(weights, (0, 1, 3, 4), strict=True))
    return np.asarray(np.abs(residuals) / np.sqrt(1 + (weights**2).sum(axis=0)))


def robust_std(e: np.ndarray) -> float:
    """Return the standard deviation of residuals e (n,), estimated from their median magnitude."""
    return 1.4826 * float(np.median(np.abs(e)))


def residual_correlation(e: np.ndarray, widths: Iterable[int]) -> tuple[float, bool]:
    """Return the correlation of neighbouring residuals e (n,), and whether they differ from white noise.

    They do if this correlation, or the variance of their sums over one of the `widths`, is significantly large.
    """
    squares, n = float(e @ e), len(e)
    if squares == 0:
        return 0.0, False
    rho = float(e[:-1] @ e[1:]) / squares
    is_correlated = abs(rho) > SIGNIFICANT_CORRELATION / np.sqrt(n)
    for width in widths:
        sums = np.add.reduceat(e, np.arange(0, n, width))
        ratio = float(np.mean(sums**2)) / (width * squares / n)
        is_correlated = is_correlated or ratio > 1 + SIGNIFICANT_SUMS * np.sqrt(2 * width / n)
    return rho, bool(is_correlated)


def block_scores(jacobian: np.ndarray, e: np.ndarray, count: int, n_unknowns: int) -> tuple[np.ndarray, float]:
    """Return the scores, products of columns (n, k) and residuals e (n,), summed over at most `count` blocks.

    The second result is the factor by which their squares are too small after a fit of `n_unknowns` values.
    """
    edges = np.unique(np.linspace(0, len(e), count + 1).astype(int))[:-1]
    scores = np.add.reduceat(jacobian * e[:, None], edges, axis=0)
    return scores, len(edges) / max(len(edges) - n_unknowns, 1)


def find_reversals(x: np.ndarray, threshold: float) -> np.ndarray:
    """Return the samples at which x (n,) reverses by `threshold` or more, including the first extremum."""
    reversals: list[int] = []
    low = high = 0
    is_rising = None
    values = x.tolist()
    for i, value in enumerate(values):
        if value > values[high]:
            high = i
        if value < values[low]:
            low = i
        if is_rising is not False and values[high] - value >= threshold:
            reversals.append(high)
            is_rising, low = False, i
        elif is_rising is not True and value - values[low] >= threshold:
            reversals.append(low)
            is_rising, high = True, i
    return np.array(reversals, int)
