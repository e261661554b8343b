"""Points of a sweep: a full grid, or a Latin hypercube."""

from dataclasses import dataclass
from functools import cached_property
from math import isfinite, log, prod

import numpy as np

from ...errors import MAX_VALUE_LENGTH, SceneError

MAX_RUNS = 10_000_000  # runs
VARY_HELP = "as in m=1:2:11, k=10:1000:31:log, mu=0.1,0.2,0.4 or, with --random, m=1:2"


@dataclass(frozen=True)
class SweepAxis:
    """A parameter with its `values`, or with its two bounds for a random sample; `log`: logarithmic spacing."""

    name: str
    values: tuple[float, ...]
    log: bool = False


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
    if len(set(values)) < len(values):
        raise SceneError(f"--vary {text}: a value occurs twice")
    return SweepAxis(name, values, is_log)


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
    """The points of a sweep: a grid, computed on demand with the last axis fastest, or `random` points of a Latin
    hypercube, held in memory.

    M. D. McKay, R. J. Beckman, W. J. Conover, Technometrics 21 (1979).
    """

    axes: tuple[SweepAxis, ...]
    random: int | None = None
    seed: int = 1

    def __post_init__(self) -> None:
        if len(self) > MAX_RUNS:
            raise SceneError(f"{len(self)} runs exceed the maximum of {MAX_RUNS}; reduce the number of values")

    def __len__(self) -> int:
        return prod(len(axis.values) for axis in self.axes) if self.random is None else self.random

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
