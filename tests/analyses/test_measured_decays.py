"""Measured records, which are not a part of the project: the losses of windows of one record agree."""

from functools import cache
from itertools import combinations, pairwise

import numpy as np
import pytest
from measured_records import find_record, missing
from variants import slow_after

from harness import identify_decay

RECORDS = ("pendulum_multiarm.csv", "bicycle_wheel.csv")
LOSSES = ("zeta", "r", "b")


@cache
def fits(name):
    """Return the fits of a whole record, of its halves and of its thirds."""
    path = find_record(name)
    if path is None:
        pytest.skip(missing(name))
    record_fit = identify_decay(path)
    parts = []
    for count in (2, 3):
        edges = np.linspace(record_fit.t[0], record_fit.t[-1], count + 1)
        windows = pairwise(edges)
        parts.append([identify_decay(path, begin=begin, end=end) for begin, end in windows])
    return record_fit, parts


@pytest.mark.campaign
@pytest.mark.parametrize("name", slow_after(1, RECORDS))
def test_the_losses_of_halves_and_thirds_of_a_measured_record_agree(name):
    _, parts = fits(name)
    for windows in parts:
        for fit, other in combinations(windows, 2):
            for loss in LOSSES:
                assert fit[loss].low <= other[loss].high, loss
                assert other[loss].low <= fit[loss].high, loss


@pytest.mark.slow
def test_a_measured_pendulum_on_ball_bearings_has_dry_friction():
    """Its swings fall by 4 r in each half cycle under friction alone, and by more with other losses."""
    fit, _ = fits("pendulum_multiarm.csv")
    swings = np.abs(np.diff(fit.extrema.x))[:9]
    largest = (swings[0] - swings[-1]) / (4 * (len(swings) - 1))
    assert 0.3 * largest < fit["r"].low < fit["r"].value < largest
    assert "r" in fit.best.terms
