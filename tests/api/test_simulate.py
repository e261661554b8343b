"""harness.simulate: models, scenes, FMUs and stored results, with options and input signals."""

import sys
from math import pi
from pathlib import Path

import fmi3_fixtures
import native_fmus
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from variants import campaign_after

import harness

pytestmark = pytest.mark.usefixtures("in_workspace")

SMD = {"m": 1.0, "k": 157.9, "c": 2.0}


def driven_positions(t, force):
    """Return the positions of smd from rest under a force, by scipy."""

    def rates(t, y):
        return y[1], (force(t) - SMD["k"] * y[0] - SMD["c"] * y[1]) / SMD["m"]

    return solve_ivp(rates, (0.0, t[-1]), (0.0, 0.0), "DOP853", t_eval=t, rtol=1e-11, atol=1e-13).y[0]


def test_a_model_runs_with_all_outputs():
    run = harness.simulate("stickslip", {"mu_s": 0.8}, stop=8.0)
    assert run.time[0] == 0.0
    assert run.time[-1] == 8.0
    assert {"x", "v", "a", "F_friction", "mode"} <= {*run.columns}
    assert run.parameters["mu_s"] == 0.8
    assert run.units["x"] == "m"
    # the sled breaks away when the spring reaches the holding force: t = mu_s m g/(k v_driver)
    assert run.events.t[1] == pytest.approx(0.8 * 12.5 * 9.81 / (742.5 * 0.034), rel=1e-12)
    assert run.statistics.steps == 5


def test_interval_is_the_time_between_recorded_points():
    run = harness.simulate("coulomb", stop=3.0, interval=0.25)
    assert run.time == pytest.approx(np.arange(13) * 0.25, abs=1e-12)
    assert len(run.events.t) > 5


def test_method_and_tolerance_are_those_of_the_solver():
    exact, ode45 = (
        harness.simulate("coulomb", stop=3.0, interval=0.1, method=method, rtol=1e-6, outputs=["x"])
        for method in ("exact", "ode45")
    )
    assert 0.0 < np.abs(exact["x"] - ode45["x"]).max() < 1e-6
    assert ode45.parameters["solver.method"] == "ode45"
    assert ode45.parameters["solver.rtol"] == 1e-6
    assert {*exact.columns} == {"x"}


def test_an_interval_ends_with_the_stop():
    run = harness.simulate("smd", stop=1.05, interval=0.25)
    assert run.time == pytest.approx([0.0, 0.25, 0.5, 0.75, 1.0, 1.05])
    assert run["x"][-1] == harness.simulate("smd", stop=1.05)["x"][-1]


@pytest.mark.parametrize(
    "folder",
    [lambda: Path("fmus"), native_fmus.build_native_fmus, fmi3_fixtures.build_fmi3_fmus],
    ids=["python", "fmi2", "fmi3"],
)
def test_a_refusal_states_whether_a_bound_is_excluded(folder):
    for values, message in (
        ({"m": 0.0}, "m = 0.0 is outside its range; allowed: above 0.0 kg"),
        ({"m": -1.0}, "m = -1.0 is outside its range; allowed: above 0.0 kg"),
        ({"k": -1.0}, "k = -1.0 is outside its range; allowed: at least 0.0 N/m"),
        ({"solver.rtol": 1.0}, "solver.rtol = 1.0 is outside its range; allowed: at least 0.0 and below 1.0"),
    ):
        with pytest.raises(harness.SceneError) as refusal:
            harness.simulate(folder() / "smd.fmu", values)
        assert str(refusal.value) == message


@pytest.mark.parametrize(
    ("model", "options"),
    [
        ("stickslip", {"rtol": 1e-9}),
        ("pacejka", {"stop": 2.0}),
        ("coulomb", {"inputs": {"time": [0.0, 1.0, 1.0, 2.0], "F_ext": [1.0, 1.0, 2.0, 2.0]}, "method": "dop853"}),
    ],
)
def test_an_fmu_of_fmi3_runs_at_its_internal_steps_as_in_fmi2(model, options):
    """Also its events are listed, and its solver is the one that a tolerance is for. Its inputs have no slopes."""
    two, three = (
        harness.simulate(build() / f"{model}.fmu", **options)
        for build in (native_fmus.build_native_fmus, fmi3_fixtures.build_fmi3_fmus)
    )
    assert (three.note, three.failure) == (two.note, "")
    assert np.array_equal(three.time, two.time)
    assert all(np.array_equal(three[name], two[name]) for name in two)
    assert np.array_equal(three.steps.t, two.steps.t)
    if two.events is not None:
        assert len(two.events.t) > 3
        assert np.array_equal(three.events.t, two.events.t)
        assert np.array_equal(three.events.mode, two.events.mode)


@pytest.mark.parametrize("interface", campaign_after(1, ["CoSimulation", "ModelExchange"]))
@pytest.mark.parametrize(
    "folder", campaign_after(1, [native_fmus.build_native_fmus, fmi3_fixtures.build_fmi3_fmus]), ids=["fmi2", "fmi3"]
)
def test_input_signals_drive_every_interface(folder, interface):
    time = np.linspace(0.0, 2.0, 201)
    table = {"time": time, "F_ext": np.sin(pi * time)}
    start = {"x0": 0.0, "v0": 0.0}
    options = {"interface": interface, "rtol": 1e-6, "interval": 0.02}
    run = harness.simulate(folder() / "smd.fmu", start, stop=2.0, inputs=table, **options)
    expected = driven_positions(run.time, lambda t: np.interp(t, *table.values()))
    assert np.abs(run["x"] - expected).max() < 1e-5 * np.abs(expected).max()


def test_an_input_that_jumps_jumps_at_its_time():
    table = {"time": [0.0, 1.0, 1.0, 4.0], "F_ext": [0.0, 0.0, 5.0, 5.0]}
    run = harness.simulate("smd", {"x0": 0.0, "v0": 0.0}, stop=4.0, inputs=table)
    decay, after = SMD["c"] / 2, np.maximum(run.time - 1.0, 0.0)
    omega = np.sqrt(SMD["k"] - decay**2)
    swing = np.cos(omega * after) + decay / omega * np.sin(omega * after)
    assert run["x"] == pytest.approx(5.0 / SMD["k"] * (1.0 - np.exp(-decay * after) * swing), abs=1e-14)


@pytest.mark.parametrize(("interface", "at_jump"), [("CoSimulation", [5.0]), ("ModelExchange", [0.0, 5.0])])
def test_outputs_at_a_jump_have_the_input_after_it(interface, at_jump):
    """Model exchange shows both sides, because a jump is an event there."""
    table = {"time": [0.0, 0.0, 1.0, 1.0, 4.0], "F_ext": [9.0, 0.0, 0.0, 5.0, 5.0]}
    options = {"source": native_fmus.build_native_fmus() / "smd.fmu", "inputs": table, "interface": interface}
    run, sampled_run = harness.simulate(**options), harness.simulate(**options, times=[0.5, 1.0, 1.5])
    force, sampled_force = (
        SMD["m"] * result["a"] + SMD["c"] * result["v"] + SMD["k"] * result["x"] for result in (run, sampled_run)
    )
    assert sampled_force == pytest.approx([0.0, 5.0, 5.0], abs=1e-12)
    assert force[run.time == 1.0] == pytest.approx(at_jump, abs=1e-12)
    assert force[run.time != 1.0] == pytest.approx(np.where(run.time[run.time != 1.0] > 1.0, 5.0, 0.0), abs=1e-12)


def test_a_native_fmu_breaks_away_where_a_ramp_between_rows_reaches_the_limit():
    """Closed form: F_ext = 2 t reaches the limit of 0.7 N at 0.35 s. A Python FMU holds F_ext within a step."""
    table, values = {"time": [0.0, 1.0], "F_ext": [0.0, 2.0]}, {"x0": 0.0, "v0": 0.0, "f": 0.7}
    sources = native_fmus.build_native_fmus() / "coulomb.fmu", "coulomb"
    native, python = (harness.simulate(fmu, values, stop=1.0, interval=0.5, inputs=table) for fmu in sources)
    assert native.events.t[1] == pytest.approx(0.35, abs=1e-12)
    assert python.events.t[1] == pytest.approx(0.35, abs=0.5 / 4096)


@pytest.mark.parametrize("interval", [0.25, 0.3, 2.0])
def test_inputs_are_followed_between_the_times_of_the_interval(interval):
    """A force that starts and ends within an interval moves the body as with short intervals."""
    table = {"time": [0.0, 0.1, 0.12, 0.2, 0.22, 2.0], "F_ext": [0.0, 0.0, 5.0, 5.0, 0.0, 0.0]}
    values = {"x0": 0.0, "v0": 0.0}
    run, short = (harness.simulate("smd", values, stop=2.0, interval=h, inputs=table) for h in (interval, 0.01))
    assert run["x"][-1] == pytest.approx(short["x"][-1], rel=1e-4)
    assert abs(run["x"][-1]) > 1e-3


def test_a_data_frame_drives_inputs():
    pandas = pytest.importorskip("pandas")
    table = pandas.DataFrame({"F_ext": [0.0, 2.0]}, index=pandas.Index([0.0, 4.0], name="time"))
    frame_run = harness.simulate("coulomb", inputs=table, interval=0.5)
    mapping_run = harness.simulate("coulomb", inputs={"time": [0.0, 4.0], "F_ext": [0.0, 2.0]}, interval=0.5)
    assert np.array_equal(frame_run["x"], mapping_run["x"])


def test_results_convert_with_their_units():
    run = harness.simulate("smd", stop=1.0, interval=0.1)
    frame, dataset = run.to_pandas(), run.to_xarray()
    assert frame.index.name == "time"
    assert frame.index.to_numpy() == pytest.approx(run.time)
    assert frame.attrs["units"]["v"] == "m/s"
    assert dataset["F_spring"].attrs["units"] == "N"
    assert dataset["time"].attrs["units"] == "s"
    assert dataset.attrs["k"] == 157.9
    assert np.array_equal(dataset["x"], frame["x"])


@pytest.mark.parametrize(("package", "convert"), [("pandas", "to_pandas"), ("xarray", "to_xarray")])
def test_a_missing_package_is_named(monkeypatch, package, convert):
    run = harness.simulate("smd", stop=1.0)
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(harness.HarnessError, match=rf"needs {package}, which is not installed: .*friction-fmus\[sweep"):
        getattr(run, convert)()


def test_plot_draws_one_panel_for_each_output(monkeypatch):
    monkeypatch.setenv("MPLBACKEND", "Agg")
    run = harness.simulate("coulomb")
    import matplotlib.pyplot as plt

    axes = run.plot("x", "mode")
    assert [panel.get_ylabel() for panel in axes] == ["x [m]", "mode"]
    assert len(run.plot()) == len(run.columns)
    plt.close("all")
    with pytest.raises(harness.SceneError, match="unknown column 'y'"):
        run.plot("y")


def test_nothing_is_printed(capfd):
    harness.simulate("pendulum", stop=1.0, inputs={"time": [0.0], "T_ext": [0.001]})
    shares = []
    harness.simulate("coulomb", method="ode23", rtol=1e-9, progress=shares.append)
    assert capfd.readouterr() == ("", "")
    assert shares
    assert all(0.0 <= share <= 1.0 for share in shares)


def test_a_failed_run_raises_the_message_of_the_fmu():
    with pytest.raises(harness.HarnessError, match="mu_d"):
        harness.simulate("stickslip", {"mu_s": 0.5, "mu_d": 0.6})


def test_an_interval_records_every_multiple_once(in_workspace):
    """The first internal step of pendulum takes 3.6 microseconds, a rounding of a long interval."""
    run = harness.simulate("pendulum", stop=2e4, interval=1e4, outputs=["theta"])
    assert run.time.tolist() == [0.0, 1e4, 2e4]


@pytest.mark.parametrize("method", campaign_after(1, ["ode45", "ode23", "dop853", "rodas", "radau9"]))
def test_a_tolerance_acts_on_every_method(in_workspace, method):
    """In a run, in a sweep and on both sides of a comparison: a smaller tolerance takes more steps."""
    pytest.importorskip("xarray")
    steps = []
    for rtol in (1e-2, 1e-9):
        run = harness.simulate("pacejka", {"x_m": 0.1}, stop=2.0, method=method, rtol=rtol)
        grid, values = {"x_m": [0.1]}, {"solver.method": method}
        data = harness.sweep("pacejka", grid, values=values, measures=["steps"], stop=2.0, rtol=rtol)
        assert float(data["steps"][0]) == run.statistics.steps
        steps.append(run.statistics.steps)
    assert steps[0] < steps[1]


def test_the_tolerance_of_a_comparison_acts_on_fmus_and_scenes(in_workspace):
    recorded_run = harness.simulate("pacejka", stop=1.0)
    for source in ("fmus/pacejka.fmu", "pacejka"):
        loose, tight = (harness.compare(source, recorded_run, stop=1.0, rtol=rtol).one for rtol in (1e-2, 1e-9))
        assert loose.statistics.steps < tight.statistics.steps
    comparison = harness.compare("fmus/smd.fmu", "fmus/pacejka.fmu", stop=1.0, rtol=1e-9)
    assert comparison.two.parameters["solver.rtol"] == 1e-9
