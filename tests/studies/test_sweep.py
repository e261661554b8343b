"""Sweeps on the built FMUs: the runs, their measures, and the messages of failed runs."""

import json
from functools import partial
from math import nan, pi, sqrt
from pathlib import Path

import commands
import external_fmus
import numpy as np
import pytest
from sweep_results import open_sweep, sweep_folder

pandas = pytest.importorskip("pandas", reason="the extra 'sweep' is not installed")

from harness import SceneError, Trajectory  # noqa: E402
from harness.scenes.run_spec import RunSpec  # noqa: E402
from harness.studies.sweep.measures import TRAJECTORY_MEASURES  # noqa: E402
from harness.studies.sweep.runner import SweepSpec, open_runner  # noqa: E402
from harness.studies.sweep.sampling import SweepAxis, SweepPoints, parse_axis  # noqa: E402

MAP = ("sweep", "stickslip", "--vary", "mu_d=0.5:0.8:4", "--vary", "v_driver=0.02,0.05,0.1", "--measure", "final,slips")


@pytest.fixture
def harness(workspace):
    """Return harness(argument, ...): the finished process, in a folder with the built FMUs."""
    return partial(commands.harness, workspace)


def test_a_grid_has_every_combination_and_a_sample_every_stratum():
    grid = SweepPoints((parse_axis("a=1:3:3", False), parse_axis("b=1:100:3:log", False)))
    expected = np.array([[a, b] for a in (1, 2, 3) for b in (1, 10, 100)])
    assert grid.coordinates(0, len(grid)) == pytest.approx(expected)
    assert grid.coordinates(2, 7) == pytest.approx(expected[2:7])
    spread = (parse_axis("a=1:2", True), parse_axis("b=1:100:log", True))
    sample = SweepPoints(spread, 20, 1).coordinates(0, 20)
    assert sorted(np.floor(20 * (sample[:, 0] - 1))) == list(range(20))
    assert sorted(np.floor(20 * np.log(sample[:, 1]) / np.log(100))) == list(range(20))
    assert (sample[5:9] == SweepPoints(spread, 20, 1).coordinates(5, 9)).all()
    assert not np.isin(sample, SweepPoints(spread, 20, 2).coordinates(0, 20)).any()


@pytest.mark.parametrize(
    ("text", "random"),
    [
        ("a", False),
        ("a=1:2", False),
        ("a=1:2:x", False),
        ("a=1:2:0", False),
        ("a=1:nan:3", False),
        ("=1:2:3", False),
        ("a=-1:2:3:log", False),
        ("a=1,1", False),
        ("a=2:1", True),
        ("a=1:2:3", True),
        ("a=1,2", True),
    ],
)
def test_an_invalid_axis_is_refused(text, random):
    with pytest.raises(SceneError):
        parse_axis(text, random)


@pytest.mark.parametrize(("n_axes", "random"), [(2, None), (4, None), (1, 10_000_001), (1, 10**30)])
def test_too_many_runs_are_refused(n_axes, random):
    """Also if no list could hold them."""
    axes = tuple(SweepAxis(f"a{i}", tuple(range(100_000))) for i in range(n_axes))
    with pytest.raises(SceneError, match="runs exceed the maximum of 10000000; reduce the number of values"):
        SweepPoints(axes, random)


def test_a_reset_instance_gives_the_same_results_as_a_fresh_one(fmus):
    """Also after a failed run."""
    measures = ("final", "events", "slips", "period", "peak_speed", "stuck")
    runs = SweepSpec(RunSpec(fmus / "stickslip.fmu", follow=False), ("mu_d", "v_driver"), measures)
    spots = [[0.6, 0.034], [0.95, 0.034], [0.3, 0.1], [0.6, 0.034]]
    with open_runner(runs) as rerun:
        rows = [rerun.run(spot) for spot in spots]
    assert rows[0] == rows[3]
    assert rows[1].startswith("mu_d is 0.95, above mu_s = 0.9")
    for spot, row in zip(spots, rows, strict=True):
        with open_runner(runs) as rerun:
            assert rerun.run(spot) == row
    omega, x_d = sqrt(742.5 / 12.5), 0.3 * 12.5 * 9.81 / 742.5
    peak = 0.034 + omega * sqrt(x_d**2 + (0.034 / omega) ** 2)
    assert rows[0][2:] == pytest.approx([8, 4, 3.34510449933, peak, 16 - 3 * 0.430665996656 - 0.430665996656], rel=1e-4)


def test_decay_measures_match_the_parameters(fmus):
    with open_runner(SweepSpec(RunSpec(fmus / "coulomb.fmu", follow=False), ("f",), ("rest", "f_over_k"))) as rerun:
        rest, ratio = rerun.run([2.0])
    assert ratio == pytest.approx(2 / 157.9, rel=1e-3)
    assert abs(rest) <= 2 / 157.9
    with open_runner(SweepSpec(RunSpec(fmus / "smd.fmu", follow=False), ("c",), ("zeta",))) as rerun:
        assert rerun.run([1.0]) == pytest.approx([1 / (2 * sqrt(157.9))], rel=1e-5)


@pytest.mark.parametrize("driver", [0.02, -0.02])
def test_a_sled_pulled_backward_has_the_measures_of_one_pulled_forward(driver):
    """A law without modes: three slips of a speed that swings between 0 and three times that of the driver."""
    time = np.linspace(0.0, 3.0, 3001)
    v = 1.5 * driver * (1.0 - np.cos(2.0 * pi * time))
    spec = RunSpec(Path("sled.fmu"), outputs=("x", "v"))
    columns = {"x": 0.0 * v, "v": v}
    run = Trajectory(time, columns, {"x": "m", "v": "m/s"}, spec=spec, parameters={"v_driver": driver})
    measured = {name: measure.measure(run) for name, measure in TRAJECTORY_MEASURES.items() if not measure.decay}
    expected = {"slips": 3, "period": 1.0, "unsteady": 1.5, "peak_speed": 0.06, "stuck": nan, "rest": nan}
    assert measured == pytest.approx(expected, rel=1e-6, nan_ok=True)


def test_a_map_is_labelled_for_xarray_and_pandas_for_any_number_of_workers(harness, tmp_path):
    for workers in (1, 4):
        done = harness(*MAP, "--workers", workers, "--out", f"out{workers}", blank=workers == 1)
        assert (done.returncode, done.stderr) == (0, "")
        assert "12 runs, 0 of them resumed, 0 failed" in done.stdout
    one, four = (sweep_folder(tmp_path / f"out{workers}", "stickslip-mu_d-v_driver") for workers in (1, 4))
    for file in ("sweep.nc", "sweep.csv"):
        assert (one / file).read_bytes() == (four / file).read_bytes()
    assert {file.name for file in four.iterdir()} == {
        "sweep.nc",
        "sweep.csv",
        "data.npz",
        "figure.svg",
        "provenance.json",
        "summary.json",
    }
    assert [file.name for file in one.parent.iterdir()] == [one.name]
    data = open_sweep(one)
    assert data["slips"].dims == ("mu_d", "v_driver")
    assert data["v_driver"].attrs["units"] == data["final_v"].attrs["units"] == "m/s"
    assert len(data.attrs["fmu_sha256"]) == 64
    assert json.loads(data.attrs["parameters"])["m"] == 12.5
    table = pandas.read_csv(one / "sweep.csv")
    assert list(table.columns) == ["mu_d", "v_driver [m/s]", "final_x [m]", "final_v [m/s]", "slips", "error"]
    assert (table["slips"].to_numpy().reshape(4, 3) == data["slips"].to_numpy()).all()


def test_failed_runs_are_reported_on_screen_in_files_and_in_the_exit_status(harness, tmp_path):
    vary = ("--vary", "mu_d=0.5:1:5", "--vary", "m=-1,2")
    done = harness("sweep", "stickslip", *vary, "--set", "k=100", "--workers", 1, "--name", "mine")
    assert done.returncode == 1
    assert "10 runs, 0 of them resumed, 6 failed" in done.stdout
    first, *kinds = done.stderr.splitlines()
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
        pytest.param(name, marks=() if name in ("Midpoint", "Arrays", *REASONS) else pytest.mark.slow)
        for name in external_fmus.SWEEP_AXES
        if name != "Gain"  # zero without an input
    ],
)
def test_an_external_fmu_is_swept_or_refused_with_a_reason(harness, tmp_path, name):
    """Only numbers are measured: each element of an array, and no strings."""
    fmu, vary = external_fmus.build_external_fmus() / f"{name}.fmu", external_fmus.SWEEP_AXES[name].replace(":3", ":2")
    done = harness(
        "sweep", fmu, "--vary", vary, "--measure", "final,largest", "--name", "a", "--tolerance", 1e-3, blank=True
    )
    if name in REASONS:
        assert (done.returncode, REASONS[name] in done.stderr) == (1, True)
        return
    assert (done.returncode, done.stderr) == (0, "")
    data = open_sweep(tmp_path / "results/sweep/a").drop_vars("error")
    assert len(data.data_vars) >= 2
    for measured in data.data_vars.values():
        assert np.isfinite(measured.to_numpy()).all()
    assert any(len(set(measured.to_numpy().tolist())) == 2 for measured in data.data_vars.values())


def test_crashing_and_failing_runs_of_an_external_fmu_are_reported_individually(harness, tmp_path):
    """With kind 0 it succeeds, with 2 it crashes, with 6 it fails."""
    trouble = external_fmus.build_external_fmus() / "Faulty.fmu"
    done = harness("sweep", trouble, "--vary", "kind=2,6,0", "--name", "a", "--workers", 2, blank=True)
    assert done.returncode == 1
    assert done.stderr.startswith("Error: 2 of 3 runs failed")
    assert "its binary crashed" in done.stderr
    error = open_sweep(tmp_path / "results/sweep/a")["error"].to_numpy().tolist()
    assert [bool(sentence) for sentence in error] == [True, True, False]


def test_sweeps_of_different_ranges_have_separate_folders(harness, tmp_path):
    for vary in ("m=1:2:2", "m=1:3:2"):
        assert harness("sweep", "smd", "--vary", vary, "--workers", 1, blank=True).returncode == 0
    values = [open_sweep(folder)["m"].to_numpy().tolist() for folder in (tmp_path / "results/sweep").iterdir()]
    assert sorted(values) == [[1.0, 2.0], [1.0, 3.0]]


def test_a_sample_has_a_row_for_each_run(harness, tmp_path):
    done = harness(
        "sweep", "coulomb", "--vary", "f=0.1:2", "--vary", "k=50:500:log", "--random", 7, "--workers", 1, blank=True
    )
    assert (done.returncode, done.stderr) == (0, "")
    data = open_sweep(sweep_folder(tmp_path / "results", "coulomb-f-k"))
    assert data.sizes == {"run": 7}
    assert data["k"].dims == ("run",)
    assert set(data.coords) == {"f", "k"}


def test_the_magic_formula_slides_steadily_below_the_peak_of_its_curve(harness, tmp_path):
    """The slope is positive there and damps; beyond it the sled sticks and slips."""
    arguments = ("--vary", "x_m=0.03,0.06", "--vary", "v_driver=0.02,0.04,0.08", "--measure", "unsteady", "--stop", 40)
    assert harness("sweep", "pacejka", *arguments, "--workers", 2, blank=True).returncode == 0
    steady = open_sweep(sweep_folder(tmp_path / "results", "pacejka-x_m-v_driver"))["unsteady"].to_numpy() < 0.1
    assert steady.tolist() == [[True, False, False], [True, True, False]]
