"""The file of a sweep, the scales of its map, and its boundaries."""

import ast
import tracemalloc
from pathlib import Path
from zipfile import ZipFile

import numpy as np
import pytest
from build_cache import ROOT
from models import MODELS
from sweep_results import open_sweep, xarray

from harness import HarnessError
from harness.running.fmu_archive import read_description
from harness.scenes.run_spec import RunSpec
from harness.studies.sweep import figure
from harness.studies.sweep import result_files as writing
from harness.studies.sweep.boundaries import Boundary, read_boundaries
from harness.studies.sweep.checkpoint import RunBlock
from harness.studies.sweep.runner import SweepSpec
from harness.studies.sweep.sampling import SweepPoints, parse_axis
from harness.studies.sweep.study import Sweep


def test_memory_use_does_not_grow_with_the_number_of_runs(monkeypatch, tmp_path):
    """The parts of a sweep that handle every run, with ten times as many of them."""
    monkeypatch.setattr(figure, "draw", lambda *arguments: None)
    monkeypatch.setattr(writing, "CHUNK_SIZE", "40 KiB")
    peaks = []
    for n_points in (20, 200):
        axes = parse_axis(f"a=0:1:{n_points}", False), parse_axis("b=0:1:100", False)
        sweep = Sweep(SweepSpec(RunSpec(Path("many.fmu")), ("a", "b")), SweepPoints(axes), b"", 1)
        labels = dict.fromkeys(("a", "b"), ("m", ""))
        about = writing.SweepDescription(labels, (writing.MeasureColumn("c", "s", "some"),), {}, 1.0, ())
        folder = tmp_path / str(n_points)
        folder.mkdir()
        tracemalloc.start()
        checkpoint = sweep.checkpoint(folder)
        with checkpoint.open():
            for first in range(0, len(sweep.points), 200):
                checkpoint.add(
                    RunBlock(first, sweep.points.coordinates(first, first + 200)[:, :1], {3: f"failed at {first}"})
                )
        (failure,) = writing.write_files(sweep, checkpoint, about, folder)
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
        assert failure.runs == len(sweep.points) // 200
        data = open_sweep(folder)
        assert (data["c"] == data["a"]).all()
        assert (data["error"] != "").sum() == failure.runs
        assert data["error"].to_numpy().ravel()[203] == "failed at 200"
    assert peaks[1] < 1.5 * peaks[0]


@pytest.mark.parametrize(
    ("values", "spread", "kind"),
    [
        ((0.001, 0.01, 0.1), "linear", "log"),
        ((1.0, 2.0, 4.0), "log", "log"),
        ((1.0, 50.0, 99.0), "linear", "linear"),
        ((0.0, 1.0, 1000.0), "linear", "linear"),
        ((np.nan, 1.0, 1000.0), "linear", "log"),
        ((np.nan, np.nan), "linear", "linear"),
    ],
)
def test_an_axis_spanning_decades_is_logarithmic(values, spread, kind):
    data = xarray.Dataset({"a": ("n", np.array(values), {"scale": spread})})
    assert figure.axis_scale(data, "a") == kind


@pytest.mark.parametrize("name", MODELS)
def test_known_boundaries_are_packed_in_the_fmu_and_depend_on_its_parameters(fmus, name):
    """At its own values each quantity is a number, and its dependencies are declared."""
    values = {
        variable.name: float(variable.start)
        for variable in read_description(fmus / f"{name}.fmu").modelVariables
        if variable.causality == "parameter" and variable.type == "Real"
    }
    boundaries = read_boundaries(fmus / f"{name}.fmu", tuple(values), {})
    assert boundaries
    for item in boundaries:
        assert item.parameters <= set(values)
        assert np.isfinite(item.evaluate(values, 1.0))


def test_the_quantity_of_a_boundary_has_the_value_of_its_arithmetic():
    values = {"c": np.array([1.0, 2.0]), "k": 9.0, "m": 4.0}
    quantity = Boundary("", " -(c - 5e-1) / (2*sqrt(k*m)) + abs(-3)*cos(0)*t", "")
    assert quantity.parameters == {"c", "k", "m"}
    assert quantity.evaluate(values, 7.0) == pytest.approx([21 - 0.5 / 12, 21 - 1.5 / 12], rel=1e-15)


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
def test_a_boundary_beyond_arithmetic_is_refused(tmp_path, quantity):
    with ZipFile(tmp_path / "odd.fmu", "w") as archive:
        table = f'[[boundaries]]\ntext = "a"\nbelow = "b"\nquantity = "{quantity}"\n'
        archive.writestr("documentation/boundaries.toml", table)
    with pytest.raises(HarnessError, match=r"odd\.fmu: documentation/boundaries\.toml is invalid"):
        read_boundaries(tmp_path / "odd.fmu", ("m",), {})
