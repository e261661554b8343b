"""Unknowns of a fit: parameters and start values of the FMU, and offset, gain and delay of a sensor."""

from dataclasses import dataclass
from functools import cached_property
from math import exp, inf, log

OFFSET, GAIN, DELAY = "offset", "gain", "delay"  # of a sensor
SENSOR = (OFFSET, GAIN, DELAY)
RANGE_FACTOR = 4.0  # of the range that is searched by default, about the start value of the FMU
# limits of a fit beyond the range to search: a factor, or for a range that holds zero a number of its quarters
BEYOND_FACTOR = 2.0


@dataclass(frozen=True)
class Unknown:
    """A number to fit.

    Attributes
    ----------
    name : str
        Name in results.
    variable : str
        Variable of the FMU that it sets, or one of SENSOR.
    unit : str
        Unit of the value.
    low, high : float
        Range to search.
    minimum, maximum : float
        Limits of the FMU; infinite if it has none.
    record : int or None
        Index of the only record that it applies to; None if it applies to all.
    column : int or None
        Index of the observed column whose sensor it describes.
    start : float or None
        Value to start from, in addition to those of the search.
    is_tunable : bool
        Whether it may change during a run.
    """

    name: str
    variable: str
    unit: str
    low: float
    high: float
    minimum: float = -inf
    maximum: float = inf
    record: int | None = None
    column: int | None = None
    start: float | None = None
    is_tunable: bool = False

    @cached_property
    def sign(self) -> int:
        """Return the sign of the range, 0 if it holds zero. With a sign, the coordinate is the logarithm."""
        return 1 if self.low > 0 else -1 if self.high < 0 else 0

    @cached_property
    def scale(self) -> float:
        """Return the unit of the coordinate of a range that holds zero."""
        return (self.high - self.low) / 4

    def to_coordinate(self, value: float) -> float:
        """Return the coordinate of a value, in which the fit is done."""
        return log(abs(value)) if self.sign else value / self.scale

    def to_value(self, coordinate: float) -> float:
        """Return the value at a coordinate."""
        return self.sign * exp(coordinate) if self.sign else coordinate * self.scale

    @property
    def search_range(self) -> tuple[float, float]:
        """Return the range to search in the coordinate."""
        low, high = sorted((self.to_coordinate(self.low), self.to_coordinate(self.high)))
        return low, high

    @property
    def limits(self) -> tuple[float, float]:
        """Return the limits of a fit in the coordinate, beyond which no interval is followed."""
        beyond = log(BEYOND_FACTOR) if self.sign else BEYOND_FACTOR
        low, high = self.search_range
        return low - beyond, high + beyond

    def coordinate_bounds(self) -> tuple[float, float]:
        """Return the limits of the FMU in the coordinate, infinite if it has none."""
        if not self.sign:
            return self.minimum / self.scale, self.maximum / self.scale
        near, far = (self.minimum, self.maximum) if self.sign > 0 else (-self.maximum, -self.minimum)
        return log(near) if near > 0 else -inf, log(far) if far < inf else inf

    def value_interval(self, low: float | None, high: float | None) -> tuple[float | None, float | None]:
        """Return the interval of values between two coordinates; None is no bound."""
        ends = [None if end is None else self.to_value(end) for end in (low, high)]
        return (ends[1], ends[0]) if self.sign < 0 else (ends[0], ends[1])

    def error_of(self, deviation: float, value: float) -> float:
        """Return the standard error of a value from the deviation of its coordinate."""
        return float(deviation * (abs(value) if self.sign else self.scale))
