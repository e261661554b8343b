"""Intervals by profile likelihood: how far one coordinate moves until the sum of squares exceeds a limit.

References
----------
D. M. Bates, D. G. Watts, Nonlinear Regression Analysis and Its Applications (1988), section 6.1
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from .fit_problem import FitProblem
from .uncertainty import Uncertainty

MAX_EVALUATIONS = 14
STUCK = 2  # trials in turn that move only one side of the bracket: the outer one may be on a higher branch
MAX_STEPS, MIN_GAIN = 40, 5e-4  # of a fit of the other coordinates; least gain of a step, in units of the limit
FARTHEST = 2.0  # times the farthest point of a profile, up to which a parabola is extrapolated
CLOSE = 0.02  # relative distance from the limit at which a bound is accepted, in standard errors
NEAR_LIMIT = 0.05  # distance of a coordinate from the limits of the fit at which it has no bound
WIDER, NEGLIGIBLE = 0.7, 0.1  # limits of other coordinates, moved by this, lower a profile by less than this share


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

    def fit_others(x: float) -> tuple[float, np.ndarray]:
        """Return the squares and coordinates with coordinate i at the distance x."""
        guess = extrapolate(path, x) if len(path) > 1 else z + tangent * x
        guess[i] = z[i] + side * x
        into_region = problem.region.constrained_step(np.eye(len(others)), np.zeros(len(others)), guess, others)
        if not np.isfinite(into_region).all():
            return np.inf, guess
        guess[others] += into_region
        if problem.residuals(guess, problem.all) is None:
            problem.region.learn(problem.is_refused, z, guess - z)
        return problem.minimize(guess, problem.all, MAX_STEPS, MIN_GAIN * target / uncertainty.squares, others)

    tangent = side * covariance[:, i] / max(covariance[i, i], 1e-300)
    x = float(np.clip(np.sqrt(target / uncertainty.variance * covariance[i, i]), 1e-6, 0.5))
    low, path, last = (0.0, excess(float(start @ start))), {0.0: z}, z
    before, is_below, n_in_turn = low, True, 0
    high: tuple[float, float] | None = None
    better: np.ndarray | None = None
    fits: dict[float, tuple[float, np.ndarray]] = {}
    for _ in range(MAX_EVALUATIONS):
        squares, there = fits[x] = min(fit_others(x), fits.get(x, (np.inf, z)), key=lambda fit: fit[0])
        if squares < uncertainty.squares - 0.02 * target:
            better = there
            if ends_at_better:
                return Bound(None, better)
        distance = excess(squares)
        if np.isfinite(distance):
            path[x] = last = there
        n_in_turn = n_in_turn + 1 if (distance < 0) == is_below else 1
        is_below = distance < 0
        if is_below:
            before, low = low, (x, distance)
            high = high if high and x < high[0] else None
        else:
            high = (x, distance)
        if abs(distance) < CLOSE or (high and high[0] - low[0] < 1e-3 * high[0]):
            break
        is_stuck = high and n_in_turn >= STUCK and (not is_below or extend_line(before, low, high[0]) < 0)
        if is_stuck:
            path = {a: path[a] for a in path if a <= low[0]}
        if high is None:
            x *= float(np.clip(1 / max(1 + distance, 1e-3), 1.05, 4.0))
        elif np.isfinite(high[1]) and is_stuck and is_below:
            x = high[0]  # fit it again, from the inner points
        elif np.isfinite(high[1]):
            x = low[0] + (high[0] - low[0]) * float(np.clip(-low[1] / (high[1] - low[1]), 0.1, 0.95))
        else:  # the region ends here
            x = (low[0] + high[0]) / 2
    else:
        x = high[0] if high and np.isfinite(high[1]) else np.inf  # the outer side of the bracket
    end = None if x == np.inf or depends_on_limits(problem, last, i, target) else float(z[i] + side * x)
    profile = [(x, excess(squares)) for x, (squares, _) in fits.items() if np.isfinite(squares)]
    return Bound(end, better, profile=tuple((float(z[i] + side * x), (1 + distance) ** 2) for x, distance in profile))


def extend_line(a: tuple[float, float], b: tuple[float, float], x: float) -> float:
    """Return the height at x of the line through two points."""
    return b[1] + (b[1] - a[1]) / (b[0] - a[0]) * (x - b[0])


def extrapolate(path: Mapping[float, np.ndarray], x: float) -> np.ndarray:
    """Return coordinates at the distance x, on the parabola through three points of a path, or the line through two."""
    near = sorted(path, key=lambda distance: abs(distance - x))[: 3 if x < FARTHEST * max(path) else 2]
    weights = [np.prod([(x - b) / (a - b) for b in near if b != a]) for a in near]
    return np.asarray(weights @ np.array([path[a] for a in near]))


def depends_on_limits(problem: FitProblem, z: np.ndarray, i: int, target: float) -> bool:
    """Return whether coordinate i is at a limit of the fit at z (k,), or wider limits of others lower its profile.

    At a minimum within limits, the squares fall by their slope where a limit moves, whatever the others then do.
    """
    limits = np.array([unknown.limits for unknown in problem.unknowns])
    outward = np.where(z < limits[:, 0] + NEAR_LIMIT, -1.0, 0.0) + np.where(z > limits[:, 1] - NEAR_LIMIT, 1.0, 0.0)
    e, others = problem.residuals(z, problem.all), np.flatnonzero(outward)
    if i in others or e is None:
        return True
    slopes = 2 * e @ problem.jacobian(z, e, problem.all, others, central=True)
    return bool((-slopes * outward[others] * WIDER > NEGLIGIBLE * target).any())
