"""Lookup tables of an FMU in descriptions and figures, and their values as unknowns of a fit."""

import itertools
import json

import commands
import numpy as np
import pytest
from build_cache import build_user_model
from matplotlib.figure import Figure
from variants import slow_after

import harness

X, VALUES = (0.0, 0.02, 0.05, 0.1, 0.3), {"F_0": 13.0, "F_1": 9.0, "F_2": 8.5, "F_3": 9.5, "F_4": 11.5}  # m/s, N
SLED = '''from fmus import Contact, Mode, Model, Output, Parameter, State, Table, fabs


class CurvedSled(Model):
    """Mass that a driver pulls through a spring, with friction given by points whose values are parameters."""

    m = Parameter(2.0, "kg", "mass", above=0.0)
    k = Parameter(500.0, "N/m", "stiffness of the spring", low=0.0)
    v_driver = Parameter(0.05, "m/s", "speed of the driver")
    scale = Parameter(1.0, "1", "scale of the friction", low=0.0)
PARAMETERS
    guide = Table(POINTS, [NAMES], "m/s", "N", ends="continue")

    x = State("m", "position")
    v = State("m/s", "speed", rate_of=x)
    driver = State("m", "position of the driver", rate=v_driver)
    mode = Mode()
    F_friction = Contact("N", "friction force", mode=mode, slip=v, slide=scale * guide(fabs(v)))
    a = Output("m/s2", "acceleration", (k * (driver - x) - F_friction) / m, rate_of=v)

    stop_time, step_size = 2.0, 0.005
'''


@pytest.fixture(scope="module")
def sled(tmp_path_factory):
    """The FMU of the sled."""
    parameters = [f'    {name} = Parameter({value}, "N", "friction", low=0.0)' for name, value in VALUES.items()]
    text = SLED.replace("PARAMETERS", "\n".join(parameters)).replace("POINTS", str([*X]))
    file = tmp_path_factory.mktemp("sled") / "curved_sled.py"
    file.write_text(text.replace("NAMES", ", ".join(VALUES)))
    return build_user_model(file) / "curved_sled.fmu"


def draw(result):
    """Return the panels of the figure of a result by their titles."""
    figure = Figure(layout="constrained")
    result._draw(figure)
    return {axes.get_title(): axes for axes in figure.get_axes()}


@pytest.mark.campaign
@pytest.mark.parametrize(
    ("truth", "free"),
    [({"F_0": 12.0, "F_1": 10.0}, ["F_0", "F_1"]), ({"scale": 0.8}, ["scale"])],
    ids=["values", "scale"],
)
def test_values_of_a_table_are_fitted_by_name_or_by_their_scale(sled, tmp_path, truth, free):
    """The intervals contain the drawn values, and the figure has the curve before and after the fit."""
    run = harness.simulate(sled, truth, rtol=1e-9)
    assert run["v"].max() > X[2]
    noise = 1e-5 * np.random.default_rng(1).standard_normal(len(run.time))
    fit = harness.fit(sled, {"t": run.time, "x": run["x"] + noise}, free)
    for estimate in fit.estimates:
        assert estimate.low <= truth[estimate.name] <= estimate.high
        assert estimate.value == pytest.approx(truth[estimate.name], rel=0.02)
    fit.save(tmp_path / "fit")
    panels = draw(harness.load_result(tmp_path / "fit"))
    assert ("table guide" in panels) == (free != ["scale"])
    if free != ["scale"]:
        curves = [line for line in panels["table guide"].lines if len(line.get_xdata()) == len(X)]
        start_values, fitted_values = curves[0].get_ydata(), curves[-1].get_ydata()
        assert [*start_values] == [*VALUES.values()]
        np.testing.assert_allclose(fitted_values, [*(VALUES | {name: fit[name].value for name in free}).values()])


def test_points_are_listed_and_drawn_with_the_values_of_a_run(sled, tmp_path, monkeypatch):
    result = commands.harness(tmp_path, "info", str(sled), "--json")
    (table,) = json.loads(result.stdout)["tables"]
    assert (table["name"], table["unit_x"], table["unit_y"]) == ("guide", "m/s", "N")
    assert (table["x"], table["y"]) == ([*X], [*VALUES.values()])
    assert table["parameters"] == [*VALUES]
    text = commands.harness(tmp_path, "info", str(sled)).stdout
    assert "guide [N]" in text
    assert "8.5 (F_2)" in text
    panels = []

    def save(figure, *_, **__):
        panels.extend(figure.get_axes())

    monkeypatch.setattr(Figure, "savefig", save)
    commands.harness(tmp_path, "run", str(sled), "--set", "F_2=7.5", figures=True)
    (axes,) = [axes for axes in panels if axes.get_title(loc="left") == "table guide"]
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("argument [m/s]", "guide [N]")
    x, y = axes.lines[0].get_data()
    assert ([*x], [*y]) == ([*X], [*(VALUES | {"F_2": 7.5}).values()])


@pytest.mark.campaign
@pytest.mark.parametrize("sample", slow_after(1, [{}, {"samples": 30, "seed": 1}]), ids=["grid", "sample"])
def test_a_sweep_of_values_of_a_table_shows_its_curves(sled, tmp_path, sample):
    grid = {"F_0": [12.0, 13.0, 14.0], "F_2": [8.0, 8.5]} if not sample else {"F_0": (12.0, 14.0), "F_2": (8.0, 9.0)}
    sweep = harness.sweep(sled, grid, values={"F_4": 12.0}, **sample)
    sweep.save(tmp_path / "sweep")
    panels = draw(harness.load_result(tmp_path / "sweep"))
    title = "table guide: 20 of 30 curves" if sample else "table guide"
    drawn_curves = {tuple(line.get_ydata()) for line in panels[title].lines}
    if sample:
        runs = zip(*(sweep.data[name].to_numpy() for name in grid), strict=True)
    else:
        runs = itertools.product(*grid.values())
    expected = {(f_0, VALUES["F_1"], f_2, VALUES["F_3"], 12.0) for f_0, f_2 in runs}
    assert drawn_curves <= expected
    assert len(drawn_curves) == (20 if sample else len(expected))
    assert not json.loads(harness.sweep(sled, {"m": [1.0, 2.0]}).data.attrs.get("tables", "[]"))
