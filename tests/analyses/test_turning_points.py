"""Estimates from turning points alone, from all of them and from two."""

import numpy as np
import pytest
from decays import TERMS, decay_record, identify, remarks_text, values
from variants import slow_after

import harness
from harness import HarnessError


@pytest.mark.parametrize(("sine", "a"), slow_after(2, [(False, 0.1), (True, 0.1), (True, 2.0)]))
def test_turning_points_alone_give_the_same_estimates(sine, a):
    fit = identify(decay_record(0.02, 0.003, 0.02, sine, a=a, t=np.linspace(0, 5, 2001)), pendulum=sine)
    expected = {"zeta": 0.02, "r": 0.003, "b": 0.02, "rest": 0.02}
    tolerance = {"rel": 0.02, "abs": 0.01 if a < 1 else 1e-3}
    assert values(fit.extrema_estimates) == pytest.approx(
        {name: expected[name] for name in values(fit.extrema_estimates)}, **tolerance
    )
    assert {"zeta", "r"} <= set(values(fit.extrema_estimates))


@pytest.mark.parametrize("sine", slow_after(1, [True, False]))
@pytest.mark.parametrize("term", slow_after(1, TERMS))
def test_two_peaks_identify_a_single_loss(term, sine):
    truth = {term: {"zeta": 0.01, "r": 0.003, "b": 0.05}[term]}
    fit = identify(decay_record(**truth, sine=sine, a=0.3, t=np.linspace(0, 4, 401), noise=3e-6), pendulum=sine)
    assert values(fit.two_peak_estimates)[term] == pytest.approx(truth[term], rel=0.01)
    assert set(fit.best.terms) == {term}


def test_an_inapplicable_column_states_the_reason():
    fit = identify(decay_record(0.02, 0.003, order=1), drag=False)
    assert fit.extrema_estimates == fit.two_peak_estimates == ()
    assert "No turning points: a record of velocity shows no turning points of the position." in remarks_text(fit)


def test_two_peaks_of_a_mixed_law_report_the_assumed_loss():
    assert (
        "The values from two peaks are rough checks: each attributes the whole loss to one mechanism"
        in remarks_text(identify(decay_record(0.02, 0.003, noise=1e-4)))
    )
    assert "two peaks" not in remarks_text(identify(decay_record(0.02, noise=1e-4)))


@pytest.mark.parametrize("noise", [0.0, 1e-3, 1e-2])
@pytest.mark.parametrize(("phase", "count"), [(0.0, 2), (0.7, 2), (1.5, 2)])
def test_a_short_record_is_refused_with_the_count_of_its_turning_points(phase, count, noise):
    """The start is the first; the record lasts 0.6 periods, so that the motion reverses once after it."""
    t = np.linspace(0.0, 0.6, 200)
    x = np.cos(2.0 * np.pi * t + phase) + noise * np.random.default_rng(1).normal(size=200)
    with pytest.raises(
        HarnessError, match=rf"has {count} turning points above the noise .* its start among them, and 3"
    ):
        harness.identify_decay((t, x), unit="m")
