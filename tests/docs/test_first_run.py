"""What the first tutorial says about the shortcut `threshold` is true for the runs that it shows."""

import numpy as np
import pytest

import harness

pytestmark = pytest.mark.slow


def slip_ends(run):
    """Return the times at which the speed of the sled falls below a few percent of its peak."""
    slips = run["v"] > 0.01
    return run.time[1:][~slips[1:] & slips[:-1]]


def test_later_slips_of_the_threshold_law_come_early_after_hundreds_of_times_as_many_steps(fmus):
    scene = {"friction": "threshold", "solver.atol": 1e-6}, {"method": "ode23", "rtol": 1e-3}
    exact, threshold = (
        harness.simulate(fmus / "stickslip.fmu", values, stop=16.0, interval=1e-4, **options)
        for values, options in (({}, {}), scene)
    )
    assert threshold.statistics.steps > 200 * exact.statistics.steps
    early = slip_ends(exact) - slip_ends(threshold)
    assert early[1:].min() > 1e-3
    assert np.abs(early).max() < 0.03
