"""The points of a sweep: every combination on a grid, or a Latin hypercube between the bounds."""

from dataclasses import dataclass
from itertools import product
from math import isfinite, log, prod

import numpy as np

from ...errors import LONGEST, SceneError

MOST = 10_000_000  # runs
HELP = "as in m=1:2:11, k=10:1000:31:log, mu=0.1,0.2,0.4 or, with --random, m=1:2"


@dataclass(frozen=True)
class Axis:
    """A parameter and its `values` on the axis, or, for a random sample, its two bounds; `log`: evenly in ratio."""

    name: str
    values: tuple[float, ...]
    log: bool = False


def axis(text: str, random: bool) -> Axis:
    """The axis that a text names; SceneError if it does not name one."""
    name, _, span = text.partition("=")
    name = name.strip()
    wrong = SceneError(f"--vary {text[:LONGEST]} is not understood; write it {HELP}")
    words = span.split(":")
    ratio = words[-1] == "log"
    words = words[: len(words) - ratio]
    try:
        if "," in span:
            values = tuple(map(float, span.split(",")))
        elif len(words) == 2 and random:
            values = (float(words[0]), float(words[1]))
        elif len(words) == 3 and not random:
            values = spread(float(words[0]), float(words[1]), int(words[2]), ratio)
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
    return Axis(name, values, ratio)


def spread(low: float, high: float, count: int, ratio: bool) -> tuple[float, ...]:
    """`count` values from low to high, both included."""
    if not 1 <= count <= MOST:
        raise ValueError
    if ratio and low > 0 and high > 0:
        return tuple(np.geomspace(low, high, count).tolist())
    with np.errstate(all="ignore"):  # what is not finite then is refused
        return tuple(np.linspace(low, high, count).tolist())


def points(axes: tuple[Axis, ...], random: int | None, seed: int) -> np.ndarray:
    """The points (n, len(axes)): the grid with the last axis fastest, or `random` points of a Latin hypercube.

    M. D. McKay, R. J. Beckman, W. J. Conover, Technometrics 21 (1979).
    """
    count = prod(len(each.values) for each in axes) if random is None else random
    if count > MOST:
        raise SceneError(f"{count} runs are more than {MOST}; take fewer values")
    if random is None:
        return np.array(list(product(*(each.values for each in axes))))
    from scipy.stats import qmc

    share = qmc.LatinHypercube(len(axes), rng=seed).random(random)
    columns = []
    for each, column in zip(axes, share.T, strict=True):
        low, high = each.values
        columns.append(np.exp(log(low) + column * (log(high) - log(low))) if each.log else low + column * (high - low))
    return np.array(columns).T
