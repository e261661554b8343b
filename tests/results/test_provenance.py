"""Every result records its provenance: file digests, values with units, versions, the scene."""

import csv
import json
import re
import shutil
from contextlib import suppress
from hashlib import sha256
from zipfile import ZipFile

import commands
import numpy as np
import pytest
from fmpy import read_model_description
from models import MODELS
from variants import campaign_after, slow_after

from harness import HarnessError, load_result, simulate
from harness.results.folder import replace_folder
from harness.results.registry import STUDIES

COMMANDS = {  # that take seconds, and the folders of their results
    "run": (("run", "coulomb"), "coulomb"),
    "run FMU": (("run", "fmus/coulomb.fmu", "--set", "f=0.25"), "coulomb"),
    "compare": (("compare", "fmus/coulomb.fmu", "fmus/smd.fmu"), "compare/coulomb-smd"),
    "decay": (("decay", "coulomb", "--no-drag", "--end", "2"), "decay/coulomb"),
    "sweep": (("sweep", "coulomb", "--vary", "f=0.25,0.5", "--workers", "1", "--name", "f"), "sweep/f"),
}
DRAWN_RESULT = (
    "decay/coulomb"  # the others are not drawn; test_figures.py checks that the same drawing gives the same file
)
harness = commands.harness


@pytest.fixture(scope="module", params=slow_after(len(COMMANDS) - 1, COMMANDS))
def example_run(request, fmus, tmp_path_factory):
    """A folder in which one of the commands was run, its arguments, and its result."""
    workspace, (arguments, folder) = tmp_path_factory.mktemp("made"), COMMANDS[request.param]
    (workspace / "fmus").symlink_to(fmus)
    result = commands.harness(workspace, *arguments, figures=folder == DRAWN_RESULT)
    assert (result.returncode, result.stderr) == (0, "")
    return workspace, arguments, workspace / "results" / folder


@pytest.fixture(scope="module")
def first_run(user_folder):
    """A folder in which the first scene was run."""
    assert harness(user_folder, "run", "smd").returncode == 0
    return user_folder


def read_provenance(folder):
    return json.loads((folder / "provenance.json").read_text())


def test_a_result_records_the_digests_of_its_files_and_all_versions(example_run):
    workspace, arguments, folder = example_run
    provenance = read_provenance(folder)
    assert provenance["command"] == " ".join(("python -m harness", *arguments))
    assert {"python", "friction-fmus", "fmpy", "numpy"} <= set(provenance["versions"])
    assert provenance["files"]
    for file, digest in provenance["files"].items():
        assert digest == sha256((workspace / file).read_bytes()).hexdigest()


@pytest.mark.parametrize("model", MODELS)
def test_every_effective_parameter_is_recorded_with_its_unit(workspace, model):
    assert harness(workspace, "run", f"fmus/{model}.fmu", "--set", "m=1.5", "--stop", "0.5").returncode == 0
    recorded_parameters = read_provenance(workspace / "results" / model)["parameters"]
    variables = read_model_description(str(workspace / f"fmus/{model}.fmu")).modelVariables
    parameters = [variable for variable in variables if variable.causality == "parameter"]
    assert set(recorded_parameters) == {variable.name for variable in parameters}
    for variable in parameters:
        type_unit = variable.declaredType.unit if variable.declaredType is not None else None
        assert recorded_parameters[variable.name]["unit"] in (variable.unit, type_unit, "")
    assert recorded_parameters["m"] == {"value": 1.5, "unit": "kg"}


def test_a_comparison_records_the_parameters_of_both_sides(workspace):
    assert harness(workspace, "compare", "fmus/smd.fmu", "smd").returncode == 0
    parameters = read_provenance(workspace / "results/compare/fmus-smd-scene-smd")["parameters"]
    assert parameters["one: c"] == parameters["two: c"] == {"value": 2.0, "unit": "N.s/m"}


def test_the_scene_is_stored_as_it_was_run(workspace):
    (workspace / "mine.toml").write_text('title = "a title"\nmodel = "smd"\noutputs = ["x"]\n[values]\nc = 3.0\n')
    assert harness(workspace, "run", "mine.toml").returncode == 0
    provenance = read_provenance(workspace / "results/mine")
    scene, run = provenance["scene"], provenance["run"]
    assert (scene["name"], scene["title"], run["outputs"], run["values"]) == ("mine", "a title", ["x"], {"c": 3.0})
    with (workspace / "results/mine/trajectory.csv").open() as file:
        times = [float(row[0]) for row in list(csv.reader(file))[1:]]
    assert (run["start"], run["stop"]) == (times[0], times[-1])


def test_the_report_shows_the_provenance_of_its_results(first_run):
    assert harness(first_run, "report").returncode == 0
    page = (first_run / "results/report.html").read_text()
    digest = sha256((first_run / "fmus/smd.fmu").read_bytes()).hexdigest()
    assert f"smd.fmu (sha256 {digest[:12]})" in page
    assert "k = 157.9 N/m" in page


def test_the_report_shows_every_run(workspace):
    """Each FMU and each user scene, by its first and last values, if nothing else was requested."""
    (workspace / "mine.toml").write_text('title = "a title"\nmodel = "smd"\noutputs = ["x"]\nplots = ["position"]\n')
    for arguments in (("fmus/pacejka.fmu",), ("mine.toml",)):
        assert harness(workspace, "run", *arguments).returncode == 0
    assert harness(workspace, "report").returncode == 0
    page = (workspace / "results/report.html").read_text()
    assert "<h2>Runs</h2>" in page
    assert all(f"<h3>{name}</h3>" in page for name in ("pacejka", "mine"))
    assert re.search(r"<td[^>]*>x</td>\s*<td[^>]*>0.1</td>", page)
    assert "mine: plots of the run" in page


def files(folder):
    """Return the files of a result, except the provenance and the summary (which have a date), and the quantities and
    data.npz (which have run times)."""
    return {
        path.name: path.read_bytes()
        for path in folder.iterdir()
        if path.name not in ("provenance.json", "summary.json", "quantities.csv", "data.npz")
    }


SCENE = 'title = "a title"\nmodel = "smd"\noutputs = ["x"]\nplots = []\nstop = 1.0\ngrid = 0.1\n[values]\nc = 3.0\n'


def write_decay(file):
    """Write a record of a decay."""
    t = np.linspace(0, 2, 60)
    rows = np.column_stack([t, np.exp(-t) * np.cos(12 * t)])
    np.savetxt(file, rows, header="t [s],x [m]", delimiter=",", comments="")


SWEEP_OPTIONS = ("--vary", "c=2,3", "--workers", "1", "--name", "c")


@pytest.mark.parametrize(
    ("first", "second", "folder"),
    slow_after(
        4,
        [
            (("run", "coulomb"), ("run", "fmus/coulomb.fmu"), "coulomb"),
            (("run", "fmus/coulomb.fmu"), ("run", "coulomb"), "coulomb"),
            (("run", "a/mine.toml"), ("run", "b/mine.toml"), "mine"),
            (("run", "fmus/smd.fmu"), ("run", "a/smd.fmu"), "smd"),
            (("decay", "coulomb", "--no-drag"), ("decay", "a/coulomb.csv", "--no-drag"), "decay/coulomb"),
            (("compare", "smd", "a/smd.fmu"), ("compare", "smd", "b/a/smd.fmu"), "compare/scene-smd-a-smd"),
            (("sweep", "a/smd.fmu", *SWEEP_OPTIONS), ("sweep", "b/smd.fmu", *SWEEP_OPTIONS), "sweep/c"),
        ],
    ),
)
def test_a_result_of_another_scene_is_not_replaced(workspace, fmus, first, second, folder):
    for subfolder in ("a", "b", "b/a"):
        (workspace / subfolder).mkdir()
        (workspace / subfolder / "mine.toml").write_text(SCENE)
        shutil.copy(fmus / "smd.fmu", workspace / subfolder)
    write_decay(workspace / "a/coulomb.csv")
    assert harness(workspace, *first).returncode == 0
    before = files(workspace / "results" / folder)
    result = harness(workspace, *second)
    assert (result.returncode, result.stderr.count("\n"), result.stdout) == (1, 1, "")
    assert f"results/{folder} holds the result of `python -m harness {' '.join(first)}`" in result.stderr
    assert "choose another --out, or remove the folder" in result.stderr
    assert files(workspace / "results" / folder) == before


def test_a_result_with_other_values_is_not_replaced_silently(workspace):
    (workspace / "mine.toml").write_text(SCENE)
    assert "place" not in harness(workspace, "run", "mine.toml").stdout
    (workspace / "mine.toml").write_text(SCENE.replace("3.0", "4.0").replace("1.0", "2.0"))
    output = harness(workspace, "run", "mine.toml", COLUMNS="200").stdout
    assert re.search(r"It replaces the result of [-\dT:+]+, which had c = 3.0 N.s/m, .*stop = 1.0", output)


@pytest.mark.parametrize(
    ("arguments", "older", "newer", "difference"),
    campaign_after(
        2,
        [
            (("run", "fmus/coulomb.fmu"), ("--set", "f=0.25"), ("--set", "f=0.5"), "f = 0.25 N"),
            (("decay", "swing.csv"), (), ("--no-drag", "--end", "1.5"), "drag, no end"),
            (("compare", "fmus/coulomb.fmu", "smd"), ("--stop", "2"), (), "stop = 2.0"),
            (("sweep", "smd", *SWEEP_OPTIONS), ("--set", "m=2"), (), "m = 2.0 kg"),
        ],
    ),
)
def test_a_result_with_other_options_is_not_replaced_silently(workspace, arguments, older, newer, difference):
    write_decay(workspace / "swing.csv")
    assert harness(workspace, *arguments, *older).returncode == 0
    result = harness(workspace, *arguments, *newer, COLUMNS="200")
    assert (result.returncode, result.stderr) == (0, "")
    assert re.search(rf"It replaces the result of [-\dT:+]+, which had {difference}\b", result.stdout)


def test_a_result_of_another_build_of_its_fmu_is_not_replaced_silently(workspace, fmus):
    shutil.copy(fmus / "smd.fmu", workspace / "mine.fmu")
    assert harness(workspace, "run", "mine.fmu", "--stop", "0.5").returncode == 0
    with ZipFile(workspace / "mine.fmu", "a") as archive:
        archive.comment = b"built again"
    result = harness(workspace, "run", "mine.fmu", "--stop", "0.5", COLUMNS="200")
    assert re.search(r"It replaces the result of [-\dT:+]+, which had another mine\.fmu\.", result.stdout)


HOSTILE = (None, 0, float("inf"), True, "", 'unbalanced "', "\ud800", [], {}, {"a": 1}, {"a": {"b": []}})
DEEP = "[" * 900 + "]" * 900


def key_paths(table, path=()):
    """Yield the path of every key of a table, as a tuple."""
    for name, value in table.items():
        yield (*path, name)
        if isinstance(value, dict):
            yield from key_paths(value, (*path, name))


def alter(provenance, path, value):
    """Return provenance as JSON with another value at a path."""
    table = part = json.loads(json.dumps(provenance))
    for name in path[:-1]:
        part = part[name]
    part[path[-1]] = value
    return json.dumps(table)


def altered_files(provenance):
    """Yield provenance with each key of each table replaced by each hostile value, or by a deeply nested list."""
    for path in key_paths(provenance):
        if len(path) == 1 or path[:2] == ("parameters", "c") or path[-1] in ("values", "decay", "fmu", "outputs"):
            yield from (alter(provenance, path, value) for value in HOSTILE)
            yield alter(provenance, path, "deep").replace('"deep"', DEEP)


def read_source(text):
    """Return the source in provenance, with which a result may be replaced."""
    table = json.loads(text)
    source = table.get("source") if isinstance(table, dict) else ""
    return source if isinstance(source, str) else ""


def test_a_new_result_never_depends_on_the_provenance_of_an_old_one(tmp_path, first_run):
    """Reading it, for the page or from Python, raises at most the project's own error."""
    new, old = tmp_path / "new", tmp_path / "smd"
    new.mkdir()
    (new / "trajectory.csv").write_text("t [s],x [m]\n0,0.1\n1,0.2\n")
    shutil.copy(first_run / "results/smd/provenance.json", new)
    shutil.copytree(new, old)
    texts = [DEEP, *altered_files(read_provenance(new))]
    for i, text in enumerate(texts):
        (tmp_path / f"results/{i}").mkdir(parents=True)
        for file in (old / "provenance.json", tmp_path / f"results/{i}/provenance.json"):
            file.write_text(text)
        with suppress(HarnessError):
            load_result(old)
        with replace_folder(old, STUDIES[0].files, read_source(text)) as folder:
            for file in new.iterdir():
                shutil.copy(file, folder)
        assert read_provenance(old)["files"] == read_provenance(new)["files"]
    assert harness(tmp_path, "report").returncode == 0
    page = (tmp_path / "results/report.html").read_text()
    assert page.count("cannot be shown: summary.json is missing") == len(texts)


def test_a_folder_is_no_run(workspace, first_run):
    """Nothing that a provenance file names is run."""
    folder = shutil.copytree(first_run / "results/smd", workspace / "results/smd")
    result = harness(workspace, "run", "results/smd")
    assert (result.returncode, result.stdout) == (2, "")
    assert "results/smd is a folder: give a model, a scene or an FMU" in result.stderr
    with pytest.raises(HarnessError, match="is a folder"):
        simulate(folder)


def test_the_same_run_is_reproduced_bit_for_bit(example_run):
    workspace, arguments, folder = example_run
    before, provenance = files(folder), read_provenance(folder)
    result = commands.harness(workspace, *arguments, figures=folder.match(DRAWN_RESULT))
    assert (result.returncode, result.stderr) == (0, "")
    assert files(folder) == before
    for key in ("files", "parameters", "run", "scene", "source"):
        assert read_provenance(folder)[key] == provenance[key]
    if arguments[0] == "run":
        assert "the same, bit for bit" in result.stdout
