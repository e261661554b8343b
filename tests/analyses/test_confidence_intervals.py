"""Confidence intervals of nonnegative quantities, and of few samples."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import norm

import harness
from harness.analyses.decay.intervals import (
    N_DRAWS,
    confidence_interval,
    estimate_uncertainty,
    nonnegative_interval,
    quasirandom_normal,
)

T0, REST, OMEGA, ZETA = 0, 2, 4, 5  # in the order of the unknowns


def test_nonnegative_intervals_cover_95_percent():
    """Checked with the probabilities of a normal distribution, for each mean and each measured value."""
    step = 0.04
    z = np.arange(-4.0, 9.0, step)
    low, high = np.array([nonnegative_interval(np.array([item]), np.eye(1)) for item in z]).T
    for mean in (0.0, 0.3, 1.0, 2.0, 3.0, 5.0):
        share = step * np.sum(norm.pdf(z - mean)[(low <= mean) & (mean <= high)])
        assert share == pytest.approx(0.95, abs=0.004), mean


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
    """Of 200 draws; more only where both are zero, where the interval is shorter for it."""
    correlation = np.array([[1.0, rho], [rho, 1.0]])
    z = np.random.default_rng(1).multivariate_normal(means, correlation, 200)
    low, high = np.array([nonnegative_interval(item, correlation) for item in z]).T
    assert 0.9 < np.mean((low <= means[0]) & (means[0] <= high)) < (1.0 if means == (0.0, 0.0) else 0.985)
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


def test_the_draws_are_those_of_the_additive_recurrence_of_roberts():
    """Its generator is the root of g^(k + 1) = g + 1; the draws begin with its first multiple and fill the interval."""
    for k in (1, 2, 3):
        g = max(root.real for root in np.roots([1, *[0] * (k - 1), -1, -1]) if abs(root.imag) < 1e-12)
        uniform = norm.cdf(quasirandom_normal(k))
        assert uniform.shape == (k, N_DRAWS)
        for i, row in enumerate(uniform, 1):
            assert row[0] == pytest.approx((0.5 + g**-i) % 1, abs=1e-12)
            assert row[-1] == pytest.approx((0.5 + N_DRAWS * g**-i) % 1, abs=1e-9)
            assert np.abs(np.sort(row) - (np.arange(N_DRAWS) + 0.5) / N_DRAWS).max() < 10 / N_DRAWS


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
    assert estimate_uncertainty(problem, p, ("zeta",)).unconstrained == pytest.approx(expected, rel=1e-9)
    assert expected[2] < -0.2


def test_the_product_of_a_loss_and_an_uncertain_factor_is_not_negative():
    t = np.linspace(0.0, 10.0, 301)
    decay = harness.identify_decay(t, np.exp(-0.2 * t) * np.cos(6.0 * t), unit="m")
    loss = replace(decay["zeta"], value=1.0, error=0.4, low=0.2, high=1.8)
    force = loss.multiply(2.0, "f", "N", "", relative_error=0.5)
    assert (force.value, force.low) == (2.0, 0.0)
    assert force.high == pytest.approx(2.0 + np.hypot(1.6, norm.ppf(0.975)))
    assert force.error == pytest.approx(np.hypot(0.8, 1.0))
