"""Runs are recorded at given times, and at no others."""

from dataclasses import replace

import commands
import numpy as np
import pytest
from external_fmus import build_external_fmus
from fmi3_fixtures import build_fmi3_fmus
from spec_runs import run_spec

import harness
from harness.running.session import find_step_ends
from harness.scenes.run_spec import RunSpec

UNEVEN = np.sort(np.random.default_rng(2).uniform(0.01, 7.99, 40))


def test_times_keep_the_points_of_another_grid(backend_fmus):
    """Internal steps do not depend on communication points, and all events are known."""
    sled = backend_fmus / "stickslip.fmu"
    full = harness.simulate(sled, {"mu_s": 0.8}, interval=0.125, stop=8.0)
    indices = np.sort(np.random.default_rng(1).choice(len(full.time), 20, replace=False))
    run = harness.simulate(sled, {"mu_s": 0.8}, times=full.time[indices], stop=8.0)
    assert np.array_equal(run.time, full.time[indices])
    for name, column in run.columns.items():
        assert np.array_equal(column, full[name][indices]), name
    assert np.array_equal(run.events.t, full.events.t)
    assert np.array_equal(run.steps.t, full.steps.t)


@pytest.mark.parametrize("follow", [True, False])
def test_a_run_stops_at_the_last_time(fmus, follow):
    run = run_spec(RunSpec(fmus / "smd.fmu", times=UNEVEN, follow=follow))
    assert np.array_equal(run.time, UNEVEN)
    assert run.statistics.steps > 0
    later = harness.simulate(fmus / "smd.fmu", times=UNEVEN, stop=20.0)
    assert np.array_equal(later["x"], run["x"])


@pytest.mark.parametrize(
    ("name", "interface"), [("Midpoint", None), ("Fmi3Midpoint", None), ("ModelExchangeOnly", "ModelExchange")]
)
def test_an_external_fmu_is_recorded_at_times(name, interface):
    times = UNEVEN / 8.0
    run = harness.simulate(
        build_external_fmus() / f"{name}.fmu", {"k": 50.0}, times=times, stop=1.0, rtol=1e-3, interface=interface
    )
    assert np.array_equal(run.time, times)
    position = next(iter(run.columns.values()))
    assert np.abs(position - np.cos(np.sqrt(50.0) * times)).max() < 2e-3


def test_equal_steps_divide_the_time_from_start_to_stop(fmus):
    spec = RunSpec(fmus / "smd.fmu", ("x",), start=2.0, stop=4.0, equal_steps=4, follow=False)
    assert run_spec(spec).time.tolist() == [2.0, 2.5, 3.0, 3.5, 4.0]


@pytest.mark.parametrize(("next_step", "ends"), [(2.0, [0, 1, 2]), (2.0 + 1e-12, [0, 1, 2]), (2.5, [0, 1])])
def test_the_last_internal_step_may_end_a_rounding_after_the_stop(next_step, ends):
    rows = find_step_ends(np.array([0.0, 1.0, 2.0]), np.array([1.0, next_step, 3.0]), 1e-9)
    assert rows.tolist() == ends


def test_model_exchange_is_recorded_at_times(fmus):
    """At times of events as well, where the solver has two points."""
    sled = RunSpec(build_fmi3_fmus() / "stickslip.fmu", ("x", "mode"), exchange=True, tolerance=1e-8, stop=8.0)
    reference = harness.simulate(fmus / "stickslip.fmu", stop=8.0)
    times = np.sort(np.append(UNEVEN, reference.events.t[1:]))
    run = run_spec(replace(sled, times=times))
    expected = harness.simulate(fmus / "stickslip.fmu", times=times, stop=8.0)
    assert len(run.time) == len(times)
    assert np.abs(run["x"] - expected["x"]).max() < 1e-6


def test_steps_without_refinement_end_at_the_times_and_at_rows_of_inputs():
    spec = RunSpec(build_external_fmus() / "Midpoint.fmu", times=UNEVEN / 8.0, follow=False)
    run = run_spec(spec)
    assert np.array_equal(run.time, UNEVEN / 8.0)
    assert run.note == "requested communication times, error unknown"


def test_a_ramp_of_an_input_follows_its_rows(fmus):
    """Without a grid, steps end at the times and at the rows of the table: an input is the mean of a step."""
    rows = np.linspace(0.0, 2.0, 2001)
    spec = RunSpec(fmus / "smd.fmu", ("x",), stop=2.0, follow=False, times=(0.5, 2.0))
    driven = run_spec(replace(spec, inputs={"time": rows, "F_ext": np.sin(rows)}))
    grid = run_spec(replace(spec, grid=0.001, inputs={"time": rows[::200], "F_ext": np.sin(rows[::200])}))
    assert len(driven.time) == len(grid.time) == 2
    assert np.abs(driven["x"] - grid["x"]).max() < 2e-3 * np.abs(driven["x"]).max()
    full = run_spec(replace(spec, times=(), grid=0.001, inputs={"time": rows, "F_ext": np.sin(rows)}))
    assert np.abs(driven["x"] - full["x"][[500, -1]]).max() < 1e-12


def test_an_aborted_run_keeps_the_times_that_it_reached():
    crashing = RunSpec(build_external_fmus() / "Faulty.fmu", values={"kind": 2}, stop=1.0)  # after half of the run
    run = run_spec(replace(crashing, times=(0.1, 0.2, 0.9)))
    assert run.time.tolist() == [0.1, 0.2]
    assert "crashed" in run.failure
    late = run_spec(replace(crashing, times=(0.8, 0.9)))
    assert 0.4 < late.time.item() < 0.8


def test_a_scene_is_recorded_at_times(workspace):
    scene = 'title = "some times"\nmodel = "stickslip"\noutputs = ["x", "v"]\ntimes = [0.0, 0.5, 4.5, 6.25, 15.0]\n'
    (workspace / "some.toml").write_text(scene)
    done = commands.harness(workspace, "run", "some.toml")
    assert done.returncode == 0, done.stderr
    table = np.loadtxt(workspace / "results/some/trajectory.csv", delimiter=",", skiprows=1)
    assert table[:, 0].tolist() == [0.0, 0.5, 4.5, 6.25, 15.0]
