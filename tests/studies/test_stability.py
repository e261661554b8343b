"""Stiff and extreme scenes: reference solutions, verdicts, and a part of the table."""

import csv
from dataclasses import replace
from math import nan
from pathlib import Path

import commands
import independent_pendulum
import independent_solution
import numpy as np
import pytest
from build_cache import build_user_model
from models import EXAMPLE_MODELS, LARGER_MODELS, MODELS, declared
from spec_runs import ignore_progress

from harness import Trajectory
from harness.process.worker import Worker, WorkerTimeoutError
from harness.references.models.pacejka import MagicFormula
from harness.references.reference_trajectory import CommunicationGrid, compute_reference
from harness.results.provenance import load_provenance
from harness.running import step_sequence
from harness.running.solution import Solution
from harness.running.step_sequence import RefusalSummary, RefusedRun, inject_nonfinite
from harness.running.trajectory import Statistics
from harness.scenes.run_spec import RunSpec
from harness.studies.stability import study
from harness.studies.stability.cases import StabilityCase, expand_scene, load_scenes, value_spans
from harness.studies.stability.study import (
    FINISHED,
    REFUSED,
    WRONG,
    CaseOutcome,
    grouped_cases,
    judge_injections,
    judge_refusal,
    judge_solution,
    run_group,
    run_stability,
    stability_regions,
)
from harness.studies.stability.table import error_table, refusal_table, summary

SLOW = pytest.mark.slow
QUICK = (
    "c = {} N.s/m: damping ratio c/20",
    "k = 0",
    "f just below k x0: it moves by less than a bit",
    "exactly inverted: the pin holds",
    "stuck for 1e6 s",
    "events on communication points",
    "communication step of {}",
    "stop at {} s",
    "NaN, inf, -inf in every Real, before and in mid-run",
)


def is_sampled():
    """Return a predicate for scenes in QUICK or at the soft end of the region: the first with each model and value."""
    seen = set()

    def is_new(scene):
        if not (scene["pattern"] in QUICK or ("region" in scene and scene["varied"] in (0.1, 0.03))):
            return False
        marks = {(scene["pattern"], key, repr(scene.get(key))) for key in ("model", "varied")}
        has_new_mark = not marks <= seen
        seen.update(marks)
        return has_new_mark

    return is_new


def defaults(name):
    """Return the values of a model, SI units."""
    return {variable: d.start for variable, d in declared(name).items() if d.causality in ("parameter", "input")}


# ---- the reference solutions


LINEAR = {
    "underdamped": ("coulomb", {"c": 2.0, "v0": 0.3, "F_ext": 0.2}),
    "critically damped": ("coulomb", {"k": 100.0, "c": 20.0, "v0": 1.0}),
    "overdamped, no spring": ("smd", {"k": 0.0, "v0": 1.0, "F_ext": 0.5}),
    "driven": ("stickslip", {}),
    "driven backward": ("stickslip", {"v_driver": -0.05, "F_ext": 3.0}),
}


@pytest.mark.parametrize("case", LINEAR.values(), ids=LINEAR)
def test_the_closed_form_agrees_with_the_independent_one(case):
    name, chosen = case
    values, stop = {**defaults(name), **chosen}, 16.0 if name == "stickslip" else 4.0
    solution = compute_reference(name, [(0.0, stop, values)], CommunicationGrid(0.0, stop, 60))
    traits = {k: v for k, v in chosen.items() if k not in ("x0", "v0")}
    motion = independent_solution.ClosedFormMotion(
        [(0.0, getattr(independent_solution, name)(**traits))], values["x0"], values["v0"], stop
    )
    expected = np.array([[float(value) for value in motion.at(t)] for t in solution.times]).T
    np.testing.assert_allclose(solution.states.T, expected, rtol=1e-15, atol=1e-18)
    assert [mode for _, mode in solution.events] == [mode for _, mode in motion.events]
    assert [t for t, _ in solution.events] == pytest.approx([float(t) for t, _ in motion.events], rel=1e-15)


def test_a_change_of_values_starts_a_new_segment():
    values = defaults("stickslip")
    changes = {2.0: {"F_ext": 90.0}, 2.1: {"F_ext": -50.0}}
    solution = compute_reference(
        "stickslip", value_spans(0.0, 16.0, values, changes), CommunicationGrid(0.0, 16.0, 40, (2.0, 2.1))
    )
    parts = [
        (0.0, independent_solution.stickslip()),
        *((t, independent_solution.stickslip(**change)) for t, change in changes.items()),
    ]
    motion = independent_solution.ClosedFormMotion(parts, 0.0, 0.0, 16.0)
    assert list(solution.states[:, 0]) == pytest.approx(
        [float(motion.at(t)[0]) for t in solution.times], rel=1e-15, abs=1e-18
    )


@pytest.mark.parametrize("reaction", [False, True], ids=["weight", "reaction"])
def test_the_pendulum_agrees_with_the_independent_one(reaction):
    values = {**defaults("pendulum"), "pin_load": 1 + reaction}
    solution = compute_reference("pendulum", [(0.0, 5.0, values)], CommunicationGrid(0.0, 5.0, 60))
    swing = independent_pendulum.PendulumMotion(
        [(0.0, independent_pendulum.Pendulum(reaction))], values["theta0"], 0.0, 5.0
    )
    assert list(solution.states[:, 0]) == pytest.approx([swing.at(t)[0] for t in solution.times], abs=1e-11)
    assert [mode for _, mode in solution.events] == [mode for _, mode in swing.events]


def test_the_smooth_sled_creates_no_energy():
    """Radau against the power balance: the work of pull and friction changes the kinetic energy."""
    values = defaults("pacejka")
    solution = compute_reference("pacejka", [(0.0, 8.0, values)], CommunicationGrid(0.0, 8.0, 8000))
    x, speeds = solution.states.T
    curve, pull = MagicFormula(values), values["k"] * (values["v_driver"] * solution.times - x)
    power = [(f - curve.mu(v) * values["m"] * values["g"]) * v for f, v in zip(pull, speeds, strict=True)]
    work = np.concatenate([[0.0], np.cumsum(np.diff(solution.times) * (np.array(power[1:]) + power[:-1]) / 2)])
    np.testing.assert_allclose(0.5 * values["m"] * speeds**2, work, atol=3e-4)


# ---- the verdicts


CASE = StabilityCase(
    "rest",
    "coulomb",
    "exact",
    run=RunSpec(Path("coulomb.fmu")),
    grid=CommunicationGrid(0.0, 1.0, 2),
    spans=[],
    max_error=1e-3,
)
REST = Solution(np.array([0.0, 0.5, 1.0]), np.column_stack([np.ones(3), np.zeros(3)]), [(0.5, 0)])
GOOD = {"x": np.ones(3), "v": np.zeros(3), "energy": np.zeros(3)}
COUNTS = Statistics(2, 0, 3, 0.1, events=1, last_event=0.5)


def motion(columns=None, **counts):
    """Return the correct motion with other columns or other counts."""
    columns = GOOD | (columns or {})
    return Trajectory(REST.times, columns, {}, spec=CASE.run, statistics=replace(COUNTS, **counts))


@pytest.fixture
def case():
    """A case without input."""
    return CASE


def test_a_correct_motion_is_finished(case):
    assert judge_solution(case, motion(), REST).ended == FINISHED


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"columns": {"x": np.array([1.0, 1.0, 1.01])}}, "error 0.01"),
        ({"columns": {"v": np.array([0.0, nan, 0.0])}}, "error nan"),
        ({"columns": {"energy": np.array([1.0, 0.5, 0.6])}}, "energy rises by 0.1"),
        ({"last_event": 0.6}, "error 0.1"),
        ({"events": 2}, "2 events, not 1"),
    ],
    ids=["far", "not a number", "energy out of nothing", "late", "one event too many"],
)
def test_a_plausible_wrong_motion_is_wrong(case, changed, message):
    row = judge_solution(case, motion(**changed), REST)
    assert row.ended == WRONG
    assert not row.has_passed
    assert message in row.text


def test_a_refusal_needs_its_message_and_no_values(case):
    expecting = replace(case, max_error=None, expected_message="mu_d is")
    assert judge_refusal(expecting, RefusedRun("mu_d is 1.0, above", all_nan=True)).ended == REFUSED
    for wrong in (RefusedRun("", True), RefusedRun("mu_d is 1.0", False), RefusedRun("something else", True)):
        assert judge_refusal(expecting, wrong).ended == WRONG
    assert judge_refusal(case, RefusedRun("mu_d is 1.0", True)).ended == WRONG
    assert judge_injections(expecting, RefusalSummary(6, ("m = nan was taken",))).ended == WRONG


@pytest.mark.parametrize("wrong", [{"all_nan": False}, {"message": "a value is refused"}])
def test_a_refused_number_needs_its_name_in_the_message_and_no_values(fmus, monkeypatch, wrong):
    run, read_refusal = RunSpec(fmus / "smd.fmu"), step_sequence.read_refusal
    summary = inject_nonfinite(run)
    assert summary.failures == ()
    monkeypatch.setattr(step_sequence, "read_refusal", lambda session: replace(read_refusal(session), **wrong))
    assert len(inject_nonfinite(run).failures) == summary.n_tried > 0


def test_the_slope_is_that_of_the_stiff_end(case):
    rows = [
        CaseOutcome(replace(case, region=x), FINISHED, "", motion=motion(steps=n))
        for x, n in ((1e-4, 1000), (1e-3, 100), (1e-2, 50))
    ]
    (region,) = stability_regions(rows)
    assert region.slope == pytest.approx(-1.0)
    assert region.steps.tolist() == [50, 100, 1000]


# ---- the table


def test_every_scene_states_its_expected_ending_for_an_existing_model():
    all_scenes, finish = load_scenes()
    assert set(finish) == {"exact", "tolerances", "least"}
    assert {scene["model"] for scene in all_scenes} == set(MODELS)
    for scene in all_scenes:
        assert not ("refuse" in scene and "finish" in scene), scene["title"]
        assert "{" not in scene["title"], scene["title"]


def test_a_scene_is_expanded_over_models_and_values():
    scene = {"title": "rtol = {}", "models": ["smd", "coulomb"], "each": {"rtol": [0.1, 0.2]}}
    assert [(one["model"], one["title"], one["rtol"]) for one in expand_scene(scene)] == [
        ("smd", "rtol = 0.1", 0.1),
        ("smd", "rtol = 0.2", 0.2),
        ("coulomb", "rtol = 0.1", 0.1),
        ("coulomb", "rtol = 0.2", 0.2),
    ]


def test_a_part_of_the_table_ends_as_expected(user_folder, tmp_path, monkeypatch):
    monkeypatch.chdir(user_folder)
    result = run_stability(tmp_path, ignore_progress, grouped_cases(is_sampled()))
    rows, regions = result.outcomes, result.regions
    assert [f"{row.case.label}: {row.text}" for row in rows if not row.has_passed] == []
    assert {row.case.method for row in rows} == {"exact", "ode23", "ode45", "dop853", "rodas", "radau9"}
    assert {row.case.model for row in rows} == set(MODELS)
    with (tmp_path / "stability" / "stability.csv").open(encoding="utf-8", newline="") as file:
        assert len(list(csv.DictReader(file))) == len(rows) > 100
    parameters = load_provenance(tmp_path / "stability")["parameters"]
    assert parameters["pendulum: theta0"]["unit"] == "rad"
    assert {name.partition(":")[0] for name in parameters} == set(MODELS)
    assert [region.method for region in regions[-2:]] == ["rodas", "radau9"]
    for region in regions[-2:]:
        assert region.stiffness.tolist() == [0.1, 0.03]
    assert error_table(rows).row_count > 20
    assert refusal_table(rows).row_count > 5
    assert summary(rows, []).startswith(f"{len(rows)} of {len(rows)} ended as expected.")


@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=SLOW if name in ("smd", "stickslip") else pytest.mark.campaign) for name in MODELS],
)
def test_every_case_of_a_shipped_model_ends_as_expected(user_folder, tmp_path, monkeypatch, name):
    monkeypatch.chdir(user_folder)
    monkeypatch.setattr(study, "LIMIT", 1200.0)  # a loaded machine needs minutes until a run is refused
    rows = run_stability(tmp_path, ignore_progress, grouped_cases(models=[name])).outcomes
    assert [f"{row.case.label}: {row.text}" for row in rows if not row.has_passed] == []
    assert {row.case.title for row in rows} == {scene["title"] for scene in load_scenes()[0] if scene["model"] == name}


@pytest.mark.parametrize("name", ["rotor_brake", *(pytest.param(name, marks=SLOW) for name in ("sleds", "belt"))])
def test_a_user_model_passes_the_standard_scenes(tmp_path, name):
    """Its values, its tolerances and nonfinite numbers, by every method; a rule between two values may refuse them,
    and a belt adds energy."""
    (path,) = (path for path in (*EXAMPLE_MODELS, *LARGER_MODELS) if path.stem == name)
    file = build_user_model(path) / f"{name}.fmu"
    titles = ("as it comes", "rtol = 1e-09", "NaN", "T_d = 3", "J = 0.002", "m1 = 125")
    groups = [[case for case in group if case.title.startswith(titles)] for group in grouped_cases(models=[str(file)])]
    rows = run_stability(tmp_path, ignore_progress, [group for group in groups if group]).outcomes
    assert {row.case.name for row in rows} == {name}
    assert {row.case.title for row in rows} >= {"as it comes", "rtol = 1e-09"}
    assert [f"{row.case.label}: {row.text}" for row in rows if not row.has_passed] == []
    bound = [row for row in rows if row.case.title == "T_d = 3"]
    assert {row.ended for row in bound} <= {REFUSED}
    assert all("T_d is 3.0, above T_s = 0.5" in row.text for row in bound)


RELAX = '''
from fmus import Model, Output, Parameter, State

class Relax(Model):
    """What turns into something else."""

    k = Parameter(1.0, "1/s", "rate", above=0.0)
    x = State("1", "what there is", start=1.0)
    y = State("1", "what it becomes")
    p = Output("1/s", "what goes", -k * x, rate_of=x)
    q = Output("1/s", "what comes", k * x, rate_of=y)
'''


def test_a_model_without_position_and_speed_is_refused_by_stability_but_not_by_precision(tmp_path):
    (tmp_path / "relax.py").write_text(RELAX)
    assert commands.build("relax.py", folder=tmp_path).returncode == 0
    done = commands.harness(tmp_path, "stability", "relax.py")
    assert (done.returncode, done.stdout) == (1, "")
    output = "no state is the rate of another one; the cases need a position and a speed"
    assert done.stderr == f"Error: relax.py: {output}\n"
    done = commands.harness(tmp_path, "precision", "relax.py", "--quick", blank=True)
    assert (done.returncode, done.stderr) == (0, "")
    assert (tmp_path / "results/precision/relax/points.csv").is_file()


def test_a_hang_or_crash_is_the_outcome_of_its_case(monkeypatch):
    def call(self, function, *arguments, timeout):
        raise WorkerTimeoutError("no answer after 120 s", "")

    monkeypatch.setattr(Worker, "call", call)
    (row,) = run_group([CASE], Worker())
    assert (row.ended, row.text) == (WRONG, "no answer after 120 s")


def test_a_motion_that_differs_from_two_agreeing_methods_is_wrong():
    file = str(build_user_model(EXAMPLE_MODELS[0]) / f"{EXAMPLE_MODELS[0].stem}.fmu")
    group = next(group for group in grouped_cases(models=[file]) if group[0].title == "as it comes")
    one = replace(group[0], max_error=1e-300)
    with Worker() as worker:
        (row,) = run_group([one], worker)
    assert (row.has_passed, row.ended) == (False, WRONG)
    assert "more than 1e-300" in row.text
