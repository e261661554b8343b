"""A rise of friction at low speed is shown where the noise allows it; records come from scipy's integrator."""

import numpy as np
import pytest
from decays import random_record, remarks_text

from benchmarks.campaigns.low_speed_friction import AMPLITUDE, decay
from harness.analyses.decay.estimates import KnownParameters
from harness.analyses.decay.identification import fit_decay
from harness.records.record import Record

R = 0.006  # friction over stiffness at high speed, relative to the amplitude


def fit_rise(rise, noise):
    t, x = decay(0.0, R, rise, 0.2)
    x = AMPLITUDE * (x + noise * np.random.default_rng(1).standard_normal(len(t)))
    return fit_decay(Record("decay", t / (2 * np.pi), x), KnownParameters())


def test_a_rise_is_measured_and_widens_the_intervals():
    fit = fit_rise(1.5, 1e-3)
    assert fit.rise.size * fit.problem.scale == pytest.approx(0.5 * R * AMPLITUDE, rel=0.3)
    assert fit["r"].low < R * AMPLITUDE < fit["r"].high
    assert "Friction that rises at low speed fits better" in remarks_text(fit)


def test_a_rise_below_the_stated_limit_is_not_excluded():
    fit = fit_rise(1.0, 1e-3)
    assert not fit.rise.is_shown
    assert 0.02 < fit.undetected_rise < 0.2
    assert f"less than {100 * fit.undetected_rise:.2g} % of r is not excluded" in remarks_text(fit)


@pytest.mark.parametrize("law", [("zeta", "r"), ("r", "b")])
def test_records_of_the_laws_show_no_rise(law):
    for number in range(2):
        record, _, _ = random_record((41, number), law, False, False, 600)
        assert not fit_decay(record, KnownParameters()).rise.is_shown
