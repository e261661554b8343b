"""The estimates from the swings alone: right without the phase, and wide where the loss departs from the law."""

import numpy as np
import pytest
from decays import Signal, decay_record, identify, values

T = np.linspace(0.0, 8.0, 1600)
TRUTH = {"zeta": 0.004, "r": 4e-4, "b": 0.0}


def swung(change=lambda t: t, gain=lambda t: 1.0):
    """Return the fit of a decay of which the sensor changes times or gain."""
    record = decay_record(**TRUTH, turn=-0.1, t=change(T), noise=2e-5, rest=0.0)
    return identify(Signal(T, record.x * gain(T)), k=100.0)


def test_the_swings_give_the_law_of_a_clean_record():
    fit = swung()
    assert {one.name for one in fit.swing_estimates} == set(TRUTH)
    assert all(one.low <= TRUTH[one.name] <= one.high for one in fit.swing_estimates)
    assert values(fit.swing_estimates) == pytest.approx(TRUTH, rel=0.1, abs=0.05)
    assert not any("departs" in remark or "swings" in remark for remark in fit.remarks)


@pytest.mark.slow
def test_an_error_of_the_clock_does_not_change_the_estimates_from_the_swings():
    """Whose phase the whole signal cannot follow."""
    clean, wrong = swung(), swung(lambda t: t + 0.004 * np.sin(1.3 * t))
    for one, other in zip(clean.swing_estimates, wrong.swing_estimates, strict=True):
        assert abs(one.value - other.value) < 3 * np.hypot(one.error, other.error)
    assert all(wrong[name].low <= value <= wrong[name].high for name, value in TRUTH.items())


@pytest.mark.slow
def test_a_loss_that_departs_from_the_law_is_reported_and_covered():
    fit = swung(gain=lambda t: 1.0 + 0.03 * np.sin(0.9 * t) + 0.02 * np.sin(2.3 * t + 1.0))
    assert "The loss per half cycle departs from every law by" in " ".join(fit.remarks)
    assert all(fit[name].low <= value <= fit[name].high for name, value in TRUTH.items())
    for loss, force in (("r", "f"), ("b", "q")):  # the constants of forces have intervals in proportion
        assert fit[force].high / fit[loss].high == pytest.approx(100.0 if loss == "r" else 100.0 / 12.566**2, rel=0.01)


def test_forces_have_the_widened_intervals_of_their_losses():
    """The damping rises during the record, so that its halves disagree, and the swings with every law."""
    record = decay_record(0.004, 4e-4, turn=-0.1, t=T, noise=2e-5, rest=0.0)
    x = record.x * np.exp(-0.003 * T**2)
    fit = identify(Signal(T, x), k=100.0, drag=False)
    remarks = " ".join(fit.remarks)
    assert "in the first half of the record" in remarks
    assert "departs from every law" in remarks
    for force, loss, factor in (("f", "r", 100.0), ("c", "zeta", 2 * 100.0 / fit["omega"].value)):
        ends = factor * fit[loss].low, factor * fit[loss].high
        assert (fit[force].low, fit[force].high) == pytest.approx(ends, rel=1e-3)


def test_few_swings_give_no_second_estimate():
    assert identify(decay_record(0.01, t=np.linspace(0, 2, 400), noise=1e-4)).swing_estimates == ()


def test_swings_that_do_not_determine_the_losses_give_no_second_estimate():
    """Their equations were singular, and the search for the ends of the intervals failed."""
    record = decay_record(0.0, 1e-6, 0.0, turn=-0.1, t=T, noise=1e-9, rest=0.0)
    assert identify(record.select(0.0, 3.2)).swing_estimates == ()
