"""Unknowns of a fit: parameters and start values of the FMU, those of a sensor, and the region of a search."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import exp, inf, log

import numpy as np
from scipy.optimize import nnls

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

    def slope(self, value: float) -> float:
        """Return the derivative of a value by its coordinate."""
        return value if self.sign else self.scale

    @property
    def search_range(self) -> tuple[float, float]:
        """Return the range to search in the coordinate."""
        low, high = sorted((self.to_coordinate(self.low), self.to_coordinate(self.high)))
        return low, high

    @property
    def limits(self) -> tuple[float, float]:
        """Return the limits of a fit in the coordinate, beyond which no interval is followed."""
        margin = log(BEYOND_FACTOR) if self.sign else BEYOND_FACTOR
        low, high = self.search_range
        return low - margin, high + margin

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


MAX_PLANES = 40
BISECTIONS = 30
PROBE = 1e-3  # distance at which the direction of a boundary is probed


class FeasibleRegion:
    """Half spaces normal . z <= bound of the coordinates z (k,)."""

    def __init__(self, unknowns: Sequence[Unknown]) -> None:
        self.normals: list[np.ndarray] = []
        self.bounds: list[float] = []
        for axis, unknown in zip(np.eye(len(unknowns)), unknowns, strict=True):
            for low, high in (unknown.coordinate_bounds(), unknown.limits):
                for normal, bound in ((-axis, -low), (axis, high)):
                    if np.isfinite(bound):
                        self.add(normal, bound)

    def add(self, normal: np.ndarray, bound: float) -> None:
        self.normals.append(normal)
        self.bounds.append(bound)

    def add_refusal(self, is_refused: Callable[[np.ndarray], bool], z: np.ndarray, step: np.ndarray) -> None:
        """Add the plane beyond which the FMU refuses values, if it refuses z + step.

        The plane is found by bisection along the step, and its direction by bisection along each axis.
        """

        def accepted_share(start: np.ndarray, step: np.ndarray) -> float:
            low, high = 0.0, 1.0
            for _ in range(BISECTIONS):
                middle = (low + high) / 2
                low, high = (low, middle) if is_refused(start + middle * step) else (middle, high)
            return low

        if len(self.normals) > MAX_PLANES or not is_refused(z + step):
            return
        inner_point = z + step * max(accepted_share(z, step) - 1e-6, 0.0)
        normal = np.zeros(len(z))
        for i, axis in enumerate(PROBE * np.eye(len(z))):
            for side in (1, -1):
                if is_refused(inner_point + side * axis):
                    normal[i] = side / (PROBE * max(accepted_share(inner_point, side * axis), 1e-9))
        if normal.any():
            size = np.linalg.norm(normal)
            self.add(normal / size, float((normal @ inner_point + 1) / size) - 1e-9)

    def constrained_step(self, matrix: np.ndarray, slope: np.ndarray, z: np.ndarray, free: np.ndarray) -> np.ndarray:
        """Return the step s of the `free` coordinates with the least s.matrix.s/2 + slope.s inside the region.

        NaN if there is none.

        References
        ----------
        C. L. Lawson, R. J. Hanson, Solving Least Squares Problems (1974), chapter 23
        """
        s = -np.linalg.solve(matrix, slope)
        normals = np.array(self.normals)
        slack, normals = np.array(self.bounds) - normals @ z, normals[:, free]
        if (normals @ s <= slack + 1e-12).all():
            return np.asarray(s)
        # relative to the largest element, as the limits of this method are absolute
        transform = np.linalg.inv(np.linalg.cholesky(matrix / matrix.max(initial=1e-300))).T
        left, right = -normals @ transform, normals @ s - slack
        u, _ = nnls(np.vstack([left.T, right]), np.append(np.zeros(len(free)), 1.0))
        r = np.append(left.T @ u, right @ u - 1)
        return np.asarray(s - transform @ (r[:-1] / r[-1])) if r[-1] < -1e-12 else np.full(len(free), np.nan)
