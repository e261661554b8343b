"""Errors in FMI 3.0 co-simulation: status 3 (error) and one sentence."""

from math import isfinite, nan

import fmi3_fixtures
import pytest
from fmi3_fixtures import FmpyError
from models import MODELS, ODE23, PUSHED, declared, model_class, outputs, push
from row_comparison import assert_identical
from worker_client import FmiError

from tests.hosts.test_invalid_values import test_an_impossible_step_is_refused_and_changes_nothing  # noqa: F401

fmus, worker, _workers = fmi3_fixtures.FIXTURES
fresh_worker = fmi3_fixtures.fresh_worker
ERROR = 3


@pytest.mark.parametrize("kind", ["Float64", "Float32", "Int32", "Int64", "UInt64", "Boolean", "String"])
def test_a_wrong_call_fails_without_ending_the_run(launch, kind):
    """Each call returns Error with one sentence and changes nothing. In the sled, reference 0 is the mass."""
    times, names = [0.0, 0.1, 0.2], outputs("stickslip")
    expected, fmu = launch("stickslip").run(times, names), launch("stickslip")
    rows = [fmu.get(*names)]
    for t, reference in ((0.0, 0 if kind != "Float64" else 10**6), (0.1, 2**32 - 1)):
        for function, arguments in (("read_one", []), ("write_one", [{"Boolean": True, "String": "1"}.get(kind, 1)])):
            with pytest.raises(FmiError, match="returned status 3"):
                getattr(fmu, function)(kind, reference, *arguments)
            ((status, category, sentence),) = fmu.messages()
            assert (status, category) == (ERROR, "logStatusError")
            assert f"value reference {reference} is refused: this FMU has no such variable of type {kind}" in sentence
            assert fmu.worker.read_stderr().splitlines() == [f"Stickslip (test): {sentence}"]
        fmu.step(t, 0.1)
        rows.append(fmu.get(*names))
    assert_identical(rows, expected, names)


# ---- as reported by fmpy


def failures(name):
    """Return invalid runs: options for fmpy.simulate_fmu, and words of the message."""
    force, _ = push(name)
    rows = [(0.0, 0.0), (0.5, 0.0), (0.5, nan), (1.0, nan)]
    yield "SetFloat64", {"start_values": {"m": -1.0}}, ("m = -1.0", declared(name)["m"].allowed)
    yield "SetFloat64", {"input": [[force], rows]}, (f"{force} = nan",)
    runaway = {"omega0": 1e200} if name == "pendulum" else {"v0": 1e300, "k": 1e300, "m": 1e-300}
    yield "DoStep", {"start_values": {**runaway, "solver.method": ODE23}}, ("solution diverges",)


FAILURES = [(name, *failure) for name in PUSHED for failure in failures(name)]


@pytest.mark.parametrize(
    ("name", "call", "options", "words"), FAILURES, ids=[f"{name}-{next(iter(o))}" for name, _, o, _ in FAILURES]
)
def test_fmpy_raises_and_one_sentence_gives_the_reason(worker, fmus, name, call, options, words):
    with pytest.raises(FmpyError, match=f"fmi3{call} failed with status 3"):
        worker.simulate(fmus / f"{name}.fmu", "CoSimulation", stop_time=1.0, **options)
    (line,) = worker.read_stderr().splitlines()
    assert [word for word in words if word not in line] == [], line
    assert worker.simulate(fmus / f"{name}.fmu", "CoSimulation", stop_time=0.1)["time"][-1] == pytest.approx(0.1)


@pytest.mark.parametrize("name", MODELS)
def test_a_successful_run_logs_nothing(worker, fmus, name):
    columns = worker.simulate(fmus / f"{name}.fmu", "CoSimulation")
    assert columns["time"][-1] == pytest.approx(model_class(name).stop_time, rel=1e-12)
    assert all(isfinite(value) for column in columns.values() for value in column)
    assert worker.read_stderr() == ""
