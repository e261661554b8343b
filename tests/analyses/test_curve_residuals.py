"""Residuals that depend on time, acceleration or travel are named in `curve`, and standstill need not read zero."""

import numpy as np
import pytest
from scipy.signal import lfilter
from variants import campaign_after, slow_after

import harness
from benchmarks.campaigns.hidden_defects import curve_record, preslide

T = np.arange(0, 40.0, 0.005)
V = 0.2 * np.sin(2 * np.pi * 2 * T / 40)
STAIRS = np.concatenate([np.repeat([v, 0.0], [360, 90]) for v in np.outer(np.geomspace(0.02, 0.5, 8), [1, -1]).ravel()])
STAIR_TIMES = np.arange(len(STAIRS)) * 0.005


def stribeck(v, F_c=6.0, F_s=9.0, F_v=20.0, v_s=0.02):
    return np.sign(v) * (F_c + (F_s - F_c) * np.exp(-((v / v_s) ** 2))) + F_v * v


def identify(t, v, force, heading="v [m/s]", **options):
    noise = 0.03 * np.random.default_rng(1).standard_normal(len(t))
    return harness.identify_curve({"t [s]": t, heading: v, "F [N]": force + noise}, mass=1e-9, **options)


def assert_covers(curve, margin=1.0, **truth):
    """Check the interval of each constant, widened by a factor about its value."""
    for name, value in truth.items():
        estimate = curve[name]
        low = estimate.value + margin * (estimate.low - estimate.value)
        high = estimate.value + margin * (estimate.high - estimate.value)
        assert low <= value <= high, (name, value, estimate, curve.remarks)


@pytest.mark.campaign
@pytest.mark.parametrize(
    ("share", "changes", "remark"),
    [
        ({"F_c": 0.2}, {"F_c": 6.6}, "F_c drifts by +1.2 N over the record"),
        ({"F_v": -0.3}, {"F_v": 17.0}, "F_v drifts"),
    ],
    ids=["Coulomb", "viscous"],
)
def test_friction_that_drifts_is_no_bias_and_no_asymmetry(share, changes, remark):
    parts = {"F_c": 6.0 * np.sign(V), "F_v": 20.0 * V}
    drift = sum(size * T / 40 * parts[name] for name, size in share.items())
    curve = identify(T, V, stribeck(V) + drift)
    assert curve.best.name == "stribeck"
    assert_covers(curve, 1.5, **{"F_c": 6.0, "F_v": 20.0, "bias": 0.0} | changes)
    assert any(remark in text for text in curve.remarks)


@pytest.mark.parametrize("time_constant", campaign_after(1, [0.08, 0.02]))
def test_a_lag_of_the_force_is_estimated(time_constant):
    keep = np.exp(-0.005 / time_constant)
    curve = identify(T, V, lfilter([1 - keep], [1, -keep], stribeck(V)))
    assert curve["lag"].value == pytest.approx(time_constant, rel=0.15, abs=0.004)
    assert curve["F_s"].value == pytest.approx(9.0, rel=0.03)
    assert any("The force lags the velocity" in text for text in curve.remarks)


@pytest.mark.campaign
def test_presliding_suggests_the_option_that_leaves_it_out():
    force = preslide(np.cumsum(V) * 0.005, V, stribeck(V, F_s=10.48), 5e-4)
    curve = identify(T, V, force)
    assert curve["F_s"].value == pytest.approx(10.48, rel=0.05)
    (remark,) = (text for text in curve.remarks if "presliding or backlash" in text)
    backlash = float(remark.split("backlash=")[1].split()[0])
    assert 5e-4 < backlash < 1e-2
    assert identify(T, V, force, backlash=backlash)["F_s"].value == pytest.approx(10.48, rel=0.05)


def test_a_clean_sweep_has_no_remark():
    curve = identify(T, V, stribeck(V))
    assert curve.best.name == "stribeck"
    assert not curve.remarks
    assert_covers(curve, 1.5, F_c=6.0, F_s=9.0, F_v=20.0, v_s=0.02, bias=0.0)


def code_without_zero(v):
    """Velocities (n,) in codes of 0.0146 rad/s none of which is zero; at rest, both codes next to zero."""
    dither = 1e-3 * np.random.default_rng(2).standard_normal(len(v))
    return (np.floor((v + dither) / 0.0146) + 0.5) * 0.0146


@pytest.mark.parametrize(
    ("heading", "measure", "note"),
    [
        ("v [m/s]", code_without_zero, "no code for zero: standstill reads plus or minus 0.0073"),
        ("v [m/s]", lambda v: v + 0.02, "Standstill reads 0.02 m/s whatever the force"),
        ("v [m/s]", lambda v: v - 0.02 + 2e-4 * np.random.default_rng(3).standard_normal(len(v)), "Standstill reads"),
        ("x [m]", lambda v: np.cumsum(v + 0.02) * 0.005, "Standstill reads 0.02 m/s whatever the force"),
    ],
    ids=["code", "tachometer", "gyro", "position"],
)
def test_standstill_that_does_not_read_zero_is_no_sliding(heading, measure, note):
    holding_force = np.repeat(np.random.default_rng(5).uniform(-2, 2, len(STAIRS) // 45), 45)  # by the drive, at rest
    force = np.where(STAIRS == 0, holding_force, 2.0 * np.sign(STAIRS) + 0.8 * STAIRS)
    curve = identify(STAIR_TIMES, measure(STAIRS), force, heading)
    assert any(note in text for text in curve.points.notes)
    assert curve["F_c"].value == pytest.approx(2.0, abs=0.05)
    assert curve["F_v"].value == pytest.approx(0.8, abs=0.07)
    assert_covers(curve, 1.5, F_c=2.0, F_v=0.8)
    assert curve.used.all()


@pytest.mark.parametrize("seed", slow_after(1, [7, 16]))
def test_intervals_contain_what_the_steps_of_a_code_without_zero_hide(seed):
    """Each of these records missed a constant by several half widths."""
    record, truth = curve_record(np.random.default_rng((seed, 4)), "code")
    curve = harness.identify_curve(record, mass=1e-9)
    assert all(item.low <= truth[item.name][0] <= item.high for item in curve.estimates)


@pytest.mark.campaign
def test_pauses_do_not_replace_the_samples_that_move():
    v = np.concatenate(
        [np.concatenate([np.zeros(200), 0.5 * np.sin(np.pi * np.arange(120) / 120) * s]) for s in [1, -1] * 6]
    )
    holding_force = np.repeat(np.random.default_rng(5).uniform(-2, 2, len(v) // 20), 20)
    force = np.where(v == 0, holding_force, 2.0 * np.sign(v) + 0.8 * v)
    curve = identify(np.arange(len(v)) * 0.005, code_without_zero(v), force)
    assert "no plateaus" in curve.points.notes[-1]
    assert curve["F_c"].value == pytest.approx(2.0, abs=0.03)


def test_directions_that_were_measured_at_different_times_leave_a_drift_open():
    levels = [*np.geomspace(0.02, 0.5, 8), *-np.geomspace(0.02, 0.5, 8)]
    v = np.concatenate([np.repeat([level, 0.0], [360, 90]) for level in levels])
    force = np.sign(v) * (6.0 + 0.6 * (v < 0)) + 20.0 * v
    curve = identify(np.arange(len(v)) * 0.005, v, force)
    assert any("Each direction was measured once, at another time" in text for text in curve.remarks)


def test_six_speeds_in_each_direction_do_not_choose_eight_constants():
    v = np.outer([1, -1], np.geomspace(0.01, 0.3, 6)).ravel()
    for seed in range(10):
        force = 6 * np.sign(v) + 20 * v + 0.1 * np.random.default_rng(seed).standard_normal(12)
        assert harness.identify_curve((v, force)).best.name in ("viscous", "asymmetric-viscous", "tustin", "stribeck")
