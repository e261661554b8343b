"""Scene files: valid contents, and errors of invalid ones."""

import json
from pathlib import Path

import pytest

from harness import SceneError
from harness.results.files import to_json
from harness.scenes.coupled.scene import CoupledKeys
from harness.scenes.run_spec import RunSpec
from harness.scenes.scene import load_scene, scene_from_provenance, shipped_scenes
from harness.scenes.schema import parse_table

GOOD = {"title": '"a title"', "model": '"stickslip"', "outputs": '["x", "v", "a"]'}


def write(folder, extra="", **keys):
    """Write a scene file; a key with value None is omitted."""
    lines = [f"{key} = {value}" for key, value in (GOOD | keys).items() if value is not None]
    path = folder / "mine.toml"
    path.write_text("\n".join([*lines, extra]))
    return path


CITATION = "[citation]\nauthor = 'me'\ntitle = 'mine'\nyear = 2020\nlocation = 'table 1'"


@pytest.mark.parametrize("path", shipped_scenes(), ids=lambda path: path.stem)
def test_every_shipped_scene_loads_and_names_its_source(path):
    scene = load_scene(path.stem)
    assert scene == load_scene(path)
    assert scene.known.values
    assert bool(scene.known.citation) == (scene.known.kind == "published")


def test_omitted_keys_are_left_to_the_fmu(tmp_path):
    scene = load_scene(write(tmp_path))
    assert {scene.run.start, scene.run.stop, scene.run.grid} == {None}
    assert (scene.analyses, scene.run.values, scene.run.follow) == ((), {}, True)


def test_a_grid_follows_the_solver_only_on_request(tmp_path):
    assert not load_scene(write(tmp_path, grid="0.1")).run.follow
    assert load_scene(write(tmp_path, grid="0.1", follow="true")).run.follow
    assert not load_scene(write(tmp_path, times="[0.0, 1.0]", follow="false")).run.follow


@pytest.mark.parametrize(
    ("outputs", "plots"),
    [
        ('["x", "v", "a"]', ("position", "velocity", "acceleration", "phase")),
        ('["x", "v", "mode"]', ("position", "velocity", "mode", "phase")),
        ('["mode"]', ("mode",)),
        ('["x", "v", "a", "mode", "energy", "F_spring", "F_friction"]', 6),
    ],
)
def test_a_scene_without_plots_shows_its_outputs(tmp_path, outputs, plots):
    result = load_scene(write(tmp_path, outputs=outputs)).plots
    assert result == plots if isinstance(plots, tuple) else len(result) == plots + 1
    assert load_scene(write(tmp_path, outputs=outputs, plots="[]")).plots == ()


@pytest.mark.parametrize(
    ("keys", "sentence"),
    [
        ({"mehtod": '"ode23"'}, "unknown key 'mehtod' (nearest: 'method'); allowed: about, analyses, "),
        ({"model": '"stikslip"'}, "unknown model 'stikslip' (nearest: 'stickslip'); allowed: belt, clutch, coulomb, "),
        ({"analyses": '["decy"]'}, "unknown name in analyses 'decy' (nearest: 'decay'); allowed: decay, slip, steps"),
        ({"plots": '["phse"]'}, "unknown name in plots 'phse' (nearest: 'phase')"),
        ({"title": None}, "the key 'title' is missing"),
        ({"model": None}, "set either model"),
        ({"fmu": '"x.fmu"'}, "set either model"),
        ({"outputs": "[]"}, "outputs is empty"),
        ({"outputs": None}, "outputs is empty"),
        ({"equal_steps": "10"}, "unknown key 'equal_steps'"),
        ({"method": "'ode23'", "extra": "[values]\n'solver.method' = 'ode45'"}, "solver.method is set twice"),
        ({"outputs": '["x", "x"]'}, "is not a list of distinct names"),
        ({"stop": '"soon"'}, "stop = 'soon' is not a finite number"),
        ({"stop": "inf"}, "stop = inf is not a finite number"),
        ({"rtol": "0"}, "rtol = 0 is not a finite number above 0"),
        ({"repeat": "true"}, "repeat = True is not a whole number from 1 to 1000"),
        ({"follow": "false"}, "follow = false needs a grid"),
        ({"times": "[0.0, 1.0, 1.0]"}, "times = [0.0, 1.0, 1.0] is not a list of increasing finite numbers"),
        ({"times": "0.5"}, "times = 0.5 is not a list of increasing finite numbers"),
        ({"grid": "0.1", "analyses": '["steps"]'}, "the analysis 'steps' needs follow = true"),
        ({"outputs": '["x"]', "plots": '["phase"]'}, "the plot 'phase' needs the velocity: add v or omega"),
        ({"analyses": '["decay"]'}, "the table [decay] with gives"),
        ({"extra": "[decay]\ngives = 'mu'"}, "gives = 'mu' is not 'zeta', 'f' or 'T_f'"),
        ({"extra": "[decay]\ncycles = 0.3"}, "cycles = 0.3 is not a whole or half number above 0"),
        ({"extra": "[decay]\nfrist = 1"}, "unknown key in [decay] 'frist' (nearest: 'first')"),
        ({"extra": "[published]\nperiod = 3"}, "[published] needs a source"),
        ({"extra": "[reference]\nperiod = 3"}, "[reference] needs a source"),
        (
            {"extra": "[parameter]\nf = 1\n[reference]\nsource = 'me'\nperiod = 3"},
            "[reference] and [parameter] are both",
        ),
        ({"extra": "[parameter]\nf = 1\n" + CITATION}, "[citation] has no effect without [published]"),
        ({"extra": "[published]\nsource = 'me'\n[citation]\nauthor = 'me'"}, "the key 'citation.location' is missing"),
        (
            {"extra": "[published]\nsource = 'me'\n" + CITATION.replace("2020", "'2020'")},
            "citation.year = '2020' is not",
        ),
        ({"extra": "[published]\nsource = 'me'\nperiod = [1, 2, 3]"}, "published.period = [1, 2, 3] is not"),
        ({"title": "'''"}, "not valid TOML"),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_an_invalid_scene_is_reported_in_one_sentence(tmp_path, keys, sentence):
    with pytest.raises(SceneError) as caught:
        load_scene(write(tmp_path, **keys))
    assert str(caught.value).startswith("scene mine: ")
    assert sentence in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_value_is_published_only_with_a_citation(tmp_path):
    """A table [published] without one, as in earlier versions, holds references. A stored scene keeps its table."""
    for citation, kind in ((CITATION, "published"), ("", "reference")):
        scene = load_scene(write(tmp_path, extra=f"[published]\nsource = 'a method'\nperiod = 3\n{citation}"))
        assert (scene.known.kind, scene.known.label) == (kind, f"{kind} (a method)")
        stored = json.loads(to_json({"scene": scene.presentation, "run": scene.run}))
        assert scene_from_provenance(stored).known == scene.known


def test_a_scene_of_an_earlier_version_holds_the_keys_of_its_run():
    keys = {"name": "mine", "source": "mine.toml", "title": "a title", "decay": {"gives": None}, "stop": 2.0}
    keys |= {"file": "fmus/smd.fmu", "outputs": ["x"], "values": {"c": 3.0}, "grid": 0.01, "patience": 7.0}
    expected = RunSpec(
        Path("fmus/smd.fmu"), ("x",), {"c": 3.0}, stop=2.0, grid=0.01, follow=False, timeout=7.0, equal_steps=4096
    )
    assert scene_from_provenance({"scene": keys}).run == expected


PAIR = {
    "title": "a title",
    "stop": 1.0,
    "steps": [0.1],
    "parts": {"a": {"model": "smd"}, "b": {"model": "smd"}},
}


@pytest.mark.parametrize(
    ("wrong", "sentence"),
    [
        ({"parts": 3}, "parts = 3 is not a table"),
        ({"parts": {"a": 3}}, "parts.a = 3 is not a table"),
        (
            {"parts": {"a": {"modle": "smd"}}},
            "unknown key in [parts.a] 'modle' (nearest: 'model'); allowed: model, values",
        ),
        ({"parts": {"a": {"values": {"k": 1}}}}, "the key 'parts.a.model' is missing"),
        ({"parts": {"a": {"model": "smd", "values": {"k": "x"}}}}, "parts.a.values.k = 'x' is not a finite number"),
        ({"springs": {"k": 1}}, "springs = {'k': 1} is not a list"),
        ({"springs": [{"between": ["a", "b"], "k": 1}, 3]}, "springs[1] = 3 is not a table"),
        (
            {"springs": [{"between": ["a", "a"], "k": 1}]},
            "springs[0].between = ['a', 'a'] is not a list of two distinct",
        ),
        ({"connections": [{"from": 1, "to": "b", "factor": 1}]}, "connections[0].from = 1 is not a text"),
        ({"connections": [{"from_": "a.x", "to": "b", "factor": 1}]}, "unknown key in [connections[0]] 'from_'"),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_an_error_names_its_location_at_any_depth(wrong, sentence):
    parse_table(PAIR, CoupledKeys)
    with pytest.raises(SceneError) as caught:
        parse_table(PAIR | wrong, CoupledKeys)
    assert str(caught.value).startswith(sentence)


def test_an_unknown_scene_error_lists_the_shipped_names():
    with pytest.raises(SceneError, match=r"unknown scene 'pendulm' \(nearest: 'pendulum'\); allowed: coulomb, "):
        load_scene("pendulm")


def test_a_missing_file_is_reported():
    with pytest.raises(SceneError, match=r"cannot read the scene nowhere\.toml: No such file"):
        load_scene("nowhere.toml")
