"""Every result says what it was made from: files by their digest, values with their units, versions, the scene."""

import csv
import json
import re
import shutil
from functools import partial
from hashlib import sha256

import commands
import numpy as np
import pytest
from builds import published
from commands import UNPLOTTED
from fmpy import read_model_description
from models import MODELS

from harness.scenes.scene import shipped_scenes

COMMANDS = {  # that take seconds, and the folders of their results
    "run": (("run", "coulomb"), "coulomb"),
    "run --fmu": (("run", "--fmu", "fmus/coulomb.fmu", "--set", "f=0.25"), "coulomb"),
    "compare": (("compare", "fmus/coulomb.fmu", "fmus/smd.fmu"), "compare/coulomb-smd"),
    "decay": (("decay", "coulomb", "--no-drag", "--until", "2"), "decay/coulomb"),
    "sweep": (("sweep", "coulomb", "--vary", "f=0.25,0.5", "--workers", "1", "--name", "f"), "sweep/f"),
}
DRAWN = "decay/coulomb"  # the others are not, for the same drawing is the same file (test_figures.py)
harness = partial(commands.harness, blank=UNPLOTTED)  # each of these is plotted by a test of its study


@pytest.fixture
def here(fmus, tmp_path):
    """A folder with the built FMUs."""
    (tmp_path / "fmus").symlink_to(fmus)
    return tmp_path


@pytest.fixture(scope="module", params=COMMANDS)
def made(request, fmus, tmp_path_factory):
    """A folder in which one of the commands was run, its arguments, and its result."""
    here, (arguments, folder) = tmp_path_factory.mktemp("made"), COMMANDS[request.param]
    (here / "fmus").symlink_to(fmus)
    done = commands.harness(here, *arguments, blank=folder != DRAWN and UNPLOTTED)
    assert (done.returncode, done.stderr) == (0, "")
    return here, arguments, here / "results" / folder


@pytest.fixture(scope="module")
def swung(place):
    """A folder in which the first scene was run."""
    assert harness(place, "run", "smd").returncode == 0
    return place


def told(folder):
    return json.loads((folder / "provenance.json").read_text())


def test_a_result_names_its_files_by_digest_and_the_versions_that_made_it(made):
    here, arguments, folder = made
    found = told(folder)
    assert found["command"] == " ".join(("python -m harness", *arguments))
    assert {"python", "friction-fmus", "fmpy", "numpy"} <= set(found["versions"])
    assert found["files"]
    for file, digest in found["files"].items():
        assert digest == sha256((here / file).read_bytes()).hexdigest()


@pytest.mark.parametrize("model", MODELS)
def test_every_parameter_in_force_is_told_with_its_unit(here, model):
    assert harness(here, "run", "--fmu", f"fmus/{model}.fmu", "--set", "m=1.5", "--stop", "0.5").returncode == 0
    found = told(here / "results" / model)["parameters"]
    variables = read_model_description(str(here / f"fmus/{model}.fmu")).modelVariables
    parameters = [each for each in variables if each.causality == "parameter"]
    assert set(found) == {each.name for each in parameters}
    for each in parameters:
        type_unit = each.declaredType.unit if each.declaredType is not None else None
        assert found[each.name]["unit"] in (each.unit, type_unit, "")
    assert found["m"] == {"value": 1.5, "unit": "kg"}


def test_a_comparison_tells_the_parameters_of_both_sides(here):
    assert harness(here, "compare", "fmus/smd.fmu", "smd").returncode == 0
    found = told(here / "results/compare/fmus-smd-scene-smd")["parameters"]
    assert found["one: c"] == found["two: c"] == {"value": 2.0, "unit": "N.s/m"}


def test_the_scene_is_kept_as_it_was_run(here):
    (here / "mine.toml").write_text('title = "a title"\nmodel = "smd"\noutputs = ["x"]\n[values]\nc = 3.0\n')
    assert harness(here, "run", "mine.toml").returncode == 0
    scene = told(here / "results/mine")["scene"]
    assert (scene["name"], scene["title"], scene["outputs"], scene["values"]) == ("mine", "a title", ["x"], {"c": 3.0})
    with (here / "results/mine/trajectory.csv").open() as file:
        times = [float(row[0]) for row in list(csv.reader(file))[1:]]
    assert (scene["start"], scene["stop"]) == (times[0], times[-1])


def test_the_report_says_what_its_results_were_made_from(swung):
    assert harness(swung, "report").returncode == 0
    page = (swung / "results/report.html").read_text()
    digest = sha256((swung / "fmus/smd.fmu").read_bytes()).hexdigest()
    assert f"smd.fmu (sha256 {digest[:12]})" in page
    assert "k = 157.9 N/m" in page


def test_the_report_shows_whatever_was_run(here):
    """Each FMU and each scene of one's own, by its first and last values where nothing else was asked."""
    (here / "mine.toml").write_text('title = "a title"\nmodel = "smd"\noutputs = ["x"]\nplots = ["position"]\n')
    for arguments in (("--fmu", "fmus/pacejka.fmu"), ("mine.toml",)):
        assert harness(here, "run", *arguments).returncode == 0
    assert harness(here, "report").returncode == 0
    page = (here / "results/report.html").read_text()
    assert "Other runs" in page
    assert all(f"<h3>{name}</h3>" in page for name in ("pacejka", "mine"))
    assert re.search(r"<td[^>]*>x \[m\]</td>\s*<td[^>]*>0.1</td>", page)
    assert "mine: the plots that its scene names" in page


def test_a_damaged_account_is_told_in_the_page(here, swung):
    damaged = ("", "[]", "{}", '{"files": 1}', '{"files": {}, "versions": {}}')
    for model, content in zip(MODELS, damaged, strict=True):
        shutil.copytree(swung / "results/smd", here / "results" / model)
        (here / "results" / model / "provenance.json").write_text(content)
    done = harness(here, "report")
    assert (done.returncode, done.stderr) == (0, "")
    page = (here / "results/report.html").read_text()
    assert [model for model in MODELS if f"results/{model} cannot be shown" not in page] == []


def files(folder):
    """What a result holds, but for its account, which has a date, and its figures, which have a run time."""
    return {
        path.name: path.read_bytes()
        for path in folder.iterdir()
        if path.name not in ("provenance.json", "quantities.csv")
    }


def test_a_result_is_made_again_by_its_folder_and_to_the_last_bit(made):
    here, (command, *_), folder = made
    before, account = files(folder), told(folder)
    done = commands.harness(here, "run", folder.relative_to(here), blank=not folder.match(DRAWN) and UNPLOTTED)
    assert (done.returncode, done.stderr) == (0, "")
    assert files(folder) == before
    for key in ("files", "parameters", "scene", "source"):
        assert told(folder)[key] == account[key]
    if command == "run":
        assert "the same, bit for bit" in done.stdout
        assert harness(here, "run", folder.relative_to(here), "--quiet").returncode == 0  # and again


@pytest.mark.parametrize(
    "scene", [path.stem for path in shipped_scenes() if path.stem not in ("coulomb", "pacejka-0.001")]
)
def test_every_shipped_scene_is_run_again_to_the_last_bit(here, scene):
    shutil.copytree(published() / "results" / scene, here / "results" / scene)
    assert "the same, bit for bit" in harness(here, "run", f"results/{scene}").stdout


MINE = 'title = "a title"\nmodel = "smd"\noutputs = ["x"]\nplots = []\nstop = 1.0\ngrid = 0.1\n[values]\nc = 3.0\n'


def test_a_result_is_made_again_though_its_scene_is_gone_and_goes_where_it_is_wanted(here):
    (here / "mine.toml").write_text(MINE)
    assert harness(here, "run", "mine.toml", "--out", "there").returncode == 0
    before = files(here / "there/mine")
    (here / "mine.toml").unlink()
    for out in ((), ("--out", "elsewhere")):
        assert harness(here, "run", "there/mine", *out).returncode == 0
    assert files(here / "there/mine") == files(here / "elsewhere/mine") == before
    assert sorted(path.name for path in here.iterdir()) == ["elsewhere", "fmus", "there"]


def test_a_result_whose_fmu_has_changed_or_gone_is_not_made_again_as_if_it_were_the_same(here, fmus):
    shutil.copy(fmus / "smd.fmu", here / "mine.fmu")
    (here / "mine.toml").write_text(MINE.replace('model = "smd"', 'fmu = "mine.fmu"'))
    assert harness(here, "run", "mine.toml").returncode == 0
    before = files(here / "results/mine")
    shutil.copy(fmus / "coulomb.fmu", here / "mine.fmu")
    done = harness(here, "run", "results/mine")
    assert (done.returncode, done.stderr.count("\n")) == (1, 1)
    assert "mine.fmu has changed since this was made from it" in done.stderr
    assert "`python -m harness run mine.toml`" in done.stderr
    (here / "mine.fmu").unlink()
    assert "mine.fmu, from which this was made, is not here" in harness(here, "run", "results/mine").stderr
    assert files(here / "results/mine") == before


def swinging(file):
    """Write a record of a decay."""
    t = np.linspace(0, 2, 60)
    rows = np.column_stack([t, np.exp(-t) * np.cos(12 * t)])
    np.savetxt(file, rows, header="t [s],x [m]", delimiter=",", comments="")


ONCE = ("--vary", "c=2,3", "--workers", "1", "--name", "c")


@pytest.mark.parametrize(
    ("first", "second", "folder"),
    [
        (("run", "coulomb"), ("run", "--fmu", "fmus/coulomb.fmu"), "coulomb"),
        (("run", "--fmu", "fmus/coulomb.fmu"), ("run", "coulomb"), "coulomb"),
        (("run", "a/mine.toml"), ("run", "b/mine.toml"), "mine"),
        (("run", "--fmu", "fmus/smd.fmu"), ("run", "--fmu", "a/smd.fmu"), "smd"),
        (("decay", "coulomb", "--no-drag"), ("decay", "a/coulomb.csv", "--no-drag"), "decay/coulomb"),
        (("compare", "smd", "a/smd.fmu"), ("compare", "smd", "b/a/smd.fmu"), "compare/scene-smd-a-smd"),
        (("sweep", "a/smd.fmu", *ONCE), ("sweep", "b/smd.fmu", *ONCE), "sweep/c"),
    ],
)
def test_a_result_of_something_else_is_replaced_only_by_the_word_for_it(here, fmus, first, second, folder):
    for place in ("a", "b", "b/a"):
        (here / place).mkdir()
        (here / place / "mine.toml").write_text(MINE)
        shutil.copy(fmus / "smd.fmu", here / place)
    swinging(here / "a/coulomb.csv")
    assert harness(here, *first).returncode == 0
    before = files(here / "results" / folder)
    done = harness(here, *second)
    assert (done.returncode, done.stderr.count("\n"), done.stdout) == (1, 1, "")
    assert f"results/{folder} holds the result of `python -m harness {' '.join(first)}`" in done.stderr
    assert "name another --out, or replace it with --overwrite" in done.stderr
    assert files(here / "results" / folder) == before
    source = told(here / "results" / folder)["source"]
    assert harness(here, *second, "--overwrite").returncode == 0
    now = told(here / "results" / folder)
    assert now["command"] == " ".join(("python -m harness", *second, "--overwrite"))
    assert now["source"] != source


def test_a_result_of_other_values_is_not_replaced_in_silence(here):
    (here / "mine.toml").write_text(MINE)
    assert "place" not in harness(here, "run", "mine.toml").stdout
    (here / "mine.toml").write_text(MINE.replace("3.0", "4.0").replace("1.0", "2.0"))
    said = harness(here, "run", "mine.toml", COLUMNS="200").stdout
    assert re.search(r"It takes the place of the result of [-\dT:+]+, which had c = 3.0 N.s/m, .*stop = 1.0", said)


@pytest.mark.parametrize(
    ("arguments", "older", "newer", "had"),
    [
        (("run", "--fmu", "fmus/coulomb.fmu"), ("--set", "f=0.25"), ("--set", "f=0.5"), "f = 0.25 N"),
        (("decay", "swing.csv"), (), ("--no-drag", "--until", "1.5"), "drag, no end"),
        (("compare", "fmus/coulomb.fmu", "smd"), ("--stop", "2"), (), "stop = 2.0"),
        (("sweep", "smd", *ONCE), ("--set", "m=2"), (), "m = 2.0 kg"),
    ],
)
def test_a_result_of_other_options_is_not_replaced_in_silence(here, arguments, older, newer, had):
    swinging(here / "swing.csv")
    assert harness(here, *arguments, *older).returncode == 0
    done = harness(here, *arguments, *newer, COLUMNS="200")
    assert (done.returncode, done.stderr) == (0, "")
    assert re.search(rf"It takes the place of the result of [-\dT:+]+, which had {had}\b", done.stdout)


def test_a_folder_that_does_not_say_what_made_it_is_not_run(here, swung):
    account = here / "results/smd/provenance.json"
    shutil.copytree(swung / "results/smd", here / "results/smd")
    for content in ("[]", "{}", '{"command": 1}', "", None):
        if content is None:
            account.unlink()
        else:
            account.write_text(content)
        done = harness(here, "run", "results/smd")
        assert (done.returncode, done.stderr.count("\n")) == (1, 1)
        assert "results/smd holds no result that tells what made it" in done.stderr
        if not content:
            assert harness(here, "run", "smd").returncode == 0
