"""Noise of measured records: the scatter, and the step of a quantiser."""

import numpy as np
import pytest

from harness.analyses.fit.measured_record import MeasuredRecord
from harness.analyses.fit.noise import estimate_noise


@pytest.mark.parametrize("levels", [[0, 151, 860, 909, 935], [0, 7, 8, 30]])
def test_a_record_of_long_rests_reveals_the_step_of_its_quantiser(levels):
    step = 3.7e-4
    x = step * np.repeat(levels, 40).astype(float)
    noise, found = estimate_noise(np.arange(len(x)) * 0.01, x)
    assert found == pytest.approx(step, rel=1e-9)
    assert noise == pytest.approx(step / 12**0.5, rel=1e-9)


def test_levels_without_a_common_step_are_not_quantised():
    x = np.repeat(np.random.default_rng(1).normal(size=6), 40)
    assert estimate_noise(np.arange(len(x)) * 0.01, x)[1] == 0.0


def test_means_of_a_quantised_rest_keep_the_error_of_one_sample():
    t, step = np.linspace(0.0, 10.0, 20_001), 0.1
    moving = np.where(t > 5.0, 2.03 + 10.0 * (t - 5.0), 2.03)
    levels = np.round(moving / step) * step
    record = MeasuredRecord("record", t, levels[:, None], {}, [None], binned=True)
    errors = record.quantisation_errors(np.interp(record.t, t, moving)[:, None])[:, 0]
    assert record.width > 1
    assert errors[record.t < 4.9] == pytest.approx(-0.03)
    difference = record.y[1:, 0] - np.interp(record.t[1:], t, moving)
    assert errors[1:] == pytest.approx(difference, abs=1.1 * step / record.width)
