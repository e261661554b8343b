"""Quantities in other units, and values written with their intervals."""

from math import inf, nan

import numpy as np
import pytest

from harness.results.quantity import Quantity, format_interval, published_mean_step, step_size_quantities


def test_quantities_change_their_unit_but_not_their_dimension():
    assert Quantity("T_f", 0.1129848290276167, "N.m", "").to_unit("lbf.in") == pytest.approx(1.0, rel=1e-15)
    with pytest.raises(KeyError):
        Quantity("period", 1.0, "s", "").to_unit("deg")


@pytest.mark.parametrize(
    ("value", "low", "high", "text"),
    [
        (0.0118642, 0.0117, 0.0120284, "0.0119 ± 0.00016"),  # to a tenth of the margin at least
        (9.81234, 9.3, 10.32468, "9.81 ± 0.51"),
        (-2.0, -2.5, -1.5, "-2 ± 0.5"),
        (1.0, 0.93, 1.2, "1 (0.93 to 1.2)"),
        (0.02007, 0.01899, 0.02791, "0.0201 (0.019 to 0.0279)"),  # to the smaller margin
        (1.0, 0.91, 1.1, "1 ± 0.1"),  # hardly asymmetric: the larger margin
        (1.0, 0.9, 1.09, "1 ± 0.1"),
        (3.0, 0.0, 40.0, "3 (0 to 40)"),  # two digits at least
        (0.0, 0.0, 0.00123, "< 0.0012"),
        (2.0 / 3.0, 2.0 / 3.0, 2.0 / 3.0, "0.66666667 ± 0"),
        (2.0 / 3.0, 0.1, inf, "0.66667"),
        (2.0 / 3.0, nan, nan, "0.66667"),
    ],
)
def test_the_digits_of_a_value_follow_from_its_interval(value, low, high, text):
    assert format_interval(value, low, high) == text


def test_the_share_of_refused_steps_counts_all_attempts():
    quantities = {quantity.name: quantity.value for quantity in step_size_quantities(np.array([1.0, 2.0, 6.0]), 1)}
    assert quantities["refused"] == 0.25


def test_the_published_mean_counts_the_last_step_twice():
    assert published_mean_step(np.array([1.0, 2.0, 6.0])) == (1 + 2 + 6 + 6) / 4
