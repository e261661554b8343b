"""Slow departures from the law that no residual shows by itself are reported, and the intervals cover them."""

import numpy as np
import pytest
from decays import Signal, decay_record, identify
from variants import campaign_after

from harness import HarnessError
from harness.analyses.decay.intervals import extend_interval

T = np.linspace(0.0, 30.0, 1800)
TRUTH = {"omega": 12.566, "zeta": 0.001, "r": 1e-4, "b": 0.0}
NOISE = 2e-5  # 2e-4 of the amplitude


def fit_decay(seed, clock=0.0, gain=0.0):
    """Return the fit of a decay with an error of the clock in rad, and of the amplitude, both as random walks."""
    clean = decay_record(**TRUTH, turn=-0.1, t=T, noise=NOISE, rest=0.0, seed=seed)
    knots = np.linspace(T[0], T[-1], 9)
    walk = np.interp(T, knots, np.cumsum(np.random.default_rng(seed).standard_normal(9)))
    bridge = walk - np.polyval(np.polyfit(T, walk, 1), T)
    record = clean._replace(t=T + clock / TRUTH["omega"] * bridge, x=clean.x * (1 + gain * walk))
    return identify(record)


def errors(fit):
    """Return the deviations of the values from the truth, in standard errors."""
    return [abs(fit[name].value - value) / fit[name].error for name, value in TRUTH.items()]


@pytest.mark.parametrize(
    ("defect", "cause"), campaign_after(1, [("clock", "a clock whose rate varies"), ("gain", "another law")])
)
def test_a_wander_near_the_noise_is_reported_and_covered(defect, cause):
    fits = [fit_decay(seed, **{defect: 2e-4}) for seed in range(4)]
    assert sum(cause in " ".join(fit.remarks) for fit in fits) >= 3
    assert np.mean([np.array(errors(fit)) < 2 for fit in fits]) > 0.8
    assert max(max(errors(fit)) for fit in fits) < 4


@pytest.mark.campaign
def test_white_noise_is_no_wander():
    fits = [fit_decay(seed) for seed in range(4)]
    assert not any("departs from the law" in " ".join(fit.remarks) for fit in fits)


def test_a_loss_that_departs_from_every_law_is_reported_and_covered():
    t, truth = np.linspace(0.0, 8.0, 1600), {"zeta": 0.004, "r": 4e-4, "b": 0.0}
    record = decay_record(**truth, turn=-0.1, t=t, noise=2e-5, rest=0.0)
    fit = identify(Signal(t, record.x * (1.0 + 0.03 * np.sin(0.9 * t) + 0.02 * np.sin(2.3 * t + 1.0))), k=100.0)
    assert "a loss that follows another law" in " ".join(fit.remarks)
    assert all(fit[name].low <= value <= fit[name].high for name, value in truth.items())
    for loss, force in (("r", "f"), ("b", "q")):  # the constants of forces have intervals in proportion
        assert fit[force].high / fit[loss].high == pytest.approx(100.0 if loss == "r" else 100.0 / 12.566**2, rel=0.02)


def test_a_rest_position_that_drifts_is_reported():
    record = decay_record(0.004, 4e-4, turn=-0.1, t=T, noise=NOISE, rest=0.0)
    fit = identify(record._replace(x=record.x + 1e-4 * T / T[-1]))
    assert "a sensor that drifts" in " ".join(fit.remarks)
    assert "drift=True fits a constant drift" in " ".join(fit.remarks)


def test_a_sensor_that_differs_between_the_sides_is_named():
    record = decay_record(0.004, 4e-4, turn=-0.1, t=T, noise=NOISE, rest=0.0)
    fit = identify(record._replace(x=record.x + 0.05 * record.x**2))
    assert "in direction by" in " ".join(fit.remarks)
    assert "a spring or a sensor that differs between the sides" in " ".join(fit.remarks)
    assert all(fit[name].low <= value <= fit[name].high for name, value in {"zeta": 0.004, "r": 4e-4}.items())


def test_hum_widens_the_intervals():
    record = decay_record(0.005, 2e-4, t=np.linspace(0.0, 12.0, 4801), noise=1e-4)
    fit = identify(record._replace(x=record.x + 1e-3 * np.sin(2 * np.pi * 50.0 * record.t + 1.0)))
    assert all(fit[name].low <= value <= fit[name].high for name, value in {"zeta": 0.005, "r": 2e-4}.items())


@pytest.mark.slow
def test_a_wander_that_resembles_a_negative_loss_is_reported_and_covered():
    t = np.linspace(0.0, 8.0, 800)
    record = decay_record(b=0.5, t=t, noise=2e-4, rest=0.0, seed=12)
    fits = [identify(record._replace(x=record.x * (1 - size * t * (8 - t) / 16))) for size in (0.0, 0.0015)]
    assert ["A loss below zero would fit better" in " ".join(fit.remarks) for fit in fits] == [False, True]
    assert all(fit["b"].low < 0.5 < fit["b"].high for fit in fits)


@pytest.mark.campaign
def test_a_sustained_oscillation_whose_amplitude_wanders_has_no_interval():
    t = np.arange(0, 40.0, 0.02)
    for seed in range(4):
        rng = np.random.default_rng(seed)
        wander = np.interp(t, np.linspace(0, 40, 30), 0.25 * rng.standard_normal(30))
        x = (1 + wander) * np.cos(4.0 * t) + 0.03 * rng.standard_normal(len(t))
        try:
            fit = identify(Signal(t, x))
        except HarnessError:
            continue
        assert fit.remarks[0].endswith("Do not rely on these values.")
        assert all(np.isnan([estimate.low, estimate.high]).all() for estimate in fit.estimates)


@pytest.mark.parametrize(
    ("value", "low", "high"), [(0.002, 0.002, 0.005), (0.0, 0.0, 0.0), (1.0, 1.2, 1.4), (3.0, 1.0, 2)]
)
def test_an_interval_has_a_width_and_holds_its_value_inside(value, low, high):
    first, last = extend_interval(value, low, high)
    assert first <= value < last
    assert first < value or value == 0.0
