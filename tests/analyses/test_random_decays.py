"""Random records of each law, amplitude, rate and noise: the estimates are right within their intervals."""

import numpy as np
import pytest
from decays import LAWS, identify, random_record

from benchmarks.campaigns.interval_coverage import FAR

pytestmark = pytest.mark.slow


@pytest.fixture(
    scope="module",
    params=[(False, False, 0), (False, True, 0), (True, True, 0), (False, False, 1), (False, False, 2)],
    ids=["mass", "quantised", "pendulum", "velocity", "acceleration"],
)
def of_each_law(request):
    """A record of at least 200 samples for each law, of random amplitude, rate and noise: true parameters and fit."""
    sine, is_quantised, order = request.param
    records = [random_record(100 + i, law, sine, is_quantised, 200, order) for i, law in enumerate(LAWS)]
    return [(truth, identify(record, pendulum=sine)) for record, truth, _ in records]


@pytest.mark.campaign
def test_no_estimate_is_far_off_without_a_remark(of_each_law):
    """benchmarks/campaigns/interval_coverage.py checks many more."""
    for truth, result in of_each_law:
        by_name = {estimate.name: estimate for estimate in result.estimates}
        off = {name: abs(by_name[name].value - value) / by_name[name].error for name, value in truth.items()}
        assert max(off.values()) < FAR or result.remarks


def test_intervals_cover_the_true_value_at_their_level(of_each_law):
    """Fewer than 28 of 35 intervals at 95 % would cover the true value once in a thousand times
    (benchmarks/campaigns/interval_coverage.py counts a thousand records of every law)."""
    coverage = []
    for truth, result in of_each_law:
        by_name = {estimate.name: estimate for estimate in result.estimates}
        coverage += [by_name[name].low <= value <= by_name[name].high for name, value in truth.items()]
    assert np.sum(coverage) >= 28


def test_an_extra_term_never_costs_more_than_ln_n(of_each_law):
    for _, result in of_each_law:
        bic = {frozenset(law.terms): law.bic for law in result.laws}
        for terms in bic:
            assert all(
                bic[more_terms] - bic[terms] < len(more_terms - terms) * np.log(len(result.t)) + 1e-6
                for more_terms in bic
                if terms < more_terms
            )
