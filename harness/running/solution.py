"""Solution of one problem by one solver."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Solution:
    """Solution of a problem at given points.

    Attributes
    ----------
    states : numpy.ndarray
        States (n, states) at the n points in SI units, position and velocity first.
    events : list of (float, int) or None
        Changes of mode as (time in s, new mode); None if the solver does not report them.
    evaluations : int
        Evaluations of right-hand sides and Jacobians.
    """

    states: np.ndarray
    events: list[tuple[float, int]] | None
    evaluations: int
