"""A stored run holds its specification and all values, whatever the run was made from."""

import pickle

import external_fmus
import fmi3_fixtures
import native_fmus
import numpy as np
import pytest
from commands import blank_figures
from variants import slow_after

import harness

SCENE = """title = "a driven oscillator"
model = "smd"
outputs = ["x", "v"]
stop = 2.0
grid = 0.01
[values]
c = 3
[inputs]
time = [0, 1, 1, 2]
F_ext = [0, 5, 0, 1]
"""
INPUTS = {"time": [0.0, 1.0, 1.0, 2.0], "F_ext": [0.0, 5.0, 0.0, 1.0]}
CALLS = {  # arguments of harness.simulate
    "model": {"source": "coulomb"},
    "enumerations": {"source": "stickslip", "values": {"friction": "threshold"}, "method": "ode45", "stop": 0.2},
    "interval": {"source": "coulomb", "interval": 0.25, "stop": 2.0, "outputs": ["x"]},
    "inputs": {"source": "smd", "inputs": INPUTS, "stop": 2.0},
    "inputs at an interval": {"source": "smd", "inputs": INPUTS, "stop": 2.0, "interval": 0.1},
    "times": {"source": "stickslip", "times": [0.3, 0.55, 0.9, 4.0], "inputs": INPUTS},
    "external at times": {"source": "{external}/Midpoint.fmu", "times": [0.3, 0.55, 1.0], "rtol": 1e-3},
    "scene": {"source": "mine.toml"},
    "native": {"source": "{native}/pendulum.fmu", "values": {"pin_load": "reaction"}},
    "fmi3": {"source": "{fmi3}/smd.fmu", "stop": 1.0},
    "model exchange": {"source": "{fmi3}/coulomb.fmu", "interface": "ModelExchange", "stop": 1.0, "rtol": 1e-5},
    "external": {"source": "{external}/Midpoint.fmu", "rtol": 1e-3, "timeout": 30.0},
}


@pytest.fixture(autouse=True)
def scene(in_workspace):
    """Work in a folder with the built FMUs and a scene, and save no figures."""
    (in_workspace / "mine.toml").write_text(SCENE)
    with blank_figures():
        yield


@pytest.mark.parametrize("call", slow_after(6, CALLS))
def test_a_stored_run_holds_its_specification_and_values(call):
    folders = {
        "native": native_fmus.build_native_fmus,
        "fmi3": fmi3_fixtures.build_fmi3_fmus,
        "external": external_fmus.build_external_fmus,
    }
    arguments, source = CALLS[call], CALLS[call]["source"]
    for name, build in folders.items():
        if f"{{{name}}}" in source:
            source = source.format(**{name: build()})
    run = harness.simulate(**arguments | {"source": source})
    run.save("saved")
    stored_run = harness.load_result("saved")
    assert pickle.loads(pickle.dumps(run.spec)) == run.spec == stored_run.spec
    assert np.array_equal(stored_run.time, run.time)
    for name in run.columns:
        assert np.array_equal(stored_run[name], run[name]), name


def test_a_stored_specification_names_enumerations_by_their_labels():
    run = harness.simulate("stickslip", {"friction": 3, "solver.method": 2, "k": 700}, stop=0.1)
    assert run.spec.values == {"friction": "threshold", "solver.method": "ode23", "k": 700.0}


def test_a_run_at_an_interval_knows_its_internal_steps():
    """The scene alone does not follow them."""
    assert harness.simulate("mine.toml").steps is None
    assert harness.simulate("mine.toml", interval=0.5).steps is not None


def test_input_signals_of_a_scene_are_those_of_python():
    scene = harness.simulate("mine.toml")
    python = harness.simulate("smd", {"c": 3.0}, stop=2.0, interval=0.01, inputs=INPUTS, outputs=["x", "v"])
    assert scene["x"] == pytest.approx(python["x"], abs=1e-5)
    assert np.abs(scene["x"]).max() > 0.01


@pytest.mark.parametrize("source", slow_after(1, ["run", "stored run", "trajectory.csv"]))
def test_a_fit_fixes_the_values_of_its_run(source):
    """Those that the FMU has otherwise would shift all others without a word."""
    fmu = native_fmus.build_native_fmus() / "coulomb.fmu"
    run = harness.simulate(fmu, {"m": 2.0, "x0": 0.2, "f": 0.3}, stop=4.0)
    run.save("mine")
    record = {"run": run, "stored run": harness.load_result("mine"), "trajectory.csv": "mine/trajectory.csv"}[source]
    fit = harness.fit(fmu, record, ["f", "k"], observe=["x"])
    assert (fit["f"].value, fit["k"].value) == pytest.approx((0.3, run.parameters["k"]), rel=1e-6)
    assert fit.notes[-1] == "m = 2.0, x0 = 0.2, as in the run of the record; `values` sets other values."
    with pytest.raises(harness.SceneError, match=r"differ in m, 2.0 and 3.0: free it, and name it in `each`"):
        harness.fit(fmu, [run, harness.simulate(fmu, {"m": 3.0}, stop=4.0)], ["f"], observe=["x"])
