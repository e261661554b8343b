"""A true motion, piece by piece."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

ParameterValues = dict[str, float]
MotionFunction = Callable[[Any], tuple[Any, Any]]  # position and speed at a time
ParameterSpan = tuple[
    float, float, ParameterValues
]  # from, to in s, and the values that hold; `rate` is that of the input, per s
Friction = Callable[[Mapping[str, Any]], tuple[Any, Any]]  # of values: the sliding force, and the most that is held


@dataclass(frozen=True)
class Segment:
    """From `start` (s) on in `mode`, up to the next piece: `at(t)` gives position and speed."""

    start: Any
    mode: int
    at: MotionFunction


def shift_time(at: MotionFunction, origin: Any) -> MotionFunction:
    """A motion with its time counted from elsewhere."""
    return lambda t: at(t - origin)


def constant_velocity(x: Any, v: Any) -> MotionFunction:
    """Constant speed."""
    return lambda s: (x + v * s, v)
