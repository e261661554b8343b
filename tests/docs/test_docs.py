"""Every code block of docs/ and every example of a docstring runs, generated tables are up to date, and the site builds
without warnings."""

import doctest
import html
import importlib.util
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from build_cache import build_once
from commands import harness as harness_command
from commands import run_process
from native_fmus import require_compiler
from PIL import Image
from scipy.integrate import solve_ivp

import harness
from benchmarks.campaigns.__main__ import CAMPAIGNS
from benchmarks.rivals import figure as rivals_figure
from benchmarks.rivals.catalogue import RIVALS
from benchmarks.rivals.comparison import Comparison
from benchmarks.rivals.scenes import SCENES

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
SOURCES = [file for folder in ("fmus", "harness") for file in sorted((ROOT / folder).rglob("*.py"))]
PAGES = sorted(str(page.relative_to(DOCS)) for page in DOCS.rglob("*.md"))
ENVIRONMENT = {**os.environ, "PYTHONPATH": str(ROOT), "NO_MKDOCS_2_WARNING": "1"}


def load(name):
    """A script of docs/ as a module."""
    specification = importlib.util.spec_from_file_location(name, DOCS / f"{name}.py")
    module = sys.modules[name] = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(module)
    return module


def runnable(page):
    """Whether a page has a block that runs."""
    return any(
        block.language in scripts.RUN and not block.title and not block.skip_reason
        for block in scripts.find_blocks((DOCS / page).read_text(encoding="utf-8"))
    )


scripts = load("run_blocks")


def run_page(page, folder, environment):
    """Run the blocks of a page in a folder."""
    (folder / "docs").symlink_to(DOCS)
    command = [Path(environment["PROGRAMS"], "run_blocks"), folder, page]
    result = subprocess.run(command, capture_output=True, text=True, env=environment, timeout=600)
    assert result.returncode == 0, result.stderr


def figure_words(figure, leave_out):
    """Return the words of a figure without tick labels that are powers and texts that match an expression.

    The texts of a figure whose letters are paths are comments.
    """
    svg = figure.read_text(encoding="utf-8")
    texts = re.findall(r"<text[^>]*>([^<]+)</text>", svg) or re.findall(r"<!--\s*([^$]+?)\s*-->", svg)
    remaining_texts = [html.unescape(text) for text in texts if not re.fullmatch(leave_out, text)]
    return {word for text in remaining_texts for word in text.split()}


def is_number(word):
    """Return whether a word is a number, as those of tick labels."""
    return re.fullmatch(r"[-+\d.e]+", word.replace("\N{MINUS SIGN}", "-")) is not None


def assert_same_texts(picture, figure, leave_out=""):
    """The picture of the pages has the texts of the figure of a run; only its tick labels differ."""
    picture_words, run_words = (figure_words(path, leave_out) for path in (picture, figure))
    assert run_words, f"{figure.name} has no text"
    message = f"{picture.name} shows another run: python docs/make_images.py {picture.stem}"
    assert run_words - picture_words == set(), message
    assert {word for word in picture_words - run_words if not is_number(word)} == set(), message


def read_description(name):
    """Return the text that a PNG picture of the pages shows."""
    with Image.open(DOCS / "images" / f"{name}.png") as picture:
        return picture.text["Description"]


@pytest.mark.slow
@pytest.mark.parametrize("page", [page for page in PAGES if runnable(page)])
def test_code_blocks_run_and_draw_the_pictures_of_the_page(page, workspace, environment):
    run_page(DOCS / page, workspace, environment)
    for name, (source, file) in load("make_images").FIGURES_OF_PAGES.items():
        if source == page:
            (figure,) = workspace.glob(file)
            assert_same_texts(DOCS / "images" / f"{name}.svg", figure)
    if page == "how-to/share.md":
        report = (workspace / "results/report.html").read_text(encoding="utf-8")
        assert load("make_images").read_text_of_report(report) == read_description("report")


@pytest.mark.slow
@pytest.mark.parametrize("name", ["coulomb", "pendulum", "derivatives"])
def test_the_picture_of_a_scene_is_that_of_its_run(name, workspace):
    command, file = load("make_images").FIGURES_OF_COMMANDS[name]
    result = harness_command(workspace, *command.split()[1:])
    assert result.returncode == 0, result.stderr
    assert_same_texts(DOCS / "images" / f"{name}.svg", workspace / file)


@pytest.fixture
def images(fmus, tmp_path, monkeypatch):
    """The script that draws pictures, which reads the FMUs of the tests and writes into the folder of the test."""
    script = load("make_images")
    (tmp_path / "fmus").mkdir()
    for file in fmus.glob("*.fmu"):
        (tmp_path / "fmus" / file.name).symlink_to(file)
    monkeypatch.setattr(script, "FMUS", tmp_path / "fmus")
    monkeypatch.setattr(script, "IMAGES", tmp_path)
    return script


def test_the_picture_of_the_laws_is_that_of_its_script(images, tmp_path):
    images.draw_laws(tmp_path)
    assert_same_texts(DOCS / "images" / "laws.svg", tmp_path / "laws.svg")


@pytest.mark.slow
def test_the_picture_of_four_laws_is_that_of_their_runs(images, tmp_path):
    (tmp_path / "fmus" / "more").symlink_to(build_once("lugre", "elastoplastic"))
    images.draw_friction_laws(tmp_path)
    assert_same_texts(DOCS / "images" / "friction-laws.svg", tmp_path / "friction-laws.svg")


@pytest.mark.slow
def test_the_first_picture_is_that_of_its_runs_and_its_description_has_the_same_counts(images, tmp_path):
    images.draw_stick(tmp_path)
    for name in ("stick-light.svg", "stick-dark.svg"):
        assert_same_texts(DOCS / "images" / name, tmp_path / name)
    counts = re.findall(r"<!-- (about [\d ]+) -->", (tmp_path / "stick-light.svg").read_text(encoding="utf-8"))
    assert len(counts) == 2
    for page in (ROOT / "README.md", DOCS / "index.md", DOCS / "explanation" / "accuracy.md"):
        text = " ".join(page.read_text(encoding="utf-8").split())
        assert all(count in text for count in counts), f"{page.name} has other counts of steps than {counts}"


def read_errors_of_figure(panel):
    """Return the errors of a panel of the figure of rivals, sorted, from the heights of its markers."""
    (frame,) = re.findall(r'<g id="patch_\d+">\s*<path d="([^"]+)"', panel)[:1]
    heights = [float(y) for y in re.findall(r"[ML] \S+ (\S+)", frame)]
    markers = re.findall(r'<g clip-path[^>]*>\s*<use xlink:href="#\w+" x="[^"]+" y="([^"]+)"', panel)
    low, high = np.log10([0.3 * rivals_figure.FLOOR, 3.0])
    return np.sort(10.0 ** np.interp([-float(y) for y in markers], [-max(heights), -min(heights)], [low, high]))


def test_the_picture_of_rivals_has_the_texts_of_its_script_and_the_errors_of_the_table(tmp_path):
    """Its run needs the other engines."""
    picture = DOCS / "images" / "rivals.svg"
    rivals_figure.draw(Comparison(tuple(RIVALS.values()), ()), tmp_path / "rivals.svg")
    assert_same_texts(picture, tmp_path / "rivals.svg")
    page = (DOCS / "explanation" / "accuracy.md").read_text(encoding="utf-8")
    (table,) = re.findall(r"^\| engine \|( `rest`.*?)\n\n", page, re.M | re.S)
    heading, _, *rows = table.splitlines()
    assert len(rows) == len(RIVALS)
    panels = re.split(r'<g id="axes_\d+">', picture.read_text(encoding="utf-8"))[1:]
    scene_panels = dict(zip(SCENES, panels, strict=True))
    for column, name in enumerate(re.findall(r"`(\w+)`", heading)):
        cells = [row.strip("| ").split(" | ")[column + 1] for row in rows]
        errors = [float(word) for cell in cells for word in cell.split(" / ") if word != "-"]
        assert read_errors_of_figure(scene_panels[name]) == pytest.approx(np.sort(errors), rel=0.05), name


@pytest.mark.slow
@pytest.mark.parametrize("words", ["info", "run nosuch", "run smd --nosuch"])
def test_a_forked_command_prints_and_ends_as_a_fresh_one(environment, workspace, words):
    program = [Path(environment["PROGRAMS"], "friction-fmus"), *words.split()]
    forked_process = subprocess.run(program, cwd=workspace, env=environment, capture_output=True, text=True)
    fresh_process = run_process(workspace, *words.split())
    expected = [
        text.replace("python -m harness", "friction-fmus") for text in (fresh_process.stdout, fresh_process.stderr)
    ]
    assert (forked_process.returncode, [forked_process.stdout, forked_process.stderr]) == (
        fresh_process.returncode,
        expected,
    )


@pytest.mark.slow
def test_a_page_fails_with_a_block(environment, tmp_path):
    page = tmp_path / "page.md"
    page.write_text("```sh\nfriction-fmus run nosuch\n```\n")
    with pytest.raises(AssertionError, match="exit status 2"):
        run_page(page, tmp_path, environment)


@pytest.mark.parametrize("source", [str(file.relative_to(ROOT)) for file in SOURCES if ">>> " in file.read_text()])
def test_examples_of_docstrings_run(source):
    module = importlib.import_module(source.removesuffix(".py").replace("/", "."))
    assert doctest.testmod(module).failed == 0


def test_each_python_or_sh_block_that_is_not_run_has_a_reason():
    for page in PAGES:
        for block in scripts.find_blocks((DOCS / page).read_text(encoding="utf-8")):
            assert block.language, f"{page}, line {block.line}: the block has no language"
            assert not block.skip_reason or len(block.skip_reason.split()) >= 3, (
                f"{page}, line {block.line}: give a reason"
            )


SEEDS = {  # arguments; others have fixed seeds
    "fit_campaign": r" --seed \d+ --records \d+",
    "decay_defects": r" \d+ \d+",
    "low_speed_friction": r" \d+",
}
CAMPAIGN = re.compile(r"python -m benchmarks\.campaigns\.(\w+)([^`]*)`")


def find_campaigns(page):
    """Return names and arguments of the campaigns of a page; a line of the text may end in the command."""
    matches = CAMPAIGN.findall(page.read_text(encoding="utf-8"))
    return {(name, " ".join(arguments.split())) for name, arguments in matches}


def test_each_campaign_on_a_page_exists_and_names_its_seed():
    """So that its table can be made again."""
    campaigns = {campaign for page in PAGES for campaign in find_campaigns(DOCS / page)}
    assert {name for name, _ in campaigns} >= {"fit_campaign", "decay_defects", "low_speed_friction", "curve_coverage"}
    for name, arguments in campaigns:
        assert (ROOT / "benchmarks" / "campaigns" / f"{name}.py").is_file()
        assert re.fullmatch(SEEDS.get(name, ".*").strip(), arguments), f"{name} {arguments}: name the seed"


def test_each_campaign_has_the_same_arguments_everywhere():
    arguments = {name: {" ".join(words)} for name, (_, _, *words) in CAMPAIGNS.items() if name != "tests"}
    for page in (ROOT / "CONTRIBUTING.md", *(DOCS / page for page in PAGES)):
        for name, words in find_campaigns(page):
            if name in arguments:
                arguments[name].add(words.split(" --log")[0])
    assert {name: words for name, words in arguments.items() if len(words) > 1} == {}


def errors_of_rest(t, x, y):
    """Return the errors of time and position of the rest of the model puck, by its certified result."""
    (_, start), (rest, _) = np.loadtxt(ROOT / "fmus" / "more" / "puck-events.csv", delimiter=",", skiprows=1).tolist()
    certified_row = np.loadtxt(ROOT / "fmus" / "more" / "puck.csv", delimiter=",", skiprows=2)[-1]
    assert start == 1.0
    return abs(t - rest), np.hypot(x - certified_row[1], y - certified_row[2])


@pytest.mark.slow
def test_the_errors_of_friction_in_a_plane_on_the_page_are_those_of_runs():
    require_compiler()
    fmu = build_once("puck", "--native", "--platform", "linux64") / "puck.fmu"
    gravity, friction = 9.81 * np.sin(0.4), 0.5 * 9.81 * np.cos(0.4)

    def rates(_, y):
        size = np.hypot(y[2], y[3])
        return [y[2], y[3], -friction * y[2] / size, -gravity - friction * y[3] / size]

    def slow(_, y):
        return np.hypot(y[2], y[3]) - 1e-9

    slow.terminal = True
    rows = {}
    for label, rtol in ((", default setting", None), (", `rtol` 1e-10", 1e-10)):
        run = harness.simulate(fmu, rtol=rtol)
        rows[f"FMU of `puck`{label}"] = errors_of_rest(run.events.t[-1], run["x"][-1], run["y"][-1])
    run = solve_ivp(rates, (0.0, 2.5), [0.0, 0.0, 2.0, 1.0], "DOP853", events=slow, rtol=1e-12, atol=1e-14)
    rows["scipy, DOP853, `rtol` 1e-12"] = errors_of_rest(run.t[-1], *run.y[:2, -1])
    # each axis by itself: gravity holds at rest, and does not bend the path
    times = 2.0 / friction, 1.0 / (friction + gravity)
    rows["a contact for each axis"] = errors_of_rest(max(times), times[0], 0.5 * times[1])
    page = (DOCS / "explanation" / "accuracy.md").read_text(encoding="utf-8")
    for name, errors in rows.items():
        stated_errors = re.search(rf"\| {name} \| (\S+) \| (\S+) \|", page).groups()
        assert [float(number) for number in stated_errors] == pytest.approx(errors, rel=0.3, abs=1e-12), name


def test_the_errors_of_the_magic_formula_on_the_page_are_those_of_default_runs(fmus):
    text = (DOCS / "explanation" / "accuracy.md").read_text(encoding="utf-8")
    widths, stated_errors = re.search(r"\| magic formula, x_m = (.*?) m/s \|.*\| (.*?) \|\n", text).groups()
    summary = re.search(r"`pacejka` \| radau9 \| (\S+) of the states", text)[1]
    errors = []
    for width in widths.split(" / "):
        file = ROOT / "fmus" / f"pacejka{'' if width == '0.01' else f'-{width}'}.csv"
        t, *states = np.loadtxt(file, delimiter=",", skiprows=2, unpack=True)
        run = harness.simulate(fmus / "pacejka.fmu", {"x_m": float(width)}, stop=t[-1], interval=t[1] - t[0])
        rows = np.searchsorted(run.time, t - 1e-9)
        errors.append(
            max(np.abs(run[name][rows] - y).max() / np.abs(y).max() for name, y in zip("xv", states, strict=True))
        )
    assert [f"{error:.2g}" for error in errors] == [f"{float(number):.2g}" for number in stated_errors.split(" / ")]
    assert f"{max(errors):.0e}".replace("e-0", "e-") == summary


@pytest.mark.slow
def test_generated_tables_are_up_to_date(fmus, environment, monkeypatch):
    monkeypatch.setenv("PATH", environment["PATH"])
    reference = load("make_reference")
    for page in sorted((DOCS / "reference").glob("*.md")):
        text = page.read_text(encoding="utf-8")
        assert reference.update_page(text, fmus) == text, f"run `python docs/make_reference.py` for {page.name}"


def test_the_page_on_architecture_quotes_the_numerics_as_they_are():
    """Its other texts are outputs of commands, which run with the page."""
    (quotation,) = [
        block.text
        for block in scripts.find_blocks((DOCS / "explanation" / "architecture.md").read_text(encoding="utf-8"))
        if block.language == "text" and "model.rates(" in block.text and "modes)" in block.text
    ]
    lines = {line.strip() for line in (ROOT / "fmus" / "runtime" / "ode23.py").read_text(encoding="utf-8").splitlines()}
    assert set(quotation.splitlines()) <= lines


def test_each_picture_is_used_and_small():
    names_in_pages = {name for page in DOCS.rglob("*.md") for name in re.findall(r"images/([\w.-]+)", page.read_text())}
    names_in_pages |= set(re.findall(r"docs/images/([\w.-]+)", (ROOT / "README.md").read_text()))
    for picture in sorted((DOCS / "images").iterdir()):
        assert picture.stat().st_size < 150_000, f"{picture.name} is too large"
        assert picture.name in names_in_pages or picture.name == "stick-dark.svg", f"no page shows {picture.name}"


def count_endings(notebook):
    """Return how many cases of stability ended as expected, and of how many, by the output of the notebook."""
    outputs = [str(output) for cell in notebook.cells for output in cell.get("outputs", ())]
    return {*re.findall(r"(\d+) of (\d+) ended as expected", "".join(outputs))}


@pytest.mark.slow
def test_notebook_runs(workspace, environment):
    """All cases of stability end as expected, and are as many as in the shown output."""
    nbclient = pytest.importorskip("nbclient", reason="extra docs")
    nbformat = pytest.importorskip("nbformat", reason="extra docs")
    notebook = nbformat.read(DOCS / "tutorials" / "python_api.ipynb", as_version=4)
    ((n_passed, total),) = endings = count_endings(notebook)
    assert n_passed == total
    client = nbclient.NotebookClient(notebook, timeout=120, resources={"metadata": {"path": str(workspace)}})
    client.execute(env={**environment, "MPLBACKEND": "agg"})  # the figures are drawn, but not painted
    assert count_endings(notebook) == endings


@pytest.mark.slow
def test_site_builds_without_warnings(tmp_path):
    pytest.importorskip("mkdocs", reason="extra docs")
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--quiet", "--site-dir", str(tmp_path)]
    result = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, env=ENVIRONMENT, timeout=300)
    assert (result.returncode, result.stderr) == (0, ""), result.stdout + result.stderr
    assert (tmp_path / "reference" / "commands" / "index.html").is_file()
    pages = [(tmp_path / "reference" / name / "index.html").read_text("utf-8") for name in ("python", "python_results")]
    assert [name for name in harness.__all__ if f'id="harness.{name}"' not in "".join(pages)] == []
