"""Intervals by profile likelihood: how far one coordinate moves until the sum of squares exceeds a limit.

References
----------
D. M. Bates, D. G. Watts, Nonlinear Regression Analysis and Its Applications (1988), section 6.1
"""

from dataclasses import dataclass

import numpy as np

from .fit_problem import FitProblem
from .uncertainty import Uncertainty

MAX_EVALUATIONS = 14
CLOSE = 0.02  # relative distance from the limit at which a bound is accepted, in standard errors
NEAR_LIMIT = 0.05  # distance of a coordinate from the limits of the fit at which there is no bound


@dataclass(frozen=True)
class Bound:
    """End of an interval: the coordinate, None if there is none; a better minimum, if the profile met one.

    `profile` holds coordinates of the profile, with the squares above the minimum in units of the limit.
    """

    end: float | None
    better: np.ndarray | None = None
    profile: tuple[tuple[float, float], ...] = ()


def profile_bound(
    problem: FitProblem, z: np.ndarray, uncertainty: Uncertainty, i: int, side: int, ends_at_better: bool = True
) -> Bound:
    """Return how far coordinate `i` moves from z (k,) to one side until the squares exceed the limit of 95 %.

    The other coordinates are fitted at each position.

    Parameters
    ----------
    ends_at_better : bool
        Whether there is no end where a better minimum is met; otherwise the profile is followed on.
    """
    others = np.delete(np.arange(len(z)), i)
    target = uncertainty.variance * uncertainty.inflation[i] * uncertainty.quantile**2
    covariance = uncertainty.covariance
    start = problem.residuals(z, problem.all)
    assert start is not None

    def excess(squares: float) -> float:
        return float(np.sqrt(max(squares - uncertainty.squares, 0.0) / target)) - 1

    def fit_others(x: float, last: tuple[float, np.ndarray]) -> tuple[float, np.ndarray]:
        """Return the squares and coordinates with coordinate i at the distance x, extrapolated from the last ones."""
        guess = z + (last[1] - z) * (x / last[0])
        guess[i] = z[i] + side * x
        into_region = problem.region.constrained_step(np.eye(len(others)), np.zeros(len(others)), guess, others)
        if not np.isfinite(into_region).all():
            return np.inf, guess
        guess[others] += into_region
        if problem.residuals(guess, problem.all) is None:
            problem.region.learn(problem.is_refused, z, guess - z)
        max_steps = 20 if problem.central else 12
        return problem.minimize(guess, problem.all, max_steps, 0.002 * target / uncertainty.squares, others)

    tangent = side * covariance[:, i] / max(covariance[i, i], 1e-300)
    x = float(np.clip(np.sqrt(target / uncertainty.variance * covariance[i, i]), 1e-6, 0.5))
    low, last = (0.0, excess(float(start @ start))), (1.0, z + tangent)
    high: tuple[float, float] | None = None
    better: np.ndarray | None = None
    profile = []
    for _ in range(MAX_EVALUATIONS):
        squares, there = fit_others(x, last)
        if squares < uncertainty.squares - 0.02 * target:
            better = there
            if ends_at_better:
                return Bound(None, better)
        distance = excess(squares)
        if np.isfinite(distance):
            last = (x, there)
            profile.append((float(z[i] + side * x), (1 + distance) ** 2))
        if abs(distance) < CLOSE or (high and high[0] - low[0] < 1e-3 * high[0]):
            break
        low, high = ((x, distance), high) if distance < 0 else (low, (x, distance))
        if high is None:
            x *= float(np.clip(1 / max(1 + distance, 1e-3), 1.05, 4.0))
        elif np.isfinite(high[1]):
            x = low[0] + (high[0] - low[0]) * float(np.clip(-low[1] / (high[1] - low[1]), 0.1, 0.95))
        else:  # the region ends here
            x = (low[0] + high[0]) / 2
    end = None if is_at_limit(problem, last[1]) else float(z[i] + side * x)
    return Bound(end, better, profile=tuple(profile))


def is_at_limit(problem: FitProblem, z: np.ndarray) -> bool:
    """Return whether coordinates are at the limits of the fit."""
    limits = np.array([unknown.limits for unknown in problem.unknowns])
    return bool(((z < limits[:, 0] + NEAR_LIMIT) | (z > limits[:, 1] - NEAR_LIMIT)).any())
