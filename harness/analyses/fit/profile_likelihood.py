"""Intervals by profile likelihood: how far one coordinate moves until the sum of squares exceeds a limit.

References
----------
D. M. Bates, D. G. Watts, Nonlinear Regression Analysis and Its Applications (1988), section 6.1
"""

from dataclasses import dataclass, replace

import numpy as np

from .fit_problem import FitProblem
from .uncertainty import Uncertainty

MAX_TRIALS = 14
MAX_STEPS, MIN_GAIN = 40, 5e-4  # of a fit of the other coordinates; smallest gain of a step, in units of the limit
LONGEST_FIRST_STEP = 0.25  # distance of the first trial
MIN_GROWTH, MAX_GROWTH = 0.05, 2.0  # next step outwards: smallest share of the distance, and ratio to the last step
MIN_SHARE, MAX_SHARE = 0.1, 0.95  # of a bracket, between which the next trial lies
FARTHEST = 2.0  # times the farthest inner trial, up to which a parabola is extrapolated
CLOSE = 0.02  # difference of a height from 1 at which a trial is the end
JUMP, SHORT = 0.1, 0.1  # excess height that indicates a higher branch; relative step that need not be shorter
NARROW = 0.01  # relative width of a bracket that needs no more trials, where the squares jump
BETTER = 0.02  # of the limit, by which the squares of a better minimum are lower
NEAR_LIMIT = 0.05  # distance of a coordinate from the limits of the fit at which it has no bound
WIDER, NEGLIGIBLE = 0.7, 0.1  # limits of other coordinates, moved by this, lower a profile by less than this share
FAR, FLAT = 5.0, 4.0  # distance of a tail in units of that of the end; excess below which it is flat, in limits


@dataclass(frozen=True)
class Bound:
    """One side of the interval of a coordinate.

    Attributes
    ----------
    end : float or None
        Coordinate of the end; None if the interval has none.
    better : numpy.ndarray or None
        Coordinates (k,) of a lower minimum, if the profile reaches one.
    profile : tuple of (float, float)
        Coordinates of the profile, and the squares above the minimum in units of the limit.
    has_flat_tail : bool
        Whether values far beyond the end fit nearly as well as those at the end. A small part of the record excludes
        them, such as the last samples, in which a slip begins or does not.
    """

    end: float | None
    better: np.ndarray | None = None
    profile: tuple[tuple[float, float], ...] = ()
    has_flat_tail: bool = False


@dataclass(frozen=True)
class Trial:
    """A fit with one coordinate at a distance from the minimum.

    Attributes
    ----------
    distance : float
        Distance of the coordinate from the minimum.
    height : float
        Root of the squares above the minimum, in units of the limit: 1 at the end of the interval, infinite if refused.
    z : numpy.ndarray
        Coordinates (k,).
    n_inner : int
        Number of inner trials from which its start was extrapolated.
    """

    distance: float
    height: float
    z: np.ndarray
    n_inner: int


class Bracket:
    """Trials of one side of a profile, about the distance at which it reaches its limit.

    A trial that is much higher than the inner ones suggest may be in a higher minimum of the other coordinates. It
    counts as outside until trials nearer to the inner ones show that the profile is as steep.

    Parameters
    ----------
    z : numpy.ndarray
        Coordinates (k,) of the minimum.
    tangent : numpy.ndarray
        Change (k,) of the coordinates with the distance, near the minimum.
    reach : float
        Distance of the limit if the squares are quadratic.
    height : float
        Height of the minimum; above 0 if another one is lower.

    Attributes
    ----------
    inner : list of Trial
        Trials below the limit, outwards, from the minimum on.
    outer : Trial or None
        The nearest trial outside.
    """

    def __init__(self, z: np.ndarray, tangent: np.ndarray, reach: float, height: float = 0.0) -> None:
        self.tangent, self.reach = tangent, reach
        self.inner: list[Trial] = [Trial(0.0, height, z, 0)]
        self.outer: Trial | None = None

    @property
    def slope(self) -> float:
        """Return the increase of the height with the distance at the last inner trials."""
        if len(self.inner) < 2:
            return (1 - self.inner[0].height) / self.reach
        before, last = self.inner[-2:]
        return max((last.height - before.height) / (last.distance - before.distance), 1e-300)

    @property
    def expected_end(self) -> float:
        """Return the distance at which the line through the last inner trials reaches the limit."""
        return self.inner[-1].distance + (1 - self.inner[-1].height) / self.slope

    def is_jump(self, trial: Trial) -> bool:
        """Return whether a trial may be on a higher branch."""
        last = self.inner[-1]
        step = trial.distance - last.distance
        return trial.height > last.height + self.slope * step + JUMP and step > SHORT * trial.distance

    def add(self, trial: Trial) -> None:
        """Add a trial between the last inner and the outer one, or one that replaces the outer one."""
        outer = self.outer
        if trial.height < 1 and not self.is_jump(trial):
            self.inner.append(trial)
            self.outer = outer if outer and trial.distance < outer.distance else None
        elif outer and outer.height < min(trial.height, 1.0):  # farther, yet lower: it is on the lower branch
            self.inner.append(outer)
            self.outer = None
        else:
            self.outer = trial

    def next_distance(self) -> float:
        """Return the distance of the next trial."""
        last, outer = self.inner[-1], self.outer
        expected = self.expected_end
        if outer is None and len(self.inner) == 1:
            return min(expected / 2, LONGEST_FIRST_STEP)
        if outer is None:
            step = max(MAX_GROWTH * (last.distance - self.inner[-2].distance), MIN_GROWTH * last.distance)
            return float(np.clip(expected, (1 + MIN_GROWTH) * last.distance, last.distance + step))
        width = outer.distance - last.distance
        if not np.isfinite(outer.height):
            return last.distance + width / 2
        if (outer.height < 1 or expected >= outer.distance) and outer.n_inner < len(self.inner):
            return outer.distance  # a fit from the last inner trial may be lower
        if self.is_jump(outer):
            return last.distance + width / 2
        share = (1 - last.height) / (outer.height - last.height)
        return last.distance + width * float(np.clip(share, MIN_SHARE, MAX_SHARE))

    def end(self) -> Trial | None:
        """Return the trial at the end of the profile, if it is known."""
        outer, last = self.outer, self.inner[-1]
        for trial in (last, outer):
            if trial and abs(trial.height - 1) < CLOSE and not self.is_jump(trial):
                return trial
        is_narrow = outer is not None and outer.height >= 1 and outer.distance - last.distance < NARROW * outer.distance
        return outer if is_narrow else None

    def fallback_end(self) -> Trial | None:
        """Return the end of a profile after too many trials; None if it does not reach its limit.

        Trials on higher branches may have ended it too early: the end is at least that of the line through the inner
        trials.
        """
        if self.outer is None:
            return None
        return Trial(max(self.outer.distance, self.expected_end), np.inf, self.inner[-1].z, len(self.inner))

    def extrapolate(self, distance: float) -> np.ndarray:
        """Return coordinates (k,) on the parabola through the last three inner trials, or the line through two."""
        if len(self.inner) == 1:
            return self.inner[0].z + self.tangent * distance
        near = self.inner[-3 if distance < FARTHEST * self.inner[-1].distance else -2 :]
        x = [trial.distance for trial in near]
        weights = [np.prod([(distance - b) / (a - b) for b in x if b != a]) for a in x]
        return np.asarray(weights @ np.array([trial.z for trial in near]))


def profile_bound(
    problem: FitProblem,
    z: np.ndarray,
    uncertainty: Uncertainty,
    i: int,
    side: int,
    ends_at_better: bool = True,
    excess: float = 0.0,
) -> Bound:
    """Return how far coordinate `i` moves from z (k,) to one side until the squares exceed the limit of 95 %.

    The other coordinates are fitted at each position.

    Parameters
    ----------
    ends_at_better : bool
        Whether the search stops, without an end, at a better minimum; otherwise it follows the profile further.
    excess : float
        Squares at z above the minimum, less than those of the limit; above 0 where z is another minimum.
    """
    target = uncertainty.limit(i)
    variance = max(uncertainty.covariance[i, i], 1e-300)
    reach = max(float(np.sqrt((target - excess) / uncertainty.variance * variance)), 1e-6)
    bracket = Bracket(z, side * uncertainty.covariance[:, i] / variance, reach, float(np.sqrt(excess / target)))
    low, high = problem.unknowns[i].limits
    farthest = high - z[i] if side > 0 else z[i] - low
    better: np.ndarray | None = None
    end: Trial | None = None
    for _ in range(MAX_TRIALS):
        distance = min(bracket.next_distance(), farthest)
        starts = [bracket.extrapolate(distance), bracket.inner[-1].z.copy()]
        goal = uncertainty.squares + target
        squares, position = fit_at(problem, z, uncertainty, i, side * distance, starts, goal)
        if squares < uncertainty.squares - BETTER * target:
            better = position
            if ends_at_better:
                return Bound(None, better)
        height = float(np.sqrt(max(squares - uncertainty.squares, 0.0) / target))
        bracket.add(Trial(distance, height, position, len(bracket.inner)))
        end = bracket.end()
        if end or bracket.inner[-1].distance >= farthest:
            break
    else:
        end = bracket.fallback_end()
    trials = [*bracket.inner[1:], *([end] if end and end.height >= 1 else [])]
    profile = tuple((float(trial.z[i]), trial.height**2) for trial in trials if np.isfinite(trial.height))
    position = next(trial.z for trial in (end, bracket.inner[-1]) if trial and np.isfinite(trial.height))
    if end is None or depends_on_limits(problem, position, i, target):
        return Bound(None, better, profile)
    coordinate = float(z[i] + side * end.distance)
    return Bound(coordinate if low < coordinate < high else None, better, profile)


def search_bound(
    problem: FitProblem, z: np.ndarray, uncertainty: Uncertainty, i: int, side: int, ends_at_better: bool = True
) -> Bound:
    """Return the bound of coordinate `i` on one side of the minimum at z (k,), and what lies far behind it.

    Where the squares there are below the limit, the bound of `profile_bound` is a ridge, and the profile is followed on
    from behind it.
    """
    bound = profile_bound(problem, z, uncertainty, i, side, ends_at_better)
    if bound.end is None:
        return bound
    target, distance = uncertainty.limit(i), FAR * abs(bound.end - z[i])
    low, high = problem.unknowns[i].limits
    distance = min(distance, high - z[i] if side > 0 else z[i] - low)
    if distance**2 < 2 * FLAT * (bound.end - z[i]) ** 2:  # where squares that are quadratic are not much above FLAT
        return bound
    tangent = side * uncertainty.covariance[:, i] / max(uncertainty.covariance[i, i], 1e-300)
    goal = uncertainty.squares + FLAT * target
    squares, position = fit_at(problem, z, uncertainty, i, side * distance, [z + distance * tangent, z.copy()], goal)
    excess = (squares - uncertainty.squares) / target
    if excess < -BETTER and ends_at_better:
        return Bound(None, position)
    if excess < 1:
        far_bound = profile_bound(problem, position, uncertainty, i, side, ends_at_better, max(excess, 0.0) * target)
        return replace(far_bound, profile=bound.profile + far_bound.profile)
    return replace(bound, has_flat_tail=excess < FLAT)


def fit_at(
    problem: FitProblem,
    z: np.ndarray,
    uncertainty: Uncertainty,
    i: int,
    displacement: float,
    starts: list[np.ndarray],
    goal: float,
) -> tuple[float, np.ndarray]:
    """Return the least squares and the coordinates with coordinate `i` displaced from z (k,); see `fit_others`."""
    for start in starts:
        start[i] = z[i] + displacement
    limit = uncertainty.limit(i)
    min_gain = MIN_GAIN * limit / max(uncertainty.squares, limit)  # the squares may be 0
    return fit_others(problem, z, starts, np.delete(np.arange(len(z)), i), min_gain, goal)


def fit_others(
    problem: FitProblem, z: np.ndarray, starts: list[np.ndarray], others: np.ndarray, min_gain: float, limit: float
) -> tuple[float, np.ndarray]:
    """Fit the `others` from the best of the starts (k,); return the sum of squares and the coordinates.

    The sum is infinite if the region holds no such values of the others, and need not be the smallest one above the
    limit. The path from z (k,) to a start shows where the FMU refuses values.
    """
    best, lowest = starts[0], np.inf
    for start in starts:
        into_region = problem.region.constrained_step(np.eye(len(others)), np.zeros(len(others)), start, others)
        if not np.isfinite(into_region).all():
            return np.inf, start
        start[others] += into_region
        e = problem.residuals(start, problem.all_samples)
        if e is None:
            problem.region.add_refusal(problem.is_refused, z, start - z)
        elif e @ e < lowest:
            best, lowest = start, e @ e
    return problem.minimize(best, problem.all_samples, MAX_STEPS, min_gain, others, goal=limit)


def depends_on_limits(problem: FitProblem, z: np.ndarray, i: int, target: float) -> bool:
    """Return whether coordinate i is at a limit of the fit at z (k,), or wider limits of others lower its profile.

    At a minimum within limits, the squares fall by at least their slope times the shift of a limit.
    """
    limits = np.array([unknown.limits for unknown in problem.unknowns])
    outward = np.where(z < limits[:, 0] + NEAR_LIMIT, -1.0, 0.0) + np.where(z > limits[:, 1] - NEAR_LIMIT, 1.0, 0.0)
    e, others = problem.residuals(z, problem.all_samples), np.flatnonzero(outward)
    if i in others or e is None:
        return True
    slopes = 2 * e @ problem.jacobian(z, e, problem.all_samples, others, central=True)
    return bool((-slopes * outward[others] * WIDER > NEGLIGIBLE * target).any())
