"""Identification from decays whose answer is known: exact on clean signals, right in its choice on noisy ones."""

import numpy as np
import pytest
from decays import OMEGA, said, swung, values

from harness.analyses.decay.estimates import KnownParameters
from harness.analyses.decay.identification import fit_decay
from harness.analyses.decay.law import LAWS, TERMS
from harness.records.record import Record


@pytest.mark.parametrize(  # every law of a mass and of a pendulum, of which the quantities take turns
    ("law", "sine", "order"),
    [(law, False, 0) for law in LAWS]
    + [(law, True, i % 3) for i, law in enumerate(LAWS)]
    + [(LAWS[0], False, order) for order in (1, 2)],
    ids=lambda each: "+".join(each) if isinstance(each, tuple) else None,
)
def test_a_clean_signal_gives_its_constants_back_to_nine_digits(law, sine, order):
    truth = {term: {"zeta": 0.01, "r": 0.003, "b": 0.4}[term] for term in law}
    t = np.linspace(0, 3, 200)
    found = fit_decay(swung(**truth, sine=sine, order=order, turn=0.0, t=t), KnownParameters(pendulum=sine))
    assert set(found.best.terms) == set(law)
    assert values(found.estimates) == pytest.approx(
        dict.fromkeys(TERMS, 0.0) | truth | {"omega": OMEGA, "rest": 0.02}, rel=1e-9, abs=1e-12
    )
    assert found.remarks == ()


@pytest.mark.parametrize("turn", [-0.01, 0.0, 0.001, 0.12, 0.24])
def test_it_matters_not_where_the_record_begins_nor_how_it_is_sampled(turn):
    times = np.sort(np.random.default_rng(1).uniform(0.0, 3.0, 500))
    found = fit_decay(swung(0.02, 0.003, turn=turn, t=times), KnownParameters(), drag=False)
    expected = {"zeta": 0.02, "r": 0.003, "omega": OMEGA, "rest": 0.02}
    assert values(found.estimates) == pytest.approx(expected, rel=1e-9, abs=1e-12)


@pytest.mark.parametrize("origin", [2.0**4, 2.0**8, -(2.0**9), 2.0**10, 2.0**12])
def test_a_late_clock_and_a_far_origin_take_no_digits(origin):
    """As of seconds since 1970, binary fractions so that the times themselves are exact."""
    times = np.arange(1000) / 256
    x = swung(0.02, 0.003, t=times).x
    found = fit_decay(Record("late", times + 2.0**30, x + origin), KnownParameters(), drag=False)
    expected = {"zeta": 0.02, "r": 0.003, "omega": OMEGA, "rest": origin + 0.02}
    assert values(found.estimates) == pytest.approx(expected, rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("truth", [{"zeta": 0.02}, {"r": 0.003}, {"zeta": 0.02, "r": 0.003}])
def test_noise_does_not_hide_the_law(truth):
    found = fit_decay(swung(**truth, noise=1e-3), KnownParameters())
    assert set(found.best.terms) == set(truth)
    assert found.best.description in found.sentence


def test_what_noise_hides_is_said_with_what_would_tell():
    found = fit_decay(swung(0.004, noise=3e-3, t=np.linspace(0, 2, 300)), KnownParameters())
    assert "cannot be told from" in said(found)
    assert "less noise" in said(found)


@pytest.mark.parametrize(("k", "m"), [(157.9, None), (None, 2.0)])
def test_stiffness_or_mass_give_force_damping_and_drag(k, m):
    found = values(fit_decay(swung(0.02, 0.003, 0.4, noise=1e-4), KnownParameters(k, m)).estimates)
    zeta, r, b, omega = (found[name] for name in (*TERMS, "omega"))
    k, m = k or m * omega**2, m or k / omega**2
    expected = {"f": k * r, "c": 2 * zeta * m * omega, "q": b * m}
    assert b > 0
    assert {name: found[name] for name in expected} == pytest.approx(expected, rel=1e-9)


def test_no_loss_is_called_a_loss():
    found = fit_decay(swung(noise=1e-3), KnownParameters())
    assert "No loss stands out" in found.sentence or all(each.value < 3 * each.error for each in found.estimates[1:4])
