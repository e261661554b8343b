"""The scales of the figure of a sweep, and texts that are not run as Python."""

import ast

import numpy as np
import pytest
from build_cache import ROOT
from matplotlib.figure import Figure

import harness


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
    replacements = {"final_x": ("m", np.array(values), short_sweep["final_x"].attrs | {"scale": spread})}
    if np.isfinite(values).all():
        replacements |= {"m": ("m", np.array(values), short_sweep["m"].attrs | {"scale": spread})}
    short_sweep.dataset = short_sweep.data.assign(replacements)
    axes = Figure().subplots()
    short_sweep._draw_panel(axes)
    assert axes.get_yscale() == kind
    assert "m" not in replacements or axes.get_xscale() == kind


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
