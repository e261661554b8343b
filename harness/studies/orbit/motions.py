"""Motions that stay, and the points at which they begin, end or change."""

from dataclasses import dataclass, field
from math import nan
from typing import Any

import numpy as np

AT_REST, STEADY, STICK_SLIP, SLIDING_ORBIT = "rest", "steady sliding", "stick-slip", "sliding orbit"
NEUTRAL = 1e-9  # growth in a period, relative, below which a motion is neither stable nor unstable


@dataclass(frozen=True)
class Motion:
    """A motion that stays: rest, steady sliding or a periodic motion.

    Attributes
    ----------
    value : float
        Value of the parameter; NaN without one.
    kind : str
        "rest", "steady sliding", "stick-slip" or "sliding orbit".
    largest, smallest : float
        Extreme values of the coordinate.
    period : float
        Period in s; of steady sliding, that of small oscillations around it.
    stick_time : float
        Time of a period in s in which a contact sticks.
    n_sticks : int
        Number of sticks in a period.
    growth : float
        Growth rate of small disturbances in 1/s: negative if the motion is stable.
    multipliers : numpy.ndarray
        Factors by which disturbances grow in a period: Floquet multipliers; NaN where no derivative exists.
    error : float
        Relative change of the states after a period of an orbit.
    y : numpy.ndarray
        States (n,) of a point of the motion.
    """

    value: float
    kind: str
    largest: float
    smallest: float
    period: float = nan
    stick_time: float = 0.0
    n_sticks: int = 0
    growth: float = nan
    multipliers: np.ndarray = field(default_factory=lambda: np.zeros(0))
    error: float = 0.0
    y: np.ndarray = field(default_factory=lambda: np.zeros(0))

    @property
    def amplitude(self) -> float:
        """Return half the range of the coordinate."""
        return 0.5 * (self.largest - self.smallest)

    @property
    def slip_time(self) -> float:
        """Return the time of a period in s without sticking."""
        return self.period - self.stick_time

    @property
    def stability(self) -> str:
        """Return "stable", "unstable", or "neutral"; empty where it is not known."""
        if self.growth != self.growth:
            return ""
        size = self.growth * self.period if self.period == self.period else self.growth
        return "neutral" if abs(size) <= NEUTRAL else "stable" if size < 0.0 else "unstable"

    def as_row(self, parameter: str) -> dict[str, Any]:
        """Return the numbers by name, as files and pandas have them."""
        multiplier = float(np.abs(self.multipliers).max()) if self.multipliers.size else nan
        return {
            parameter or "model": self.value,
            "motion": self.kind,
            "stability": self.stability,
            "period": self.period,
            "amplitude": self.amplitude,
            "largest": self.largest,
            "smallest": self.smallest,
            "stick_time": self.stick_time,
            "slip_time": self.slip_time,
            "sticks": self.n_sticks,
            "multiplier": multiplier,
            "growth": self.growth,
        }


@dataclass(frozen=True)
class SpecialPoint:
    """A value of the parameter at which motions begin, end or change.

    Attributes
    ----------
    value : float
        Value of the parameter.
    kind : str
        What happens as the parameter increases.
    largest : float
        Largest value of the coordinate there.
    how : str
        How the value was found.
    """

    value: float
    kind: str
    largest: float
    how: str
