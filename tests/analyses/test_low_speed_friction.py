"""A rise of friction at low speed is named where the noise allows it; records come from scipy's integrator."""

import numpy as np
import pytest
from decays import Signal, identify, random_record
from variants import campaign_after

from benchmarks.campaigns.low_speed_friction import AMPLITUDE, decay

R = 0.006  # friction over stiffness at high speed, relative to the amplitude


@pytest.mark.parametrize(("rise", "zeta"), campaign_after(1, [(1.5, 0.0), (2.0, 0.003)]))
def test_a_rise_is_named_and_widens_the_intervals(rise, zeta):
    t, x = decay(zeta, R, rise, 0.05)
    x = AMPLITUDE * (x + 1e-3 * np.random.default_rng(1).standard_normal(len(t)))
    fit = identify(Signal(t / (2 * np.pi), x))
    text = " ".join(fit.remarks)
    assert "in speed by" in text
    assert "as with friction that rises at low speed" in text
    assert "The intervals are widened. No law of decay has" in text
    assert fit["r"].low < R * AMPLITUDE < fit["r"].high
    assert fit["zeta"].low <= zeta < fit["zeta"].high


@pytest.mark.parametrize("law", [("zeta", "r"), ("r", "b")])
def test_records_of_the_laws_show_no_rise(law):
    for number in range(2):
        record, _, _ = random_record((41, number), law, False, False, 600)
        assert "low speed" not in " ".join(identify(record).remarks)
