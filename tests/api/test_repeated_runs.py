"""A stored specification repeats its run, whatever the run was made from."""

import json
import pickle
from dataclasses import replace
from pathlib import Path

import external_fmus
import fmi3_fixtures
import native_fmus
import numpy as np
import pytest
from spec_runs import run_spec

import harness
from harness import SceneError
from harness.results.files import to_json
from harness.running.resolve import resolve
from harness.scenes.run_spec import RunSpec
from harness.scenes.scene import shipped_scenes

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
    """Work in a folder with the built FMUs and a scene."""
    (in_workspace / "mine.toml").write_text(SCENE)


def read_back(spec):
    """Return a specification that went through JSON and through pickle."""
    return pickle.loads(pickle.dumps(RunSpec.from_json(json.loads(to_json(spec)))))


@pytest.mark.parametrize("call", CALLS)
def test_a_stored_run_is_repeated_bit_for_bit(call):
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
    assert read_back(run.spec) == run.spec == harness.load_result("saved").spec
    for repeated in (harness.simulate("saved"), run_spec(read_back(run.spec))):
        assert np.array_equal(repeated.time, run.time)
        for name in run.columns:
            assert np.array_equal(repeated[name], run[name]), name


def test_a_stored_specification_names_enumerations_by_their_labels():
    run = harness.simulate("stickslip", {"friction": 3, "solver.method": 2, "k": 700}, stop=0.1)
    assert run.spec.values == {"friction": "threshold", "solver.method": "ode23", "k": 700.0}


def test_a_run_at_an_interval_knows_its_internal_steps():
    """The scene alone does not follow them."""
    assert harness.simulate("mine.toml").steps is None
    assert harness.simulate("mine.toml", interval=0.5).steps is not None


@pytest.mark.parametrize("name", [file.stem for file in shipped_scenes()])
def test_every_shipped_scene_is_a_specification_that_reads_back(name):
    spec = resolve(name, scenes_first=True)
    assert read_back(spec) == spec


def test_input_signals_of_a_scene_are_those_of_python():
    scene = harness.simulate("mine.toml")
    spec = replace(
        resolve("smd"), outputs=("x", "v"), values={"c": 3.0}, stop=2.0, grid=0.01, follow=False, equal_steps=0
    )
    python = run_spec(replace(spec, inputs={name: tuple(column) for name, column in INPUTS.items()}))
    assert np.array_equal(scene["x"], python["x"])
    assert np.abs(scene["x"]).max() > 0.01


@pytest.mark.parametrize(
    ("stored", "sentence"),
    [
        ({}, "the key 'fmu' is missing"),
        ({"fmu": "a.fmu", "stop": "soon"}, "stop = 'soon' is not a finite number"),
        ({"fmu": "a.fmu", "stopp": 1.0}, "unknown key 'stopp' (nearest: 'stop')"),
        ({"fmu": "a.fmu", "inputs": {"time": [0, "x"]}}, "inputs.time[1] = 'x' is not a finite number"),
    ],
)
def test_an_invalid_stored_specification_is_one_sentence(stored, sentence):
    with pytest.raises(SceneError) as raised:
        RunSpec.from_json(stored)
    assert sentence in str(raised.value)


def test_a_specification_defaults_to_those_of_the_fmu():
    assert RunSpec.from_json({"fmu": "a.fmu", "stop": None}) == RunSpec(Path("a.fmu"))
