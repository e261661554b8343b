"""Dense records are averaged over blocks of samples, by no more than their motion allows."""

import numpy as np
import pytest
from decays import OMEGA, Signal, decay_record, identify

from harness import HarnessError


@pytest.mark.parametrize(("order", "uneven"), [(0, False), (2, True)])
def test_a_thinned_record_is_that_of_the_same_motion_at_fewer_times(order, uneven):
    """Blocks are a 64th of a period at most; viscous damping has no jumps of the acceleration."""
    t = np.linspace(0.0, 6.0, 30_000)
    if uneven:
        t = np.sort(np.random.default_rng(1).uniform(0.0, 6.0, len(t)))
    fit = identify(decay_record(0.01, turn=-0.01, t=t, order=order), drag=False)
    assert len(fit.record.t) < 10_000
    expected = decay_record(0.01, turn=-0.01, t=fit.record.t, order=order)
    error = np.abs(fit.record.x - expected.x).max() / (0.1 * OMEGA**order)
    assert error < (1e-4 if uneven else (2 * np.pi / 64) ** 4 / 72)


def test_a_gap_costs_the_blocks_next_to_it_only():
    t = np.linspace(0.0, 6.0, 30_000)
    t = t[(t < 2.0003) | (t > 3.5)]  # within a block
    record = identify(decay_record(0.01, turn=-0.01, t=t), drag=False).record
    assert np.abs(record.x - decay_record(0.01, turn=-0.01, t=record.t).x).max() < 1e-6
    assert len(record.t) > len(t) // (len(t) // 5000) - 10


@pytest.mark.parametrize("step", [0.0, 1e-4])
def test_a_dense_record_gives_the_law_and_says_how_it_was_thinned(step):
    truth = {"zeta": 0.004, "r": 2e-4}
    t = np.linspace(0.0, 20.0, 60_000)
    fit = identify(decay_record(**truth, turn=-0.1, t=t, noise=3e-5, step=step), drag=False)
    assert all(fit[name].low < value < fit[name].high for name, value in truth.items())
    assert fit["r"].error < 3e-3 * truth["r"]
    assert "are averaged over" in " ".join(fit.remarks)
    assert len(fit.record.t) < 15_000


def test_a_dense_record_without_oscillation_is_refused():
    t = np.linspace(0.0, 1.0, 20_000)
    with pytest.raises(HarnessError, match="has 1 turning point above the noise"):
        identify(Signal(t, t))
