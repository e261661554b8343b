"""The harness on the built FMUs, through its command line."""

import csv
import json
import re
import shutil
from functools import partial
from math import cos, exp
from types import SimpleNamespace

import commands
import numpy as np
import pytest
from build_cache import ROOT, run_published_cases
from models import MODELS, outputs
from variants import campaign_after

from harness import load_result

BASE = 'title = "a title"\nmodel = "stickslip"\noutputs = ["x", "v"]\n'


TIME = r'"name": "run_time",\s+"value": [^,]+'
NUMBER = r"-?\b\d+\.?\d*(?:e[-+]\d+)?"
harness = partial(commands.harness, PATH="", COLUMNS="100")  # published cases are drawn elsewhere


@pytest.fixture
def scene(user_folder, tmp_path):
    """Return scene(text, option, ...): the finished process, and the folder of results."""

    def run(text, *options, **environment):
        (tmp_path / "mine.toml").write_text(text)
        arguments = ("run", tmp_path / "mine.toml", "--out", tmp_path / "out", *options)
        return harness(user_folder, *arguments, **environment), tmp_path / "out/mine"

    return run


def table(path):
    """Return header and columns of a CSV file."""
    with path.open() as file:
        head, *rows = csv.reader(file)
    return head, np.array(rows, float).T


@pytest.fixture(scope="module")
def main_job():
    """The finished main job and its results."""
    folder = run_published_cases()
    process = json.loads((folder / "process.json").read_text())
    return SimpleNamespace(**dict(zip(("returncode", "stdout", "stderr"), process, strict=True))), folder / "results"


def test_the_main_job_runs_every_published_case(main_job):
    result, results = main_job
    assert (result.returncode, result.stderr) == (0, "")
    cases = {path.stem for path in (ROOT / "harness/scenes").glob("*.toml")}
    assert {path.name for path in results.iterdir()} == cases
    assert re.search(" published *\n.* MATLAB ode23 *\n", result.stdout)  # above the values of a run
    for case in cases:
        assert case in result.stdout
        assert {"trajectory.csv", "steps.csv", "figure.svg"} <= {path.name for path in (results / case).iterdir()}


def test_the_main_job_ends_with_one_sentence_on_what_agrees_and_explains_steps_that_depend_on_rounding(main_job):
    """Steps of a law that chatters are explained, not counted as a difference."""
    text = " ".join(main_job[0].stdout.split())
    assert "Steps of coulomb-sign, stickslip-threshold are not judged: friction chatters at a stop" in text
    *_, folder, last = main_job[0].stdout.splitlines()
    assert folder == "Results in results"
    assert last == "9 of 9 cases agree within 5 % (6 published, 1 reference, 2 parameter)."


def test_the_main_job_names_each_case_that_differs(workspace, monkeypatch):
    """In red, as in a terminal; the exit status is that of the runs."""
    (workspace / "scenes").mkdir()
    shutil.copy(ROOT / "harness/scenes/coulomb-stop.toml", workspace / "scenes")
    monkeypatch.setattr("harness.scenes.scene.SCENE_FOLDER", workspace / "scenes")
    monkeypatch.setattr("harness.studies.run.result.MAX_DEVIATION", -1.0)
    result = harness(workspace, "--out", "results", FORCE_COLOR="1")
    assert result.returncode == 0
    assert "\x1b[31m0 of 1 cases agree within" in result.stdout
    assert "coulomb-stop: " in result.stdout.splitlines()[-1]


@pytest.mark.parametrize(
    ("case", "quantity", "value"),
    [
        ("smd", "steps", "235"),
        ("smd", "mean step", "17.059"),
        ("smd", "peak 1, as sampled", "0.060305"),
        ("smd", "peak 4, as sampled", "0.013227"),
        ("smd", "damping ratio, 3 cycles", "0.080161"),
        ("coulomb-sign", "friction force, 3 cycles", "0.50859"),
        ("coulomb", "friction force, 7.5 cycles", "0.5"),
        ("stickslip", "slip period", "3.34510449933"),
        ("stickslip", "peak speed", "0.41736"),
        ("stickslip", "peak acceleration", "2.9546"),
        ("pacejka-0.01", "steps", "6667"),
        ("pendulum", "joint torque, 5 cycles", "0.011522"),
    ],
)
def test_the_table_shows_the_published_values(main_job, case, quantity, value):
    block = main_job[0].stdout.split(f"\n{case} ")[1].split("\n   ")[0]
    line = next(line for line in block.splitlines() if line.strip().startswith(quantity))
    assert line.replace(quantity, "", 1).replace("(time points)", "").split()[0] == value


@pytest.mark.parametrize(("case", "kind"), [("smd", "published"), ("stickslip", "reference"), ("coulomb", "parameter")])
def test_json_states_the_kind_of_the_known_values(workspace, case, kind):
    comparison = json.loads(harness(workspace, "run", case, "--json").stdout)["comparison"]
    assert (comparison["kind"], comparison["agrees"]) == (kind, True)
    assert bool(comparison["citation"]) == (kind == "published")
    assert comparison["values"][0].keys() == {"name", "value", "percent"}


def test_the_table_of_all_cases_fits_into_80_columns_without_truncation(main_job):
    lines = main_job[0].stdout.splitlines()
    assert lines[0].split() == ["quantity", "measured", "unit", "compared", "with", "difference"]
    assert max(map(len, lines)) <= 80
    assert not [line for line in lines if re.search(r"\belsewh?e?r?$|[+-][\d.e-]+$", line)]


def test_a_trajectory_is_read_back_bit_for_bit_and_in_order(main_job):
    head, columns = table(main_job[1] / "stickslip/trajectory.csv")
    assert head == ["t [s]", "x [m]", "v [m/s]", "a [m/s2]", "x_driver [m]", "mode"]
    assert (np.diff(columns[0]) > 0).all()
    assert columns[0][-1] == 16.0
    text = (main_job[1] / "stickslip/trajectory.csv").read_text().split("\n")[700].split(",")
    assert [repr(float(number)) for number in text[:-1]] == text[:-1]


def test_events_are_listed_for_dry_friction(main_job):
    head, (times, modes) = table(main_job[1] / "stickslip/events.csv")
    assert head == ["t [s]", "mode"]
    assert list(modes) == [0, 1, 0, 1, 0, 1, 0, 1, 0]
    assert np.diff(times[1::2]) == pytest.approx(3.345104499330, rel=1e-12)
    for smooth in ("smd", "pacejka-0.01", "coulomb-sign"):
        assert not (main_job[1] / smooth / "events.csv").exists()


def test_steps_add_up_to_the_run(main_job):
    head, (times, sizes, rejections) = table(main_job[1] / "coulomb-sign/steps.csv")
    assert head == ["t [s]", "h [s]", "rejected"]
    assert times[-1] == 4.0
    assert sizes.sum() == pytest.approx(4.0, rel=1e-14)
    assert rejections.sum() > 100  # it chatters at every reversal


def test_a_scene_writes_only_the_files_it_requests(scene):
    result, results = scene(BASE + "grid = 0.25\nstop = 2")
    assert (result.returncode, result.stderr) == (0, "")
    assert {path.name for path in results.iterdir()} == {
        "trajectory.csv",
        "figure.svg",
        "provenance.json",
        "summary.json",
    }
    head, columns = table(results / "trajectory.csv")
    assert head == ["t [s]", "x [m]", "v [m/s]"]
    assert list(columns[0]) == [0.25 * i for i in range(9)]


def test_a_scene_without_plots_has_no_figure(scene):
    _, results = scene(BASE + "grid = 1\nplots = []")
    assert {path.name for path in results.iterdir()} == {"trajectory.csv", "provenance.json", "summary.json"}


@pytest.mark.parametrize("model", MODELS)
def test_a_scene_without_a_grid_is_densely_sampled_and_keeps_the_solver_steps(scene, model):
    text = f"title = 'a title'\nmodel = '{model}'\noutputs = {outputs(model)[:2]}\nplots = []\n"
    _, results = scene(text)
    times = table(results / "trajectory.csv")[1][0]
    assert np.diff(times).max() <= (times[-1] - times[0]) / 4096 * (1 + 1e-9)
    steps = table(results / "steps.csv")[1]
    assert set(steps[0]) <= set(times)
    _, results = scene(text + "follow = true\n")
    assert table(results / "steps.csv")[1] == pytest.approx(steps, rel=1e-9)
    assert len(table(results / "trajectory.csv")[1][0]) == len(steps[0]) + 1


SLIP = 'model = "stickslip"\nplots = []\noutputs = ["x", "v", "a"]\nanalyses = ["slip"]\n'
SWING = 'model = "smd"\noutputs = ["x", "v"]\nanalyses = ["decay"]\n'
END = 'plots = []\n[decay]\ngives = "zeta"\n'


@pytest.mark.parametrize(
    ("text", "coarse", "name", "value"),
    [
        (SLIP, "grid = 0.2\n", "peak_speed", 0.41736),
        (SLIP, "grid = 0.2\nfollow = true\n", "peak_speed", 0.41736),
        (SLIP, "follow = true\n", "peak_acceleration", 2.9546),  # the closed form steps from event to event
        (SLIP + 'method = "ode23"\nlaw = "threshold"\n', "grid = 0.15\n", "peak_speed", 0.41736),
        (SWING, "grid = 0.3\n", "zeta", 0.0796),
        (SWING, "grid = 0.04\n", "zeta", 0.0796),
    ],
)
def test_a_measure_unsupported_by_its_samples_is_refused_and_the_remedy_works(scene, text, coarse, name, value):
    text = 'title = "a title"\n' + text
    text += "" if text.endswith(SLIP[-20:]) or "law" in text else END
    result, _ = scene(text.replace("\nanalyses", f"\n{coarse}analyses"))
    assert result.returncode == 1
    (step,) = re.findall(r"each .* needs at least 8 samples, .* has \d: set grid to (\S+) s or less\n", result.stderr)
    result, _ = scene(text.replace("\nanalyses", f"\ngrid = {step}\nanalyses"), "--json")
    quantities = {item["name"]: item["value"] for item in json.loads(result.stdout)["quantities"]}
    assert quantities[name] == pytest.approx(value, rel=1e-3)


def test_slips_are_measured_without_the_acceleration(scene):
    result, _ = scene(BASE + "plots = []\nanalyses = ['slip']", "--json")
    names = [item["name"] for item in json.loads(result.stdout)["quantities"]]
    assert "peak_speed" in names
    assert "peak_acceleration" not in names


def test_a_following_grid_contains_the_grid_points_and_the_steps(scene):
    _, results = scene(BASE + "grid = 0.1\nfollow = true")
    times = table(results / "trajectory.csv")[1][0]
    steps = table(results / "steps.csv")[1][0]
    assert set(steps) <= set(times)
    assert len(times) == 161 + len(steps) - 1  # the stop is both


def test_the_grid_does_not_change_the_solver_steps(scene):
    text = BASE + 'stop = 6\nmethod = "ode23"\nlaw = "hybrid"\nrtol = 1e-5\n'
    _, results = scene(text)
    free_steps = table(results / "steps.csv")[1]
    _, results = scene(text + "grid = 0.013\nfollow = true")
    gridded_steps = table(results / "steps.csv")[1]
    assert free_steps.shape == gridded_steps.shape
    assert gridded_steps == pytest.approx(free_steps, rel=1e-9)


@pytest.mark.parametrize(
    ("text", "status", "sentence"),
    [
        (BASE.replace('"v"', '"vv"'), 2, "unknown output 'vv' (nearest: 'v'); allowed: F_friction, "),
        (BASE + "[values]\nmuu_d = 1", 2, "unknown name in [values] 'muu_d' (nearest: 'mu_d')"),
        (BASE + "[values]\nm = -1", 2, "m = -1 is outside its range; allowed: above 0.0 kg"),
        (BASE + "[values]\nm = nan", 2, "values: m = nan must be a finite number or a text"),
        (
            BASE + "[values]\nx = 1",
            2,
            "x = 1: x is calculated; to set the start value of a state, declare a Fixed in the",
        ),
        (BASE + 'law = "sgn"', 2, "unknown value of friction 'sgn'; allowed: hybrid, threshold"),
        (BASE.replace("stickslip", "smd") + 'law = "sign"', 2, "law = 'sign': smd has no such choice"),
        (BASE + "stop = -1", 2, "stop = -1.0 s is not after start = 0.0 s"),
        (BASE + "[values]\nmu_d = 0.95", 1, "mu_d is 0.95, above mu_s = 0.9"),
        (BASE + 'law = "threshold"\nmethod = "exact"', 1, "closed form"),
        (
            BASE.replace("stickslip", "smd") + "stop = 0.1\nanalyses = ['decay']\n[decay]\ngives = 'f'",
            1,
            "turning points",
        ),
        (BASE + "[reference]\nsource = 'me'\nperiod = 3", 2, "unknown name in [reference] 'period'"),
        (
            BASE + "analyses = ['slip']\n[parameter]\nperiod = 3",
            2,
            "period = 3 in [parameter] is not what the run sets",
        ),
        (BASE.replace("model", "fmu"), 1, "there is no "),
    ],
)
def test_an_invalid_scene_is_one_sentence_and_keeps_the_previous_result(scene, tmp_path, text, status, sentence):
    older = tmp_path / "out/mine/trajectory.csv"
    older.parent.mkdir(parents=True)
    older.write_text("older")
    result, results = scene(text)
    assert result.returncode == status
    assert result.stderr.startswith("Error: scene mine: ")
    assert sentence in result.stderr
    assert result.stderr.count("\n") == 1
    assert result.stdout == ""
    assert older.read_text() == "older"
    assert [path.name for path in results.parent.iterdir()] == ["mine"]


def test_a_failing_case_does_not_lose_the_others(workspace, monkeypatch):
    reference_table = "\n[reference]\nsource = 'me'\nrun_time = 1\n"
    for name, extra in (("bad", "[values]\nmu_d = 0.95"), ("good", "stop = 1")):
        (workspace / f"{name}.toml").write_text(BASE + extra + reference_table)
    monkeypatch.setattr("harness.scenes.scene.SCENE_FOLDER", workspace)
    result = harness(workspace, "--out", workspace / "out")
    assert result.returncode == 1
    assert result.stderr.startswith("Error: scene bad: mu_d is 0.95")
    assert result.stderr.count("\n") == 1
    assert "\nbad: failed\n" in result.stdout
    assert [path.name for path in (workspace / "out").iterdir()] == ["good"]


@pytest.mark.parametrize(
    "arguments",
    campaign_after(
        2,
        [
            ["info"],
            ["run", "nosuch"],
            ["run", "mine.toml", "--json"],
            ["decay", "swing.csv", "--no-drag", "--json"],
            ["report", "--help"],
        ],
    ),
)
def test_a_command_runs_alike_in_a_process_of_its_own(workspace, arguments):
    """Most tests run commands in the process of pytest."""
    (workspace / "mine.toml").write_text(BASE + "analyses = ['slip']\nplots = []")
    rows = [f"{0.04 * i},{exp(-0.04 * i) * cos(0.48 * i)}" for i in range(50)]
    (workspace / "swing.csv").write_text("\n".join(["t [s],x [m]", *rows]))
    inside = harness(workspace, *arguments)
    shutil.rmtree(workspace / "results", ignore_errors=True)  # otherwise the second run reports that nothing changed
    separate = commands.run_process(workspace, *arguments, PATH="", COLUMNS="100")
    assert (inside.returncode, inside.stderr) == (separate.returncode, separate.stderr)
    outputs = [re.sub(TIME, "", result.stdout) for result in (inside, separate)]
    assert re.sub(NUMBER, "", outputs[0]) == re.sub(NUMBER, "", outputs[1])
    numbers, other_numbers = (list(map(float, re.findall(NUMBER, text))) for text in outputs)
    # sums of numpy depend on the memory alignment of an array
    assert numbers == pytest.approx(other_numbers, rel=1e-6, abs=1e-9)


@pytest.mark.campaign
def test_a_scene_imports_only_the_modules_it_needs(user_folder, tmp_path):
    """Scenes that use more and more modules, one after the other in one process."""
    optional = ["harness.analyses.slip", "harness.analyses.decay", "harness.analyses.steps", "matplotlib"]
    extras = ("plots = []", "plots = []\nanalyses = ['slip']", "plots = ['position']")
    code = "import sys; from pathlib import Path; from harness.commands.run import run_and_save\n"
    for number, extra in enumerate(extras):
        (tmp_path / f"{number}.toml").write_text(BASE + extra)
        file = str(tmp_path / f"{number}.toml")
        code += (
            f"run_and_save({file!r}, Path({str(tmp_path)!r}), lambda name, share: None)\n"
            f"print([name for name in {optional} if name in sys.modules])\n"
        )
    result = commands.run_python(user_folder, "-c", code)
    assert result.stderr == ""
    assert result.stdout == f"[]\n{optional[:1]}\n{[optional[0], optional[3]]}\n"


def test_no_temporary_fmu_files_remain_of_a_failed_run(user_folder, tmp_path):
    """Nor of others: tests/simulation/test_paths.py."""
    temporary = tmp_path / "temporary"
    temporary.mkdir()
    (tmp_path / "mine.toml").write_text(BASE + "[values]\nmu_d = 0.95")
    command = ("run", tmp_path / "mine.toml", "--out", tmp_path / "out")
    assert commands.run_process(user_folder, *command, TMPDIR=str(temporary)).returncode == 1
    assert list(temporary.iterdir()) == []


@pytest.mark.campaign
def test_a_run_that_hardly_advances_ends_at_its_time_limit(workspace):
    """A slip every two seconds, up to 1e12 s; up to 1e300 s, a slip is too short beside the run."""
    result = commands.harness(workspace, "run", "fmus/stickslip.fmu", "--stop", 1e300, "--timeout", 0.5)
    assert (result.returncode, result.stderr.count("\n")) == (1, 1)
    result = commands.harness(workspace, "run", "fmus/stickslip.fmu", "--stop", 1e12, "--timeout", 0.5)
    assert result.returncode == 1
    (line,) = result.stderr.splitlines()
    assert line.startswith("Error: stickslip.fmu is at t = ")
    assert line.endswith("advances by less than 1/4096 of the run in 0.5 s: shorten the run, or allow a longer timeout")
    result = commands.harness(workspace, "run", "fmus/stickslip.fmu", "--stop", 20, "--timeout", 5)
    assert (result.returncode, result.stderr) == (0, "")


@pytest.mark.parametrize("words", [["--set", "m=1.5,c=0,solver.method=exact"], ["--set", "m=1.5", "--set", "c=0"]])
@pytest.mark.parametrize(
    "command", campaign_after(1, [(("run",),), (("sweep", "--vary", "x0=0.1,0.2", "--workers", "1"),)])
)
def test_several_assignments_stand_in_one_option(workspace, command, words):
    result = commands.harness(workspace, *command, "fmus/smd.fmu", *words, "--stop", "0.5", "--out", "out")
    assert (result.returncode, result.stderr) == (0, "")
    (file,) = (workspace / "out").rglob("provenance.json")
    parameters = json.loads(file.read_text())["parameters"]
    assert (parameters["m"]["value"], parameters["c"]["value"]) == (1.5, 0.0)


@pytest.mark.parametrize("words", [["--rtol", "1e-4"], ["--set", "solver.rtol=1e-4"]])
def test_rtol_sets_the_solver_of_an_fmu_of_this_project(fmus, tmp_path, words):
    (tmp_path / "fmus").symlink_to(fmus)
    result = commands.harness(tmp_path, "run", "fmus/coulomb.fmu", "--set", "solver.method=ode45", *words)
    assert (result.returncode, result.stderr) == (0, "")
    assert load_result(tmp_path / "results/coulomb").parameters["solver.rtol"] == 1e-4


@pytest.mark.parametrize(
    ("name", "assignments", "values", "comparison"),
    [
        ("stickslip", ["mu_s=0.7,mu_d=0.5"], {"mu_s": 0.7, "mu_d": 0.5}, []),
        ("stickslip", ["mu_s=0.7", "mu_d=0.5"], {"mu_s": 0.7, "mu_d": 0.5}, []),
        ("coulomb", ["f=0.6"], {"f": 0.6}, []),
        ("coulomb", ["k=100"], {"k": 100.0}, ["f"]),
        ("pendulum", ["m=2"], {"m": 2.0}, []),
    ],
)
def test_a_scene_runs_with_other_values_and_is_not_compared_with_known_ones(
    user_folder, tmp_path, name, assignments, values, comparison
):
    """The value of a parameter that is not changed stays known."""
    options = [word for text in assignments for word in ("--set", text)]
    result = harness(user_folder, "run", name, *options, "--json", "--out", tmp_path)
    assert (result.returncode, result.stderr) == (0, "")
    content = json.loads(result.stdout)
    assert content["quantities"]
    assert [row["name"] for row in (content["comparison"] or {"values": []})["values"]] == comparison
    effective = load_result(tmp_path / name).parameters
    assert {key: effective[key] for key in values} == values


def test_a_scene_runs_to_another_stop_and_is_not_compared_then(workspace):
    result = harness(workspace, "run", "stickslip", "--stop", 9)
    assert (result.returncode, result.stderr) == (0, "")
    assert "reference" not in result.stdout
    assert re.search(r"slips +2 ", result.stdout)
    assert load_result(workspace / "results" / "stickslip").time[-1] == 9.0


def test_a_scene_that_runs_too_short_for_an_analysis_names_it(workspace):
    result = harness(workspace, "run", "stickslip", "--stop", 5)
    assert (result.returncode, result.stderr) == (0, "")
    assert "the analysis 'slip' needs two slips, and the run has 1: set a later stop" in result.stdout
    assert load_result(workspace / "results" / "stickslip").time[-1] == 5.0


@pytest.mark.campaign
def test_the_first_slip_without_modes_is_named_as_what_is_measured(workspace):
    """A sled that creeps breaks away at no time; it becomes as fast as the driver later than a stick ends."""
    texts = [harness(workspace, "run", name, "--stop", 9).stdout for name in ("stickslip", "pacejka-0.001")]
    names = ("first slip", "first time as fast as the driver")
    assert [[name in text for name in names] for text in texts] == [[True, False], [False, True]]
