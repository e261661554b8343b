"""Impossible results of an FMU are refused in one sentence, and never used."""

from pathlib import Path
from types import SimpleNamespace

import commands
import numpy as np
import pytest
from external_fmus import build_external_fmus, edited_copy

import harness
from harness.scenes.run_spec import RunSpec
from harness.simulation.external.step_refinement import RefinementRun, refine

EARLY, ENDS, NO_TEXT, BAD_TEXT = 1, 2, 3, 4  # faults of Ticking
TERMINATES, ENDLESS_ITERATION, NEXT_EVENT, IMMEDIATE, LOGS = 1, 2, 3, 4, 5  # faults of Bouncing


def run_faulty(folder, name, fault, value=0.0, *options, fmu=None):
    """Run an FMU with a fault; return the error message and what was recorded until then."""
    fmu = fmu or build_external_fmus() / f"{name}.fmu"
    settings = "--set", f"fault={fault}", "--set", f"value={value!r}"
    result = commands.harness(folder, "run", fmu, *settings, *options)
    assert (result.returncode, result.stderr.count("\n")) == (1, 1)
    return result.stderr, harness.load_result(folder / "results" / name)


def test_an_unauthorised_early_return_is_refused(tmp_path):
    """Early returns are permitted in event mode."""
    changes = {"modelDescription.xml": lambda text: text.replace(' hasEventMode="true"', "")}
    fmu = edited_copy(build_external_fmus() / "Ticking.fmu", tmp_path / "Ticking.fmu", changes)
    message, run = run_faulty(tmp_path, "Ticking", EARLY, 0.0, "--lenient", fmu=fmu)
    assert "fmi3DoStep returned early without permission" in message
    assert 0.3 < run.time[-1] < 0.32


@pytest.mark.parametrize(("last_time", "last"), [(0.5 + 1e-6, 0.5 + 1e-6), (-1.0, 0.5), (1e300, 0.5)])
def test_a_termination_time_lies_within_the_step(tmp_path, last_time, last):
    message, run = run_faulty(tmp_path, "Ticking", ENDS, last_time)
    assert "it terminated the simulation: fmi3DoStep returned terminateSimulation" in message
    assert run.time[-1] == pytest.approx(last, abs=1e-9)
    assert (np.diff(run.time) >= 0.0).all()


@pytest.mark.parametrize(("fault", "text"), [(0, "good"), (NO_TEXT, ""), (BAD_TEXT, "\ufffd bad")])
def test_a_null_or_malformed_string_is_recorded(fault, text):
    fmu = build_external_fmus() / "Ticking.fmu"
    run = harness.simulate(fmu, {"fault": fault}, outputs=["said"], stop=0.04, rtol=1e-3)
    assert {*run["said"]} == {text}


@pytest.mark.parametrize("next_time", [0.1, -1e300])
def test_an_event_in_the_past_is_refused(tmp_path, next_time):
    message, run = run_faulty(tmp_path, "Bouncing", NEXT_EVENT, next_time)
    assert f"it sets its next event to {next_time:.9g} s, at t = 0.4515" in message
    assert run.time[-1] == pytest.approx(np.sqrt(2 / 9.81), abs=1e-6)


def test_an_immediate_event_is_handled_at_once_and_not_forever(tmp_path):
    fmu = build_external_fmus() / "Bouncing.fmu"
    plain, immediate = (harness.simulate(fmu, {"fault": fault}) for fault in (0, IMMEDIATE))
    assert plain["h"].tolist() == immediate["h"].tolist()
    message, _ = run_faulty(tmp_path, "Bouncing", ENDLESS_ITERATION)
    assert "its discrete states do not settle at t = 0.4515" in message


def test_the_event_that_terminates_a_run_is_recorded(tmp_path):
    message, run = run_faulty(tmp_path, "Bouncing", TERMINATES, 2.0)
    assert "it returned terminateSimulation from an event" in message
    assert run["bounces"].tolist() == sorted(run["bounces"])
    assert run["bounces"][-1] == 2
    assert run.time[-1] == run.time[-2]


def test_a_later_warning_does_not_hide_an_error(tmp_path):
    message, _ = run_faulty(tmp_path, "Bouncing", LOGS)
    assert "its rubber is torn" in message


@pytest.mark.parametrize("declared_step", ["0", "-1", "inf", "a tenth"])
def test_an_impossible_step_size_is_treated_as_undeclared(declared_step):
    steps = []

    def run(h, tolerance):
        steps.append(h)
        return RefinementRun(len(steps), np.zeros(1), {}, "no")

    description = SimpleNamespace(
        coSimulation=SimpleNamespace(fixedInternalStepSize=declared_step), defaultExperiment=None
    )
    refine(RunSpec(Path("any.fmu"), start=0.0, stop=1.0), description, run)
    assert min(steps) > 0.0
