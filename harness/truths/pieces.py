"""A true motion, piece by piece."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

Values = dict[str, float]
Course = Callable[[Any], tuple[Any, Any]]  # position and speed at a time
Span = tuple[float, float, Values]  # from, to in s, and the values that hold


@dataclass(frozen=True)
class Piece:
    """From `start` (s) on in `mode`, up to the next piece: `at(t)` gives position and speed."""

    start: Any
    mode: int
    at: Course
