"""Work-precision of the FMI 3.0 FMUs with fmpy: with the solver of fmpy in model exchange, with their own in
co-simulation."""

import csv
import json
from dataclasses import replace
from functools import cache
from html import unescape
from math import isnan
from unittest.mock import patch

import commands
import numpy as np
import pytest
from fmi3_fixtures import build_fmi3_fmus

from harness import HarnessError
from harness.references import peer_solvers
from harness.references.certified_reference import load_reference
from harness.references.models import CASES
from harness.references.peer_solvers import CS, FMI3_TOOLS, FMPY, FMU, ME
from harness.results.quantity import format_power
from harness.scenes.run_spec import RunSpec
from harness.simulation.embedded_model import load_model_class
from harness.simulation.runner import run_own_fmu
from harness.studies.precision import study
from harness.studies.precision.study import QUICK, SweepSettings, solver_jobs, sweep_tolerances

CASE = {case.name: case for case in CASES}
pytestmark = pytest.mark.slow
SMOOTH = [case for case in CASES if not case.is_chattering]
TOLERANCES = (1e-4, 1e-6, 1e-8)


@pytest.fixture(scope="module")
def versions_folder(fmus, tmp_path_factory):
    """A user's folder, with the FMUs for FMI 2.0 and 3.0."""
    folder = tmp_path_factory.mktemp("both")
    (folder / "fmus").mkdir()
    for file in fmus.glob("*.fmu"):
        (folder / "fmus" / file.name).symlink_to(file)
    (folder / "fmus" / "native").mkdir()
    (folder / "fmus" / "native" / "fmi3").symlink_to(build_fmi3_fmus())
    return folder


@pytest.fixture(scope="module")
def points(versions_folder):
    """Return points(name, tool, tolerances): the results of the study for a case with a tool, without run times."""

    @cache
    def points(name, tool, tolerances=TOLERANCES):
        file = versions_folder / "fmus" / f"{CASE[name].model}.fmu"
        jobs = [job for job in solver_jobs(CASE[name], load_model_class(file), file) if job.tool == tool]
        with patch.object(study, "best_time", lambda run, budget: 0.0):
            return [
                point
                for job in jobs
                for point in sweep_tolerances(CASE[name], job, SweepSettings(tolerances, 5.0, 0.0))
            ]

    return points


def amplification(case):
    """Return the amplification of a position error at breakaway, relative to the motion.

    The error also shifts the time, by its size over the speed of the driver, and the speed, by that times the largest
    acceleration.
    """
    if case.model not in ("stickslip", "pacejka"):
        return 1.0
    x, v = np.abs(load_reference("stickslip").states).max(axis=0)
    return 2.9546 / 0.034 * x / v


@pytest.mark.parametrize("case", SMOOTH, ids=lambda case: case.name)
def test_model_exchange_errors_fall_with_the_tolerance_and_stay_below_the_sum_of_step_errors(points, case):
    loose, middle, tight = all_points = points(case.name, ME)
    assert [point.rtol for point in all_points] == list(TOLERANCES)
    assert loose.largest > 4 * middle.largest > 16 * tight.largest
    assert loose.evaluations < middle.evaluations < tight.evaluations  # at least one per step
    for point in (middle, tight):
        assert point.largest < amplification(case) * point.evaluations * point.rtol


@pytest.mark.parametrize("case", [case for case in SMOOTH if case.problem.has_dry_friction], ids=lambda case: case.name)
def test_every_change_of_mode_is_located_in_model_exchange(points, case):
    *_, middle, tight = points(case.name, ME)
    assert tight.events < 0.1 * middle.events < 1e-4


@pytest.mark.parametrize("case", SMOOTH, ids=lambda case: case.name)
def test_co_simulation_is_one_point_with_the_own_method(points, case):
    (point,) = points(case.name, CS)
    assert isnan(point.rtol)
    assert point.method == {"pacejka": "radau9", "pendulum": "dop853"}.get(case.model, "exact")
    assert point.largest < {"pacejka": 1e-6, "pendulum": 1e-9}.get(case.model, 1e-13)
    assert point.evaluations > 0


def test_a_step_limit_of_cvode_gives_a_gap_with_the_reason_of_fmpy(points, capfd):
    (point,) = points("pacejka-0.01", ME, (1e-12,))
    assert point.failure.startswith("fmpy's CVode (500 steps from point to point at most): At t = ")
    assert "mxstep steps taken" in point.failure
    assert capfd.readouterr() == ("", "")


def test_each_run_of_an_instance_starts_from_scratch(versions_folder):
    sled = RunSpec(
        versions_folder / "fmus/native/fmi3/stickslip.fmu", ("x", "v", "mode"), {"mu_s": 0.8}, stop=16.0, grid=0.5
    )
    sled = replace(sled, follow=False, exchange=True)
    single_run, repeated_run = (run_own_fmu(replace(sled, repeat=repeat)) for repeat in (1, 3))
    other_run = run_own_fmu(replace(sled, values={}))
    assert np.array_equal(single_run.time, repeated_run.time)
    assert all(np.array_equal(single_run[name], repeated_run[name]) for name in sled.outputs)
    assert single_run.statistics.evaluations == repeated_run.statistics.evaluations > 100
    assert other_run["x"][-1] != single_run["x"][-1]


@pytest.mark.parametrize("exchange", [True, False])
def test_a_failure_is_one_sentence(versions_folder, tmp_path, exchange, capfd):
    def failure_message(file, values=None, timeout=60.0):
        run = RunSpec(file, ("x",), values or {}, stop=16.0, grid=0.01, follow=False, exchange=exchange)
        with pytest.raises(HarnessError) as error:
            run_own_fmu(run, study.limit_run_time(timeout, 16.0))
        return str(error.value)

    sled, missing_file, broken_file = (
        versions_folder / "fmus/native/fmi3/stickslip.fmu",
        tmp_path / "missing.fmu",
        tmp_path / "broken.fmu",
    )
    broken_file.write_bytes(b"no archive")
    assert failure_message(sled, {"m": -1.0}).startswith("m = -1.0 is outside its range")
    assert failure_message(sled, {"mu_d": 2.0}).startswith("mu_d is 2.0, above mu_s = 0.9: ")
    assert "'mess'" in failure_message(sled, {"mess": 1.0})
    assert failure_message(sled, timeout=1e-6).endswith(" s after 1e-06 s of run time")
    assert failure_message(missing_file).startswith(f"there is no {missing_file}: ")
    assert failure_message(broken_file).startswith("broken.fmu cannot be read: File is not a zip file")
    assert capfd.readouterr() == ("", "")


def harness(folder, *arguments):
    """Run a command in a folder, without figures, and return the finished process."""
    return commands.harness(folder, *arguments, PATH="", COLUMNS="100")


@pytest.fixture(scope="module")
def two_studies(versions_folder, fmus, tmp_path_factory):
    """Two studies of smd with the report: with its FMI 3.0 FMU, and without it.

    The second one is of the model file, leaves out peers, and keeps results of another model. Returns the output of
    each study (the second as JSON), the tables of the first, the pages, and the folder of all studies.
    """
    (out, without), outputs, pages, files = map(tmp_path_factory.mktemp, ("out", "without")), [], [], {}
    (without / "fmus").symlink_to(fmus)
    for folder, *words in ((versions_folder, "precision", "smd"), (without, "--json", "precision", "fmus/smd.fmu")):
        result = harness(folder, *words, "--quick", "--out", out)  # --json before any command
        assert (result.returncode, result.stderr) == (0, "")
        outputs.append(result.stdout)
        files = files or {file.name: file.read_text() for file in (out / "precision/smd").glob("*.csv")}
        assert harness(folder, "report", "--out", out).returncode == 0
        pages.append(unescape((out / "report.html").read_text(encoding="utf-8")))
        (out / "precision/pendulum").mkdir(exist_ok=True)
        (out / "precision/pendulum/points.csv").write_text("older")
    return outputs, files, pages, out / "precision"


@pytest.mark.campaign
def test_the_command_shows_both_interfaces_and_error_against_tolerance(two_studies):
    (output, _), files, *_ = two_studies
    assert "  FMI 3.0 CS: exact  " in output
    assert "  FMI 3.0 ME: fmpy's CVode  " in output
    rows = [row for row in csv.DictReader(files["points.csv"].splitlines()) if row["tool"] in (CS, ME)]
    assert [(row["case"], row["tool"], row["rtol [1]"]) for row in rows] == [
        ("smd", CS, ""),
        *(("smd", ME, rtol) for rtol in ("0.001", "1e-06", "1e-09")),
    ]
    for row in rows:  # on a loaded machine the tightest one may exceed the time limit of --quick, and is reported
        assert "run time" in row["failure"] if row["failure"] else float(row["seconds [s]"]) > 0
    heads, *table = csv.reader(files["model-exchange.csv"].splitlines())
    assert heads == ["model exchange by fmpy's CVode: largest error at rtol [1]", "smd [1]"]
    assert table == [[row["rtol [1]"], row["largest [1]"]] for row in rows[1:]]
    error_table = output.partition("FMI 3.0 model exchange with fmpy's CVode: largest error by rtol")[2]
    table_rows = [line.split() for line in error_table.splitlines() if line.startswith("1e-")]
    assert table_rows == [[format_power(float(number)) if number else "-" for number in row] for row in table]


def test_json_holds_all_results(two_studies):
    data = json.loads(two_studies[0][1])
    assert set(data) == {"points", "laws", "advice", "missing"}
    assert {point["method"] for point in data["points"]["smd"]} >= {"exact", "dop853", "fmpy's CVode"}
    assert data["advice"][0].startswith("smd: use exact")


def test_the_page_shows_error_against_tolerance_of_the_fmus_that_are_built(two_studies):
    head = "FMI 3.0 model exchange with fmpy's CVode: largest error by rtol"
    complete, incomplete = two_studies[2]
    assert head in complete
    assert head not in incomplete  # files of another build are removed


def test_the_command_writes_every_point_and_advice_and_keeps_results_of_other_models(two_studies):
    (output, incomplete), files, _, folder = two_studies
    assert "smd: use exact: " in output
    assert {path.name for path in folder.iterdir()} == {"smd", "pendulum"}
    expected_files = {"data.npz", "points.csv", "figure.svg", "provenance.json", "summary.json"}
    assert {path.name for path in (folder / "smd").iterdir()} == expected_files
    assert (folder / "pendulum/points.csv").read_text() == "older"
    texts = files["points.csv"], (folder / "smd/points.csv").read_text()
    rows, later_rows = (list(csv.DictReader(text.splitlines())) for text in texts)
    tools = {FMU, FMPY, *FMI3_TOOLS, "scipy", "cvode"} - peer_solvers.missing_packages().keys()
    assert {row["tool"] for row in rows} == tools
    unbuilt = "not built: fmus/native/fmi3/smd.fmu (`friction-fmus build --fmi 3`)"
    assert [row["failure"] for row in later_rows if row["tool"] in FMI3_TOOLS] == [unbuilt, unbuilt]
    (unrun,) = (item for item in json.loads(incomplete)["missing"] if item.startswith("Not run: "))
    assert unrun.count(unbuilt) == 1
    inside, outside = ([row for row in rows if row["tool"] == tool] for tool in (FMU, FMPY))
    assert len(inside) == 1 + 4 * len(QUICK.tolerances)
    assert float(inside[0]["largest [1]"]) < 1e-13
    numbers = ("method", "rtol [1]", "evaluations", "largest [1]")
    finished_rows = [
        [[row[name] for name in numbers] for row in item if not row["failure"]] for item in (inside, outside)
    ]
    assert finished_rows[0] == finished_rows[1]
    assert all(bool(row["failure"]) == (row["seconds [s]"] == "") for row in rows + later_rows)
