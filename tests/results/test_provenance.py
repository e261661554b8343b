"""Every result says what it was made from: files by their digest, values with their units, versions, the scene."""

import csv
import json
from hashlib import sha256

import pytest
from commands import harness
from fmpy import read_model_description
from models import MODELS

COMMANDS = {  # that take seconds, and the folders of their results
    "run": (("run", "coulomb"), "coulomb"),
    "run --fmu": (("run", "--fmu", "fmus/coulomb.fmu", "--set", "f=0.25"), "coulomb"),
    "compare": (("compare", "fmus/coulomb.fmu", "fmus/smd.fmu"), "compare/coulomb-smd"),
    "decay": (("decay", "coulomb"), "decay/coulomb"),
    "sweep": (("sweep", "coulomb", "--vary", "f=0.25,0.5", "--workers", "1", "--name", "f"), "sweep/f"),
}


@pytest.fixture
def here(fmus, tmp_path):
    """A folder with the built FMUs."""
    (tmp_path / "fmus").symlink_to(fmus)
    return tmp_path


def told(folder):
    return json.loads((folder / "provenance.json").read_text())


@pytest.mark.parametrize("command", COMMANDS)
def test_a_result_names_its_files_by_digest_and_the_versions_that_made_it(here, command):
    arguments, folder = COMMANDS[command]
    done = harness(here, *arguments, "--quiet")
    assert (done.returncode, done.stderr) == (0, "")
    found = told(here / "results" / folder)
    assert found["command"] == " ".join(("python -m harness", *arguments, "--quiet"))
    assert {"python", "friction-fmus", "fmpy", "numpy"} <= set(found["versions"])
    assert found["files"]
    for file, digest in found["files"].items():
        assert digest == sha256((here / file).read_bytes()).hexdigest()


@pytest.mark.parametrize("model", MODELS)
def test_every_parameter_in_force_is_told_with_its_unit(here, model):
    assert harness(here, "run", "--fmu", f"fmus/{model}.fmu", "--set", "m=1.5").returncode == 0
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
    found = told(here / "results/compare/smd-smd")["parameters"]
    assert found["one: c"] == found["two: c"] == {"value": 2.0, "unit": "N.s/m"}


def test_the_scene_is_kept_as_it_was_run(here):
    (here / "mine.toml").write_text('title = "a title"\nmodel = "smd"\noutputs = ["x"]\n[values]\nc = 3.0\n')
    assert harness(here, "run", "mine.toml").returncode == 0
    scene = told(here / "results/mine")["scene"]
    assert (scene["name"], scene["title"], scene["outputs"], scene["values"]) == ("mine", "a title", ["x"], {"c": 3.0})
    with (here / "results/mine/trajectory.csv").open() as file:
        times = [float(row[0]) for row in list(csv.reader(file))[1:]]
    assert (scene["start"], scene["stop"]) == (times[0], times[-1])


def test_the_report_says_what_its_results_were_made_from(here):
    assert harness(here, "run", "smd").returncode == 0
    assert harness(here, "report").returncode == 0
    page = (here / "results/report.html").read_text()
    digest = sha256((here / "fmus/smd.fmu").read_bytes()).hexdigest()
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
    assert "<td>x [m]</td><td>0.1</td>" in page
    assert "mine: the plots that its scene names" in page


@pytest.mark.parametrize("content", ["", "[]", "{}", '{"files": 1}', '{"files": {}, "versions": {}}'])
def test_a_damaged_account_is_told_in_the_page(here, content):
    assert harness(here, "run", "smd").returncode == 0
    (here / "results/smd/provenance.json").write_text(content)
    done = harness(here, "report")
    assert (done.returncode, done.stderr) == (0, "")
    assert "smd cannot be shown" in (here / "results/report.html").read_text()
