"""A rise of friction at low speed is shown where the noise allows it; records come from scipy's integrator."""

import numpy as np
import pytest
from decays import Signal, decay_record, identify, random_record, remarks_text

from benchmarks.campaigns.low_speed_friction import AMPLITUDE, decay

R = 0.006  # friction over stiffness at high speed, relative to the amplitude


def fit_rise(rise, noise, zeta=0.0, speed=0.2):
    t, x = decay(zeta, R, rise, speed)
    x = AMPLITUDE * (x + noise * np.random.default_rng(1).standard_normal(len(t)))
    return identify(Signal(t / (2 * np.pi), x))


def test_a_rise_is_measured_and_widens_the_intervals():
    fit = fit_rise(1.5, 1e-3)
    assert fit.rise.size == pytest.approx(0.5 * R * AMPLITUDE, rel=0.3)
    assert fit["r"].low < R * AMPLITUDE < fit["r"].high
    assert "Friction that rises at low speed fits better" in remarks_text(fit)


def test_a_rise_below_the_stated_limit_is_not_excluded():
    fit = fit_rise(1.0, 1e-3)
    assert not fit.rise.is_shown
    assert 0.02 < fit.undetected_rise < 0.2
    assert f"less than {100 * fit.undetected_rise:.2g} % of r is not excluded" in remarks_text(fit)


def test_a_rise_of_the_size_of_the_friction_or_more_is_not_mentioned():
    """A limit above 100 % says nothing about the friction."""
    fit = fit_rise(1.0, 0.02)
    assert fit.undetected_rise > 1.0
    assert "at low speed" not in remarks_text(fit)


@pytest.mark.slow
def test_a_rise_is_shown_by_a_record_that_is_cut_where_it_departs():
    """The part before the departure follows a law of its own, with too much dry friction."""
    fit = fit_rise(1.67, 1e-4, zeta=0.003, speed=0.125)
    assert "then departs from it; the rest is left out" in remarks_text(fit)
    assert "Friction that rises at low speed fits better" in remarks_text(fit)
    assert "not excluded" not in remarks_text(fit)
    assert fit["r"].low < R * AMPLITUDE < fit["r"].value


@pytest.mark.slow
def test_a_record_cut_for_another_reason_excludes_no_rise():
    """Stopped by hand, it would not show any rise that acts after the cut."""
    t = np.linspace(0, 8, 1500)
    record = decay_record(0.005, 0.0003, turn=0.0, t=t, noise=1e-4)
    record.x[t > 6] = 0.02 + 0.3 * (record.x[t > 6] - 0.02)
    fit = identify(record)
    assert "No friction that rises at low speed is excluded" in remarks_text(fit)
    assert fit.as_json()["low_speed_rise"]["limit"] is None


@pytest.mark.parametrize("law", [("zeta", "r"), ("r", "b")])
def test_records_of_the_laws_show_no_rise(law):
    for number in range(2):
        record, _, _ = random_record((41, number), law, False, False, 600)
        assert not identify(record).rise.is_shown
