"""Estimates: values with standard errors and 95 % intervals."""

from dataclasses import dataclass

import numpy as np
from scipy import special

UPPER = 0.975  # probability below the upper end of a 95 % interval
NORMAL_QUANTILE = float(special.ndtri(UPPER))


@dataclass(frozen=True)
class Estimate:
    """A value with its standard error and its 95 % interval; NaN where the data leave no degrees of freedom."""

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
