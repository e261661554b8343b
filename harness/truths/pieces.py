"""A true motion, piece by piece."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

Values = dict[str, float]
Course = Callable[[Any], tuple[Any, Any]]  # position and speed at a time
Span = tuple[float, float, Values]  # from, to in s, and the values that hold; `rate` is that of the input, per s
Friction = Callable[[Mapping[str, Any]], tuple[Any, Any]]  # of values: the sliding force, and the most that is held


@dataclass(frozen=True)
class Piece:
    """From `start` (s) on in `mode`, up to the next piece: `at(t)` gives position and speed."""

    start: Any
    mode: int
    at: Course


def later(at: Course, origin: Any) -> Course:
    """A motion with its time counted from elsewhere."""
    return lambda t: at(t - origin)


def gliding(x: Any, v: Any) -> Course:
    """Constant speed."""
    return lambda s: (x + v * s, v)
