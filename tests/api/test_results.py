"""harness.compare, identify_decay, sweep and load_result, and what the module offers."""

import ast
import inspect
import json
from pathlib import Path

import numpy as np
import pytest
from external_fmus import build_external_fmus
from native_fmus import build_native_fmus
from variants import campaign_after

import harness

pytestmark = pytest.mark.usefixtures("in_workspace")


def test_public_names_are_complete_and_documented():
    tree = ast.parse(inspect.getsource(harness))
    imported_names = {alias.name for node in tree.body if isinstance(node, ast.ImportFrom) for alias in node.names}
    public = {name for name in imported_names if not name.startswith("_")} - {"import_module", "TYPE_CHECKING", "Any"}
    assert {*harness.__all__} == public | {*harness.TYPES, "__version__"}
    for name in harness.__all__:
        value = getattr(harness, name)
        assert name == "__version__" or inspect.getdoc(value)
    with pytest.raises(AttributeError, match="no attribute 'run'"):
        _ = harness.run


def test_functions_document_every_parameter():
    for name in ("simulate", "compare", "identify_decay", "fit", "sweep", "load_result"):
        function = getattr(harness, name)
        text = inspect.getdoc(function)
        for section in ("Parameters", "Returns", "Raises"):
            assert f"\n{section}\n---" in text, (name, section)
        body = text.split("Parameters\n")[1].split("Returns\n")[0]
        for parameter in inspect.signature(function).parameters:
            assert parameter in body, (name, parameter)


@pytest.mark.parametrize("start", [0.0, 1.0])
def test_a_stored_run_loads_bit_for_bit(start):
    text = f'title = "late"\nmodel = "stickslip"\noutputs = ["x", "F_spring"]\nstart = {start}\nvalues.mu_s = 0.7\n'
    Path("late.toml").write_text(text)
    run = harness.simulate("late.toml")
    run.save("saved")
    loaded_run = harness.load_result("saved")
    assert {*loaded_run.columns} == {*run.columns}
    for name in run.columns:
        assert np.array_equal(loaded_run[name], run[name])
    assert loaded_run.parameters == run.parameters
    assert loaded_run.spec == run.spec
    assert loaded_run.units == run.units
    assert np.array_equal(loaded_run.events.t, run.events.t)
    assert np.array_equal(loaded_run.steps.t, run.steps.t)


def test_saving_does_not_overwrite_other_files(tmp_path):
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "notes.txt").write_text("keep")
    with pytest.raises(harness.HarnessError, match=r"notes\.txt"):
        harness.simulate("smd").save("mine")


def test_compare_takes_runs_folders_and_fmus():
    run = harness.simulate("coulomb")
    run.save("saved")
    for other in ("saved", run, "fmus/coulomb.fmu"):
        assert harness.compare(run, other).worst == 0.0
    other = harness.simulate("coulomb", {"f": 0.5001})
    comparison = harness.compare(run, other)
    (x,) = (difference for difference in comparison.differences if difference.name == "x")
    assert x.largest == pytest.approx(np.abs(run["x"] - np.interp(run.time, other.time, other["x"])).max(), rel=1e-3)
    with pytest.raises(harness.HarnessError, match="no variable in common"):
        harness.compare(harness.simulate("smd", outputs=["F_damper"]), run)


@pytest.mark.campaign
def test_a_fit_and_a_comparison_take_any_record():
    pandas = pytest.importorskip("pandas")
    fmu = build_native_fmus() / "coulomb.fmu"  # for speed
    run = harness.simulate("coulomb", stop=2.0, interval=0.01, outputs=["x"])
    deltas = pandas.to_timedelta(run.time, unit="s")
    named_records = {
        "run": run,
        "frame": run.to_pandas(),
        "mapping": {"t": run.time, "x": run["x"]},
        "series": pandas.Series(run["x"], run.time, name="x"),
        "deltas": pandas.Series(1000 * run["x"], deltas, name="x [mm]"),
    }
    for name, record in named_records.items():
        comparison = harness.compare(run, record)
        assert comparison.worst < 1e-12, name
        assert comparison.differences[0].name == "x", name
    unnamed_records = {"pair": {"records": (run.time, run["x"])}, "samples": {"records": run["x"], "rate": 100.0}}
    calls = {name: {"records": record} for name, record in named_records.items()} | unnamed_records
    for name, arguments in calls.items():
        result = harness.fit(fmu, free=["f"], observe="x", **arguments)
        assert result["f"].value == pytest.approx(0.5, rel=1e-3), name
    joint_fit = harness.fit(fmu, [(run.time, run["x"]), named_records["series"]], ["f"], observe="x")
    assert len(joint_fit.records) == 2


def test_a_run_starts_at_a_given_time():
    run = harness.simulate("coulomb", start=1.0, stop=2.0)
    assert (run.time[0], run.time[-1]) == (1.0, 2.0)


@pytest.mark.campaign
def test_a_decay_is_identified_from_any_source(tmp_path):
    pandas = pytest.importorskip("pandas")
    run = harness.simulate("coulomb", stop=2.0, interval=0.02, outputs=["x"])
    lines = ["t [s],x [m]", *(f"{t!r},{x!r}" for t, x in zip(run.time.tolist(), run["x"].tolist(), strict=True))]
    (tmp_path / "record.csv").write_text("\n".join(lines))
    sources = {
        "file": {"record": "record.csv"},
        "run": {"record": run},
        "frame": {"record": run.to_pandas()},
        "columns": {"record": pandas.DataFrame({"t [s]": run.time, "x [m]": run["x"]})},
        "positions": {"record": pandas.DataFrame({"x [m]": run["x"]}), "rate": 50.0},
        "arrays": {"record": run.time, "x": run["x"], "unit": "m"},
        "pair": {"record": (run.time, run["x"]), "unit": "m"},
        "samples": {"record": run["x"], "unit": "m", "rate": 50.0},
        "mapping": {"record": {"t [s]": run.time, "x [mm]": 1000 * run["x"]}},
        "series": {"record": pandas.Series(run["x"], run.time, name="x [m]")},
        "deltas": {"record": pandas.Series(run["x"], pandas.to_timedelta(run.time, unit="s"), name="x [m]")},
        "frame of deltas": {"record": pandas.DataFrame({"x [m]": run["x"]}, pandas.to_timedelta(run.time, unit="s"))},
        "millimetres": {"record": run.time, "x": 1000 * run["x"], "unit": "mm"},
    }
    for name, arguments in sources.items():
        identification = harness.identify_decay(**arguments, k=157.9, drag=False)
        assert identification["f"].value == pytest.approx(0.5, rel=1e-6), name
        assert identification["zeta"].value == pytest.approx(0.0, abs=1e-9), name
    assert len(repr(identification)) < 300
    with pytest.raises(harness.SceneError, match="unknown estimate 'mu'"):
        _ = identification["mu"]


@pytest.mark.parametrize(
    "values", campaign_after(1, [{}, {"solver.method": "dop853", "solver.rtol": 0.1}]), ids=["exact", "long steps"]
)
def test_a_sweep_measures_what_single_runs_measure(values):
    """Also where steps are as long as the run allows."""
    pytest.importorskip("xarray")
    grid = {"f": [0.3, 0.6], "k": [100.0, 200.0, 300.0]}
    data = harness.sweep("coulomb", grid, values=values, measures=["final", "events"])
    assert data.sizes == {"f": 2, "k": 3}
    for f in data["f"].values:
        for k in data["k"].values:
            run = harness.simulate("coulomb", values | {"f": f, "k": k})
            point = data.sel(f=f, k=k)
            assert float(point["final_x"]) == run["x"][-1]
            assert int(point["events"]) == len(run.events.t) - 1
    assert (data["error"] == "").all()


def test_a_sweep_takes_enumerations_by_label(in_workspace):
    pytest.importorskip("xarray")
    method, laws = {"solver.method": "ode23"}, {"friction": ["hybrid", "threshold"]}
    sweep = harness.sweep("stickslip", laws, values=method, measures=["final"], stop=2.0)
    for number, label in ((1, "hybrid"), (3, "threshold")):
        run = harness.simulate("stickslip", method | {"friction": label}, stop=2.0)
        assert float(sweep.sel(friction=number)["final_x"]) == run["x"][-1]
    assert "1 = hybrid, 3 = threshold" in sweep["friction"].attrs["long_name"]
    with pytest.raises(harness.SceneError, match=r"unknown label of friction 'hybird' \(nearest: 'hybrid'\)"):
        harness.sweep("stickslip", {"friction": ["hybird"]})


@pytest.mark.campaign
def test_the_tolerance_of_a_sweep_is_that_of_its_runs():
    pytest.importorskip("xarray")
    fmu = build_external_fmus() / "Midpoint.fmu"
    for rtol in (1e-2, 1e-3):
        data = harness.sweep(fmu, {"k": [40.0]}, rtol=rtol)
        assert float(data["final_x"][0]) == harness.simulate(fmu, {"k": 40.0}, rtol=rtol)["x"][-1]


@pytest.mark.campaign
def test_samples_are_reproducible_and_stored():
    pytest.importorskip("xarray")
    first = harness.sweep("smd", {"k": (100.0, 200.0), "c": (0.0, 3.0)}, samples=8, seed=3, folder="kept")
    repeated_sweep = harness.sweep("smd", {"k": (100.0, 200.0), "c": (0.0, 3.0)}, samples=8, seed=3)
    assert first.equals(repeated_sweep.data)
    (folder,) = (path for path in Path("kept/sweep").iterdir() if not path.name.startswith("."))
    assert harness.load_result(folder).equals(first.data)


def test_results_of_commands_load(tmp_path):
    (tmp_path / "decay").mkdir()
    (tmp_path / "decay" / "decay.json").write_text(json.dumps({"record": "a"}))
    with pytest.raises(harness.SceneError, match="decay lacks the data of its result: run `the command that wrote it`"):
        harness.load_result("decay")
    with pytest.raises(harness.SceneError, match="holds no result"):
        harness.load_result("nowhere")
