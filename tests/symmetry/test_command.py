"""The command `python -m benchmarks symmetry`, and what it finds."""

import ast
import json
from dataclasses import replace

import commands
import numpy as np
import pytest
from variants import slow_after

from benchmarks.symmetry.builds import PYTHON, all_models, find_source
from benchmarks.symmetry.changes import FRAME, MIRROR, ORDER, TIME, UNITS, Change
from benchmarks.symmetry.equations import Equations
from benchmarks.symmetry.long_run import find_irregular_period
from benchmarks.symmetry.model_text import move_frame, reverse_declarations
from benchmarks.symmetry.motion import FmuRuns, Motion, find_difference
from tests.symmetry.symmetry_models import build, examine

LITERAL = """
from fmus import Model, Output, Parameter, State


class Cart(Model):
    '''Cart on a spring that is stiffer far away: m a = - k x.'''

    m = Parameter(1.0, "kg", "mass", above=0)
    k = Parameter(100.0, "N/m", "stiffness", low=0)
    x = State("m", "position"{start})
    v = State("m/s", "speed", rate_of=x)
    {more}
    a = Output("m/s2", "acceleration", -k * x / m {term}, rate_of=v)
"""


RATE = "the rate of y contains a number with a unit"


def write_cart(folder, start="", more="", term=""):
    path = folder / "cart.py"
    path.write_text(LITERAL.format(start=start, more=more, term=term))
    return path


def run_command(folder, *arguments):
    return commands.benchmarks(folder, "symmetry", *arguments, "--builds", folder / "builds")


def test_the_command_prints_counts_and_data(tmp_path):
    options = ("--backend", "python", "--method", "exact", "--change", TIME, "--change", MIRROR)
    result = run_command(tmp_path, "smd", *options)
    assert (result.returncode, result.stderr) == (0, "")
    assert result.stdout.splitlines()[0].startswith("What a change of time, unit, sign or order changes")
    assert [cell.strip() for cell in result.stdout.splitlines()[4].split("│")[1:4]] == ["smd", "0 of 5", "0 of 1"]
    data = json.loads(run_command(tmp_path, "smd", *options, "--json").stdout)
    assert data["table"] == {"smd": {TIME: {"differing": 0, "runs": 5}, MIRROR: {"differing": 0, "runs": 1}}}
    assert [run["text"] for run in data["runs"]][-1] == "signs inverted"


@pytest.mark.parametrize(
    ("name", "message"), [("nothing", "There is no model 'nothing'"), ("nothing.fmu", "there is no file nothing.fmu")]
)
def test_a_model_that_does_not_exist_is_refused(tmp_path, name, message):
    result = run_command(tmp_path, name)
    assert result.returncode == 1
    assert result.stderr.startswith(f"Error: {message}")


def test_a_method_that_does_not_exist_is_refused(tmp_path, fmus):
    result = run_command(tmp_path, fmus / "smd.fmu", "--method", "heun")
    assert result.returncode == 1
    assert result.stderr.startswith("Error: no model has the method heun")


def test_an_fmu_without_its_model_file_is_examined(tmp_path, fmus):
    result = run_command(tmp_path, fmus / "smd.fmu", "--method", "exact")
    assert result.returncode == 0, result.stdout
    assert "smd: order left out, smd.fmu is no model file (exact)" in result.stdout.splitlines()


@pytest.mark.parametrize(
    ("number", "reason"),
    slow_after(
        1,
        [
            ({"start": ", start=0.1"}, "the start value of x is a number with a unit"),
            ({"more": 'y = State("m", "position of the driver", rate=0.5)', "term": "+ k * y / m"}, RATE),
        ],
    ),
)
def test_a_number_with_a_unit_is_no_silent_pass(tmp_path, number, reason):
    result = run_command(tmp_path, write_cart(tmp_path, **number), "--backend", "python", "--change", UNITS)
    assert result.returncode == 0
    assert result.stdout.splitlines()[-1].startswith(f"cart: units left out, not scalable: {reason} (")


def test_a_model_that_does_not_build_is_refused(tmp_path):
    result = run_command(tmp_path, write_cart(tmp_path, term="+ k"), "--backend", "python")
    assert result.returncode == 1
    assert result.stderr.startswith(f"Error: {tmp_path / 'cart.py'}, line ")
    assert "Traceback" not in result.stderr


def test_odd_variables_are_found():
    odd_variables = {}
    for label in ("stickslip", "belt", "rotor_brake"):
        fmu = build(find_source(label), PYTHON)
        names, _ = Equations(fmu).find_odd_variables(FmuRuns(fmu), {})
        odd_variables[label] = sorted(names)
    assert odd_variables == {
        "stickslip": ["F_ext", "v0", "v_driver", "x0"],
        "belt": ["F_ext", "v0", "v_belt", "x0"],
        "rotor_brake": ["T", "omega0", "omega_turn"],
    }


BASE = Motion(
    np.array([0.0, 1.0, 2.0]),
    {"x": np.array([0.0, 1.0, -2.0]), "v": np.array([1.0, -1.0, 0.0])},
    np.array([0.0, 1.0]),
    np.array([[1], [0]]),
    {"steps": 2},
)
SHIFT = Change(TIME, "start 0 s", {}, 0.0, 2.0)
EXACT = replace(SHIFT, is_exact=True)


@pytest.mark.parametrize(
    ("changed_fields", "change", "difference"),
    [
        ({}, SHIFT, ""),
        ({}, EXACT, ""),
        ({"modes": np.array([[1], [-1]])}, SHIFT, "event 1 at 1 s: mode -1 instead of 0; of 1 events"),
        ({"event_times": np.array([0.0, 1.001])}, SHIFT, "event 1 at 1 s: 0.001 s off; of 1 events"),
        ({"event_times": np.array([0.0, 1.0 + 2.0**-50])}, SHIFT, ""),
        ({"event_times": np.array([0.0, 1.0 + 2.0**-50])}, EXACT, "event 1 at 1 s: 8.9e-16 s off; of 1 events"),
        (
            {"event_times": np.zeros(1), "modes": np.ones((1, 1))},
            SHIFT,
            "event 1 at 1 s: missing; 0 events instead of 1",
        ),
        ({"failure": "the solver stalls"}, SHIFT, "fails: the solver stalls"),
        ({"counts": {"steps": 3}}, EXACT, "3 instead of 2 steps"),
        (
            {"columns": {**BASE.columns, "x": np.array([0.0, 1.0, -2.1])}},
            SHIFT,
            "x at 2 s: 0.048 of its largest value off",
        ),
        (
            {"columns": {**BASE.columns, "x": np.array([0.0, 1.0, -2.0 - 2.0**-51])}},
            EXACT,
            "x at 2 s: bits differ, by 2e-16 of its largest value",
        ),
    ],
)
def test_the_first_difference_is_found(changed_fields, change, difference):
    assert find_difference(BASE, replace(BASE, **changed_fields), change, ["x", "v"], 1e-6) == difference


@pytest.mark.parametrize(
    ("defect", "difference"),
    [
        (None, ""),
        (("mode", 700), "event 700 at 350.5 s: another mode than a period before"),
        (("time", 700), "event 700 at 350.51 s: 1.01 s after that of the period before, not 1"),
        (("end", 1500), "no event after 750 s"),
    ],
)
def test_an_irregular_period_is_found(defect, difference):
    times, modes = 0.5 + 0.5 * np.arange(1999), np.tile([[1], [0]], (1000, 1))[:1999]
    kind, k = defect or ("", 0)
    if kind == "mode":
        modes[k] = -1
    elif kind == "time":
        times[k] += 0.01
    elif kind == "end":
        times, modes = times[:k], modes[:k]
    irregularity, has_period = find_irregular_period(times, modes, 1000.0, 1e-6)
    assert has_period
    assert irregularity.startswith(difference)
    assert bool(irregularity) == bool(difference)


@pytest.mark.parametrize("path", all_models(), ids=lambda path: f"{path.parent.name}/{path.stem}")
def test_another_order_has_the_same_declarations(path):
    (model,) = (node for node in ast.parse(path.read_text()).body if isinstance(node, ast.ClassDef))
    (reversed_model,) = (
        node for node in ast.parse(reverse_declarations(path.read_text())).body if isinstance(node, ast.ClassDef)
    )
    names = [
        [part.id for node in item.body for part in ast.walk(node) if is_stored(part)]
        for item in (model, reversed_model)
    ]
    assert sorted(names[0]) == sorted(names[1])
    assert names[0] != names[1]
    assert sum(a != b for a, b in zip(*names, strict=True)) > len(names[0]) // 2


def test_declarations_that_need_each_other_have_no_other_order():
    loop = "    for i in range(2):\n        vars()[f'a{i}'] = i\n"
    assert reverse_declarations(f"class Loops(Model):\n{loop}") != ""
    assert reverse_declarations(f"class Loops(Model):\n{loop}{loop}") == ""


def is_stored(node):
    return isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store)


def test_a_frame_at_rest_is_the_ground():
    frame = move_frame(find_source("sleds").read_text())
    assert frame.velocities == {"v_1": "v_1_in_frame", "v_2": "v_2_in_frame"}
    assert frame.positions == {"x_1": "x_1_in_frame", "x_2": "x_2_in_frame"}
    assert move_frame(find_source("spring").read_text()) is None


@pytest.mark.campaign
def test_a_wrong_model_in_another_order_or_frame_is_found(tmp_path, monkeypatch):
    """A declaration that another order changes, and an equation that depends on the frame, differ."""
    monkeypatch.setattr("benchmarks.symmetry.study.reverse_declarations", lambda text: text.replace("40.0", "40.01"))
    monkeypatch.setattr(
        "benchmarks.symmetry.study.move_frame",
        lambda text: replace(frame := move_frame(text), text=frame.text.replace("slip=v_1", "slip=v_1_in_frame")),
    )
    _, differences = examine("sleds", kinds=(ORDER, FRAME), methods=("ode45",), max_steps=300)
    assert len(differences) == 2
