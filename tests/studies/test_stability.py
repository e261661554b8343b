"""Stiff and extreme scenes: reference solutions, verdicts, and a part of the table."""

import csv
import tomllib
from contextlib import chdir
from dataclasses import replace
from math import nan
from types import SimpleNamespace

import commands
import independent_pendulum
import independent_solution
import numpy as np
import pytest
from build_cache import ROOT, build_user_model
from model_text import PULSES
from models import EXAMPLE_MODELS, LARGER_MODELS, MODELS, declarations_of
from spec_runs import ignore_progress

import harness
from harness.references.reference_trajectory import CommunicationGrid, compute_reference
from harness.studies.stability import study
from harness.studies.stability.study import FINISHED, REFUSED, WRONG, grouped_cases, measure_stability

SCENES = tomllib.loads((ROOT / "harness/studies/stability/stability.toml").read_text())
QUICK = (
    "c = {} N.s/m: damping ratio c/20",
    "f just below k x0: it moves by some bits",
    "exactly inverted: the pin holds",
    "stuck for 1e6 s",
    "communication step of {}",
    "stop at {} s",
    "NaN, inf, -inf in every Real, before and in mid-run",
)


def is_sampled():
    """Return a predicate for scenes in QUICK or at the soft end of the region: the first with each model and value."""
    seen_marks = set()

    def is_new(scene):
        if not (scene["pattern"] in QUICK or ("region" in scene and scene["varied"] in (0.1, 0.03))):
            return False
        marks = {(scene["pattern"], key, repr(scene.get(key))) for key in ("model", "varied")}
        has_new_mark = not marks <= seen_marks
        seen_marks.update(marks)
        return has_new_mark

    return is_new


def defaults(name):
    """Return the values of a model, SI units."""
    return {variable: d.start for variable, d in declarations_of(name).items() if d.causality in ("parameter", "input")}


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
    name, settings = case
    values, stop = {**defaults(name), **settings}, 16.0 if name == "stickslip" else 4.0
    solution = compute_reference(name, [(0.0, stop, values)], CommunicationGrid(0.0, stop, 60))
    traits = {k: v for k, v in settings.items() if k not in ("x0", "v0")}
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
    spans = [(0.0, 2.0, values), (2.0, 2.1, values | changes[2.0]), (2.1, 16.0, values | changes[2.1])]
    solution = compute_reference("stickslip", spans, CommunicationGrid(0.0, 16.0, 40, (2.0, 2.1)))
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


@pytest.mark.slow
def test_the_smooth_sled_creates_no_energy():
    """Radau against the power balance: the work of pull and friction changes the kinetic energy."""
    values = defaults("pacejka")
    solution = compute_reference("pacejka", [(0.0, 8.0, values)], CommunicationGrid(0.0, 8.0, 8000))
    x, speeds = solution.states.T
    D, C = values["mu_s"], 2.0 - 2.0 * np.arcsin(values["mu_d"] / values["mu_s"]) / np.pi
    bv, top = 2.0 / (values["x_m"] * C) * speeds, 2.0 / C
    E = (top - np.tan(np.pi / (2.0 * C))) / (top - np.arctan(top))
    mu = D * np.sin(C * np.arctan(bv - E * (bv - np.arctan(bv))))
    pull = values["k"] * (values["v_driver"] * solution.times - x)
    power = (pull - mu * values["m"] * values["g"]) * speeds
    work = np.concatenate([[0.0], np.cumsum(np.diff(solution.times) * (power[1:] + power[:-1]) / 2)])
    np.testing.assert_allclose(0.5 * values["m"] * speeds**2, work, atol=3e-4)


# ---- the verdicts


@pytest.fixture(scope="module")
def case(user_folder):
    """A case of the table, which finishes: the mass at rest with dry friction, without input."""
    with chdir(user_folder):
        cases = grouped_cases(lambda scene: scene["title"].startswith("f = 15.9"))  # has one error for all methods
    (case,) = (case for group in cases for case in group if case.method == "exact" and case.model == "coulomb")
    run = replace(case.run, fmu=user_folder / case.run.fmu)
    return replace(case, run=run, max_error=1e-3, grid=CommunicationGrid(0.0, 1.0, 2), events="all")


@pytest.fixture(scope="module")
def counts(fmus):
    """Two steps and one event."""
    statistics = harness.simulate(fmus / "coulomb.fmu", stop=0.1).statistics
    return replace(statistics, steps=2, events=1, last_event=0.5)


REST = SimpleNamespace(  # a reference
    times=np.array([0.0, 0.5, 1.0]), states=np.column_stack([np.ones(3), np.zeros(3)]), events=[(0.5, 0)]
)
GOOD = {"x": np.ones(3), "v": np.zeros(3), "energy": np.zeros(3)}


def judge(case, counts, columns=None, reference=REST, **changes):
    """Return the outcome of the correct motion with other columns or other counts."""
    statistics = replace(counts, **changes)
    motion = harness.Trajectory(REST.times, GOOD | (columns or {}), {}, spec=case.run, statistics=statistics)
    return study.judge_solution(case, motion, reference)


def test_a_correct_motion_is_finished(case, counts):
    assert judge(case, counts).ended == FINISHED


def test_events_that_rounding_decides_are_not_judged(case, counts):
    reference = SimpleNamespace(**{**vars(REST), "events": None})
    assert judge(case, counts, reference=reference, events=2).ended == FINISHED


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"columns": {"x": np.array([1.0, 1.0, 1.01])}}, "error 0.01"),
        ({"columns": {"v": np.array([0.0, nan, 0.0])}}, "error nan"),
        ({"columns": {"energy": np.array([1.0, 0.5, 0.6])}}, "energy rises by 0.1"),
        ({"last_event": 0.6}, "error 0.1"),
        ({"events": 2}, "2 events, not 1"),
    ],
    ids=["far", "not a number", "energy out of nothing", "late", "one event too many"],
)
def test_a_plausible_wrong_motion_is_wrong(case, counts, changes, message):
    row = judge(case, counts, **changes)
    assert row.ended == WRONG
    assert not row.has_passed
    assert message in row.text


def test_a_refusal_needs_its_message_and_no_values(case):
    def judge_refusal(case, message, all_nan):
        return study.judge_refusal(case, SimpleNamespace(message=message, all_nan=all_nan)).ended

    refusal_case = replace(case, max_error=None, expected_message="mu_d is")
    assert judge_refusal(refusal_case, "mu_d is 1.0, above", True) == REFUSED
    for outcome in (("", True), ("mu_d is 1.0", False), ("something else", True)):
        assert judge_refusal(refusal_case, *outcome) == WRONG
    assert judge_refusal(case, "mu_d is 1.0", True) == WRONG
    summary = SimpleNamespace(n_tried=6, failures=("m = nan was taken",))
    assert study.judge_injections(refusal_case, summary).ended == WRONG


@pytest.mark.parametrize("wrong", [{"all_nan": False}, {"message": "a value is refused"}])
def test_a_refused_number_needs_its_name_in_the_message_and_no_values(case, monkeypatch, wrong):
    read_refusal = study.inject_nonfinite.__globals__["read_refusal"]
    summary = study.inject_nonfinite(case.run)
    assert summary.failures == ()
    read = "harness.simulation.step_sequence.read_refusal"
    monkeypatch.setattr(read, lambda session: replace(read_refusal(session), **wrong))
    assert len(study.inject_nonfinite(case.run).failures) == summary.n_tried > 0


def test_the_slope_is_that_of_the_stiff_end(case, counts):
    rows = [judge(replace(case, region=x), counts, steps=n) for x, n in ((1e-4, 1000), (1e-3, 100), (1e-2, 50))]
    (region,) = study.stability_regions(rows)
    assert region.slope == pytest.approx(-1.0)
    assert region.steps.tolist() == [50, 100, 1000]


# ---- the table


def test_every_scene_states_its_expected_ending_for_an_existing_model():
    assert {*SCENES["finish"]} == {"exact", "tolerances", "least"}
    assert {model for scene in SCENES["scene"] for model in scene.get("models", [scene.get("model")])} == {*MODELS}
    assert {*QUICK} <= {scene["title"] for scene in SCENES["scene"]} | {
        "NaN, inf, -inf in every Real, before and in mid-run"
    }
    for scene in SCENES["scene"]:
        assert not ("refuse" in scene and "finish" in scene), scene["title"]
        assert ("{" in scene["title"]) == ("each" in scene), scene["title"]


@pytest.mark.slow
def test_a_part_of_the_table_ends_as_expected(user_folder, tmp_path, monkeypatch):
    monkeypatch.chdir(user_folder)
    result = measure_stability(grouped_cases(is_sampled()), ignore_progress)
    result.save(tmp_path / "stability")
    rows, regions = result.outcomes, result.regions
    assert [f"{row.case.label}: {row.text}" for row in rows if not row.has_passed] == []
    assert {row.case.method for row in rows} == {"exact", "ode23", "ode45", "dop853", "rodas", "radau9"}
    assert {row.case.model for row in rows} == set(MODELS)
    with (tmp_path / "stability" / "stability.csv").open(encoding="utf-8", newline="") as file:
        assert len(list(csv.DictReader(file))) == len(rows) > 80
    assert [region.method for region in regions[-2:]] == ["rodas", "radau9"]
    for region in regions[-2:]:
        assert region.stiffness.tolist() == [0.1, 0.03]
    errors, refusals = result._tabulate()
    assert len(errors.items) > 10
    assert len(refusals.items) > 5
    assert f"{len(rows)} of {len(rows)} ended as expected." in str(result)


@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=pytest.mark.campaign) for name in MODELS],
)
def test_every_case_of_a_shipped_model_ends_as_expected(user_folder, tmp_path, monkeypatch, name):
    """In CI, README.md runs those of the sled, and the notebook of the documentation those of smd."""
    monkeypatch.chdir(user_folder)
    monkeypatch.setattr(study, "LIMIT", 1200.0)  # a loaded machine needs minutes until a run is refused
    rows = measure_stability(grouped_cases(models=[name]), ignore_progress).outcomes
    assert [f"{row.case.label}: {row.text}" for row in rows if not row.has_passed] == []
    scenes = [scene for scene in SCENES["scene"] if name in scene.get("models", [scene.get("model")])]
    n_values = [len(next(iter(scene.get("each", {"": [0]}).values()))) for scene in scenes]
    assert len({row.case.title for row in rows}) == sum(n_values)


@pytest.mark.campaign
@pytest.mark.parametrize("name", ["rotor_brake", "sleds", "belt"])
def test_a_user_model_passes_the_standard_scenes(tmp_path, name):
    """Its values, its tolerances and nonfinite numbers, by every method; a rule between two values may refuse them,
    and a belt adds energy."""
    (path,) = (path for path in (*EXAMPLE_MODELS, *LARGER_MODELS) if path.stem == name)
    file = build_user_model(path) / f"{name}.fmu"
    titles = ("as it comes", "rtol = 1e-09", "NaN", "T_d = 3", "J = 0.002", "m_1 = 125")
    groups = [[case for case in group if case.title.startswith(titles)] for group in grouped_cases(models=[str(file)])]
    rows = measure_stability([group for group in groups if group], ignore_progress).outcomes
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


@pytest.mark.campaign
def test_a_model_without_position_and_speed_is_refused_by_stability_but_not_by_precision(tmp_path):
    (tmp_path / "relax.py").write_text(RELAX)
    assert commands.build("relax.py", folder=tmp_path).returncode == 0
    result = commands.harness(tmp_path, "stability", "relax.py")
    assert (result.returncode, result.stdout) == (1, "")
    output = "no state is the rate of another one; the cases need a position and a speed"
    assert result.stderr == f"Error: relax.py: {output}\n"
    result = commands.harness(tmp_path, "precision", "relax.py", "--quick")
    assert (result.returncode, result.stderr) == (0, "")
    assert (tmp_path / "results/precision/relax/points.csv").is_file()


@pytest.mark.campaign
def test_a_case_whose_reference_misses_a_pulse_is_wrong(tmp_path):
    (tmp_path / "pulses.py").write_text(PULSES)
    assert commands.build("pulses.py", folder=tmp_path).returncode == 0
    groups = grouped_cases(models=[str(tmp_path / "pulses.fmu")])
    cases = [case for group in groups for case in group if case.title == "as it comes"]
    with study.Worker() as worker:
        rows = list(study.run_group(cases, worker))
    assert {(row.has_passed, row.ended) for row in rows} == {(False, WRONG)}
    assert all("dop853 with a thirtieth of the largest step differs by " in row.text for row in rows)


def test_a_hang_is_the_outcome_of_its_case(case, monkeypatch):
    monkeypatch.setattr(study, "LIMIT", 1e-3)
    with study.Worker() as worker:
        (row,) = study.run_group([replace(case, inject_nonfinite=True)], worker)
    assert (row.ended, row.text) == (WRONG, "no answer after 0.001 s")


def test_a_motion_that_differs_from_two_agreeing_methods_is_wrong():
    file = str(build_user_model(EXAMPLE_MODELS[0]) / f"{EXAMPLE_MODELS[0].stem}.fmu")
    group = next(group for group in grouped_cases(models=[file]) if group[0].title == "as it comes")
    tight_case = replace(group[0], max_error=1e-300)
    with study.Worker() as worker:
        (row,) = study.run_group([tight_case], worker)
    assert (row.has_passed, row.ended) == (False, WRONG)
    assert "more than 1e-300" in row.text
