"""The intervals of an identified decay cover 95 % of the actual errors."""

import numpy as np
import pytest
from decays import identify, random_record

pytestmark = pytest.mark.slow

RECORDS = 40


@pytest.mark.campaign
def test_intervals_cover_95_percent_and_standard_errors_match_the_scatter():
    """Parameters that may be zero are excluded, because their intervals end there and shorten those of the others."""
    widths, misses = [], []
    for seed in range(RECORDS):
        record, truth, _ = random_record(seed, ("zeta", "r"), False, False, 600)
        for item in identify(record, drag=False).estimates:
            if item.name in ("omega", "zeta", "r") and item.low > 0.0:
                widths.append((item.high - item.low) / (2.0 * item.error))
                misses.append((truth[item.name] - (item.high + item.low) / 2) / item.error)
    assert len(widths) > 2 * RECORDS
    assert np.median(widths) == pytest.approx(1.96, abs=0.03)  # of the normal distribution; 1.64 would be 90 %
    assert 0.8 < np.sqrt(np.mean(np.square(misses))) < 1.2
