"""Coupled scenes: the archive is valid and opens in other tools, and the engines converge to the single-model
reference."""

import csv
import json
import re
import zipfile
from dataclasses import replace
from importlib.util import find_spec
from math import cos, sqrt
from pathlib import Path

import commands
import numpy as np
import pytest
from build_cache import ROOT, build_user_model, cached_folder
from fmi3_fixtures import build_fmi3_fmus
from fmpy.ssp.ssd import read_ssd
from native_fmus import build_native_fmus
from prescribed_motion import solve_block

import harness
from harness.references.single_model_reference import CoupledBodies, solve_bodies

HAS_ENGINES = all(map(find_spec, ("pyssp_standard", "ecospy", "libcosimpy")))
pytestmark = pytest.mark.skipif(not HAS_ENGINES, reason="the extras 'coupled' and 'importers' are not installed")
PAIR = """
title = "a title"
stop = 1.0
steps = [0.004, 0.002]
parts.a = { model = "smd", values = { c = 0.0 } }
parts.b = { model = "smd", values = { c = 0.0, x0 = -0.1 } }
springs = [{ between = ["a", "b"], k = 40.0 }]
"""


@pytest.fixture
def couple(workspace):
    """Return couple(scene, option, ...): the finished process, in a folder with the built FMUs."""

    def run(scene, *options):
        if "\n" in scene:
            (workspace / "mine.toml").write_text(scene)
            scene = "mine.toml"
        return commands.harness(workspace, "couple", scene, *options)

    return run


def bodies(**changes):
    one = np.ones(1)
    values = {"m": one, "k": one, "c": 0 * one, "hold": 0 * one, "slide": 0 * one, "driver": 0 * one, "couplings": ()}
    return CoupledBodies(**values | {name: value * one for name, value in changes.items()})


def test_the_reference_agrees_with_the_closed_form_of_dry_friction():
    """x falls by 2 f/k in each half cycle, and rests where |x| <= f/k."""
    x = solve_bodies(bodies(hold=0.1, slide=0.1), np.array([1.0, 0.0]), np.pi * np.arange(8))[:, 0]
    assert x == pytest.approx([1.0, -0.8, 0.6, -0.4, 0.2, 0.0, 0.0, 0.0], abs=1e-9)


def test_the_reference_has_the_period_of_stick_slip():
    mu_s, mu_d, m, k, g, driver = 0.9, 0.6, 12.5, 742.5, 9.81, 0.034
    sled = bodies(m=m, k=k, hold=mu_s * m * g, slide=mu_d * m * g, driver=driver)
    first, period = mu_s * m * g / (k * driver), 3.345104499330
    times = np.array([0.0, first - 1e-6, first + 0.5, first + period - 1e-6, first + period + 0.5])
    x = solve_bodies(sled, np.zeros(2), times)[:, 0]
    assert x[1] == 0.0
    assert x[2] == x[3]
    assert x[4] - x[2] == pytest.approx(period * driver, rel=1e-9)


def test_two_equal_coupled_masses_agree_with_their_closed_form(couple, tmp_path):
    """From x and -x both have the stiffness k + 2 k_spring; the error is proportional to the step."""
    done = couple(PAIR, "--stop", "0.5", "--json")
    assert (done.returncode, done.stderr) == (0, "")
    assert json.loads(done.stdout)["order"] == pytest.approx(1.0, abs=0.1)
    folder = tmp_path / "results/coupled/mine"
    assert {file.name for file in folder.iterdir()} == {
        *(
            "mine.ssp",
            "data.npz",
            "trajectory.csv",
            "error.csv",
            "engines.csv",
            "figure.svg",
            "provenance.json",
            "summary.json",
        )
    }
    values = json.loads((folder / "provenance.json").read_text())["parameters"]
    values_used = {name: values[name]["value"] for name in ("a.c", "a.x0", "b.x0", "spring_a_b.k")}
    assert values_used == {"a.c": 0.0, "a.x0": 0.1, "b.x0": -0.1, "spring_a_b.k": 40.0}
    assert values["a.k"] == {"value": 157.9, "unit": "N/m"}
    table = np.loadtxt(folder / "trajectory.csv", delimiter=",", skiprows=1)
    expected = [0.1 * cos(sqrt(157.9 + 80.0) * t) for t in table[:, 0]]
    assert table[:, 3] == pytest.approx(expected, abs=1e-9)
    assert table[:, 4] == pytest.approx([-x for x in expected], abs=1e-9)


@pytest.mark.slow
def test_values_of_parts_are_set_in_fmi3(couple, tmp_path):
    """They have another type than in FMI 2.0; libcosim and fmpy do not couple FMUs of FMI 3.0."""
    scene = PAIR.replace('"smd"', f'"{build_fmi3_fmus() / "smd.fmu"}"').replace("stop = 1.0", "stop = 0.1")
    done = couple(scene)
    assert (done.returncode, done.stderr) == (0, "")
    folder = tmp_path / "results/coupled/mine"
    _, *start = np.loadtxt(folder / "trajectory.csv", delimiter=",", skiprows=1)[0]
    assert start[:2] == [0.1, -0.1]
    for name in ("own master", "Ecos"):
        assert engines(folder)[name][1] == ""


def test_a_connection_with_a_factor_pushes_in_its_direction(couple, tmp_path):
    """A mass that hardly moves from 0.1 m pushes an oscillator with a constant force."""
    factor = -60.0
    parts = 'parts.a = { model = "smd", values = { m = 1e9, k = 0.0, c = 0.0, x0 = 0.1 } }\n'
    parts += 'parts.b = { model = "smd", values = { c = 0.0, x0 = 0.0 } }\n'
    connection = f'connections = [{{ from = "a.x", to = "b", factor = {factor} }}]\n'
    done = couple(f'title = "a push"\nstop = 0.2\nsteps = [0.004, 0.002]\n{parts}{connection}')
    assert (done.returncode, done.stderr) == (0, "")
    one_error = replace(harness.load_result(tmp_path / "results/coupled/mine"), errors=(1e-3,))
    assert "Order of convergence: not known" in str(one_error)
    table = np.loadtxt(tmp_path / "results/coupled/mine/trajectory.csv", delimiter=",", skiprows=1)
    expected = [0.1 * factor / 157.9 * (1.0 - cos(sqrt(157.9) * t)) for t in table[:, 0]]
    assert table[:, 4] == pytest.approx(expected, abs=1e-8)
    assert table[:, 2] == pytest.approx(expected, abs=2e-3)


def write_page_files(folder, *models):
    """Write the files of the page of the documentation, and build these models."""
    page = ROOT / "docs/how-to/coupled.md"
    for name, text in re.findall(r'```\w+ title="([^"]+)"\n(.*?)```', page.read_text(), re.S):
        (folder / name).write_text(text)
    for name in models:
        fmu = f"{Path(name).stem}.fmu"
        (folder / fmu).symlink_to(build_user_model(folder / name) / fmu)


def test_a_belt_carries_a_block_of_another_fmu(couple, workspace):
    """Position, speed and acceleration are connected; the reference is scipy with events."""
    write_page_files(workspace, "belt.py", "block.py")
    scene = workspace / "carried.toml"
    scene.write_text(scene.read_text().replace("0.02, 0.005, 0.00125", "0.02, 0.0025"))
    done = couple("carried.toml", "--stop", "5", "--json")
    assert (done.returncode, done.stderr) == (0, "")
    folder = workspace / "results/coupled/carried"
    times, _, x, *_ = np.loadtxt(folder / "trajectory.csv", delimiter=",", skiprows=1).T

    def belt(t):
        return 0.3 * (1.0 - np.cos(1.7 * t)), 0.51 * np.sin(1.7 * t), 0.867 * np.cos(1.7 * t)

    events, motion = solve_block(belt, 5.0, k=30.0, hold=12.0, slide=8.0)
    assert [mode for _, mode in events] == [-1, 0, 1, 0]
    assert np.abs(x - [motion(t)[0] for t in times]).max() < 6e-4
    for numbers, why in engines(folder).values():
        assert why == ""
        assert numbers[1] == pytest.approx(motion(5.0)[0], abs=6e-4)


def test_a_controller_of_another_fmu_lets_the_axis_hunt(couple, workspace):
    """It sticks where the axis with the same gains in one model sticks; both overshoot the set point in turn."""
    write_page_files(workspace, "controller.py")
    servo = build_user_model(ROOT / "fmus/more/servo.py") / "servo.fmu"
    (workspace / "servo.fmu").symlink_to(servo)
    scene = workspace / "controlled.toml"
    text = scene.read_text().replace('"servo"', '"servo.fmu"')
    scene.write_text(text.replace("0.004, 0.002, 0.001]", "0.004, 0.002]"))
    done = couple("controlled.toml", "--json")
    assert (done.returncode, done.stderr) == (0, "")
    folder = workspace / "results/coupled/controlled"
    times, x, *_ = np.loadtxt(folder / "trajectory.csv", delimiter=",", skiprows=1).T
    single = harness.simulate(servo, {"K_i": 2e5}, stop=2.0, rtol=1e-8)
    events = single.events
    middles = [
        0.5 * (begin + end)
        for begin, end, mode in zip(events.t, events.t[1:], events.modes["F_friction"], strict=False)
        if mode == 0
    ]
    expected = np.interp(middles, single.time, single["x"])
    assert len(expected) >= 4
    assert (np.diff(np.sign(expected[1:] - 0.01)) != 0).all()
    np.testing.assert_allclose(np.interp(middles, times, x), expected, atol=1e-4)
    for name, ((_, _, error), why) in engines(folder).items():
        assert why == ""
        assert error < (2e-3 if name == "fmpy" else 1e-6)


@pytest.fixture
def run():
    """Return run(scene): the results folder of a shipped scene, which is run once, with native FMUs for speed."""
    fmus = build_native_fmus()

    def run(scene):
        def make(folder):
            (folder / "fmus").symlink_to(fmus)
            done = commands.harness(folder, "couple", scene, figures=scene == "two-masses")
            assert (done.returncode, done.stderr) == (0, "")

        return cached_folder(f"coupled-{scene}", make) / "results/coupled" / scene

    return run


SCENES = sorted(file.stem for file in (ROOT / "harness/scenes/coupled").glob("*.toml"))
EVERY_SCENE = pytest.mark.parametrize(
    "scene",
    [pytest.param(scene, marks=pytest.mark.campaign if scene == "chain" else pytest.mark.slow) for scene in SCENES],
)


def engines(folder):
    with (folder / "engines.csv").open(newline="") as file:
        _, *rows = csv.reader(file)
    return {name: ([float(number) for number in numbers if number], why) for name, *numbers, why in rows}


@EVERY_SCENE
def test_a_shipped_scene_converges_to_its_reference_in_every_engine(run, scene):
    """The error is proportional to the step, also in Ecos and libcosim; fmpy passes the first forces one step later."""
    steps, errors = np.loadtxt(run(scene) / "error.csv", delimiter=",", skiprows=1).T
    assert np.log(errors[0] / errors[-1]) / np.log(steps[0] / steps[-1]) == pytest.approx(1.0, abs=0.25)
    engine_errors = engines(run(scene))
    assert [why for _, why in engine_errors.values()] == [""] * 5
    assert engine_errors["libcosim"][0] == pytest.approx(engine_errors["Ecos"][0], rel=1e-4)
    assert engine_errors["fmpy"][0][-1] < 2 * engine_errors["Ecos"][0][-1]
    size = np.abs(np.loadtxt(run(scene) / "trajectory.csv", delimiter=",", skiprows=1)[:, 1:]).max()
    assert engine_errors["Ecos"][0][-1] < 0.05 * size


@EVERY_SCENE
def test_an_archive_avoids_factors_inline_values_and_unusual_names(run, scene):
    (file,) = run(scene).glob("*.ssp")
    system = read_ssd(str(file)).system  # which validates it against the schema
    names = [system.name, *(element.name for element in system.elements)]
    assert all(re.fullmatch(r"[A-Za-z]\w*", name, re.ASCII) for name in (*names, file.stem))
    with zipfile.ZipFile(file) as archive:
        text = archive.read("SystemStructure.ssd").decode()
        bound = set(re.findall(r'ParameterBinding source="([^"]*)"', text))
        assert bound | {"resources/parameters.ssv"} <= set(archive.namelist())
    assert "LinearTransformation" not in text
    assert "ParameterValues" not in text
    assert 'type="org.openmodelica"' in text
    assert len(bound) > 1


@pytest.mark.slow
def test_an_external_archive_is_compared_with_its_finest_run(run, user_folder):
    done = commands.harness(
        user_folder, "couple", run("driven") / "driven.ssp", "--stop", "0.5", "--out", "theirs", "--json"
    )
    assert (done.returncode, done.stderr) == (0, "")
    result = json.loads(done.stdout)
    assert result["order"] > 0.8
    assert {*result["engines"]} == {"own master", "Ecos", "libcosim", "fmpy"}
    assert {item["failure"] for item in result["engines"].values()} == {""}
    table = np.loadtxt(user_folder / "theirs/coupled/driven/trajectory.csv", delimiter=",", skiprows=1)
    expected = np.loadtxt(run("driven") / "trajectory.csv", delimiter=",", skiprows=1)
    heads = (user_folder / "theirs/coupled/driven/trajectory.csv").read_text().splitlines()[0].split(",")
    column = heads.index("shaken.x [m]")
    assert table[-1, column] == pytest.approx(np.interp(0.5, expected[:, 0], expected[:, 4]), abs=1e-3)


def test_an_invalid_archive_is_reported(couple, tmp_path):
    (tmp_path / "no.ssp").write_text("no archive")
    for name, sentence in (("no.ssp", "no.ssp cannot be read"), ("gone.ssp", "gone.ssp does not exist")):
        done = couple(name)
        assert sentence in done.stderr
        assert done.stderr.count("\n") == 1


@pytest.mark.parametrize(
    ("text", "status", "sentence"),
    [
        ("nosuch", 2, "unknown coupled scene 'nosuch'"),
        (PAIR.replace("smd", "pendulums"), 2, "part a: unknown model 'pendulums'"),
        (PAIR.replace('"b"]', '"c"]'), 2, "unknown part 'c'"),
        (PAIR.replace("stop", "stopp"), 2, "unknown key 'stopp'"),
        (PAIR.replace("x0 =", "xx ="), 1, "part b (smd) has no parameter xx"),
        (PAIR.replace("k = 40.0", "k = -1"), 2, "springs[0].k = -1 must be a finite number above 0"),
        (PAIR.replace("k = 40.0", "k = 40.0, c = -1"), 2, "springs[0].c = -1 must be a finite number of at least 0"),
        (
            PAIR.replace("springs", "connections").replace(
                '{ between = ["a", "b"], k = 40.0 }', '{ from = "a.F_spring", to = "b", factor = 2.0 }'
            ),
            2,
            "a connected force needs factor = 1, got 2.0",
        ),
        (PAIR + 'connections = [{ from = "a.x", to = "b", factor = 1.0 }]\n', 2, "part b is driven twice"),
        (PAIR + 'connections = [{ from = "a.v", to = "b.v_in" }]\n', 1, "part b has no input v_in"),
        (PAIR + 'connections = [{ from = "a.w", to = "b.F_ext" }]\n', 2, "part b is driven twice"),
        (
            PAIR + 'connections = [{ from = "a.v", to = "b.v_in", factor = 2.0 }]\n',
            2,
            "a connection to an input needs factor = 1, got 2.0",
        ),
        (PAIR + 'parts.c = { model = "nosuch.fmu" }\n', 2, "there is no nosuch.fmu"),
        (PAIR + 'connections = [{ from = "a.mode", to = "b", factor = 1.0 }]\n', 2, "unknown output 'mode'"),
    ],
)
def test_an_invalid_coupled_scene_is_one_sentence(couple, tmp_path, text, status, sentence):
    done = couple(text)
    assert done.returncode == status
    assert sentence in done.stderr
    assert done.stderr.count("\n") == 1
    assert not (tmp_path / "results/coupled/mine").exists()


def test_a_scene_is_checked_before_any_fmu(tmp_path):
    """A typing error is reported even if no FMU is built."""
    done = commands.harness(tmp_path, "couple", "two-mases")
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert "unknown coupled scene 'two-mases'" in done.stderr


def test_an_engine_that_hangs_is_reported_by_name(couple, monkeypatch):
    monkeypatch.setattr("harness.studies.coupled.engine.ENGINE_TIMEOUT", 1e-3)
    done = couple(PAIR, "--stop", "0.1")
    assert (done.returncode, done.stderr) == (1, "Error: Ecos could not run mine.ssp: no answer after 0.001 s\n")
