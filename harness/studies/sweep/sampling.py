"""The points of a sweep: every combination on a grid, or a Latin hypercube between the bounds."""

from dataclasses import dataclass
from functools import cached_property
from math import isfinite, log, prod

import numpy as np

from ...errors import MAX_VALUE_LENGTH, SceneError

MAX_RUNS = 10_000_000  # runs
VARY_HELP = "as in m=1:2:11, k=10:1000:31:log, mu=0.1,0.2,0.4 or, with --random, m=1:2"


@dataclass(frozen=True)
class SweepAxis:
    """A parameter and its `values` on the axis, or, for a random sample, its two bounds; `log`: evenly in ratio."""

    name: str
    values: tuple[float, ...]
    log: bool = False


def parse_axis(text: str, random: bool) -> SweepAxis:
    """The axis that a text names; SceneError if it does not name one."""
    name, _, span = text.partition("=")
    name = name.strip()
    wrong = SceneError(f"--vary {text[:MAX_VALUE_LENGTH]} is not understood; write it {VARY_HELP}")
    words = span.split(":")
    ratio = words[-1] == "log"
    words = words[: len(words) - ratio]
    try:
        if "," in span:
            values = tuple(map(float, span.split(",")))
        elif len(words) == 2 and random:
            values = (float(words[0]), float(words[1]))
        elif len(words) == 3 and not random:
            values = evenly_spaced(float(words[0]), float(words[1]), int(words[2]), ratio)
        else:
            raise wrong
    except (ValueError, OverflowError):
        raise wrong from None
    if not name or not all(map(isfinite, values)) or (random and ("," in span or not values[0] < values[1])):
        raise wrong
    if ratio and not min(values) > 0:
        raise SceneError(f"--vary {text}: a logarithmic axis needs bounds above 0")
    if len(set(values)) < len(values):
        raise SceneError(f"--vary {text} names a value twice")
    return SweepAxis(name, values, ratio)


def evenly_spaced(low: float, high: float, count: int, ratio: bool) -> tuple[float, ...]:
    """`count` values from low to high, both included."""
    if not 1 <= count <= MAX_RUNS:
        raise ValueError
    if ratio and low > 0 and high > 0:
        return tuple(np.geomspace(low, high, count).tolist())
    with np.errstate(all="ignore"):  # what is not finite then is refused
        return tuple(np.linspace(low, high, count).tolist())


@dataclass(frozen=True)
class SweepPoints:
    """The points of a sweep: the grid of its axes with the last one fastest, made where it is asked for, or `random`
    points of a Latin hypercube, which are all held.

    M. D. McKay, R. J. Beckman, W. J. Conover, Technometrics 21 (1979).
    """

    axes: tuple[SweepAxis, ...]
    random: int | None = None
    seed: int = 1

    def __post_init__(self) -> None:
        if len(self) > MAX_RUNS:
            raise SceneError(f"{len(self)} runs are more than {MAX_RUNS}; take fewer values")

    def __len__(self) -> int:
        return prod(len(each.values) for each in self.axes) if self.random is None else self.random

    def coordinates(self, first: int, last: int) -> np.ndarray:
        """Those from number `first` to before `last`, (last - first, axes)."""
        if self.random is not None:
            return self.sample[first:last]
        places = np.unravel_index(np.arange(first, last), [len(each.values) for each in self.axes])
        return np.column_stack([np.array(each.values)[at] for each, at in zip(self.axes, places, strict=True)])

    @cached_property
    def sample(self) -> np.ndarray:
        from scipy.stats import qmc

        spots: np.ndarray = qmc.LatinHypercube(len(self.axes), rng=self.seed).random(self.random)
        for each, column in zip(self.axes, spots.T, strict=True):
            low, high = map(log, each.values) if each.log else each.values
            column[:] = np.exp(low + column * (high - low)) if each.log else low + column * (high - low)
        return spots
