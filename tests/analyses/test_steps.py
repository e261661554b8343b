"""The analyses of step sizes and of slips, on arrays with known results."""

import numpy as np
import pytest

from harness.analyses.slip import peak_value, slips_from_modes, upward_crossings
from harness.analyses.steps import step_collapse
from harness.results.quantity import published_mean_step


def test_the_published_mean_counts_the_last_step_twice():
    assert published_mean_step(np.array([1.0, 2.0, 6.0])) == (1 + 2 + 6 + 6) / 4


def test_step_collapse_compares_the_median_step_with_the_smallest_at_reversals():
    h = np.full(60, 0.1)
    h[[20, 40]] = 0.001
    h[30] = 1e-6  # far from any reversal
    ends = np.concatenate([[0.0], np.cumsum(h)])
    v = np.cos(np.pi * np.arange(61) / 20 - np.pi / 2 + np.pi / 40)  # changes sign within steps 0, 20, 40
    assert step_collapse(ends, h, ends, v) == pytest.approx(100.0)


def test_a_motion_without_reversal_has_no_step_collapse():
    ends = np.arange(5.0)
    assert step_collapse(ends, np.diff(ends), ends, np.array([0.0, 1.0, 0.0, 0.0, 1.0])) is None


@pytest.mark.parametrize(
    ("mode", "starts", "durations"),
    [
        ([0, 1, 0, 1, 0], [1, 3], [1, 1]),
        ([0, 1, 0, 1], [1, 3], [1]),  # the last slip is cut off
        ([1, 0, 1, 0], [2], [1]),  # a slip already in progress did not start here
        ([0, 1, -1, 0, -1], [1, 4], [2]),  # a reversal continues the slip
        ([0], [], []),
    ],
)
def test_slips_last_from_stick_to_stick(mode, starts, durations):
    result = slips_from_modes(np.arange(float(len(mode))), np.array(mode))
    assert [list(values) for values in result] == [starts, durations]


def test_upward_zero_crossings_are_interpolated():
    assert list(upward_crossings(np.arange(6.0), np.array([-1.0, 1.0, -3.0, 1.0, 0.0, 2.0]))) == [0.5, 2.75]


def test_the_vertex_of_a_parabola_is_interpolated_between_uneven_samples():
    t = np.array([0.0, 1.0, 1.5, 3.0])
    y = 7 - 2 * (t - 1.3) ** 2
    assert peak_value(t, y, np.full(4, True)) == pytest.approx(7.0, abs=1e-12)
    assert peak_value(t, y, np.array([True, True, False, False])) == y[1]  # not across the edge of the selection
