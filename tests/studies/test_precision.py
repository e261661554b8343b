"""Work-precision diagrams: measurements, gaps and advice."""

from dataclasses import replace
from functools import partial
from itertools import cycle
from math import nan
from pathlib import Path

import commands
import pytest
from build_cache import build_user_model
from matplotlib.figure import Figure
from models import EXAMPLE_MODELS
from precision_points import make_point, make_study
from spec_runs import ignore_progress

from benchmarks.references import event_located
from harness import HarnessError
from harness.references import peer_solvers
from harness.references.certified_reference import compute_errors, load_reference, relative_errors
from harness.references.models import CASES
from harness.references.peer_solvers import FMI3_TOOLS, FMPY, FMU
from harness.simulation.embedded_model import EmbeddedModel, load_model_class, load_more_model, method_numbers
from harness.studies.precision.study import (
    BRISTLES,
    FULL,
    QUICK,
    SolverJob,
    SweepSettings,
    compare_bristles,
    compare_with_dry_friction,
    measure_precision,
    solve_dry_block,
    solver_jobs,
    sweep_tolerances,
)

CASE = {case.name: case for case in CASES}
SMOOTH = [case for case in CASES if not case.is_chattering]


def command(user_folder, *arguments):
    """Run `python -m harness precision` in a folder and return the finished process."""
    return commands.harness(user_folder, "precision", *arguments, PATH="", COLUMNS="100")


@pytest.mark.parametrize("name", ["smd", "coulomb", "stickslip"])
def test_exact_is_within_1e_13_of_the_reference_and_1e_14_of_every_event(fmus, name):
    truth = load_reference(name)
    answer = EmbeddedModel.create(load_model_class(fmus / f"{name}.fmu"), {}, "exact", 0.0).solve(truth.times.tolist())
    off = compute_errors(answer, truth)
    assert off.largest < 1e-13
    assert not off.events or off.events < 1e-14 * truth.times[-1]


@pytest.mark.parametrize("case", [case for case in CASES if case.name != "pacejka-0.001"], ids=lambda case: case.name)
def test_every_method_of_the_fmu_approaches_the_reference_of_its_law(fmus, case):
    truth, model = load_reference(case.reference_source), load_model_class(fmus / f"{case.model}.fmu")
    tolerance = (
        0.02 if case.reference_source == "stickslip-threshold" else 2e-3
    )  # the position of rest below eps is arbitrary
    for method in method_numbers(model):
        if (case.name == "pacejka-0.0001" and method not in ("rodas", "radau9")) or (
            case.is_chattering and method == "exact"
        ):
            continue  # seconds of explicit steps; refused
        answer = EmbeddedModel.create(model, case.run.values, method, 1e-6).solve(truth.times.tolist())
        assert compute_errors(answer, truth).largest < tolerance
        assert answer.evaluations > 0


@pytest.mark.parametrize(
    "case", [CASE[name] for name in ("coulomb", "stickslip", "pacejka-0.01")], ids=lambda case: case.name
)
def test_every_installed_peer_approaches_the_reference_and_its_events(case):
    truth = load_reference(case.reference_source)
    for peer, methods in {"scipy": ("DOP853", "LSODA", "Radau"), "cvode": ("Adams", "BDF")}.items():
        for method in methods:
            if peer in peer_solvers.missing_packages() or (case.problem.is_stiff and method in ("DOP853", "Adams")):
                continue
            answer = peer_solvers.solve(peer, method, case.problem, truth.times, 1e-7, 1e-10)
            off = compute_errors(answer, truth)
            assert off.largest < 1e-3
            assert (off.events is not None) == case.problem.has_dry_friction
            assert not off.events or off.events < 1e-4
            assert answer.evaluations > 100


def test_a_missing_peer_is_listed_and_skipped(fmus, monkeypatch):
    monkeypatch.setitem(peer_solvers.PACKAGES, "cvode", ("no_such_module", "scikit-sundae"))
    assert peer_solvers.missing_packages()["cvode"] == "scikit-sundae"
    file = fmus / "smd.fmu"
    assert "cvode" not in [job.tool for job in solver_jobs(CASE["smd"], load_model_class(file), file)]


def test_a_run_is_limited_in_steps_and_in_time(fmus):
    solve = partial(peer_solvers.solve, "scipy", "RK23", CASE["smd"].problem, load_reference("smd").times, 1e-9, 1e-12)
    with pytest.raises(HarnessError, match=r"^at t = .* s after 500 right-hand sides$"):
        solve(peer_solvers.limit_evaluations(500))
    with pytest.raises(HarnessError, match=r"^at t = .* s after 0\.001 s of run time$"):
        solve(peer_solvers.limit_run_time(1e-3))
    embedded_model = EmbeddedModel.create(load_model_class(fmus / "smd.fmu"), {}, None, 1e-9)
    with pytest.raises(HarnessError, match=r"^at t = .* s after 1e-06 s of run time$"):
        embedded_model.solve(load_reference("smd").times.tolist(), timeout=1e-6)


def test_a_failed_run_is_a_gap_and_tighter_ones_after_a_slow_run_are_skipped(monkeypatch):
    rtols, clock = [], [0.0]
    monkeypatch.setattr("harness.studies.precision.study.perf_counter", lambda: clock[0])

    def run(rtol, extent):
        rtols.append(rtol)
        if rtol == 1e-3:
            raise HarnessError("it fell over")
        if rtol == 1e-5:
            clock[0] += 0.06
            raise HarnessError("it took too long")
        return replace(load_reference("smd"), evaluations=7), 0.25

    def fail(rtol, extent):
        raise HarnessError("it fell over")

    with pytest.raises(HarnessError, match="it fell over"):
        list(sweep_tolerances(CASE["smd"], SolverJob("tool", "method", 1e-3, fail, must_succeed=True), QUICK))
    assert (
        list(sweep_tolerances(CASE["smd"], SolverJob("tool", "method", 1e-3, lambda rtol, extent: None), QUICK)) == []
    )

    tolerances = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6)
    points = list(
        sweep_tolerances(CASE["smd"], SolverJob("tool", "method", 1e-3, run), SweepSettings(tolerances, 0.1, 0.1))
    )
    assert rtols == [1e-2, 1e-3, 1e-4, 1e-5]
    assert [point.rtol for point in points] == list(tolerances)
    assert [point.seconds for point in points] == pytest.approx([0.25, nan, 0.25, nan, nan], nan_ok=True)
    assert [point.largest for point in points] == pytest.approx([0.0, nan, 0.0, nan, nan], nan_ok=True)
    failures = ["", "it fell over", "", "it took too long", "skipped: at rtol 1e-05 the run stopped it took too long"]
    assert [point.failure for point in points] == failures


def test_the_advice_is_derived_from_the_points():
    points = (
        make_point("ode23", 1e-3, 1e-3),
        make_point("ode23", 8e-3, 1e-7),
        make_point("ode45", 2e-3, 1e-6),
        make_point("ode45", 1.5e-3, 1e-5),
        make_point("RK45", 0.28, 1e-7, "scipy"),
        make_point("ode23", 4e-3, 1e-9, FMPY),
        make_point("ode23", 1e-3, 1e-3, case="stickslip-threshold", beside_dry=5e-3),
    )
    study = make_study(*points, cases=("stickslip", "stickslip-threshold"))
    assert study.advice == (
        "stickslip: use ode45: error 1e-6 in 2 ms at rtol 1e-6 (hybrid; relative run time at error 1e-6: ode23 4, "
        "scipy RK45 140); the law 'threshold' does not get below an error of 0.005 against stick and slip."
    )
    assert make_study(points[0]).advice == "stickslip: no method of the FMU reaches an error of 1e-6."


def test_a_figure_labels_three_solvers_per_case_and_draws_the_others_in_grey():
    """The two fastest methods of the FMU and the fastest other solver; a law that chatters is grey."""
    points = (
        make_point("ode23", 8e-3, 1e-7),
        make_point("ode45", 2e-3, 1e-6),
        make_point("rodas", 9e-3, 1e-8),
        make_point("RK45", 2e-2, 1e-7, "scipy"),
        make_point("Adams", 3e-2, 1e-7, "cvode"),
        make_point("ode45", 4e-3, 1e-6, FMPY),
        make_point("ode23", 1e-3, 1e-3, case="stickslip-threshold", beside_dry=5e-3),
    )
    figure = Figure()
    make_study(*points, cases=("stickslip", "stickslip-threshold"))._draw(figure)
    panels = figure.get_axes()
    assert [text.get_text() for text in panels[1].get_legend().get_texts()] == [
        "FMU: ode45",
        "FMU: ode23",
        "scipy: RK45",
    ]
    for axes in panels:
        label_colours = {line.get_color() for line in axes.lines if not line.get_label().startswith("_")}
        other_colours = {line.get_color() for line in axes.lines if line.get_label().startswith("_")}
        assert len(label_colours) == 3
        assert other_colours == {"#cccccc"}
    assert [len(axes.lines) for axes in panels] == [7, 6]  # fmpy evaluates as often as the FMU itself


def test_no_advice_is_given_without_sufficient_evidence():
    """A quick run gives no advice if another solver comes close to the best method; a full run names a better peer."""
    rodas_point, ode23_point = make_point("rodas", 2e-3, 1e-7), make_point("ode23", 4e-3, 1e-7)
    message = "stickslip: no recommendation from a quick run; use `friction-fmus precision stickslip`."
    for peer, has_advice in ((1.7e-3, False), (2.5e-3, False), (4e-3, True)):
        points = rodas_point, ode23_point, make_point("LSODA", peer, 1e-7, "scipy")
        quick, complete = (make_study(*points, min_ratio=extent.min_ratio).advice for extent in (QUICK, FULL))
        assert (quick == complete) == has_advice
        assert has_advice or quick == message
        assert complete.startswith("stickslip: use rodas: ")
        assert ("scipy LSODA 0.85, not a method of the FMU" in complete) == (peer < rodas_point.seconds)
    assert make_study(min_ratio=QUICK.min_ratio).advice == message


def test_the_laws_creep_and_lose_their_symmetry_as_published(fmus):
    analyses_by_case = {
        case.name: compare_with_dry_friction(case, load_model_class(fmus / f"{case.model}.fmu"))
        for case in CASES
        if case.dry_friction_reference
    }
    assert analyses_by_case["coulomb-sign"].largest == 0.0
    assert analyses_by_case["stickslip-threshold"].creep == pytest.approx(1e-7)  # the threshold itself
    assert analyses_by_case["stickslip-threshold"].period == pytest.approx(3.345104499330, rel=1e-4)
    soft, *_, steep = magic = [analyses_by_case[f"pacejka-{x_m}"] for x_m in ("0.01", "0.001", "0.0001")]
    for law, x_m in zip(magic, (0.01, 0.001, 0.0001), strict=True):
        assert 0.3 * x_m < law.creep < 0.4 * x_m
        assert 0.4 < law.asymmetry < 0.9
    assert (soft.period, steep.period) == pytest.approx((3.7169, 3.3533), abs=1e-3)
    assert soft.asymmetry < steep.asymmetry
    assert soft.rms > steep.rms


@pytest.mark.campaign
def test_bristles_creep_and_each_law_has_a_smaller_integration_than_model_error(fmus):
    """The bristles of LuGre and of the elasto-plastic law, against a block that sticks, by two methods."""
    dry = solve_dry_block()
    problem = event_located.DryBlock()
    other, events = event_located.solve(problem, dry.times.tolist(), "Radau", *event_located.TOLERANCES["Radau"])
    assert relative_errors(other, dry.states).max() < 1e-9
    assert [mode for _, (mode,) in events] == [mode for _, mode in dry.events] == [1, 0, 1, 0]
    for name, law in BRISTLES.items():
        deviation = compare_bristles(name, law, load_more_model(name))
        assert 1e-6 < deviation.creep < 1e-5
        assert 1e-3 < deviation.rms < 0.1
        assert 0.0 < deviation.integration < 1e-4
        assert deviation.period == pytest.approx(dry.events[2][0] - dry.events[0][0], rel=0.02)


@pytest.mark.parametrize(
    ("path", "ending"),
    [
        pytest.param(path, ending, marks=pytest.mark.campaign if path.stem != "viscous_pendulum" else ())
        for path, ending in zip(EXAMPLE_MODELS, cycle((".py", ".fmu")))
    ],
    ids=lambda path: Path(path).name,
)
def test_a_user_model_is_studied_by_its_path_or_that_of_its_fmu(path, ending):
    """Every check that needs only the equations of the file; the reference is where two of its methods agree."""
    name = (build_user_model(path) / path.name).with_suffix(ending)
    points = measure_precision(str(name), SweepSettings((1e-6,), 5.0, 0.0), ignore_progress)
    assert points.model == path.stem
    assert {tool for tool, _ in points.solvers(points.cases[0])} == {FMU, FMPY, *FMI3_TOOLS}
    best = {p.tool: p.largest for p in points.points if p.method == "dop853"}
    assert best[FMU] == best[FMPY] < 1e-3
