"""The intervals of identified friction cover 95 % of the drawn constants, and the drawn law is chosen."""

import numpy as np
import pytest

from benchmarks.campaigns.curve_coverage import DRAWN_LAWS, check_record

RECORDS = 2 * len(DRAWN_LAWS)


@pytest.mark.campaign
def test_intervals_cover_the_drawn_constants_and_the_drawn_law_is_chosen():
    rows = [check_record(number) for number in range(RECORDS)]
    coverage = [value for *_, shares, _ in rows for value in shares.values()]
    assert len(coverage) > 4 * RECORDS * 0.75
    assert np.mean(coverage) > 0.85  # 0.95 minus three standard deviations of so few records
    assert np.mean([row[0] == row[2] for row in rows]) > 0.75
    assert sum(row[4] for row in rows) <= 1  # no point is drawn that does not fit
