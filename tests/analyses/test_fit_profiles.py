"""Least squares, differences and profiles of a fit, whose answers have a closed form."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from harness.analyses.fit.fit_problem import EXACT_STEPS, FeasibleRegion, FitProblem, Unknown
from harness.analyses.fit.fit_procedure import Uncertainty, estimate_uncertainty, extend_ends, starting_points
from harness.analyses.fit.profile_likelihood import depends_on_limits, profile_bound, search_bound

QUANTILE = 1.96  # for many residuals
MINIMUM = np.array([1.0, 1.0])


class Residuals(FitProblem):
    """A fit of the coordinates a and b whose residuals are a function of both."""

    def __init__(self, residuals, reach=40.0):
        self.unknowns = tuple(Unknown(name, name, "", np.exp(-reach), np.exp(reach)) for name in "ab")
        self.region, self.steps, self.central, self.all_samples = FeasibleRegion(self.unknowns), EXACT_STEPS, False, ()
        self.function, self.n_runs, self.derivatives = residuals, 0, None

    def residuals(self, z, selection):
        self.n_runs += 1
        return np.array(self.function(*z))


def uncertainty_at(problem, z):
    """Return the uncertainty at z with unit variance."""
    e = problem.residuals(z, ())
    jacobian = problem.jacobian(z, e, (), np.arange(2), central=True)
    covariance = np.linalg.inv(jacobian.T @ jacobian)
    residuals = np.concatenate([e, np.zeros(100_000)])
    return Uncertainty(float(e @ e), 1.0, covariance, np.ones(2), np.zeros((2, 0)), residuals, 0.0, np.zeros(2))


def valley(a, b):
    """Return the residuals of a narrow curved valley, b = a^2, whose minimum is at a = 1."""
    return 1000.0 * (b - a * a), 2.0 * (np.exp(a - 1.0) - 1.0), 1.0


def test_a_curved_valley_is_followed_to_its_minimum():
    problem = Residuals(valley)
    squares, z = problem.minimize(np.array([3.0, 9.0]), (), 60, 1e-12, central=True)
    assert squares == pytest.approx(1.0, abs=1e-6)
    assert z == pytest.approx(MINIMUM, abs=1e-4)
    assert problem.n_runs < 200


@pytest.mark.parametrize(("floor", "share"), [(100.0, 0.5), (0.9, 1.0)])
def test_a_fit_ends_early_only_where_its_goal_is_out_of_reach(floor, share):
    """The floor of the valley lies above the goal, a sum of squares of 1, or below."""
    counts, ends = [], []
    for goal in (np.inf, 1.0):
        problem = Residuals(lambda a, b: (*valley(a, b)[:2], floor))
        ends.append(problem.minimize(np.array([3.0, 9.0]), (), 40, 1e-9, central=True, goal=goal)[1])
        counts.append(problem.n_runs)
    assert counts[1] <= share * counts[0]
    assert share < 1.0 or ends[1] == pytest.approx(MINIMUM, abs=1e-4)


def test_a_profile_follows_a_curved_valley():
    """The profile of a is 2 (exp(a - 1) - 1), and that of b follows from b = a^2."""
    problem = Residuals(valley)
    uncertainty = uncertainty_at(problem, MINIMUM)
    ends = {(i, side): profile_bound(problem, MINIMUM, uncertainty, i, side).end for i in (0, 1) for side in (-1, 1)}
    residuals = [2 * (np.exp(a - 1) - 1) for a in (ends[0, -1], ends[0, 1], np.sqrt(ends[1, 1]))]
    assert residuals == pytest.approx([-QUANTILE, QUANTILE, QUANTILE], rel=0.03)


@pytest.mark.parametrize("height", [15.0, 3.3, 1.5, 1.0])
def test_a_profile_returns_from_a_higher_branch(height):
    """A straight path to a trial ends in a second minimum of b, 1.5 above the bent valley.

    If it is little higher, the next trials, nearer to the minimum of all, can end there as well, even below the limit.
    """

    def residuals(a, b):
        w = (b - 1.0 - 0.5 * np.tanh(8.0 * (a - 1.0))) / 1.5
        return 2.5 * (a - 1.0), 90.0 * w * (w - 1.0) / (0.5 + np.abs(w)), height * w, 1.0

    problem = Residuals(residuals)
    end = profile_bound(problem, MINIMUM, uncertainty_at(problem, MINIMUM), 0, 1).end
    assert end - 1 == pytest.approx(QUANTILE / 2.5, rel=0.03)


@pytest.mark.parametrize("slope", [1.0, 1e-9])
def test_a_profile_ends_where_the_squares_jump(slope):
    problem = Residuals(lambda a, b: (slope * (a - 1.0) + 5.0 * (a > 1.3), b - 1.0, 1.0))
    uncertainty = uncertainty_at(problem, MINIMUM)
    assert profile_bound(problem, MINIMUM, uncertainty, 0, 1).end == pytest.approx(1.3, abs=0.003)


@pytest.mark.parametrize(("residual", "is_flat"), [(2.7, True), (3.8, True), (4.2, False), (1e3, False)])
def test_a_profile_that_rises_little_beyond_its_end_has_a_flat_tail(residual, is_flat):
    """The squares rise to residual^2 above the minimum, and are flat up to four times those at the end."""
    problem = Residuals(lambda a, b: (residual * np.tanh((a - 1.0) / 0.01 / residual), b - 1.0, 1.0))
    bound = search_bound(problem, MINIMUM, uncertainty_at(problem, MINIMUM), 0, 1)
    assert bound.end - 1.0 == pytest.approx(0.01 * residual * np.arctanh(QUANTILE / residual), rel=0.03)
    assert bound.has_flat_tail == is_flat


def test_a_better_minimum_beyond_the_end_of_a_profile_is_found():
    """A ridge at a = 1.07 separates the minimum at 1 from lower squares farther out."""

    def residuals(a, b):
        u = (a - 1.0) / 0.1
        return 6.0 * u * np.exp(-u * u), b - 1.0, 1.0 - 0.5 * np.tanh(u**4)

    problem = Residuals(residuals)
    bound = search_bound(problem, MINIMUM, uncertainty_at(problem, MINIMUM), 0, 1)
    assert bound.end is None
    assert bound.better[0] > 1.1


def test_a_profile_goes_on_behind_a_ridge():
    """The ridge at a = 1.07 rises above the limit, which the valley behind it reaches at a = 4.26."""

    def residuals(a, b):
        u = (a - 1.0) / 0.1
        return 6.0 * u * np.exp(-u * u) + 0.7 * np.tanh(u**4) + max(a - 3.0, 0.0), b - 1.0, 1.0

    problem = Residuals(residuals)
    bound = search_bound(problem, MINIMUM, uncertainty_at(problem, MINIMUM), 0, 1)
    assert bound.end == pytest.approx(3.0 + QUANTILE - 0.7, rel=0.01)


def test_a_profile_that_never_reaches_its_limit_has_no_end():
    problem = Residuals(lambda a, b: (0.5 * np.tanh(a - 1.0), b - 1.0, 1.0))
    assert profile_bound(problem, MINIMUM, uncertainty_at(problem, MINIMUM), 0, 1).end is None


@pytest.mark.parametrize("side", [-1, 1])
def test_a_profile_without_an_end_stops_at_the_limit_of_the_fit(side):
    problem = Residuals(lambda a, b: (0.1 * (a - 1.0), b - 1.0, 1.0), reach=3.0)
    bound = profile_bound(problem, MINIMUM, uncertainty_at(problem, MINIMUM), 0, side)
    assert bound.end is None
    assert bound.profile[-1][0] == pytest.approx(problem.unknowns[0].limits[side > 0], abs=1e-9)


@pytest.mark.parametrize("excess", [0.0, 0.7])
def test_a_profile_from_another_minimum_starts_at_its_height(excess):
    """The limit is where the squares of that minimum and of the distance exceed those of the best one by 1.96^2."""
    problem = Residuals(lambda a, b: (a - 1.0, b - 1.0, 1.0))
    uncertainty = uncertainty_at(problem, MINIMUM)
    excess *= uncertainty.limit(0)
    best = replace(uncertainty, squares=uncertainty.squares - excess)
    end = profile_bound(problem, MINIMUM, best, 0, 1, excess=excess).end
    assert end - 1.0 == pytest.approx(np.sqrt(QUANTILE**2 - excess), rel=0.03)


def test_an_interval_extends_to_the_end_of_the_profile_of_another_minimum():
    """The squares rise to both sides of a = 1, and of a = 2 from 0.8 of the limit on."""
    excess, width = 0.8 * QUANTILE**2, 0.2
    problem = Residuals(
        lambda a, b: ((a - 1.0) / width if a < 1.5 else np.hypot(np.sqrt(excess), (a - 2.0) / width), b - 1.0, 1.0)
    )
    ends = {(0, 1): 1.0 + QUANTILE * width}
    extend_ends(problem, MINIMUM, uncertainty_at(problem, MINIMUM), ends, [(1.0 + excess, np.array([2.0, 1.0]))])
    assert ends[0, 1] - 2.0 == pytest.approx(width * np.sqrt(QUANTILE**2 - excess), rel=0.03)


def test_a_start_value_of_one_unknown_leaves_the_others_in_the_middle_of_their_ranges():
    a, b = Unknown("a", "a", "", 1.0, 16.0, start=2.0), Unknown("b", "b", "", 1.0, 16.0)
    problem = SimpleNamespace(unknowns=(a, b), low=np.log([1.0, 1.0]), high=np.log([16.0, 16.0]))
    assert np.exp(starting_points(problem, None)) == pytest.approx(np.array([[2.0, 4.0]]))


@pytest.mark.parametrize(("coupling", "has_end"), [(0.0, True), (1.0, False)])
def test_a_limit_of_another_coordinate_ends_a_profile_only_where_it_matters(coupling, has_end):
    """The record hardly determines b, which is at its limit: of a, or of a sum with b, it determines the value."""
    problem = Residuals(lambda a, b: (20.0 * (a - 1.0 + coupling * b), 1e-3 * (b - 10.0), 1.0), reach=3.0)
    _, z = problem.minimize(np.array([0.5, 0.5]), (), 60, 1e-12, central=True)
    assert z[1] == pytest.approx(problem.unknowns[1].limits[1])
    assert (profile_bound(problem, z, uncertainty_at(problem, z), 0, -1).end is not None) == has_end


def test_differences_of_runs_that_scatter_show_how_weak_a_direction_is():
    """Residuals scatter by 1e-7, as those of runs with step control do."""
    random, matrix = np.random.default_rng(1), np.random.default_rng(0).normal(size=(2000, 1)) * [1.0, 1.0]
    matrix[:, 1] += 0.01 * np.random.default_rng(2).normal(size=2000)
    problem = Residuals(lambda a, b: matrix @ [a, b] + 1e-7 * random.normal(size=2000))
    jacobian = problem.choose_steps(MINIMUM, problem.residuals(MINIMUM, ()))
    errors, expected = (np.sqrt(np.diag(np.linalg.inv(slopes.T @ slopes))) for slopes in (jacobian, matrix))
    assert errors == pytest.approx(expected, rel=0.1)


@pytest.mark.parametrize(
    ("z", "best", "expected"),
    [
        ((0.0, 0.0), 0.0, False),
        ((1.68, 0.0), 0.0, True),
        ((0.0, 1.68), 0.0, False),
        ((0.0, 1.68), 100.0, True),
        ((0.0, -1.68), 100.0, False),
    ],
)
def test_a_profile_depends_on_a_limit_that_it_reaches_or_that_ends_the_fall_of_the_squares(z, best, expected):
    """The limits of a and b are 1 + ln 2 and its negative; the least squares are at a = 0 and b = `best`."""
    problem = Residuals(lambda a, b: (a, b - best), reach=1.0)
    assert depends_on_limits(problem, np.array(z), 0, 1.0) is expected


def test_the_error_of_the_inputs_is_added_to_the_variance():
    random = np.random.default_rng(1)
    jacobian, e, error = random.normal(size=(400, 2)), random.normal(size=400), random.normal(size=400)
    problem = SimpleNamespace(
        all_samples=(),
        residuals=lambda z, selection: e,
        choose_steps=lambda z, e: jacobian,
        records=[SimpleNamespace(y=e[:, None], step=np.zeros(1), noise=np.ones(1), scatter=np.ones(1))],
    )
    without, with_error = (estimate_uncertainty(problem, MINIMUM, size * error, 0.0).deviations for size in (0.0, 9.0))
    shift = 9.0 * np.linalg.pinv(jacobian) @ error
    assert with_error**2 == pytest.approx(without**2 + shift**2)


@pytest.mark.parametrize(
    ("count", "correlation", "quantile"), [(1002, 0.0, 1.9623), (1002, 0.3, 2.0860), (12, 0.3, 2.2281)]
)
def test_correlated_residuals_have_at_most_20_degrees_of_freedom(count, correlation, quantile):
    """Quantiles of a printed table."""
    uncertainty = uncertainty_at(Residuals(valley), MINIMUM)
    uncertainty = replace(uncertainty, residuals=np.zeros(count), correlation=correlation)
    assert uncertainty.quantile == pytest.approx(quantile, abs=1e-4)
