"""Segments of a reference motion, from one event or change of values to the next."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

ParameterValues = dict[str, float]
MotionFunction = Callable[[Any], tuple[Any, Any]]  # position and velocity at a time
ParameterSpan = tuple[float, float, ParameterValues]  # start and end in s, and values; `rate` is that of the input
FrictionLaw = Callable[[Mapping[str, Any]], tuple[Any, Any]]  # from values: sliding force, largest load that it holds


@dataclass(frozen=True)
class Segment:
    """Motion in one `mode` from `start` (s) to the next segment; `at(t)` returns position and velocity."""

    start: Any
    mode: int
    at: MotionFunction


def shift_time(at: MotionFunction, origin: Any) -> MotionFunction:
    """Return a motion whose time starts at `origin` instead of 0."""
    return lambda t: at(t - origin)


def constant_velocity(x: Any, v: Any) -> MotionFunction:
    """Return a motion of constant velocity."""
    return lambda s: (x + v * s, v)
