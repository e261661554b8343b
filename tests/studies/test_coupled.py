"""Coupled scenes: the archive is valid and opens elsewhere, and the engine's answer tends to the monolithic one."""

import json
import subprocess
import sys
import zipfile
from importlib.util import find_spec
from math import cos, sqrt

import commands
import numpy as np
import pytest
from fmpy import read_model_description
from fmpy.ssp.ssd import read_ssd

from harness.studies.coupled.study import ecos
from harness.truths.monolith import Bodies, solve

here = all(map(find_spec, ("pyssp_standard", "ecospy")))
pytestmark = pytest.mark.skipif(not here, reason="the extra 'coupled' is not installed")
PAIR = """
title = "a title"
stop = 1.0
steps = [0.02, 0.01, 0.005]
parts.a = { model = "smd", values = { c = 0.0 } }
parts.b = { model = "smd", values = { c = 0.0, x0 = -0.1 } }
springs = [{ between = ["a", "b"], k = 40.0 }]
"""


@pytest.fixture
def couple(fmus, tmp_path):
    """couple(scene, option, ...): the finished process, in a folder with the built FMUs."""
    (tmp_path / "fmus").symlink_to(fmus)

    def run(scene, *options):
        if "\n" in scene:
            (tmp_path / "mine.toml").write_text(scene)
            scene = "mine.toml"
        return commands.harness(tmp_path, "couple", scene, *options)

    return run


def bodies(**changes):
    one = np.ones(1)
    values = {"m": one, "k": one, "c": 0 * one, "hold": 0 * one, "slide": 0 * one, "driver": 0 * one, "couplings": ()}
    return Bodies(**values | {name: value * one for name, value in changes.items()})


def test_the_reference_knows_the_closed_form_of_dry_friction():
    """x falls by 2 f/k in each half cycle, and rests where |x| <= f/k."""
    x = solve(bodies(hold=0.1, slide=0.1), np.array([1.0, 0.0]), np.pi * np.arange(8))[:, 0]
    assert x == pytest.approx([1.0, -0.8, 0.6, -0.4, 0.2, 0.0, 0.0, 0.0], abs=1e-9)


def test_the_reference_knows_the_period_of_stick_slip():
    mu_s, mu_d, m, k, g, driver = 0.9, 0.6, 12.5, 742.5, 9.81, 0.034
    sled = bodies(m=m, k=k, hold=mu_s * m * g, slide=mu_d * m * g, driver=driver)
    first, period = mu_s * m * g / (k * driver), 3.345104499330
    times = np.array([0.0, first - 1e-6, first + 0.5, first + period - 1e-6, first + period + 0.5])
    x = solve(sled, np.zeros(2), times)[:, 0]
    assert x[1] == 0.0
    assert x[2] == x[3]
    assert x[4] - x[2] == pytest.approx(period * driver, rel=1e-9)


def test_two_equal_masses_swing_against_each_other_as_their_closed_form_says(couple, tmp_path):
    """From x and -x both feel the stiffness k + 2 k_spring; the error falls in proportion to the step."""
    done = couple(PAIR, "--json")
    assert (done.returncode, done.stderr) == (0, "")
    assert json.loads(done.stdout)["order"] == pytest.approx(1.0, abs=0.15)
    folder = tmp_path / "results/coupled/mine"
    assert {file.name for file in folder.iterdir()} == {
        *("mine.ssp", "trajectory.csv", "error.csv", "figure.png", "provenance.json")
    }
    table = np.loadtxt(folder / "trajectory.csv", delimiter=",", skiprows=1)
    expected = [0.1 * cos(sqrt(157.9 + 80.0) * t) for t in table[:, 0]]
    assert table[:, 3] == pytest.approx(expected, abs=1e-9)
    assert table[:, 4] == pytest.approx([-x for x in expected], abs=1e-9)


@pytest.mark.parametrize("scene", ["two-masses", "driven"])
def test_a_shipped_scene_tends_to_its_reference_and_its_archive_opens_elsewhere(couple, tmp_path, scene):
    done = couple(scene)
    assert (done.returncode, done.stderr) == (0, "")
    folder = tmp_path / f"results/coupled/{scene}"
    steps, errors = np.loadtxt(folder / "error.csv", delimiter=",", skiprows=1).T
    assert (errors[:-1] / errors[1:]) == pytest.approx(steps[:-1] / steps[1:], rel=0.1)
    system = read_ssd(str(folder / f"{scene}.ssp")).system
    assert len(system.elements) == 2
    with zipfile.ZipFile(folder / f"{scene}.ssp") as archive:
        assert "SystemStructure.ssd" in archive.namelist()


LIBCOSIM = """
import sys
from libcosimpy.CosimExecution import CosimExecution
from libcosimpy.CosimLogging import CosimLogLevel, log_output_level
from libcosimpy.CosimObserver import CosimObserver
log_output_level(CosimLogLevel.ERROR)
execution = CosimExecution.from_ssp_file(sys.argv[1], 10_000_000)
observer = CosimObserver.create_last_value()
execution.add_observer(observer)
for _ in range(100):
    assert execution.step(1)
places = [execution.slave_index_from_instance_name(name) for name in ("left", "right")]
print(*(repr(observer.last_real_values(place, [int(sys.argv[2])])[0]) for place in places))
"""


@pytest.mark.skipif(not find_spec("libcosimpy"), reason="the extra 'importers' is not installed")
def test_another_engine_gives_the_same_from_the_same_file(couple, fmus, tmp_path):
    """libcosim, at the same communication step, 1 s of 10 ms."""
    assert couple("two-masses", "--quiet").returncode == 0
    archive = tmp_path / "results/coupled/two-masses/two-masses.ssp"
    variables = read_model_description(str(fmus / "coulomb.fmu")).modelVariables
    (x,) = (variable.valueReference for variable in variables if variable.name == "x")
    command = [sys.executable, "-c", LIBCOSIM, archive, str(x)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    theirs = [float(word) for word in done.stdout.split()]
    assert theirs == pytest.approx(ecos(archive, 0.01, 100, ["left::x", "right::x"])[-1], rel=1e-12)


@pytest.mark.parametrize(
    ("text", "status", "sentence"),
    [
        ("nosuch", 2, "unknown coupled scene 'nosuch'"),
        (PAIR.replace("smd", "pendulum"), 2, "part a: unknown model 'pendulum'"),
        (PAIR.replace('"b"]', '"c"]'), 2, "unknown part 'c'"),
        (PAIR.replace("stop", "stopp"), 2, "unknown key 'stopp'"),
        (PAIR.replace("x0 =", "xx ="), 1, "part b (smd) has no parameter xx"),
        (PAIR.replace("k = 40.0", "k = -1"), 2, "springs[0].k = -1 is not a finite number above 0"),
        (PAIR.replace("smd", "stickslip"), 2, "would pull at its driver"),
        (PAIR + 'connections = [{ from = "a.x", to = "b", factor = 1.0 }]\n', 2, "part b is driven twice"),
        (PAIR + 'connections = [{ from = "a.mode", to = "b", factor = 1.0 }]\n', 2, "unknown output 'mode'"),
    ],
)
def test_what_a_coupled_scene_gets_wrong_is_one_sentence(couple, tmp_path, text, status, sentence):
    done = couple(text)
    assert done.returncode == status
    assert sentence in done.stderr
    assert done.stderr.count("\n") == 1
    assert not (tmp_path / "results/coupled/mine").exists()
