"""Doubtful fits are reported and impossible ones refused, each with a remedy."""

import contextlib

import numpy as np
import pytest
from decays import OMEGA, Signal, T, decay_record, identify, remarks_text
from scipy.integrate import solve_ivp
from variants import slow_after

from harness import HarnessError, identify_decay


@pytest.mark.campaign
def test_drift_is_reported_and_fitted_on_request():
    record = decay_record(0.01, 0.001, drift=0.002, noise=1e-4)
    assert "drift=True fits" in remarks_text(identify(record))
    fit = identify(record, drift=True)
    by_name = {estimate.name: estimate for estimate in fit.estimates}
    assert by_name["drift"].value == pytest.approx(0.002, rel=2e-2)
    assert by_name["zeta"].low < 0.01 < by_name["zeta"].high
    assert fit.remarks == ()


@pytest.mark.parametrize("drift", [-0.02, 0.03])
def test_a_large_drift_is_fitted_on_request(drift):
    """The rest position is that in the middle of the record, at 2 s."""
    fit = identify(decay_record(0.01, 0.001, rest=0.02, drift=drift), drift=True, drag=False)
    expected = {"drift": drift, "rest": 0.02 + 2.0 * drift, "zeta": 0.01, "r": 0.001}
    assert {name: fit[name].value for name in expected} == pytest.approx(expected, rel=1e-6)


def test_correlated_noise_is_reported_and_widens_the_intervals():
    record = decay_record(0.01, 0.001, noise=1e-3)
    white_fit = identify(record, drag=False)
    noise = np.convolve(np.random.default_rng(3).standard_normal(1019), np.ones(20), "valid") * 2e-4
    correlated_fit = identify(Signal(record.t, decay_record(0.01, 0.001).x + noise), drag=False)
    assert "not independent" in remarks_text(correlated_fit)
    zeta = [
        next(estimate for estimate in result.estimates if estimate.name == "zeta")
        for result in (white_fit, correlated_fit)
    ]
    assert zeta[1].low < 0.01 < zeta[1].high
    assert zeta[1].error > zeta[0].error


@pytest.mark.parametrize(("r", "has_remark"), [(2e-3, True), (1.999e-3, True), (2.13e-3, False), (1.8e-3, False)])
def test_a_loss_in_phase_with_the_sensor_resolution_is_reported(r, has_remark):
    """Of 1 mm, where a half swing loses 2 r."""
    side = 1.0 if r > 1.9995e-3 else -1.0
    fit = identify(decay_record(r=r, rest=0.0203, turn=-0.1, step=1e-3, noise=1e-5, side=side), drag=False)
    assert ("rounds all turning points alike" in remarks_text(fit)) == has_remark


def test_a_second_oscillation_is_reported():
    x = decay_record(0.02).x + 0.004 * np.sin(50 * T)
    assert "something else acts" in remarks_text(identify(Signal(T, x)))


@pytest.mark.parametrize(("method", "rtol", "is_named"), [("RK23", 1e-3, True), ("DOP853", 1e-10, False)])
def test_errors_of_a_solver_are_named_as_a_cause_of_losses(method, rtol, is_named):
    """Of an oscillator with sign(v), as users write it."""
    force = 0.4

    def rates(t, y):
        return y[1], -100 * y[0] - force * np.sign(y[1])

    t = np.linspace(0, 2, 401)
    motion = solve_ivp(rates, (0, 2), (0.1, 0.0), method, t, rtol=rtol, atol=rtol / 1000)
    assert ("If a solver wrote the record" in remarks_text(identify(Signal(t, motion.y[0])))) == is_named


@pytest.mark.parametrize(
    ("x", "sentence"),
    [
        (
            decay_record(0.01, noise=1e-4).x + 0.04 * np.sin(7.3 * T),
            "not a free decay of one oscillator|driven or gains energy",
        ),
        (0.05 * np.cos(OMEGA * T) + 0.05 * np.exp(-T) * np.cos(9 * T), "beats: its swings fall to"),
        (np.random.default_rng(1).standard_normal(1000), "all noise"),
        (np.zeros(1000), "does not move"),
        (np.exp(-T), "turning point"),
        (np.cos(T), "turning points"),
        (np.exp(0.1 * T) * np.cos(12 * T), "grows, from .* peak to peak"),
    ],
)
def test_a_record_without_decay_is_refused_in_one_sentence(x, sentence):
    with pytest.raises(HarnessError, match=sentence) as refusal:
        identify(Signal(T, x))
    assert "\n" not in str(refusal.value)


def test_a_refusal_names_what_was_assumed_in_reading(tmp_path):
    np.savetxt(tmp_path / "bare.csv", np.stack([T, np.exp(-T)], 1), delimiter=",")
    with pytest.raises(HarnessError, match=r"turning points? .* The file has no headings: .*[^.]$"):
        identify_decay(str(tmp_path / "bare.csv"), unit="m")


@pytest.mark.parametrize(
    ("sine", "order", "drift", "drag"),
    slow_after(
        1,
        [
            (False, 0, 1.0, False),
            (False, 2, 0.05, False),
            (False, 0, 0.05, True),
            (True, 0, 0.05, True),
            (False, 2, 1.0, False),
        ],
    ),
)
def test_a_drift_too_large_to_fit_is_reported_with_a_remedy(sine, order, drift, drag):
    size = 0.1 * OMEGA**order
    record = decay_record(
        0.01, sine=sine, drift=drift * size, noise=1e-3 * size, order=order, turn=0.0, t=np.linspace(0, 5, 450)
    )
    with pytest.raises(HarnessError, match="add drift=True if the rest position drifts"):
        identify(record, pendulum=sine, drag=drag)


def angular_acceleration(a, noise=0.05):
    """Return the record of a pendulum that starts at the angle a, with two peaks per half cycle beyond 90 degrees."""
    return decay_record(0.01, sine=True, a=a, omega=6.0, noise=noise, order=2, turn=0.0, t=np.linspace(0, 5, 500))


def test_double_peaks_of_angular_acceleration_are_reported_with_a_remedy():
    with pytest.raises(HarnessError, match="two peaks per half cycle: record the angle or the angular velocity"):
        identify(angular_acceleration(3.1, noise=6.0), pendulum=True, drag=False)


@pytest.mark.campaign
@pytest.mark.parametrize("a", [2.8, 3.0])
def test_double_peaks_of_angular_acceleration_are_fitted_if_their_cycles_are_found(a):
    fit = identify(angular_acceleration(a), pendulum=True)
    assert fit.rms == pytest.approx(0.05, rel=0.1)
    assert fit["zeta"].low < 0.01 < fit["zeta"].high
    assert fit["omega"].value == pytest.approx(6.0, rel=1e-3)


@pytest.mark.slow
def test_a_probable_pendulum_is_suggested():
    record = decay_record(0.005, 0.001, sine=True, a=1.5, noise=1e-3, t=np.linspace(0, 5, 700))
    with pytest.raises(HarnessError, match="add pendulum=True"):
        identify(record)


def test_a_pendulum_is_identified_from_its_angle():
    with pytest.raises(HarnessError, match="pendulum=True needs an angle"):
        identify(decay_record(0.02), pendulum=True)


@pytest.mark.parametrize("seed", [3, 11, 29, 30])
def test_any_record_ends_in_a_fit_or_one_sentence(seed):
    """A random walk, on which fits may try anything."""
    walk = np.random.default_rng(seed).standard_normal(60).cumsum()
    with contextlib.suppress(HarnessError):
        assert identify(Signal(np.linspace(0, 1, 60), walk))
