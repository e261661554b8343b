"""Solution of one problem by a reference or a peer solver."""

from dataclasses import dataclass
from math import nan

import numpy as np

Events = list[tuple[float, int]]  # changes of mode as (time in s, new mode)


@dataclass(frozen=True)
class Solution:
    """Solution of a problem at given points.

    Attributes
    ----------
    times : numpy.ndarray
        Times (n,) in s.
    states : numpy.ndarray
        States (n, states) at the times in SI units, position and velocity first.
    events : list of (float, int) or None
        Changes of mode after the start as (time in s, new mode); None if the solver does not report them.
    evaluations : int
        Evaluations of right-hand sides and Jacobians.
    steps : int
        Internal steps; 0 if they are not known.
    start_mode : int or None
        Mode at the start; None if nothing sticks or it is not known.
    method : str
        Name of the solver, or names of the methods that were compared.
    estimated_error : float
        Largest difference of two methods, relative to the largest value of each column; NaN if it is not known.
    """

    times: np.ndarray
    states: np.ndarray
    events: Events | None = None
    evaluations: int = 0
    steps: int = 0
    start_mode: int | None = None
    method: str = ""
    estimated_error: float = nan

    @property
    def modes(self) -> Events:
        """Return all modes, each with the time in s at which it begins; empty if nothing sticks."""
        if self.start_mode is None:
            return []
        return [(float(self.times[0]), self.start_mode), *(self.events or [])]
