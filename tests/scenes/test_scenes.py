"""Scene files: valid contents, and errors of invalid ones."""

import json
import tomllib

import commands
import pytest
from build_cache import ROOT

import harness

pytestmark = pytest.mark.usefixtures("in_workspace")

GOOD = {"title": '"a title"', "model": '"stickslip"', "outputs": '["x", "v", "a"]'}


def write(folder, extra="", **keys):
    """Write a scene file; a key with value None is omitted."""
    lines = [f"{key} = {value}" for key, value in (GOOD | keys).items() if value is not None]
    path = folder / "mine.toml"
    path.write_text("\n".join([*lines, extra]))
    return path


def run(scene):
    """Run a scene without drawing, and return the folder of its result and its provenance."""
    result = commands.harness(scene.parent, "run", scene)
    assert (result.returncode, result.stderr) == (0, "")
    folder = scene.parent / "results" / scene.stem
    return folder, json.loads((folder / "provenance.json").read_text())


CITATION = "[citation]\nauthor = 'me'\ntitle = 'mine'\nyear = 2020\nlocation = 'table 1'"


@pytest.mark.parametrize("path", sorted((ROOT / "harness/scenes").glob("*.toml")), ids=lambda path: path.stem)
def test_every_shipped_scene_has_known_values_of_one_kind(path):
    """A publication is cited. The scenes run in other tests, by name."""
    scene = tomllib.loads(path.read_text())
    (kind,) = {"published", "reference", "parameter"} & {*scene}
    assert ("citation" in scene) == (kind == "published")


def test_omitted_keys_are_left_to_the_fmu(workspace):
    model = harness.simulate("stickslip")
    scene = harness.simulate(write(workspace))
    assert scene.time.tolist() == model.time.tolist()
    assert scene["x"].tolist() == model["x"].tolist()


def test_a_grid_follows_the_solver_only_on_request(workspace):
    oscillator = {"model": '"smd"', "outputs": '["x"]', "method": '"ode23"', "stop": "2.0", "grid": "0.5"}
    assert len(harness.simulate(write(workspace, **oscillator)).time) == 5
    assert len(harness.simulate(write(workspace, **oscillator, follow="true")).time) > 5
    assert harness.simulate(write(workspace, times="[0.0, 1.0]", follow="false")).time.tolist() == [0.0, 1.0]


@pytest.mark.parametrize(
    ("outputs", "plots"),
    [
        ('["x", "v", "a"]', ["position", "velocity", "acceleration", "phase"]),
        ('["x", "v", "mode"]', ["position", "velocity", "mode", "phase"]),
        ('["mode"]', ["mode"]),
        ('["x", "v", "a", "mode", "energy", "F_spring", "F_friction"]', 7),
    ],
)
def test_a_scene_without_plots_shows_its_outputs(workspace, outputs, plots):
    _, provenance = run(write(workspace, outputs=outputs, stop="0.1", grid="0.05"))
    shown_plots = provenance["scene"]["plots"]
    assert shown_plots == plots if isinstance(plots, list) else len(shown_plots) == plots


def test_a_scene_may_show_nothing(workspace):
    folder, provenance = run(write(workspace, plots="[]", stop="0.1", grid="0.05"))
    assert provenance["scene"]["plots"] == []
    assert not (folder / "figure.svg").exists()


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
        ({"outputs": "[1]"}, "outputs = [1] must be a name, or a list of names"),
        ({"stop": '"soon"'}, "stop = 'soon' must be a finite number"),
        ({"stop": "inf"}, "stop = inf must be a finite number"),
        ({"rtol": "0"}, "rtol = 0 must be a finite number above 0"),
        ({"repeat": "true"}, "repeat = True must be a whole number from 1 to 1000"),
        ({"follow": "false"}, "follow = false needs a grid"),
        ({"times": "[0.0, 1.0, 1.0]"}, "times: 1.0 at index 2 is not after 1.0: give increasing numbers"),
        ({"times": "0.5"}, "times = 0.5 must be a list of increasing finite numbers"),
        ({"grid": "0.1", "analyses": '["steps"]'}, "the analysis 'steps' needs follow = true"),
        ({"outputs": '["x"]', "plots": '["phase"]'}, "the plot 'phase' needs the velocity: add v or omega"),
        ({"analyses": '["decay"]'}, "the table [decay] with gives"),
        ({"extra": "[decay]\ngives = 'mu'"}, "unknown value of decay.gives 'mu'; allowed: T_f, f, zeta"),
        ({"extra": "[decay]\ncycles = 0.3"}, "cycles = 0.3 must be a whole or half number above 0"),
        ({"extra": "[decay]\nfrist = 1"}, "unknown key in [decay] 'frist' (nearest: 'first')"),
        ({"extra": "[published]\nsource = 'me'\nperiod = 3"}, "[published] needs the table [citation]"),
        ({"extra": "[reference]\nperiod = 3"}, "[reference] needs a source"),
        (
            {"extra": "[parameter]\nf = 1\n[reference]\nsource = 'me'\nperiod = 3"},
            "[reference] and [parameter] are both",
        ),
        ({"extra": "[parameter]\nf = 1\n" + CITATION}, "[citation] has no effect without [published]"),
        ({"extra": "[published]\nsource = 'me'\n[citation]\nauthor = 'me'"}, "the key 'citation.location' is missing"),
        (
            {"extra": "[published]\nsource = 'me'\n" + CITATION.replace("2020", "'2020'")},
            "citation.year = '2020' must be",
        ),
        ({"extra": "[published]\nsource = 'me'\nperiod = [1, 2, 3]"}, "published.period = [1, 2, 3] must be"),
        ({"title": "'''"}, "not valid TOML"),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_an_invalid_scene_is_reported_in_one_sentence(workspace, keys, sentence):
    with pytest.raises(harness.SceneError) as error:
        harness.simulate(write(workspace, **keys))
    assert str(error.value).startswith("scene mine: ")
    assert sentence in str(error.value)
    assert "\n" not in str(error.value)


def test_an_unknown_scene_error_lists_the_shipped_names(workspace):
    result = commands.harness(workspace, "run", "pendulm")
    assert result.returncode == 2
    assert "unknown model or scene 'pendulm' (nearest: 'pendulum'); allowed: belt, " in result.stderr


def test_a_missing_file_is_reported():
    with pytest.raises(harness.SceneError, match=r"cannot read the scene nowhere\.toml: No such file"):
        harness.simulate("nowhere.toml")
