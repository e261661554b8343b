"""Samples outside the free motion are excluded from the fit and reported: before it, after it, and outliers within.

Some fits omit the laws with drag, which take most of the time.
"""

import numpy as np
import pytest
from decays import OMEGA, Signal, decay_record, identify, remarks_text, values
from variants import campaign_after, slow_after

from harness.analyses.decay import decay_problem, signal_model

QUANTITIES = ("position", "velocity", "acceleration")


def test_stick_before_and_rest_after_the_motion_are_excluded():
    """The mass rests where static friction holds it, farther out than sliding friction alone would allow."""
    record = decay_record(0.01, 0.005)
    x = np.concatenate([np.full(100, record.x[record.x.argmin()]), record.x[record.x.argmin() :], np.full(300, 0.03)])
    fit = identify(Signal(0.004 * np.arange(len(x)), x))
    assert values(fit.estimates)["r"] == pytest.approx(0.005, rel=1e-3)
    assert "are excluded" in remarks_text(fit)


def test_a_push_before_the_motion_is_excluded_and_reported():
    t = np.linspace(0, 6, 1500)
    x = decay_record(0.01, 0.001, turn=1.06, t=t, noise=1e-5).x
    x[t < 1.2] = 0.02 + 1e-5 * np.random.default_rng(2).standard_normal((t < 1.2).sum())
    fit = identify(Signal(t, x), drag=False)
    assert values(fit.estimates)["zeta"] == pytest.approx(0.01, rel=1e-2)
    assert fit.t[0] >= 1.2
    assert "The free decay from t = 1.3" in remarks_text(fit)


@pytest.mark.slow
def test_a_motion_stopped_from_outside_is_cut_and_reported():
    t = np.linspace(0, 8, 1500)
    x = decay_record(0.005, 0.0003, turn=0.0, t=t, noise=1e-4).x
    x[t > 6] = 0.02 + 0.3 * (x[t > 6] - 0.02)
    fit = identify(Signal(t, x))
    assert values(fit.estimates)["zeta"] == pytest.approx(0.005, rel=0.1)
    assert "follows the law until t = " in remarks_text(fit)


def held_in_mid_swing(swings, noise, zeta=0.015, end=2.0, hold=1e-5, rng=4):
    """Return a record of a decay that is held after so many half cycles, with less noise than before, and that time."""
    stop = swings * np.pi / OMEGA
    t = np.linspace(0, end * stop, 3000)
    rng = np.random.default_rng(rng)
    x = decay_record(zeta, turn=0.0, t=t).x + noise * rng.standard_normal(len(t))
    is_held = t > stop
    x[is_held] = x[is_held][0] + hold * rng.standard_normal(is_held.sum())
    return Signal(t, x), stop


@pytest.mark.parametrize("swings", campaign_after(1, [9.4, 45.4]))
def test_a_motion_held_in_mid_swing_is_cut_and_reported(swings):
    """The noise of the whole record is that of the hold, and a short motion has few turning points before it."""
    record, stop = held_in_mid_swing(swings, 1e-3)
    fit = identify(record)
    assert fit.t[-1] <= stop
    assert fit["zeta"].low <= 0.015 <= fit["zeta"].high
    assert "follows the law until t = " in remarks_text(fit)


def test_a_half_without_motion_is_reported():
    """No departure of its phase or amplitude can be measured; an error ended the command."""
    rng = np.random.default_rng(27)
    rng.random(5)
    record, _ = held_in_mid_swing(
        43.37549190622319, 6.513497821427983e-4, 0.028280296634390842, 2.106056260519557, 1.7474075e-5, rng
    )
    assert "something else acts on the oscillator too" in remarks_text(identify(record))


@pytest.mark.parametrize("drag", slow_after(1, [True, False]))
def test_repeated_samples_before_and_after_the_motion_are_excluded(drag):
    """They are longer than the motion and interrupt it in mid-swing."""
    record = decay_record(0.01, 0.001, turn=0.0, noise=1e-4)
    x = np.concatenate([np.full(900, record.x[0]), record.x, np.full(1200, record.x[-1])])
    fit = identify(Signal(0.004 * np.arange(len(x)), x), drag=drag)
    by_name = {estimate.name: estimate for estimate in fit.estimates}
    assert abs(by_name["zeta"].value - 0.01) < 4 * by_name["zeta"].error < 0.002
    assert abs(by_name["r"].value - 0.001) < 4 * by_name["r"].error < 1e-4


@pytest.mark.parametrize("order", range(3), ids=QUANTITIES)
def test_one_outlier_has_bounded_influence(order):
    record = decay_record(0.01, 0.001, turn=0.0, noise=1e-5 * OMEGA**order, order=order)
    record.x[0] += 0.3 * OMEGA**order
    fit = identify(record, drag=False)
    assert values(fit.estimates)["zeta"] == pytest.approx(0.01, rel=1e-2)
    assert len(fit.t) == len(record.t) - 1


def test_outliers_are_excluded_and_counted():
    record = decay_record(0.02, 0.003, noise=1e-4)
    record.x[[200, 500]] += (0.05, -0.08)
    fit = identify(record)
    assert values(fit.estimates)["r"] == pytest.approx(0.003, rel=2e-2)
    assert "2 of 1000 samples are outliers and are left out." in remarks_text(fit)


@pytest.mark.parametrize("drag", [False, pytest.param(True, marks=pytest.mark.campaign)])
def test_single_invalid_samples_are_excluded_and_counted(drag):
    """With spurious turning points; tests/records/test_sample_defects.py has runs and marks of invalid samples."""
    record = decay_record(0.02, 0.003, rest=0.2, noise=1e-4)
    at = np.random.default_rng(3).choice(np.arange(10, 900, 9), 20, replace=False)
    record.x[at] = np.random.default_rng(4).uniform(0.45, 0.55, len(at))
    fit = identify(record, drag=drag)
    by_name = values(fit.estimates)
    assert (by_name["r"], by_name["zeta"]) == (pytest.approx(0.003, rel=2e-2), pytest.approx(0.02, rel=2e-2))
    assert 20 <= 1000 - len(fit.record.t) <= 30  # a spike may take its neighbours with it
    assert f"{1000 - len(fit.record.t)} of 1000 samples are outliers and are left out." in remarks_text(fit)


@pytest.mark.parametrize("gap", [(2.0, 2.4), (2.2, 3.7)])
def test_both_sides_of_a_gap_are_used(gap):
    t = np.linspace(0, 6, 1500)
    keep = (t < gap[0]) | (t > gap[1])
    record = decay_record(0.01, 0.001, t=t, noise=1e-4)
    fit = identify(Signal(t[keep], record.x[keep]), drag=False)
    assert values(fit.estimates) == pytest.approx(
        {"zeta": 0.01, "r": 0.001, "omega": OMEGA, "rest": 0.02}, rel=2e-2, abs=0.05
    )
    assert fit.t[0] < gap[0] < gap[1] < fit.t[-1]


@pytest.mark.parametrize(("hold", "phase"), [(0.12, 1.0), (0.3, 0.8)])
def test_a_motion_that_starts_in_mid_swing_with_speed_costs_a_bounded_number_of_half_cycles(monkeypatch, hold, phase):
    """Held at its rest position before.  No law starts so, and a fit must not try laws with many more half cycles."""
    half_cycles, iterate = [], signal_model.iterate_return_map

    def count_half_cycles(*args, **options):
        sequence = iterate(*args, **options)
        half_cycles.append(len(sequence.amplitudes))
        return sequence

    for module in (signal_model, decay_problem):
        monkeypatch.setattr(module, "iterate_return_map", count_half_cycles)
    t = np.linspace(0.0, 6.0, 240)
    swing = np.exp(-0.01 * 6 * (t - hold)) * np.cos(6 * (t - hold) + phase)
    x = np.where(t < hold, 0.0, swing) + 1e-3 * np.random.default_rng(3).standard_normal(len(t))
    fit = identify(Signal(t, x), drag=False)
    assert values(fit.estimates)["zeta"] == pytest.approx(0.01, rel=0.1)
    assert max(half_cycles) < 10 * 6 * 6 / np.pi
    assert len(half_cycles) < 400
