"""Validation of a fit whose runs are a sine."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from harness.analyses.fit.fit_problem import FitProblem
from harness.analyses.fit.fit_procedure import subdivide_inputs
from harness.analyses.fit.measured_record import MeasuredRecord, RecordData
from harness.analyses.fit.unknowns import Unknown
from harness.analyses.fit.validation import prepare_record, validate
from harness.scenes.run_spec import RunSpec

NOISE = 1e-4


def prepare(spec):
    """Return a function that returns a sine of 1 Hz with a given size."""
    return lambda values: values["size"] * np.sin(2 * np.pi * spec.times)[:, None]


SIMULATOR = SimpleNamespace(spec=RunSpec(Path("sine.fmu"), ("x",)), prepare=prepare)


def make_record(stop):
    """Return a record of 6001 samples until the stop time in s, with noise."""
    t = np.linspace(0.0, stop, 6001)
    y = prepare(RunSpec(Path(), times=t))({"size": 1.0}) + NOISE * np.random.default_rng(1).normal(size=(len(t), 1))
    return RecordData(f"{stop} s", t, y, {}, (None,))


def test_a_validation_record_is_averaged_only_where_its_means_are_those_of_the_outputs():
    """Means of two samples hold the sine where they are 1 ms apart, and smooth it where they are 10 ms apart."""
    data = make_record(6.0)
    fitted = MeasuredRecord(SIMULATOR, data, binned=True)
    problem = FitProblem([fitted], ["x"], [Unknown("size", "size", "m", 0.5, 2.0)], {})
    z = np.zeros(1)
    raw_fit = SimpleNamespace(z=z, uncertainty=SimpleNamespace(residuals=problem.residuals(z, problem.all)))
    same, longer = validate(problem, raw_fit, [data, make_record(60.0)]).records
    assert (fitted.width, same.width, longer.width) == (2, 2, 1)
    validation = validate(problem, raw_fit, [make_record(60.0)])
    assert validation.columns[0].residual == pytest.approx(NOISE, rel=0.1)
    assert validation.remarks == ()


def test_the_inputs_of_a_validation_record_are_as_fine_as_those_of_the_fit():
    data = make_record(6.0)
    driven = RecordData(data.name, data.t, data.y, {"F": np.cos(data.t)}, data.sigma)
    fitted = MeasuredRecord(SIMULATOR, driven, binned=False)
    fitted.subdivide(4)
    problem = FitProblem([fitted], ["x"], [Unknown("size", "size", "m", 0.5, 2.0)], {})
    record = prepare_record(problem, SimpleNamespace(z=np.zeros(1)), driven)
    assert len(record.fine_t) == len(record.driven["F"]) == 4 * (len(data.t) - 1) + 1


def test_inputs_pass_through_all_samples_after_their_error_has_been_estimated():
    data = make_record(6.0)
    force = np.random.default_rng(1).normal(size=len(data.t))
    record = MeasuredRecord(SIMULATOR, RecordData(data.name, data.t, data.y, {"F": force}, data.sigma), binned=False)
    problem = FitProblem([record], ["x"], [Unknown("size", "size", "m", 0.5, 2.0)], {})
    subdivide_inputs(problem, np.zeros(1))
    assert record.subdivision > 1
    assert record.driven["F"][:: record.subdivision] == pytest.approx(force, abs=1e-9)
