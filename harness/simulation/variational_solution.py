"""What a run with derivatives returns."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class EventDerivative:
    """An event.

    Attributes
    ----------
    t : float
        Time in s.
    indicator : int
        Index of the event indicator.
    before, after : tuple of int
        Modes of the contacts of an FMU of this project.
    slopes : numpy.ndarray
        Derivatives (parameters,) of the time.
    """

    t: float
    indicator: int
    before: tuple[int, ...]
    after: tuple[int, ...]
    slopes: np.ndarray


@dataclass(frozen=True)
class UndefinedDerivative:
    """A time in s from which derivatives by some parameters (k,) do not exist, its indicator (-1: none), and why.

    If `is_moment`, they exist again after this time.
    """

    t: float
    indicator: int
    reason: str
    parameters: tuple[str, ...]
    is_moment: bool = False


@dataclass(frozen=True)
class VariationalSolution:
    """Outputs and their derivatives.

    Attributes
    ----------
    values : numpy.ndarray
        Outputs (times, outputs).
    left, right : numpy.ndarray
        Derivatives (times, parameters, outputs) for decreasing and for increasing parameters, NaN where they do not
        exist. The derivative exists where they are equal.
    is_used : numpy.ndarray
        Whether something depends on each parameter (parameters,).
    events, undefined_derivatives
        Events, and times at which derivatives cease to exist.
    n_steps, n_rhs : int
        Steps, and evaluations of the right-hand side.
    """

    values: np.ndarray
    left: np.ndarray
    right: np.ndarray
    is_used: np.ndarray
    events: tuple[EventDerivative, ...]
    undefined_derivatives: tuple[UndefinedDerivative, ...]
    n_steps: int
    n_rhs: int
