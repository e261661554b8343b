"""Identification from decays with known parameters: exact on clean signals, correct law on noisy ones."""

import numpy as np
import pytest
from decays import LAWS, OMEGA, TERMS, Signal, T, decay_record, identify, remarks_text, values
from variants import campaign_after, slow_after


@pytest.mark.parametrize(  # every law, of a mass and of a pendulum in turn, with the quantities in turn
    ("law", "sine", "order"),
    slow_after(
        4,
        [(law, i % 2 == 0, i % 3) for i, law in enumerate(LAWS)]
        + [(LAWS[0], False, order) for order in (0, 1, 2)]
        + [(LAWS[-1], len(LAWS) % 2 == 0, 0)],
    ),
    ids=lambda item: "+".join(item) if isinstance(item, tuple) else None,
)
def test_clean_signals_are_identified_to_nine_digits(law, sine, order):
    truth = {term: {"zeta": 0.01, "r": 0.003, "b": 0.4}[term] for term in law}
    t = np.linspace(0, 3, 200)
    fit = identify(decay_record(**truth, sine=sine, order=order, turn=0.0, t=t), pendulum=sine)
    assert set(fit.best.terms) == set(law)
    assert values(fit.estimates) == pytest.approx(
        dict.fromkeys(TERMS, 0.0) | truth | {"omega": OMEGA, "rest": 0.02}, rel=1e-9, abs=1e-12
    )
    assert fit.remarks == ()


@pytest.mark.parametrize(
    ("term", "truth", "sine"),
    campaign_after(2, [("zeta", 0.01, False), ("r", 0.004, True), ("b", 0.4, False), ("b", 0.4, True)]),
)
def test_two_peaks_give_the_loss_that_acts_alone(term, truth, sine):
    """Twice this friction stops the motion before the last peak."""
    record = decay_record(**{term: truth}, sine=sine, turn=0.0, t=np.linspace(0, 3, 600))
    fit = identify(record, pendulum=sine)
    assert values(fit.two_peak_estimates)[term] == pytest.approx(truth, rel=2e-3)


@pytest.mark.parametrize("turn", [-0.01, 0.0, 0.001, 0.12, 0.24])
def test_the_fit_does_not_depend_on_start_or_sampling(turn):
    times = np.sort(np.random.default_rng(1).uniform(0.0, 3.0, 500))
    fit = identify(decay_record(0.02, 0.003, turn=turn, t=times), drag=False)
    expected = {"zeta": 0.02, "r": 0.003, "omega": OMEGA, "rest": 0.02}
    assert values(fit.estimates) == pytest.approx(expected, rel=1e-9, abs=1e-12)


@pytest.mark.parametrize("origin", [2.0**4, 2.0**8, -(2.0**9), 2.0**10, 2.0**12])
def test_late_clocks_and_offset_origins_cost_no_accuracy(origin):
    """As seconds since 1970; binary fractions keep the times themselves exact."""
    times = np.arange(1000) / 256
    x = decay_record(0.02, 0.003, t=times).x
    fit = identify(Signal(times + 2.0**30, x + origin), drag=False)
    expected = {"zeta": 0.02, "r": 0.003, "omega": OMEGA, "rest": origin + 0.02}
    assert values(fit.estimates) == pytest.approx(expected, rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("truth", [{"zeta": 0.02}, {"r": 0.003}, {"zeta": 0.02, "r": 0.003}])
def test_noise_does_not_hide_the_law(truth):
    fit = identify(decay_record(**truth, noise=1e-3))
    assert set(fit.best.terms) == set(truth)
    assert fit.best.description in fit.sentence


def test_an_undecidable_law_is_reported_with_what_would_decide_it():
    fit = identify(decay_record(0.004, noise=3e-3, t=np.linspace(0, 2, 300)))
    assert "cannot be distinguished from" in remarks_text(fit)
    assert "less noise" in remarks_text(fit)


@pytest.mark.slow
def test_a_loss_with_little_effect_on_the_motion_is_reported():
    small, large = (identify(decay_record(0.01, r, noise=2e-5, t=np.linspace(0, 8, 1500))) for r in (1e-5, 1e-4))
    assert small["r"].low > 0
    assert "differs from viscous damping (0.0" in remarks_text(small)
    assert "differs from" not in remarks_text(large)


@pytest.mark.parametrize(("k", "m"), [(157.9, None), (None, 2.0)])
def test_stiffness_or_mass_convert_the_fit_to_physical_parameters(k, m):
    fit = values(identify(decay_record(0.02, 0.003, 0.4, noise=1e-4), k=k, mass=m).estimates)
    zeta, r, b, omega = (fit[name] for name in (*TERMS, "omega"))
    k, m = k or m * omega**2, m or k / omega**2
    expected = {"f": k * r, "c": 2 * zeta * m * omega, "q": b * m}
    assert b > 0
    assert {name: fit[name] for name in expected} == pytest.approx(expected, rel=1e-9)


def test_no_loss_is_reported_as_no_loss():
    """Of a few cycles; many cycles of a constant amplitude are refused."""
    fit = identify(decay_record(noise=1e-3, t=T[:600]))
    assert "No loss stands out" in fit.sentence or all(item.value < 3 * item.error for item in fit.estimates[1:4])
