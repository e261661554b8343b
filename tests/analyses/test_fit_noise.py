"""Noise of measured records: the scatter, and the step of a quantiser."""

from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
import pytest
from variants import campaign_after

from harness.analyses.fit.fit_problem import FitProblem, Unknown
from harness.analyses.fit.fit_procedure import MeasuredRecord, subdivide_inputs
from harness.analyses.fit.measured_record import correlation_length, estimate_noise, significant_correlation
from harness.records.extraction import Samples


@dataclass
class Spec:
    """Settings of runs, of which a record changes all but the outputs."""

    outputs: tuple[str, ...] = ("x",)
    inputs: dict[str, np.ndarray] | None = None
    start: float = 0.0
    stop: float = 0.0
    times: np.ndarray | None = None


def prepare(spec):
    """Return a function that returns a sine of 1 Hz with a given size."""
    return lambda values: values["size"] * np.sin(2 * np.pi * spec.times)[:, None]


def prepare_impulse(spec):
    """Return a function that returns the integral of a force with a given size."""
    t, force = spec.inputs["time"], spec.inputs["F"]
    integral = np.append(0.0, np.cumsum(np.diff(t) * (force[1:] + force[:-1]) / 2))
    return lambda values: values["size"] * np.interp(spec.times, t, integral)[:, None]


SIMULATOR = SimpleNamespace(spec=Spec(), prepare=prepare)


@pytest.mark.parametrize("levels", [[0, 151, 860, 909, 935], [0, 7, 8, 30]])
def test_a_record_of_long_rests_reveals_the_step_of_its_quantiser(levels):
    step = 3.7e-4
    x = step * np.repeat(levels, 40).astype(float)
    noise, estimate = estimate_noise(np.arange(len(x)) * 0.01, x)
    assert estimate == pytest.approx(step, rel=1e-9)
    assert noise == pytest.approx(step / 12**0.5, rel=1e-9)


def test_levels_without_a_common_step_are_not_quantised():
    x = np.repeat(np.random.default_rng(1).normal(size=6), 40)
    assert estimate_noise(np.arange(len(x)) * 0.01, x)[1] == 0.0


@pytest.mark.parametrize("m", campaign_after(1, [1, 5, 10]))
def test_a_moving_average_of_white_noise_over_m_samples_counts_once_in_m(m):
    """Its neighbours have the correlation 1 - 1/m."""
    white = np.random.default_rng(m).normal(size=(200_000, 1))
    e = np.convolve(white[:, 0], np.full(m, 1.0 / m), "valid")[:, None]
    assert correlation_length(e) == pytest.approx(m, rel=0.05)
    assert significant_correlation(e) == pytest.approx(1.0 - 1.0 / m, abs=0.01)
    assert correlation_length(np.hstack([white[: len(e)], e])) == correlation_length(e)


def test_a_slow_drift_below_white_noise_is_found_in_sums():
    """Its neighbours are hardly correlated."""
    random, n = np.random.default_rng(3), 20_000
    drift = 0.12 * np.sin(np.linspace(0.0, 6.0 * np.pi, n))
    correlation = significant_correlation((random.normal(size=n) + drift)[:, None])
    assert 0.0 < abs(correlation) < 4.0 / n**0.5


def test_means_of_a_quantised_rest_keep_the_error_of_one_sample():
    t, step = np.linspace(0.0, 10.0, 20_001), 0.1
    moving = np.where(t > 5.0, 2.03 + 10.0 * (t - 5.0), 2.03)
    levels = np.round(moving / step) * step
    record = MeasuredRecord(SIMULATOR, Samples("record", t, {"x": levels}), is_averaged=True)
    errors = record.quantisation_errors(np.interp(record.t, t, moving)[:, None])[:, 0]
    assert record.width > 1
    assert errors[record.t < 4.9] == pytest.approx(-0.03)
    difference = record.y[1:, 0] - np.interp(record.t[1:], t, moving)
    assert errors[1:] == pytest.approx(difference, abs=1.1 * step / record.width)


def test_the_known_noise_of_a_sample_is_that_of_a_mean_times_the_root_of_their_number():
    t = np.linspace(0.0, 10.0, 20_001)
    record = MeasuredRecord(SIMULATOR, Samples("record", t, {"x": np.sin(t)}, sigma={"x": 0.3}), is_averaged=True)
    assert record.width > 1
    assert record.noise == pytest.approx(0.3 / record.width**0.5)


def test_inputs_pass_through_all_samples_after_their_error_has_been_estimated():
    t = np.linspace(0.0, 3.0, 49)
    force, x = np.sin(2 * np.pi * t), (1.0 - np.cos(2 * np.pi * t)) / (2 * np.pi)
    data = Samples("record", t, {"x": x}, input_t=t, inputs={"F": force}, sigma={"x": 1e-5})
    record = MeasuredRecord(SimpleNamespace(spec=Spec(), prepare=prepare_impulse), data, is_averaged=False)
    problem = FitProblem([record], ["x"], [Unknown("size", "size", "m", 0.5, 2.0)], {})
    change = subdivide_inputs(problem, np.zeros(1))
    error = np.abs(problem.residuals(np.zeros(1), problem.all_samples)).max()  # of splines only
    assert error < np.abs(change).max() < 5 * error
    assert record.subdivision > 1
    assert record.fine_inputs["F"][:: record.subdivision] == pytest.approx(force, abs=1e-9)
