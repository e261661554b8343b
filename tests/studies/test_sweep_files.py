"""The file of a sweep, the scales of its map, and its boundaries."""

import ast
import re
import tomllib
import tracemalloc
from types import SimpleNamespace
from zipfile import ZipFile

import external_fmus
import numpy as np
import pytest
from build_cache import ROOT
from matplotlib.figure import Figure
from models import MODELS
from sweep_results import open_sweep

import harness

BOUNDARIES = "documentation/boundaries.toml"


def fake_runs(points, runs, digest, fmu):
    """Return the points as values of their runs, the last of which fails."""
    messages = {len(points) - 1: f"failed at {points[0, 0]}"}
    return SimpleNamespace(values=points[:, [0, 0, 1]], messages=messages, seconds=1e-3 * len(points))


def test_memory_use_does_not_grow_with_the_number_of_runs(fmus, monkeypatch, tmp_path):
    """The parts of a sweep that handle every run, with ten times as many of them; the data are not loaded."""
    monkeypatch.setattr("harness.studies.sweep.study.run_block", fake_runs)
    monkeypatch.setattr("harness.studies.sweep.result.SweepResult.data", None)
    peaks, k = [], np.linspace(1.0, 2.0, 100)
    for n_points in (2, 20, 200):
        if n_points > 2:  # the first one imports packages
            tracemalloc.start()
        m = np.linspace(1.0, 2.0, n_points)
        result = harness.sweep(fmus / "smd.fmu", {"m": m, "k": k}, stop=0.01, folder=tmp_path / f"{n_points}")
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
        data = open_sweep(result.folder)
        assert (data["final_x"] == data["m"]).all()
        assert (data["error"] != "").sum() == result.failed > 1
        assert result.runs == 100 * n_points
    assert peaks[2] < 1.5 * peaks[1]


@pytest.fixture(autouse=True)
def no_figure(monkeypatch):
    """Save sweeps without their figure, which takes most of the time of a short one."""
    monkeypatch.setattr("harness.studies.sweep.figure.draw", lambda *arguments: None)


@pytest.fixture(scope="module")
def short_sweep(fmus):
    return harness.sweep(fmus / "smd.fmu", {"m": [1.0, 2.0, 3.0]}, stop=0.01)


@pytest.mark.parametrize(
    ("values", "spread", "kind"),
    [
        ((0.001, 0.01, 0.1), "linear", "log"),
        ((1.0, 2.0, 4.0), "log", "log"),
        ((1.0, 50.0, 99.0), "linear", "linear"),
        ((0.0, 1.0, 1000.0), "linear", "linear"),
        ((np.nan, 1.0, 1000.0), "linear", "log"),
        ((np.nan, np.nan, np.nan), "linear", "linear"),
    ],
)
def test_an_axis_spanning_decades_is_logarithmic(short_sweep, values, spread, kind):
    """That of a parameter, and that of a measure."""
    replaced = {"final_x": ("m", np.array(values), short_sweep["final_x"].attrs | {"scale": spread})}
    if np.isfinite(values).all():
        replaced |= {"m": ("m", np.array(values), short_sweep["m"].attrs | {"scale": spread})}
    short_sweep.dataset = short_sweep.data.assign(replaced)
    axes = Figure().subplots()
    short_sweep.draw_panel(axes)
    assert axes.get_yscale() == kind
    assert "m" not in replaced or axes.get_xscale() == kind


@pytest.mark.parametrize("name", MODELS)
def test_known_boundaries_are_packed_in_the_fmu_and_depend_on_its_parameters(fmus, name):
    """At its own values each quantity is a number; a sweep of one of its parameters shows it."""
    fmu = fmus / f"{name}.fmu"
    values = {item.name: item.start for item in harness.describe(fmu).variables if item.causality == "parameter"}
    with ZipFile(fmu) as archive:
        packed = tomllib.loads(archive.read(BOUNDARIES).decode())["boundaries"]
    shown = {}
    for table in packed:
        name = next(name for name in re.findall(r"[A-Za-z]\w*", table["quantity"]) if name in values)
        if table["text"] not in shown:
            grid = {name: [0.99 * values[name]]}
            shown |= {item.text: item for item in harness.sweep(fmu, grid, stop=0.01).boundaries}
    assert {*shown} == {table["text"] for table in packed}
    for item in shown.values():
        assert item.parameters <= {*values}
        assert np.isfinite(item.evaluate(values, 1.0))


def bounded(fmus, folder, quantity):
    """Return an FMU with one boundary."""
    text = f'[[boundaries]]\ntext = "a boundary"\nbelow = "below"\nquantity = "{quantity}"\n'
    return external_fmus.edited_copy(fmus / "smd.fmu", folder / "odd.fmu", {BOUNDARIES: text})


def test_a_boundary_is_drawn_where_its_arithmetic_is_1(fmus, tmp_path):
    """It is 3 t - (c - 1/2)/12, which is 1 at c = 2.9 and less above."""
    fmu = bounded(fmus, tmp_path, " -(c - 5e-1) / (2*sqrt(k*m)) + abs(-3)*cos(0)*t")
    sweep = harness.sweep(fmu, {"c": [0.0, 1.0, 4.0]}, values={"k": 9.0, "m": 4.0}, stop=0.4)
    axes = Figure().subplots()
    sweep.draw_panel(axes)
    ((at, _),) = [line.get_xdata() for line in axes.lines if line.get_label() == "a boundary"]
    assert at == pytest.approx(2.9, abs=4.0 / 399)
    (shade,) = axes.collections
    assert shade.get_paths()[0].get_extents().intervalx == pytest.approx([at, 4.0])


def test_no_text_is_run_as_python():
    """Neither by a function of Python nor by a format that runs what it reads; an FMU's own code aside."""
    for file in (ROOT / "harness").rglob("*.py"):
        tree = ast.parse(file.read_text(encoding="utf-8"))
        names = {
            node.func.id for node in ast.walk(tree) if isinstance(node, ast.Call) and isinstance(node.func, ast.Name)
        }
        modules = {name.name for node in ast.walk(tree) if isinstance(node, ast.Import) for name in node.names}
        assert not names & {"eval", "exec", "compile"}, file
        if not file.match("process/worker*.py") and file.name != "whole_run.py":  # between own processes
            assert not modules & {"pickle", "marshal", "shelve"}, file


BEYOND = [
    "m.real",
    "__import__('os')",
    "9**9**9",
    "(lambda: m)()",
    "m[0]",
    "'m'",
    "(",
    "abs(x=m)",
    "m(2)",
    "abs",
    "True",
]
BEYOND += [
    "1j",
    "m if m else 1",
    "-" * 900 + "m",
    "m+" * 600 + "m",
    "9" * 900 + "*m",
    "abs(" * 150 + "m" + ")" * 150,
    "",
]


@pytest.mark.parametrize("quantity", BEYOND)
def test_a_boundary_beyond_arithmetic_is_refused(fmus, tmp_path, quantity):
    with pytest.raises(harness.HarnessError, match=r"odd\.fmu: documentation/boundaries\.toml is invalid"):
        harness.sweep(bounded(fmus, tmp_path, quantity), {"m": [1.0]}, stop=0.01)
