"""Dense records are averaged over blocks of samples, by no more than their motion allows."""

import numpy as np
import pytest
from decays import OMEGA, decay_record

from harness.analyses.decay.estimates import KnownParameters
from harness.analyses.decay.identification import fit_decay
from harness.analyses.decay.thinning import block_size, thin, thinning_error
from harness.records.record import Record

HALF_PERIOD = np.pi / OMEGA


@pytest.mark.parametrize("order", [0, 1, 2])
@pytest.mark.parametrize("uneven", [False, True])
def test_a_thinned_record_is_that_of_the_same_motion_at_fewer_times(order, uneven):
    """Within the stated error, relative to the amplitude; viscous damping has no jumps of the acceleration."""
    t = np.linspace(0.0, 6.0, 30_000)
    if uneven:
        t = np.sort(np.random.default_rng(1).uniform(0.0, 6.0, len(t)))
    dense = decay_record(0.01, turn=-0.01, t=t, order=order)
    size = block_size(dense, HALF_PERIOD)
    assert size > 3
    thinned = thin(dense, size)
    expected = decay_record(0.01, turn=-0.01, t=thinned.t, order=order)
    error = np.abs(thinned.x - expected.x).max() / (0.1 * OMEGA**order)
    assert error < 1.5 * thinning_error(dense, HALF_PERIOD, size) < 1e-4


def test_a_gap_costs_the_blocks_next_to_it_only():
    t = np.linspace(0.0, 6.0, 30_000)
    t = t[(t < 2.0) | (t > 3.5)]
    thinned = thin(decay_record(0.01, turn=-0.01, t=t), 6)
    assert np.abs(thinned.x - decay_record(0.01, turn=-0.01, t=thinned.t).x).max() < 1e-6
    assert len(thinned.t) > len(t) / 6 - 10


@pytest.mark.parametrize("step", [0.0, 1e-4])
def test_a_dense_record_gives_the_law_and_says_how_it_was_thinned(step):
    truth = {"zeta": 0.004, "r": 2e-4}
    t = np.linspace(0.0, 20.0, 60_000)
    fit = fit_decay(decay_record(**truth, turn=-0.1, t=t, noise=3e-5, step=step), KnownParameters(), drag=False)
    assert all(fit[name].low < value < fit[name].high for name, value in truth.items())
    assert fit["r"].error < 3e-3 * truth["r"]
    assert "are averaged over" in " ".join(fit.remarks)
    assert len(fit.record.t) < 15_000


def test_a_dense_record_without_oscillation_is_left_as_it_is():
    t = np.linspace(0.0, 1.0, 20_000)
    assert block_size(Record("line", t, t), 1e-4) == 1
