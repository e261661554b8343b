"""What one solver answers to one problem, whichever way it was asked."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Solution:
    """The states `motion` (n, states), position and speed first, at the n points asked for (SI units), changes of mode
    `events` as (time in s, new mode), None where the solver was not asked for them, and the right-hand sides and
    Jacobians that were evaluated."""

    states: np.ndarray
    events: list[tuple[float, int]] | None
    evaluations: int
