"""Sweeps on the built FMUs: the runs, their measures, and the messages of failed runs."""

import json
import sys
from functools import partial
from math import sqrt

import commands
import external_fmus
import numpy as np
import pytest
from sweep_results import open_sweep, sweep_folder
from variants import campaign_after

import harness

pandas = pytest.importorskip("pandas", reason="the extra 'sweep' is not installed")

MAP = (
    "sweep",
    "stickslip",
    "--vary",
    "mu_d=0.5:0.8:4",
    "--vary",
    "v_driver=0.025:0.1:3:log",
    "--measures",
    "final,slips",
)


@pytest.fixture
def command(workspace):
    """Return command(argument, ...): the finished process, in a folder with the built FMUs."""
    return partial(commands.harness, workspace)


@pytest.fixture
def sweep(fmus, monkeypatch):
    """Return sweep(model, grid, ...): the data of a sweep of a built FMU, without its figure."""
    monkeypatch.setattr("harness.studies.sweep.figure.draw", lambda *arguments: None)

    def run(model, grid, **options):
        return harness.sweep(fmus / f"{model}.fmu", grid, **options).data

    return run


def test_a_sample_has_a_run_in_every_stratum(command, sweep, tmp_path):
    ranges = ("--vary", "m=1:2", "--vary", "k=1:100:log", "--samples", 20, "--seed", 1, "--stop", 0.01)
    result = command("sweep", "smd", *ranges, "--workers", 1, "--name", "sample")
    assert result.returncode == 0
    data = open_sweep(tmp_path / "results/sweep/sample")
    assert (data.sizes, {*data.coords}, data["k"].dims) == ({"run": 20}, {"m", "k"}, ("run",))
    m, k = data["m"].to_numpy(), data["k"].to_numpy()
    assert sorted(np.floor(20 * (m - 1))) == sorted(np.floor(20 * np.log(k) / np.log(100))) == list(range(20))
    assert not np.isin(sweep("smd", {"m": (1.0, 2.0), "k": (1.0, 2.0)}, samples=20, seed=2, stop=0.01)["m"], m).any()


@pytest.mark.parametrize(
    ("text", "options"),
    [
        *((text, ()) for text in ("k", "k=1:2", "k=1:2:x", "k=1:2:0", "k=1:nan:3", "=1:2:3", "k=-1:2:3:log", "k=1,1")),
        *((text, ("--samples", 5)) for text in ("k=2:1", "k=1:2:3", "k=1,2")),
    ],
)
def test_an_invalid_axis_is_refused(command, text, options):
    result = command("sweep", "smd", "--vary", text, *options)
    assert (result.returncode, result.stderr.count("\n")) == (2, 1)
    assert f"--vary {text}" in result.stderr


@pytest.mark.parametrize("n_axes", [2, 4])
def test_too_many_runs_are_refused(sweep, n_axes):
    """Also if no list could hold them."""
    grid = {name: range(1, 100_001) for name in ("m", "k", "c", "x0")[:n_axes]}
    with pytest.raises(harness.SceneError, match="runs exceed the maximum of 10000000; reduce the number of values"):
        sweep("smd", grid)
    with pytest.raises(harness.SceneError, match=r"samples = .* must be a whole number from 1 to 10000000"):
        sweep("smd", {"m": (1.0, 2.0)}, samples=10_000_001 if n_axes == 2 else 10**30)


def test_a_reset_instance_gives_the_same_results_as_a_fresh_one(sweep):
    """Also after a failed run."""
    options = {"measures": ("final", "events", "slips", "period", "peak_speed", "stuck")}
    grid_data = sweep("stickslip", {"mu_d": [0.3, 0.95, 0.6], "v_driver": [0.034]}, **options)
    assert str(grid_data["error"].sel(mu_d=0.95).item()).startswith("mu_d is 0.95, above mu_s = 0.9")
    single_data = sweep("stickslip", {"mu_d": [0.6], "v_driver": [0.034]}, **options)
    assert single_data.equals(grid_data.sel(mu_d=[0.6]))
    omega, x_d = sqrt(742.5 / 12.5), 0.3 * 12.5 * 9.81 / 742.5
    peak = 0.034 + omega * sqrt(x_d**2 + (0.034 / omega) ** 2)
    values = [single_data[name].item() for name in ("events", "slips", "period", "peak_speed", "stuck")]
    assert values == pytest.approx([8, 4, 3.34510449933, peak, 16 - 4 * 0.430665996656], rel=1e-4)


def test_decay_measures_match_the_parameters(sweep):
    friction = sweep("coulomb", {"f": [2.0]}, measures=("rest", "f_over_k"))
    assert friction["f_over_k"].item() == pytest.approx(2 / 157.9, rel=1e-3)
    assert abs(friction["rest"].item()) <= 2 / 157.9
    damping = sweep("smd", {"c": [1.0]}, measures=("zeta",))
    assert damping["zeta"].item() == pytest.approx(1 / (2 * sqrt(157.9)), rel=1e-5)


def test_a_sled_pulled_backward_has_the_measures_of_one_pulled_forward(sweep):
    """A law without modes, whose sled never stops; the period is that of its reference."""
    measures = ("slips", "period", "unsteady", "peak_speed")
    data = sweep("pacejka", {"v_driver": [0.034, -0.034]}, values={"x_m": 0.01}, measures=measures, rtol=1e-6)
    forward, backward = ([float(data[name].sel(v_driver=v)) for name in measures] for v in (0.034, -0.034))
    assert forward == pytest.approx(backward, rel=1e-6, nan_ok=True)
    assert forward[0] == 3
    assert forward[1] == pytest.approx(3.7169, abs=1e-3)


@pytest.mark.campaign
def test_a_map_is_labelled_for_xarray_and_pandas_for_any_number_of_workers(command, tmp_path):
    for workers in (1, 2):
        result = command(*MAP, "--workers", workers, "--out", f"out{workers}")
        assert (result.returncode, result.stderr) == (0, "")
        assert "12 runs, 0 of them resumed, 0 failed" in result.stdout
    first_folder, second_folder = (
        sweep_folder(tmp_path / f"out{workers}", "stickslip-mu_d-v_driver") for workers in (1, 2)
    )
    for file in ("sweep.nc", "sweep.csv"):
        assert (first_folder / file).read_bytes() == (second_folder / file).read_bytes()
    assert {file.name for file in second_folder.iterdir()} == {
        "sweep.nc",
        "sweep.csv",
        "data.npz",
        "figure.svg",
        "provenance.json",
        "summary.json",
    }
    assert [file.name for file in first_folder.parent.iterdir()] == [first_folder.name]
    data = open_sweep(first_folder)
    assert data["slips"].dims == ("mu_d", "v_driver")
    assert data["v_driver"].attrs["units"] == data["final_v"].attrs["units"] == "m/s"
    assert len(data.attrs["fmu_sha256"]) == 64
    assert json.loads(data.attrs["parameters"])["m"] == 12.5
    table = pandas.read_csv(first_folder / "sweep.csv")
    assert list(table.columns) == ["mu_d", "v_driver [m/s]", "final_x [m]", "final_v [m/s]", "slips", "error"]
    assert (table["slips"].to_numpy().reshape(4, 3) == data["slips"].to_numpy()).all()
    points = [[mu_d, v] for mu_d in (0.5, 0.6, 0.7, 0.8) for v in (0.025, 0.05, 0.1)]
    assert table[["mu_d", "v_driver [m/s]"]].to_numpy() == pytest.approx(np.array(points))


def test_failed_runs_are_reported_on_screen_in_files_and_in_the_exit_status(command, tmp_path):
    vary = ("--vary", "mu_d=0.5:1:5", "--vary", "m=-1,2")
    result = command("sweep", "stickslip", *vary, "--set", "k=100", "--workers", 1, "--name", "mine")
    assert result.returncode == 1
    assert "10 runs, 0 of them resumed, 6 failed" in result.stdout
    first, *kinds = result.stderr.splitlines()
    assert first.startswith("Error: 6 of 10 runs failed; see the error column of ")
    assert [kind.partition(":")[0] for kind in kinds] == [
        "5 runs, such as mu_d = 0.5, m = -1.0",
        "1 run, such as mu_d = 1.0, m = 2.0",
    ]
    assert "m = -1.0" in kinds[0].partition(":")[2]
    assert kinds[1].endswith("lower mu_d or raise mu_s")
    data = open_sweep(tmp_path / "results/sweep/mine")
    assert [bool(text) for text in data["error"].sel(m=2).to_numpy()] == [False, False, False, False, True]
    assert "above mu_s = 0.9" in str(data["error"].to_numpy()[4, 1])
    assert np.isnan(data["final_x"].to_numpy()[4, 1])
    assert json.loads(data.attrs["parameters"])["k"] == 100.0
    assert pandas.read_csv(tmp_path / "results/sweep/mine/sweep.csv")["final_x [m]"].isna().sum() == 6


REASONS = {  # why some have no run to show
    "Falling": "it terminated the simulation: fmi2DoStep returned Discard",
    "NonConforming": "violates the FMI standard in 2 places",
}


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=() if name in ("Arrays", *REASONS) else pytest.mark.campaign)
        for name in external_fmus.SWEEP_AXES
        if name != "Gain"  # zero without an input
    ],
)
def test_an_external_fmu_is_swept_or_refused_with_a_reason(command, tmp_path, name):
    """Only numbers are measured: each element of an array, and no strings."""
    fmu, vary = external_fmus.build_external_fmus() / f"{name}.fmu", external_fmus.SWEEP_AXES[name].replace(":3", ":2")
    result = command(
        "sweep", fmu, "--vary", vary, "--measures", "final,largest", "--name", "a", "--rtol", 1e-3, "--workers", 1
    )
    if name in REASONS:
        assert (result.returncode, REASONS[name] in result.stderr) == (1, True)
        return
    assert (result.returncode, result.stderr) == (0, "")
    data = open_sweep(tmp_path / "results/sweep/a").drop_vars("error")
    assert len(data.data_vars) >= 2
    for variable in data.data_vars.values():
        assert np.isfinite(variable.to_numpy()).all()
    assert any(len(set(variable.to_numpy().tolist())) == 2 for variable in data.data_vars.values())


@pytest.mark.campaign
def test_crashing_and_failing_runs_of_an_external_fmu_are_reported_individually(command, tmp_path):
    """With kind 0 it succeeds, with 2 it crashes, with 6 it fails."""
    trouble = external_fmus.build_external_fmus() / "Faulty.fmu"
    result = command("sweep", trouble, "--vary", "kind=2,6,0", "--name", "a", "--workers", 2)
    assert result.returncode == 1
    assert result.stderr.startswith("Error: 2 of 3 runs failed")
    assert "its binary crashed" in result.stderr
    error = open_sweep(tmp_path / "results/sweep/a")["error"].to_numpy().tolist()
    assert [bool(sentence) for sentence in error] == [True, True, False]


def test_sweeps_of_different_ranges_have_separate_folders(sweep, tmp_path):
    for values in ([1.0, 2.0], [1.0, 3.0]):
        sweep("smd", {"m": values}, folder=tmp_path, stop=0.1)
    stored_masses = [harness.load_result(folder)["m"].to_numpy().tolist() for folder in (tmp_path / "sweep").iterdir()]
    assert sorted(stored_masses) == [[1.0, 2.0], [1.0, 3.0]]


def test_the_magic_formula_slides_steadily_below_the_peak_of_its_curve(sweep):
    """The slope is positive there and damps; beyond it the sled sticks and slips."""
    grid = {"x_m": [0.03, 0.06], "v_driver": [0.02, 0.04, 0.08]}
    steady = sweep("pacejka", grid, measures=("unsteady",), stop=40.0)["unsteady"].to_numpy() < 0.1
    assert steady.tolist() == [[True, False, False], [True, True, False]]


def test_a_profiler_that_keeps_frames_disturbs_no_run(sweep):
    """The recorded points of one run are then still referenced in the next one."""
    grid, frames = {"mu_d": [0.5, 0.6]}, []
    sys.setprofile(lambda frame, event, value: frames.append(frame) if frame.f_code.co_name == "read_rows" else None)
    try:
        data = sweep("stickslip", grid, measures=("peak_speed",))
    finally:
        sys.setprofile(None)
    assert frames
    assert data["peak_speed"].equals(sweep("stickslip", grid, measures=("peak_speed",))["peak_speed"])


@pytest.mark.parametrize("grid", [{"m": [1e308]}, {"m": [2e307, 1e308], "k": [1.0, 1e308]}, {"m": [1.0, 1e308]}])
def test_values_that_are_too_large_for_an_axis_are_results(fmus, grid):
    """They are left out of the figure."""
    pyplot = pytest.importorskip("matplotlib.pyplot")
    pyplot.switch_backend("Agg")
    result = harness.sweep(fmus / "smd.fmu", grid, stop=0.1)
    assert result.failed == 0
    if grid["m"][0] == 1.0:
        assert [line.get_xdata().tolist() for line in result.plot()[0].lines] == [[1.0]]
    else:
        with pytest.raises(harness.HarnessError, match=r"too large for an axis; to_pandas\(\) has its numbers"):
            result.plot(ax=pyplot.figure().subplots())
    pyplot.close("all")


@pytest.mark.parametrize("workers", campaign_after(1, [None, 1]))
def test_one_run_that_works_is_a_sweep(sweep, workers):
    """Wherever it is among runs that fail."""
    mu_d = [0.95, 0.6, 0.96, 0.97, 0.98]  # mu_s is 0.9
    data = sweep("stickslip", {"mu_d": mu_d}, stop=2.0, measures=["events"], workers=workers)
    single_data = sweep("stickslip", {"mu_d": [0.6]}, stop=2.0, measures=["events"])
    assert [bool(error) for error in data["error"].to_numpy()] == [True, False, True, True, True]
    assert data["events"].sel(mu_d=[0.6]).equals(single_data["events"])
    assert (data.attrs["parameters"], data.attrs["stop_time"]) == (single_data.attrs["parameters"], 2.0)
    with pytest.raises(
        harness.HarnessError, match=r"^all runs of the sweep failed: 4 runs, such as mu_d = 0\.95: mu_d "
    ):
        sweep("stickslip", {"mu_d": [mu_d[0], *mu_d[2:]]}, stop=2.0, workers=workers)
