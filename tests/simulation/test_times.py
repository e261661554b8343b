"""Runs are recorded at given times, and at no others."""

import commands
import numpy as np
import pytest
from external_fmus import build_external_fmus
from fmi3_fixtures import build_fmi3_fmus
from variants import slow_after

import harness

UNEVEN = np.sort(np.random.default_rng(2).uniform(0.01, 7.99, 40))


def write_scene(folder, fmu, **keys):
    """Write a scene with an FMU, and return its path."""
    keys = {"outputs": ["x"], **keys}
    lines = [f"{name} = {str(value).lower() if value in (True, False) else value}" for name, value in keys.items()]
    path = folder / "scene.toml"
    path.write_text("\n".join(['title = "a title"', f'fmu = "{fmu}"', "plots = []", *lines]))
    return path


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


def test_a_run_stops_at_the_last_time(fmus, tmp_path):
    """Whether communication steps end at the ends of internal steps or not."""
    run = harness.simulate(fmus / "smd.fmu", times=UNEVEN)
    plain = harness.simulate(write_scene(tmp_path, fmus / "smd.fmu", times=UNEVEN.tolist(), follow=False))
    later = harness.simulate(fmus / "smd.fmu", times=UNEVEN, stop=20.0)
    assert run.statistics.steps > 0
    for other in (run, plain, later):
        assert np.array_equal(other.time, UNEVEN)
        assert np.array_equal(other["x"], run["x"])


@pytest.mark.parametrize(
    ("name", "interface"),
    slow_after(1, [("Midpoint", None), ("Fmi3Midpoint", None), ("ModelExchangeOnly", "ModelExchange")]),
)
def test_an_external_fmu_is_recorded_at_times(name, interface):
    times = UNEVEN / 8.0
    run = harness.simulate(
        build_external_fmus() / f"{name}.fmu", {"k": 50.0}, times=times, stop=1.0, rtol=1e-3, interface=interface
    )
    assert np.array_equal(run.time, times)
    position = next(iter(run.columns.values()))
    assert np.abs(position - np.cos(np.sqrt(50.0) * times)).max() < 2e-3


@pytest.mark.parametrize("stop", [0.3, 0.1 + 0.2, 1 / 3, 7.3])
def test_the_internal_steps_cover_the_run(fmus, stop):
    """The last one may end a rounding after the stop."""
    run = harness.simulate(fmus / "smd.fmu", stop=stop, method="ode45")
    assert run.steps.t[0] == 0.0
    assert run.steps.t[-1] == pytest.approx(stop, rel=1e-9)
    assert np.diff(run.steps.t) == pytest.approx(run.steps.h)


def test_model_exchange_is_recorded_at_times(fmus):
    """At times of events as well, where the solver has two points."""
    sled = build_fmi3_fmus() / "stickslip.fmu"
    reference = harness.simulate(fmus / "stickslip.fmu", stop=8.0)
    times = np.sort(np.append(UNEVEN, reference.events.t[1:]))
    run = harness.simulate(sled, times=times, interface="ModelExchange", rtol=1e-8)
    expected = harness.simulate(fmus / "stickslip.fmu", times=times, stop=8.0)
    assert len(run.time) == len(times)
    assert np.abs(run["x"] - expected["x"]).max() < 1e-6


def test_steps_without_refinement_end_at_the_times(tmp_path):
    midpoint = build_external_fmus() / "Midpoint.fmu"
    run = harness.simulate(write_scene(tmp_path, midpoint, times=(UNEVEN / 8.0).tolist(), follow=False))
    assert np.array_equal(run.time, UNEVEN / 8.0)
    assert run.note == "requested communication times, error unknown"


def test_a_ramp_of_an_input_follows_its_rows(fmus, tmp_path):
    """Without a grid, steps end at the times and at the rows of the table: an input is the mean of a step."""
    rows, options = np.linspace(0.0, 2.0, 2001), {"stop": 2.0, "follow": False}
    inputs = {"time": rows, "F_ext": np.sin(rows)}
    smd, times = fmus / "smd.fmu", [0.5, 2.0]
    driven_run = harness.simulate(write_scene(tmp_path, smd, **options, times=times), inputs=inputs)
    scene = write_scene(tmp_path, smd, **options, times=times, grid=0.001)
    grid = harness.simulate(scene, inputs={"time": rows[::200], "F_ext": np.sin(rows[::200])})
    assert len(driven_run.time) == len(grid.time) == 2
    assert np.abs(driven_run["x"] - grid["x"]).max() < 2e-3 * np.abs(driven_run["x"]).max()
    full = harness.simulate(write_scene(tmp_path, smd, **options, grid=0.001), inputs=inputs)
    assert np.abs(driven_run["x"] - full["x"][[500, -1]]).max() < 1e-12


def test_an_aborted_run_keeps_the_times_that_it_reached(tmp_path):
    """The FMU crashes after half of the run."""
    for times in ([0.1, 0.2, 0.9], [0.8, 0.9]):
        faulty = build_external_fmus() / "Faulty.fmu"
        write_scene(tmp_path, faulty, times=times, stop=1.0, values="{kind = 2}")
        result = commands.harness(tmp_path, "run", "scene.toml")
        assert result.returncode == 1
        assert "crashed" in result.stderr
        reached_times = harness.load_result(tmp_path / "results/scene").time
        if times[0] == 0.1:
            assert reached_times.tolist() == [0.1, 0.2]
        else:
            assert 0.4 < reached_times.item() < 0.8


def test_a_scene_is_recorded_at_times(workspace):
    scene = 'title = "some times"\nmodel = "stickslip"\noutputs = ["x", "v"]\ntimes = [0.0, 0.5, 4.5, 6.25, 15.0]\n'
    (workspace / "some.toml").write_text(scene)
    result = commands.harness(workspace, "run", "some.toml")
    assert result.returncode == 0, result.stderr
    table = np.loadtxt(workspace / "results/some/trajectory.csv", delimiter=",", skiprows=1)
    assert table[:, 0].tolist() == [0.0, 0.5, 4.5, 6.25, 15.0]
