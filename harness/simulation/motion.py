"""A motion that stays: rest, steady sliding or a periodic motion."""

from dataclasses import dataclass, field
from math import nan

import numpy as np

AT_REST, STEADY, STICK_SLIP, SLIDING_ORBIT = "rest", "steady sliding", "stick-slip", "sliding orbit"
NEUTRAL = 1e-9  # growth in a period, relative, below which a motion is neither stable nor unstable


@dataclass(frozen=True)
class Motion:
    """A motion that stays: rest, steady sliding or a periodic motion.

    Attributes
    ----------
    kind : str
        "rest", "steady sliding", "stick-slip" or "sliding orbit".
    y : numpy.ndarray
        States (n,) of a point of the motion; of an orbit, one where it slides.
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
    value : float
        Value of the parameter; NaN without one.
    """

    kind: str
    y: np.ndarray
    largest: float
    smallest: float
    period: float = nan
    stick_time: float = 0.0
    n_sticks: int = 0
    growth: float = nan
    multipliers: np.ndarray = field(default_factory=lambda: np.zeros(0))
    error: float = 0.0
    value: float = nan

    @property
    def name(self) -> str:
        """Return the kind, of periodic motions the number of sticks in a period."""
        return self.kind if self.kind in (AT_REST, STEADY) else count_text(self.n_sticks, "stick")

    @property
    def amplitude(self) -> float:
        """Return half the range of the coordinate."""
        return 0.5 * (self.largest - self.smallest)

    @property
    def slip_time(self) -> float:
        """Return the time of a period in s without sticking."""
        return self.period - self.stick_time

    @property
    def multiplier(self) -> float:
        """Return the largest modulus of the multipliers."""
        return float(np.abs(self.multipliers).max()) if self.multipliers.size else nan

    @property
    def stability(self) -> str:
        """Return "stable", "unstable", or "neutral"; empty where it is not known."""
        if self.growth != self.growth:
            return ""
        size = self.growth * self.period if self.period == self.period else self.growth
        return "neutral" if abs(size) <= NEUTRAL else "stable" if size < 0.0 else "unstable"


def count_text(count: int, name: str) -> str:
    """Return the number of sticks or returns in a period, as in "2 sticks in a period"."""
    return f"{count} {name}{'s' * (count != 1)} in a period"
