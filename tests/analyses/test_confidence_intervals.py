"""Confidence intervals of nonnegative quantities, and of few samples."""

from dataclasses import replace
from statistics import NormalDist
from types import SimpleNamespace

import numpy as np
import pytest

import harness
from harness.analyses.decay.intervals import (
    confidence_interval,
    estimate_uncertainty,
    nonnegative_interval,
)

T0, REST, OMEGA, ZETA = 0, 2, 4, 5  # in the order of the unknowns


def test_a_single_interval_is_that_of_the_likelihood_ratio():
    """The accepted means m fulfil (z - m)^2 <= 1.96^2 + min(z, 0)^2, and are not negative."""
    for z in (-3.0, -0.4, 0.0, 1.0, 1.95, 4.0):
        half = np.hypot(NormalDist().inv_cdf(0.975), min(z, 0.0))
        expected = (max(z - half, 0.0), z + half)
        assert nonnegative_interval(np.array([z]), np.eye(1)) == pytest.approx(expected, abs=2e-4)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("rho", "means"),
    [
        (-0.98, (0.0, 0.0)),
        (-0.98, (0.0, 5.0)),
        (-0.98, (2.0, 0.0)),
        (0.5, (0.0, 1.0)),
        (0.5, (0.3, 0.0)),
        (0.5, (2.0, 2.0)),
    ],
)
def test_joint_nonnegative_intervals_cover_95_percent(means, rho):
    """Of 400 draws; more at zero, where the interval is shorter for it."""
    correlation = np.array([[1.0, rho], [rho, 1.0]])
    z = np.random.default_rng(1).multivariate_normal(means, correlation, 400)
    low, high = np.array([nonnegative_interval(item, correlation) for item in z]).T
    assert np.mean((low <= means[0]) & (means[0] <= high)) > 0.92
    if means == (0.0, 0.0) and rho < 0:
        single = np.array([nonnegative_interval(item[:1], np.eye(1)) for item in z])
        assert np.mean(high) < 0.5 * np.mean(single[:, 1])


@pytest.mark.parametrize("rho", [0.0, 0.5, -0.98])
def test_an_interval_is_continuous_in_the_correlation(rho):
    """The correlation may decide the signs of the axes, and the axes themselves if they are equal."""
    correlation = np.array([[1.0, rho, 0.0], [rho, 1.0, 0.0], [0.0, 0.0, 1.0]])
    intervals = []
    for last in np.random.default_rng(1).uniform(-4e-16, 4e-16, (8, 3, 3)):
        intervals.append(nonnegative_interval(np.array([0.5, 1.0, 0.3]), correlation + last + last.T))
    assert np.ptp(intervals, axis=0).max() < 1e-9


@pytest.mark.parametrize(
    ("freedom", "quantile"), [(1, 12.7062), (2, 4.3027), (9, 2.2622), (100, 1.9840), (10**6, 1.96)]
)
def test_intervals_of_few_samples_are_those_of_student(freedom, quantile):
    """Quantiles at 97.5 % of a printed table."""
    low, high = confidence_interval(0, np.array([OMEGA]), np.array([5.0]), np.array([0.1]), np.eye(1), freedom)
    assert (low, high) == pytest.approx((5.0 - 0.1 * quantile, 5.0 + 0.1 * quantile), abs=1e-5)


def test_unconstrained_values_are_those_of_least_squares_with_a_negative_loss():
    t, unknowns, p = np.linspace(0.0, 10.0, 200), np.array([T0, REST, ZETA]), np.zeros(8)
    columns, p[OMEGA] = np.stack([np.cos(t), np.ones_like(t), t], axis=1), 2.0
    y = 1.0 - 0.3 * t + np.random.default_rng(1).normal(size=len(t))
    problem = SimpleNamespace(
        t=t,
        x=y,
        scale=1.0,
        model=SimpleNamespace(t_mid=5.0),
        residual_floor=0.0,
        noise=0.0,
        unknowns=lambda terms: unknowns,
        residuals=lambda p, terms: (columns @ p[unknowns] - y, columns),
    )
    expected = np.linalg.lstsq(columns, y, rcond=None)[0]
    assert estimate_uncertainty(problem, p, ("zeta",)).unconstrained_values == pytest.approx(expected, rel=1e-9)
    assert expected[2] < -0.2


def test_the_product_of_a_loss_and_an_uncertain_factor_is_not_negative():
    t = np.linspace(0.0, 10.0, 301)
    decay = harness.identify_decay(t, np.exp(-0.2 * t) * np.cos(6.0 * t), unit="m")
    loss = replace(decay["zeta"], value=1.0, error=0.4, low=0.2, high=1.8)
    force = loss.multiply(2.0, "f", "N", "", relative_error=0.5)
    assert (force.value, force.low) == (2.0, 0.0)
    assert force.high == pytest.approx(2.0 + np.hypot(1.6, NormalDist().inv_cdf(0.975)))
    assert force.error == pytest.approx(np.hypot(0.8, 1.0))
