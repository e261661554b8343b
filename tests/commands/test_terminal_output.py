"""Terminal output: it fits the width, keeps brackets, and formats quantities like the files and the page."""

import csv
import html
import json
import os
import re
import tomllib
from importlib.metadata import version
from pathlib import Path

import commands as processes
import numpy as np
import pytest
from build_cache import ROOT
from models import MODELS
from variants import campaign_after, slow_after

from fmus.compiler.model_lookup import more_model_names
from harness import HarnessError, PrecisionResult
from harness.commands import commands
from harness.references.peer_solvers import FMU, ME
from harness.results.summary import ResultColumn, ResultTable, format_blocks
from harness.studies.precision.study import LawDeviation, Point, PrecisionCase

SCENES = {file.stem: tomllib.loads(file.read_text()) for file in sorted((ROOT / "harness/scenes").glob("*.toml"))}
WIDTH = 80
PLAIN = {"COLUMNS": str(WIDTH), "PATH": ""}
harness = processes.harness


def assert_fits(output, *headings):
    """Assert that lines are short enough, nothing is truncated, and the headings are present."""
    lines = output.splitlines()
    assert max(map(len, lines)) <= WIDTH, max(lines, key=len)
    assert "\u2026" not in output
    for heading in headings:
        assert heading in output


@pytest.mark.parametrize(
    ("arguments", "headings"),
    slow_after(
        2,
        [
            (("info",), ("scene", *SCENES)),
            (("run", "stickslip"), ("compared with", "0.430665996656")),
            (("run", "coulomb-sign"), ("half of smd's",)),
            (("decay", "coulomb"), ("two peaks",)),
            (("compare", "fmus/coulomb.fmu", "fmus/smd.fmu"), ("at t [s]",)),
        ],
    ),
)
def test_command_tables_fit_into_80_columns(workspace, arguments, headings):
    result = harness(workspace, *arguments, **PLAIN)
    assert (result.returncode, result.stderr) == (0, "")
    assert_fits(result.stdout, *headings)


def test_tables_of_long_commands_fit_into_80_columns():
    """Those of precision, which takes minutes, with long words."""
    cases = PrecisionCase("stickslip", "hybrid", {}), PrecisionCase("stickslip-threshold", "threshold", {}, True)
    points = [
        Point(case.name, tool, "fmpy's CVode", 1e-6, 1e-9, 0.4567, 123456, largest=1.23e-7)
        for case in cases
        for tool in (FMU, ME)
    ]
    law = LawDeviation("stickslip", "stickslip-threshold", "threshold", *(1.2e-5,) * 4, 3.3451, 0.877, 1.2e-13)
    result = PrecisionResult("stickslip", cases, tuple(points), (law,))
    assert_fits(format_blocks(result.blocks(), WIDTH), "1e-3:", "model exchange", "creep [m/s]")


@pytest.mark.parametrize("width", [30, 60, 100, 400])
def test_a_table_of_any_width_shows_each_cell(width):
    """Without a lost digit; of columns that do not fit, several tables begin with the first one."""
    items = [{"t": 0.1 * i, **{f"x{n}": 1e-6 * (-i) ** n for n in range(9)}} for i in range(3)]
    columns = [ResultColumn(f"{name} [N.m/rad]", f"{{0[{name}]:.5e}}") for name in items[0]]
    table = ResultTable(items, (*columns[:1], ResultColumn("words", "F1 sticks", is_text=True), *columns[1:]), "All")
    text = format_blocks([table], width)
    assert max(map(len, text.splitlines())) <= width
    assert all(cell in text.split() for row in table.rows() for cell in row if " " not in cell)
    assert text.count("1.00000e-01") == text.count("\u2500\n")


@pytest.mark.parametrize("command", ["", *commands.commands])
def test_help_text_is_not_truncated(tmp_path, command):
    result = harness(tmp_path, *command.split(), "--help", **PLAIN)
    assert (result.returncode, result.stderr) == (0, "")
    prose = [line for line in result.stdout.splitlines() if not re.search("friction-fmus|-m harness", line)]  # commands
    assert_fits("\n".join(prose), "Example")
    assert not [line for line in prose if re.search(r"\w\.\.\.$", line)]
    assert "None" not in result.stdout


def test_names_with_brackets_are_printed_literally(tmp_path):
    for name, off in (("one", 0.0), ("two", 0.5)):
        (tmp_path / f"{name}.csv").write_text(f"t [s],x[1] [m],[bold] [m]\n0,0,1\n1,{1 + off},2\n2,3,4\n")
    output = harness(tmp_path, "compare", "one.csv", "two.csv", **PLAIN).stdout
    assert "\nx[1] " in output
    assert "\n[bold] " in output


@pytest.mark.parametrize(
    "arguments",
    [
        *("", "run stickslip", "run mine.toml", "decay coulomb", "compare smd coulomb", "sweep smd --vary c=1,2"),
        "precision smd",
    ],
)
def test_a_command_without_its_fmus_explains_how_to_build_them(tmp_path, monkeypatch, arguments):
    (tmp_path / "fmus").mkdir()
    for name in MODELS:
        (tmp_path / f"fmus/{name}.py").write_text("")
    (tmp_path / "mine.toml").write_text('title = "a title"\nmodel = "smd"\noutputs = ["x"]\n')
    monkeypatch.setattr("harness.scenes.fmu_files.FOLDERS", (Path("fmus"),))
    monkeypatch.chdir(tmp_path)
    with pytest.raises(HarnessError, match=r"there is no .*fmus.*: build .* with `friction-fmus build`"):
        commands.main(arguments.split(), standalone_mode=False)


@pytest.mark.parametrize(
    "arguments", campaign_after(1, [(("run",),), (("sweep", "--vary", "k=1,2", "--workers", "1"),)])
)
def test_an_fmu_failure_of_either_backend_is_reported_once(backend_fmus, tmp_path, arguments):
    """A native FMU also prints it to the standard error of the process, bypassing Python."""
    result = harness(tmp_path, *arguments, backend_fmus / "smd.fmu", "--set", "m=1e-300", "--set", "F_ext=1e308")
    assert result.returncode == 1
    assert re.fullmatch(r"Error: .*the solution diverges after t = 0.0 s.*\n", result.stderr)


@pytest.mark.parametrize(
    ("package", "extra", "arguments"),
    [
        ("xarray", "sweep", ("sweep", "smd", "--vary", "c=1,2")),
    ],
)
def test_a_missing_optional_package_is_named_before_any_run(workspace, package, extra, arguments):
    """In a process of its own, which has not imported them; those of `decay` are named by a test of record formats."""
    (workspace / "sitecustomize.py").write_text(f"import sys; sys.modules[{package!r}] = None")
    result = processes.run_process(workspace, *arguments, PYTHONPATH=f"{workspace}{os.pathsep}{ROOT}")
    assert (result.returncode, result.stdout, result.stderr.count("\n")) == (1, "", 1), result.stderr
    assert package in result.stderr
    assert f"pip install 'friction-fmus[{extra}]'" in result.stderr
    assert not (workspace / "results").exists()


def test_the_versions_are_printed(tmp_path):
    name_and_version = f"friction-fmus {version('friction-fmus')}"
    output = harness(tmp_path, "--version").stdout
    assert output.startswith(f"{name_and_version}, fmpy {version('fmpy')}, ")
    assert processes.build("--version", folder=tmp_path).stdout == f"{name_and_version}\n"
    assert list(tmp_path.iterdir()) == []


def test_info_lists_all_scenes_and_models(workspace):
    listing = json.loads(harness(workspace, "info", "--json").stdout)
    assert sorted(item["scene"] or item["model"] for item in listing) == sorted([*SCENES, *more_model_names()])
    for item in listing:
        if item["scene"]:
            scene = SCENES[item["scene"]]
            assert (item["title"], item["model"]) == (scene["title"], scene["model"])


DIGITS = str.maketrans("\u207b\u2070\u00b9\u00b2\u00b3\u2074\u2075\u2076\u2077\u2078\u2079", "-0123456789")
POWER = re.compile("(?:([\\d.]+)\u00b7)?10([\u207b\u2070\u00b9\u00b2\u00b3\u2074-\u2079]+)")


def page_of(workspace):
    """The report, without the markup of its cells, and with powers of ten as in the terminal."""
    text = html.unescape((workspace / "results/report.html").read_text(encoding="utf-8"))
    text = POWER.sub(lambda power: f"{power[1] or 1}e{int(power[2].translate(DIGITS)):+03}", text)
    return re.sub("<td[^>]*>", "<td>", text).replace("\N{NO-BREAK SPACE}", " ")


@pytest.mark.parametrize("scene", ["stickslip-threshold", "pendulum", "smd"])
def test_a_quantity_is_formatted_alike_in_terminal_file_and_page(workspace, scene):
    """Every measured quantity has the same digits and the same unit."""
    output = harness(workspace, "run", scene, **PLAIN).stdout
    assert harness(workspace, "report").returncode == 0
    page = page_of(workspace)
    with (workspace / f"results/{scene}/quantities.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) > 10
    for row in rows:
        cell = re.search(
            rf"  {re.escape(row[''])} +{re.escape(row['measured'])}(?= ) *.*{re.escape(row['unit'])}", output
        )
        assert cell, row
        assert f"<td>{row['']}</td><td>{row['measured']}</td>" in page, row
    steps = page.split("<summary>Internal steps of the solver</summary>")[1].split("</details>")[0]
    cell = dict(zip(*(re.findall(f"<{tag}[^>]*>([^<]*)</{tag}>", steps) for tag in ("th", "td")), strict=True))
    for row in rows:
        if row[""] in cell:
            assert cell[row[""]] == f"{row['measured']} {row['unit']}".strip()
    assert len(cell) == 6


def test_an_interval_is_formatted_alike_in_terminal_and_page(workspace):
    t = np.linspace(0.0, 10.0, 800)
    x = np.exp(-0.2 * t) * np.cos(12 * t) + 1e-3 * np.random.default_rng(1).standard_normal(800)
    np.savetxt(workspace / "mine.csv", np.column_stack([t, x]), header="t [s],x [m]", delimiter=",", comments="")
    output = harness(workspace, "decay", "mine.csv", COLUMNS="200", PATH="").stdout
    assert harness(workspace, "report").returncode == 0
    page = page_of(workspace)
    cells = re.findall(r"\S+ \u00b1 \S+|\S+ \(\S+ to \S+\)|< \S+", output.split("Best")[0])
    assert len(cells) > 4
    assert all(f"<td>{item}</td>" in page for item in cells)
