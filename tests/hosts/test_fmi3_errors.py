"""Errors in FMI 3.0 co-simulation: status 3 (error) and one sentence."""

from math import isfinite, nan

import fmi3_fixtures
import pytest
from models import MODELS, ODE23, PUSHED, declared, model_class, push
from worker_client import FmpyError

from tests.hosts.test_invalid_values import test_an_impossible_step_is_refused_and_changes_nothing  # noqa: F401

fmus = fmi3_fixtures.fmus


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
