"""Failure in co-simulation by FMI 3.0: the claims of test_refusals.py, where a refused step has status 3 (error)."""

import re
from math import inf, isfinite, nan

import fmi3_hosts
import pytest
from compare import identical
from fmi3_hosts import Failed
from models import EXACT, MODELS, ODE23, SIGN, declared, model_class, outputs, push

from tests.hosts import test_refusals
from tests.hosts.test_refusals import (  # noqa: F401
    test_a_bad_value_may_be_mended_before_it_is_used,
    test_a_calculated_value_cannot_be_set,
    test_a_motion_out_of_all_range_fails_in_one_sentence_or_stays_finite,
    test_a_step_that_begins_elsewhere_is_refused_also_at_zero,
    test_a_value_out_of_range_is_refused_by_its_name,
    test_a_value_that_turns_bad_in_mid_run_stops_the_run_and_reset_recovers,
    test_a_wrong_read_ends_the_call_and_not_the_instance,
    test_a_wrong_write_is_refused_by_the_next_step,
    test_an_unknown_choice_is_refused_with_those_there_are,
    test_friction_may_turn_bad_in_mid_run_only_as_a_pair,
    test_percent_signs_in_the_name_of_an_instance_do_no_harm,
    test_t_next_announces_a_run_that_will_fail,
    test_values_that_do_not_go_together_are_refused,
    test_whatever_is_right_within_rounding_is_taken_wherever_zero_lies,
    wrong_calls,
)

fmus, worker, _workers = fmi3_hosts.FIXTURES
fresh = fmi3_hosts.fresh
ERROR = 3
REALS, refuses = test_refusals.REALS, test_refusals.refuses


@pytest.fixture(autouse=True)
def _as_fmi_3_refuses(monkeypatch):
    monkeypatch.setattr(test_refusals, "REFUSED", ("fmi3DoStep", ERROR))


STEPS = {
    "of no size": (1.0, 0.0),
    "backwards": (1.0, -0.5),
    "of NaN": (1.0, nan),
    "without end": (1.0, inf),
    "from the past": (0.5, 0.1),
    "from the future": (1.5, 0.1),
    "from nowhere": (nan, 0.1),
    "from a little too late": (1.0 + 3e-7, 0.1),
    "from a little too early": (1.0 - 3e-7, 0.1),
}


@pytest.mark.parametrize("step", STEPS.values(), ids=STEPS)
@pytest.mark.parametrize("name", MODELS)
def test_a_step_that_cannot_be_taken_is_refused(launch, name, step):
    fmu = launch(name)
    fmu.step(0.0, 1.0)
    refuses(fmu, name, *step, "step", *(repr(part) for part in step), "1.0 s")


@pytest.mark.parametrize("t", [nan, inf, -inf])
@pytest.mark.parametrize("name", MODELS)
def test_a_first_step_from_no_time_is_refused_and_reset_recovers(launch, name, t):
    """The start time is that of the first step."""
    fmu = launch(name)
    refuses(fmu, name, t, 0.1, repr(t))
    fmu.reset()
    names = outputs(name)
    identical(fmu.begin().run([0.0, 0.5], names), launch(name).run([0.0, 0.5], names), names)


def test_what_concerns_co_simulation_only_is_not_said_before_the_first_step(launch):
    """The instance may still turn out to be one for model exchange."""
    fmu = launch("coulomb", {"friction": SIGN, "solver.method": EXACT})
    assert [message for message in fmu.messages() if message[0] != 0] == []
    assert fmu.worker.complaints() == ""
    refuses(fmu, "coulomb", 0.0, 0.1, "friction = 2", "exact", "hybrid")


WRONG_TYPES = ("Int32", "Int64", "UInt64", "Boolean", "String")


@pytest.fixture(params=wrong_calls(("Float64", *WRONG_TYPES), WRONG_TYPES), ids=str)
def wrong(request):
    return request.param


# ---- as fmpy tells it


def failures(name):
    """Ways to fail: options for fmpy.simulate_fmu, and what the sentence names."""
    force, _ = push(name)
    rows = [(0.0, 0.0), (0.5, 0.0), (0.5, nan), (1.0, nan)]
    yield "parameter", {"start_values": {"m": -1.0}}, ("m = -1.0", declared(name)["m"].allowed)
    yield "input", {"input": [[force], rows]}, (f"{force} = nan",)
    runaway = {"omega0": 1e200} if name == "pendulum" else {"v0": 1e300, "k": 1e300, "m": 1e-300}
    yield "motion", {"start_values": {**runaway, "solver.method": ODE23}}, ("range of numbers",)


FAILURES = [(name, *failure) for name in MODELS for failure in failures(name)]


@pytest.mark.parametrize(
    ("name", "options", "words"),
    [(name, options, words) for name, _, options, words in FAILURES],
    ids=[f"{name}-{what}" for name, what, _, _ in FAILURES],
)
def test_fmpy_raises_and_one_sentence_says_why(worker, fmus, name, options, words):
    with pytest.raises(Failed, match=re.escape("fmi3DoStep failed with status 3")):
        worker.simulate(fmus / f"{name}.fmu", "CoSimulation", stop_time=1.0, **options)
    (line,) = worker.complaints().splitlines()
    assert [word for word in words if word not in line] == [], line
    assert worker.simulate(fmus / f"{name}.fmu", "CoSimulation", stop_time=0.1)["time"][-1] == pytest.approx(0.1)


@pytest.mark.parametrize("name", MODELS)
def test_nothing_is_said_of_a_run_that_goes_well(worker, fmus, name):
    columns = worker.simulate(fmus / f"{name}.fmu", "CoSimulation")
    assert columns["time"][-1] == pytest.approx(model_class(name).stop_time, rel=1e-12)
    assert all(isfinite(value) for column in columns.values() for value in column)
    assert worker.complaints() == ""
