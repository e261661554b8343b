"""Bisection on labels: values between which what motions end in changes."""

from collections.abc import Callable, Hashable
from typing import Any, TypeVar

import numpy as np

from ..process.interrupt import check_interrupt

PRECISION, MAX_HALVES = 1e-13, 200  # relative, of the values at edges
MAX_SPLITS = 4
RESOLVED = 1e-6  # relative width of an interval in which a third label is not due to rounding errors
Label = TypeVar("Label", bound=Hashable)


def find_edges(
    label: Callable[[Any], Label], a: Any, b: Any, one: Label, two: Label, splits: int = MAX_SPLITS
) -> list[tuple[Any, Any, Label, Label]]:
    """Return the edges between numbers or points a and b with labels one and two, as neighbours with their labels.

    Where a third label is between theirs, there are several edges, unless they are closer than RESOLVED. Of the many
    windows of chaotic motions, not all are found: an interval is split at most `splits` times. Then the second label of
    an edge is not the first one of the next edge, or not that of b.
    """
    if one == two:
        return []
    for _ in range(MAX_HALVES):
        if np.abs(b - a).max() <= PRECISION * np.abs(b).max():
            break
        check_interrupt()
        middle = 0.5 * (a + b)
        found = label(middle)
        if found == one:
            a = middle
        elif found == two or np.abs(b - a).max() <= RESOLVED * np.abs(b).max():
            b = middle
        elif not splits:
            b, two = middle, found
        else:
            splits -= 1
            return find_edges(label, a, middle, one, found, splits) + find_edges(label, middle, b, found, two, splits)
    return [(a, b, one, two)]
