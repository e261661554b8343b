"""The decay study: its table, quantities and figure, and the command."""

import csv
import json

import commands
import numpy as np
import pytest
from build_cache import ROOT
from decays import LAWS, decay_record, identify
from shared_keys import check_shared_keys


@pytest.mark.parametrize("arguments", [("coulomb",), (ROOT / "docs/records/spring.csv", "--mass", "0.35")])
def test_the_table_fits_into_80_columns_and_its_first_values_are_those_to_use(fmus, tmp_path, arguments):
    (tmp_path / "fmus").symlink_to(fmus)
    result = commands.harness(tmp_path, "decay", *arguments, COLUMNS="80")
    assert (result.returncode, result.stderr) == (0, "")
    values, checks, *_ = result.stdout.split("\n\n")
    lines = [line for table in (values, checks) for line in table.splitlines()]
    assert max(map(len, lines)) <= 80
    assert not [line for line in lines if line.startswith(" ")]  # no cell is wrapped
    assert values.splitlines()[1].split() == ["quantity", "value", "to", "use,", "95", "%", "interval", "unit"]
    assert checks.splitlines()[0].split() == ["check", "turning", "points", "two", "peaks", "(rough)", "unit"]


def test_the_quantities_keep_their_names():
    fit = identify(decay_record(0.02, 0.003, noise=1e-4)).as_json()
    assert {"fit", "remarks", "laws", "sentence", "turning_points", "published"} <= set(fit)
    check_shared_keys(fit)
    assert {item["name"] for item in fit["fit"]} == {"omega", "zeta", "r", "b", "rest"}
    assert all({"value", "error", "low", "high", "unit"} <= set(item) for item in fit["fit"])
    assert len(fit["laws"]) == 7
    assert set(fit["loss"]["laws"]) == {"+".join(law) for law in LAWS}


def test_a_figure_shows_angles_in_degrees_and_marks_only_excluded_samples():
    """Of a record whose clock counts from 1970."""
    t = np.linspace(0.0, 9.0, 3001)
    record = decay_record(0.02, sine=True, a=1.0, turn=0.0, rest=0.0, t=t, noise=1e-3)
    fit = identify(record._replace(t=record.t + 1.7e9), pendulum=True)
    signal, residuals, shares = fit.plot()
    assert [axes.get_ylabel() for axes in (signal, residuals)] == ["x [deg]", "record - fit [deg]"]
    assert shares.get_xlabel() == "amplitude [deg]"
    curves = {line.get_label(): line.get_data() for line in signal.lines}
    assert np.degrees(1.0) == pytest.approx(np.max(curves["record"][1]), rel=5e-3)
    assert len(curves.get("excluded", [[]])[0]) == len(record.t) - len(fit.t)
    assert fit.record.format_time(1.7e9 + 0.0125) == "1700000000.0125"


def test_the_figure_of_a_long_record_shows_fewer_samples_and_the_extremes_of_each_turn():
    fit = identify(decay_record(0.01, t=np.linspace(0.0, 20.0, 20_001), noise=1e-3))
    signal, *_ = fit.plot()
    times, figure_x = next(line.get_data() for line in signal.lines if line.get_label() == "record")
    assert len(times) < 0.8 * len(fit.t)
    (omega,) = (estimate.value for estimate in fit.estimates if estimate.name == "omega")
    turn = 2 * np.pi / omega
    begins = np.arange(fit.t[0] + turn / 4, fit.t[-1] - turn, turn)
    assert len(begins) > 10
    for begin in begins:
        record_part, figure_part = (
            x[(begin <= t) & (t < begin + turn)] for t, x in ((fit.t, fit.x), (times, figure_x))
        )
        assert (figure_part.min(), figure_part.max()) == (record_part.min(), record_part.max())


def harness(folder, *arguments, text=""):
    """Run the harness in `folder` and return the finished process."""
    return commands.harness(folder, *arguments, text=text, COLUMNS="120")


def test_the_csv_of_another_program_gives_the_parameters_of_its_run(fmus, tmp_path):
    """The command line of fmpy simulates the FMU and writes the file."""
    words = ["simulate", fmus / "coulomb.fmu", "--output-file", "run.csv", "--output-interval", "0.005"]
    result = commands.run_process(tmp_path, *words, "--start-values", "c", "0.3", "f", "0.4", module="fmpy")
    assert (tmp_path / "run.csv").exists(), result.stderr
    result = harness(tmp_path, "decay", "run.csv", "--unit", "m", "--k", "157.9", "--json")
    assert (result.returncode, result.stderr) == (0, "")
    estimates = {item["name"]: item["value"] for item in json.loads(result.stdout)["fit"]}
    assert estimates["f"] == pytest.approx(0.4, rel=1e-9)
    assert estimates["c"] == pytest.approx(0.3, rel=1e-9)


def test_a_scene_writes_quantities_turning_points_fit_and_figure(workspace):
    result = harness(workspace, "decay", "coulomb")
    assert (result.returncode, result.stderr) == (0, "")
    assert "Best described by dry friction" in result.stdout
    folder = workspace / "results/decay/coulomb"
    files = {"decay.json", "turning-points.csv", "fit.csv", "figure.svg", "provenance.json", "summary.json", "data.npz"}
    assert {file.name for file in folder.iterdir()} == files
    estimates = {item["name"]: item for item in json.loads((folder / "decay.json").read_text())["fit"]}
    assert estimates["f"]["value"] == pytest.approx(0.5, rel=1e-9)
    with (folder / "fit.csv").open() as file:
        assert next(csv.reader(file)) == ["t [s]", "x [m]", "fit [m]", "residual [m]"]


def test_standard_input_is_accepted_as_a_record(tmp_path):
    record = decay_record(0.02, noise=1e-4)
    text = "t [s],x [m]\n" + "\n".join(f"{t:.9g},{x:.9g}" for t, x in zip(record.t, record.x, strict=True))
    result = harness(tmp_path, "decay", "-", "--json", text=text)
    assert (result.returncode, result.stderr) == (0, "")
    assert json.loads(result.stdout)["record"] == "stdin"


@pytest.mark.campaign
def test_a_record_needs_no_fmu_modules_and_one_drawing(tmp_path):
    """No module that runs FMUs or takes long to import is imported; the figure is drawn once."""
    program = """
import sys
from matplotlib.figure import Figure
from decays import decay_record, identify

draws, draw = [], Figure.draw
Figure.draw = lambda *arguments: draws.append(draw(*arguments))
identify(decay_record(0.02)).save("kept")
unnecessary = ("fmpy", "scipy.stats", "scipy.signal")
unnecessary += ("harness.simulation.runner", "harness.simulation.session")
unnecessary += ("harness.scenes.run_spec", "harness.scenes.scene")
print(len(draws), [name for name in unnecessary if name in sys.modules])
"""
    result = commands.run_python(tmp_path, "-c", program)
    assert (result.stdout.split(maxsplit=1), result.stderr) == (["1", "[]\n"], "")
