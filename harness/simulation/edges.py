"""Bisection on labels: values between which what motions end in changes."""

from collections.abc import Callable, Hashable
from typing import Any, TypeVar

import numpy as np

from ..process.interrupt import check_interrupt

PRECISION, MAX_HALVES = 1e-13, 200  # relative, of the values at edges
MAX_SPLITS = 4
RESOLUTION = 1e-6  # relative width of an interval in which a third label is not due to rounding errors
Label = TypeVar("Label", bound=Hashable)


def find_edges(
    label: Callable[[Any], Label], a: Any, b: Any, label_a: Label, label_b: Label, splits: int = MAX_SPLITS
) -> list[tuple[Any, Any, Label, Label]]:
    """Return the edges between numbers or points a and b, as neighbours with their labels.

    Where a third label is between them, there are several edges, unless they are closer than RESOLUTION. Of the many
    windows of chaotic motions, not all are found: an interval is split at most `splits` times. Then the second label of
    an edge is not the first one of the next edge, or not that of b.
    """
    if label_a == label_b:
        return []
    for _ in range(MAX_HALVES):
        if np.abs(b - a).max() <= PRECISION * np.abs(b).max():
            break
        check_interrupt()
        middle = 0.5 * (a + b)
        middle_label = label(middle)
        if middle_label == label_a:
            a = middle
        elif middle_label == label_b or np.abs(b - a).max() <= RESOLUTION * np.abs(b).max():
            b = middle
        elif not splits:
            b, label_b = middle, middle_label
        else:
            splits -= 1
            edges_below = find_edges(label, a, middle, label_a, middle_label, splits)
            return edges_below + find_edges(label, middle, b, middle_label, label_b, splits)
    return [(a, b, label_a, label_b)]
