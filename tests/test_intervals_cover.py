"""The intervals of an identified decay are of 95 %: as wide as the errors that are really made ask for."""

import numpy as np
from intervals import TRUTH, record

from harness.identify.fit import Known, identify

RECORDS = 60


def test_intervals_are_as_wide_as_95_percent_asks():
    """Errors in units of the half width scatter by 1/1.97; intervals of 90 % would give 1/1.65, of 99 % 1/2.59."""
    errors = []
    for seed in range(RECORDS):
        estimates = identify(record(seed), Known(), terms=("zeta", "r")).best.estimates
        errors += [2.0 * (each.value - TRUTH[each.name]) / (each.high - each.low) for each in estimates]
    assert 0.46 < np.sqrt(np.mean(np.square(errors))) < 0.56
