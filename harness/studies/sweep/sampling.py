"""Points of a sweep: a full grid, or a Latin hypercube."""

from dataclasses import dataclass
from functools import cached_property
from math import isfinite, log, prod
from typing import Any

import numpy as np

from ...arguments import MAX_RUNS, to_array
from ...errors import MAX_VALUE_LENGTH, SceneError, format_value

VARY_HELP = "as in m=1:2:11, k=10:1000:31:log, mu=0.1,0.2,0.4 or, with --samples, m=1:2"


@dataclass(frozen=True)
class SweepAxis:
    """A parameter with its `values`, or with its two bounds for a random sample; `log`: logarithmic spacing."""

    name: str
    values: tuple[float, ...]
    log: bool = False

    def __str__(self) -> str:
        """Describe the axis in words; `sweep.nc` holds all values."""
        return f"{len(self.values)} values, {self.values[0]!r} to {self.values[-1]!r}{', logarithmic' * self.log}"


def parse_axis(text: str, random: bool) -> SweepAxis:
    """Parse the argument of --vary; SceneError if it is invalid."""
    name, _, span = text.partition("=")
    name = name.strip()
    invalid = SceneError(f"--vary {text[:MAX_VALUE_LENGTH]} is invalid; write it {VARY_HELP}")
    words = span.split(":")
    is_log = words[-1] == "log"
    words = words[: len(words) - is_log]
    try:
        if "," in span:
            values = tuple(map(float, span.split(",")))
        elif len(words) == 2 and random:
            values = (float(words[0]), float(words[1]))
        elif len(words) == 3 and not random:
            values = evenly_spaced(float(words[0]), float(words[1]), int(words[2]), is_log)
        else:
            raise invalid
    except (ValueError, OverflowError):
        raise invalid from None
    if not name or not all(map(isfinite, values)) or (random and ("," in span or not values[0] < values[1])):
        raise invalid
    if is_log and not min(values) > 0:
        raise SceneError(f"--vary {text}: a logarithmic axis needs bounds above 0")
    return SweepAxis(name, check_distinct(values, f"--vary {text}"), is_log)


def axis_from_numbers(name: str, column: Any, random: bool) -> SweepAxis:
    """Return the axis of a parameter from an array of its values; SceneError if it is invalid."""
    try:
        numbers = np.atleast_1d(to_array(column))
    except (OverflowError, TypeError, ValueError):  # nested sequences of different lengths
        numbers = np.zeros((0, 0))
    if numbers.ndim != 1 or (len(numbers) and numbers.dtype.kind not in "fiu"):
        raise SceneError(f"grid: {name} = {format_value(column)} must be numbers, one or a row")
    values = tuple(numbers.astype(float).tolist())
    if not values:
        raise SceneError(f"grid: {name} has no values: give at least one")
    if not all(map(isfinite, values)):
        raise SceneError(f"grid: {name} has a value that is not a finite number")
    if random and (len(values) != 2 or not values[0] < values[1]):
        raise SceneError(f"{name} has {len(values)} values: with samples give its lower and its upper bound")
    return SweepAxis(name, check_distinct(values, f"grid: {name}"))


def check_distinct(values: tuple[float, ...], label: str) -> tuple[float, ...]:
    """Return the values; SceneError if one of them occurs twice."""
    if len(set(values)) < len(values):
        raise SceneError(f"{label}: a value occurs twice")
    return values


def evenly_spaced(low: float, high: float, count: int, ratio: bool) -> tuple[float, ...]:
    """Return `count` values from low to high, both included."""
    if not 1 <= count <= MAX_RUNS:
        raise ValueError
    if ratio and low > 0 and high > 0:
        return tuple(np.geomspace(low, high, count).tolist())
    with np.errstate(all="ignore"):  # the caller rejects values that are not finite
        return tuple(np.linspace(low, high, count).tolist())


@dataclass(frozen=True)
class SweepPoints:
    """Points of a sweep: a grid, or `random` points of a Latin hypercube.

    Grid points are computed on demand, with the last axis fastest; random points are held in memory.

    References
    ----------
    M. D. McKay, R. J. Beckman, W. J. Conover, Technometrics 21 (1979).
    """

    axes: tuple[SweepAxis, ...]
    random: int | None = None
    seed: int = 1

    def __post_init__(self) -> None:
        if len({axis.name for axis in self.axes}) < len(self.axes):
            raise SceneError("--vary names a parameter twice")
        if self.n_runs > MAX_RUNS:
            raise SceneError(f"{self.n_runs} runs exceed the maximum of {MAX_RUNS}; reduce the number of values")

    @property
    def names(self) -> tuple[str, ...]:
        """Return the names of the varied parameters."""
        return tuple(axis.name for axis in self.axes)

    @property
    def n_runs(self) -> int:
        """Return the number of points; unlike len(), also a number that is too large."""
        return prod(len(axis.values) for axis in self.axes) if self.random is None else self.random

    def __len__(self) -> int:
        return self.n_runs

    def coordinates(self, first: int, last: int) -> np.ndarray:
        """Return the points from number `first` to before `last`, (last - first, axes)."""
        if self.random is not None:
            return self.sample[first:last]
        indices = np.unravel_index(np.arange(first, last), [len(axis.values) for axis in self.axes])
        return np.column_stack([np.array(axis.values)[index] for axis, index in zip(self.axes, indices, strict=True)])

    @cached_property
    def sample(self) -> np.ndarray:
        from scipy.stats import qmc

        points: np.ndarray = qmc.LatinHypercube(len(self.axes), rng=self.seed).random(self.random)
        for axis, column in zip(self.axes, points.T, strict=True):
            low, high = map(log, axis.values) if axis.log else axis.values
            column[:] = np.exp(low + column * (high - low)) if axis.log else low + column * (high - low)
        return points
