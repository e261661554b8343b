"""Estimates of `decay` and of `fit`: values with standard errors and 95 % intervals, and the JSON that both share."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
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

    def widen(self, error: float, *values: float) -> "Estimate":
        """Return this estimate with at least this standard error, and with an interval that contains the values."""
        return replace(self, error=max(self.error, error), low=min(self.low, *values), high=max(self.high, *values))

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
        "record": ", ".join(used.record for used in samples),
        "records": [used.as_json() for used in samples],
        "columns": [asdict(column) for column in columns],
        "fit": [asdict(estimate) for estimate in estimates],
        "remarks": [*remarks],
    }
