"""Impossible results of an FMU are refused in one sentence, and never used."""

import re
from ctypes import byref, c_bool, c_double
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from fmpy.model_description import ModelVariable
from spec_runs import ignore_progress

from harness import HarnessError
from harness.running.event_mode import update_discrete_states
from harness.running.external.step_refinement import RefinementRun, refine
from harness.running.fmu_instance import FmuInstance, TerminatedError
from harness.running.recorder import Recorder, StringTable, read_rows
from harness.running.stepping import CoSimulation, TimeGrid, step_to_stop
from harness.scenes.run_spec import RunSpec

NAN, HUGE = float("nan"), 1e300


def run_with_step(answer):
    """Return the sample times of an FMU whose fmi3DoStep returns `answer`, and the exception."""

    def do_step(instance, t, h, is_final, *results):
        for result, value in zip(results, answer(t, h), strict=True):
            result._obj.value = value
        return 0

    instance = FmuInstance.__new__(FmuInstance)  # without a library
    instance.component, instance.do_step, instance.uses_event_mode = None, do_step, False
    instance.step_results = (c_bool(), c_bool(), c_bool(), c_double())
    instance.step_arguments = tuple(map(byref, instance.step_results))
    times, grid = [], TimeGrid(0.0, 1.0, 0.25)
    with pytest.raises((TerminatedError, HarnessError)) as caught:
        step_to_stop(CoSimulation(instance, grid, only_grid=True), grid, times.append, ignore_progress)
    return times, str(caught.value)


def test_an_unauthorised_early_return_is_refused():
    times, output = run_with_step(lambda t, h: (False, False, t > 0.3, t + h / 2))
    assert times == [0.0, 0.25, 0.5]
    assert output == "fmi3DoStep returned early without permission"


@pytest.mark.parametrize(
    ("last_time", "last"), [(0.6, 0.6), (0.75, 0.75), (0.5, 0.5), (0.1, 0.5), (-1.0, 0.5), (NAN, 0.5), (HUGE, 0.5)]
)
def test_a_termination_time_lies_within_the_step(last_time, last):
    times, output = run_with_step(lambda t, h: (False, t == 0.5, t == 0.5, last_time))
    assert (times[-1], times) == (last, sorted(times))
    assert output == "it terminated the simulation: fmi3DoStep returned terminateSimulation"


@pytest.mark.parametrize("next_time", [NAN, 1.9, -HUGE])
def test_an_event_in_the_past_or_at_infinity_is_refused(next_time):
    with pytest.raises(HarnessError, match=re.escape(f"sets its next event to {next_time:.9g} s, at t = 2 s")):
        update_discrete_states(lambda: (False, False, False, False, True, next_time), 2.0)


def test_an_immediate_event_is_handled_at_once_and_not_forever():
    answers = iter([(False, False, False, False, True, 2.0), (False, False, False, False, True, 3.0)])
    assert update_discrete_states(lambda: next(answers), 2.0) == 3.0
    with pytest.raises(HarnessError, match="do not settle at t = 2 s"):
        update_discrete_states(lambda: (False, False, False, False, True, 2.0), 2.0)


@pytest.mark.parametrize("declared", ["0", "-1", "inf", "a tenth"])
def test_an_impossible_step_size_is_treated_as_undeclared(declared):
    steps = []

    def run(h, tolerance):
        steps.append(h)
        return RefinementRun(len(steps), np.zeros(1), {}, "no")

    description = SimpleNamespace(coSimulation=SimpleNamespace(fixedInternalStepSize=declared), defaultExperiment=None)
    refine(RunSpec(Path("any.fmu"), start=0.0, stop=1.0), description, run)
    assert min(steps) > 0.0


@pytest.mark.parametrize(("bytes_", "text"), [(None, '""'), (b"\xff bad", '"\\ufffd bad"'), (b"good", '"good"')])
def test_a_null_or_malformed_string_is_recorded(tmp_path, bytes_, text):
    def answer(component, references, count, values, size):
        values[0] = bytes_
        return 0

    variable = ModelVariable("said", valueReference=7, type="String")
    instance = SimpleNamespace(
        ticks_clocks=False,
        is_fmi2=False,
        type_name=lambda variable: "String",
        prepare_call=lambda name, *arguments: (name, answer, (None, *arguments)),
    )
    texts, rows = StringTable(tmp_path / "texts"), bytearray()
    Recorder(instance, [(variable, ())], rows.extend, texts).record(0.0)
    texts.file.close()
    _, columns = read_rows(rows, [(variable, ())], is_fmi2=False)
    assert columns["said"].tolist() == [0]
    assert (tmp_path / "texts").read_text() == text + "\n"
