"""The benchmark: every error is measured against an independent solution, every time against a peer."""

import csv
import ctypes
import json
import os
import shutil
import sys
from dataclasses import replace
from functools import partial
from math import atan, inf, nan, sin

import fmi3_fixtures
import pytest
from build_cache import build_once
from native_fmus import build_native_fmus as native_built

from benchmarks import c_host, stepping_loops
from benchmarks.bench import model_exchange, native, stiff
from benchmarks.bench import speed as bench_speed
from benchmarks.bench.accuracy import (
    default_run_error,
    event_time_error,
    exact_run_error,
    last_event_error,
    stuck_drift,
)
from benchmarks.bench.benchmark import Baseline, Benchmark
from benchmarks.bench.speed import time_communication_step, time_in_process, time_many_runs, time_one_step
from benchmarks.bench.study import FILE, FOLDER, all_benchmarks, benchmark_table, format_baseline, run_benchmarks
from harness import HarnessError
from harness.scenes.run_spec import RunSpec

pytestmark = pytest.mark.slow

FAST = Benchmark("a step", 2e-6, "s", 3e-6, (Baseline("theirs", 5e-6), Baseline("absent is not installed")))


@pytest.fixture
def all_measures(user_folder, monkeypatch):
    """The measures of the benchmark."""
    monkeypatch.chdir(user_folder)
    monkeypatch.setattr(bench_speed, "RUNS", 20)
    return all_benchmarks()


@pytest.fixture
def both_backends(fmus, tmp_path, monkeypatch):
    """A folder with Python and native FMUs, and an empty cache of measurements."""
    (tmp_path / "fmus").mkdir()
    for file in fmus.glob("*.fmu"):
        (tmp_path / "fmus" / file.name).symlink_to(file)
    (tmp_path / "fmus" / "native").mkdir()
    for file in native_built().glob("*.fmu"):
        (tmp_path / "fmus" / "native" / file.name).symlink_to(file)
    (tmp_path / "fmus" / "native" / "fmi3").symlink_to(fmi3_fixtures.build_fmi3_fmus())
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(native, "REPEAT", 3)
    monkeypatch.setattr(stepping_loops, "REPEATS", 5)
    forget()
    return tmp_path / "fmus"


def forget():
    """Clear the cache of measurements."""
    for function in (native.time_fmu, native.time_cvode, native.time_through_fmpy, stiff.run_fmu, stiff.run_cvode):
        function.cache_clear()


def of(all_measures, function):
    """Return the measures of a function."""
    return [measure for measure in all_measures if measure.func is function]


@pytest.mark.campaign
def test_exact_events_and_the_pendulum_meet_their_targets_and_a_stuck_body_stays(all_measures):
    calls = [
        call
        for function in (exact_run_error, event_time_error, last_event_error, stuck_drift)
        for call in of(all_measures, function)
    ]
    calls += [call for call in of(all_measures, default_run_error) if call.args[0] == "pendulum"]
    measures = [call() for call in calls]
    assert len(measures) == 3 + 2 + 2 + 3 + 2
    assert [measure.name for measure in measures if not measure.is_met] == []


def test_a_missed_accuracy_target_is_reported(all_measures):
    model, card, *rest = of(all_measures, default_run_error)[0].args
    loose = replace(card, start_values={**card.start_values, "solver.method": 2, "solver.rtol": 1e-3})
    measure = default_run_error(model, loose, *rest)
    assert not measure.is_met
    assert 1e-4 < measure.value < 0.1


@pytest.mark.campaign
def test_the_own_code_is_faster_than_python_peers(all_measures):
    for call in (
        of(all_measures, time_in_process)[0],
        *of(all_measures, time_one_step),
        *of(all_measures, time_many_runs),
    ):
        measure = call()
        assert 0.0 < measure.value < measure.baselines[0].value


@pytest.mark.campaign
def test_a_communication_step_is_timed_against_an_empty_fmu_with_the_same_outputs(all_measures, monkeypatch):
    monkeypatch.setattr(stepping_loops, "REPEATS", 2)
    measure = of(all_measures, time_communication_step)[2]()
    default, empty, lean, lean_empty = (peer.value for peer in measure.baselines)
    assert measure.value == default / empty
    assert 0.0 < default < 10 * empty
    assert 0.0 < lean < 10 * lean_empty


def test_the_baseline_of_many_runs_is_their_number_times_one_run(all_measures, monkeypatch):
    monkeypatch.setattr(bench_speed, "time_fastest_call", lambda call, repeats: 2.0)
    (measure,) = of(all_measures, time_many_runs)
    (baseline,) = measure().baselines
    assert baseline.value == 2.0 * 20


def test_the_best_run_after_a_warm_up_counts():
    calls = []
    assert 0.0 <= bench_speed.time_fastest_call(partial(calls.append, 1), 4) < inf
    assert len(calls) == 5


@pytest.mark.parametrize(("value", "is_met"), [(1.0, True), (1.1, False), (nan, False)])
def test_a_target_is_met_up_to_its_bound(value, is_met):
    assert Benchmark("a number", value, "1", 1.0, ()).is_met is is_met


def test_a_peer_is_reported_as_a_ratio_and_a_missing_one_by_name():
    assert [format_baseline(FAST, peer) for peer in FAST.baselines] == [
        "theirs: 5 µs, 2.5 times",
        "absent is not installed",
    ]
    assert len(benchmark_table([FAST]).rows()) == 1


def test_the_csv_holds_every_value_and_the_provenance_every_parameter(tmp_path, user_folder, monkeypatch):
    monkeypatch.chdir(user_folder)
    run_benchmarks([lambda: FAST], tmp_path, lambda name, share: None)
    provenance = json.loads((tmp_path / FOLDER / "provenance.json").read_text())
    assert provenance["parameters"]["smd: c"] == {"value": 2.0, "unit": "N.s/m"}
    with (tmp_path / FOLDER / FILE).open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert [(row["measured"], row["baseline value"]) for row in rows] == [("2e-06", "5e-06"), ("2e-06", "")]


@pytest.mark.skipif(c_host.COMPILER is None, reason="there is no C compiler on this machine: install gcc")
def test_a_native_fmu_is_faster_in_c_and_through_fmpy_than_the_python_one(both_backends):
    for _ in range(3):  # a loaded machine may spoil one measurement, but hardly three
        forget()
        measures = [native.run_in_c("stickslip"), native.step_in_c("stickslip")]
        measures += [native.run_through_fmpy("stickslip"), native.step_through_fmpy("stickslip")]
        slower = [measure for measure in measures if not 0.0 < measure.value < measure.baselines[0].value]
        if not slower:
            break
    assert slower == []
    assert native.largest_error("stickslip", native.time_fmu("stickslip", "native")) < 1e-12


@pytest.mark.skipif(c_host.COMPILER is None, reason="there is no C compiler on this machine: install gcc")
@pytest.mark.parametrize("case", native.RUN_TIME_TARGETS)
def test_the_cvode_fmu_improves_with_its_tolerance_and_the_native_one_is_better(case, both_backends):
    try:
        errors = [native.largest_error(case, native.time_cvode(case, rtol)) for rtol in (1e-4, 1e-6, 1e-8)]
    except c_host.MissingToolError as error:
        pytest.skip(str(error))
    assert 0.1 > errors[0] > 5 * errors[1] > 25 * errors[2] > 0.0
    measure = native.compare_with_cvode(case)
    assert measure.value >= native.largest_error(case, native.time_fmu(case, "native")) / min(errors)
    assert len(measure.baselines) == 4


def test_the_run_time_at_an_error_is_not_that_of_a_lucky_run():
    """Errors 1e-3, 1e-6 by luck, 1e-4, 1e-6 take 1, 2, 4, 8 s."""
    runs = [(1.0, 1e-3), (2.0, 1e-6), (4.0, 1e-4), (8.0, 1e-6)]
    assert stiff.time_at_error(runs, 1e-4) == pytest.approx(2.0)
    assert stiff.time_at_error(runs, 1e-5) == pytest.approx(32.0**0.5)
    assert stiff.time_at_error(runs, 1e-6) == pytest.approx(8.0)
    assert stiff.time_at_error(runs, 1e-7) == inf


@pytest.mark.campaign
@pytest.mark.skipif(c_host.COMPILER is None, reason="there is no C compiler on this machine: install gcc")
def test_radau9_is_faster_than_cvode_at_equal_error(both_backends, monkeypatch):
    monkeypatch.setattr(stiff, "RUN_TIME", 0.0)
    monkeypatch.setattr(stiff, "TOLERANCES", (1e-3, 1e-5, 1e-7, 1e-9, 1e-11))
    (both_backends / "more").mkdir()
    (both_backends / "more" / "lugre.fmu").touch()
    (both_backends / "more" / "native").symlink_to(build_once("lugre", "--native", "--platform", "linux64"))
    for name in (name for name, case in stiff.CASES.items() if case.reference_source):
        errors = (1e-4, 1e-6)
        measures = [stiff.compare_at_equal_error(name, error) for error in errors]
        if "not installed: SUNDIALS" in measures[0].baselines[0].name:
            pytest.skip(measures[0].baselines[0].name)
        for error, measure in zip(errors, measures, strict=True):
            assert 0.0 < measure.value < measure.baselines[0].value
            assert measure.target == pytest.approx(measure.baselines[0].value / stiff.SPEED_RATIOS[error])


def test_missing_tools_are_reported_in_their_row_and_fail_nothing(both_backends, monkeypatch):
    monkeypatch.setattr(c_host, "COMPILER", None)
    shutil.rmtree(both_backends / "native")
    (both_backends / "more").mkdir()
    (both_backends / "more" / "lugre.fmu").touch()
    c_host.build_host.cache_clear()
    native.build_cvode_fmu.cache_clear()
    measures = [native.run_through_fmpy("smd"), native.run_in_c("smd"), native.compare_with_cvode("smd")]
    measures += [stiff.compare_at_equal_error(name, 1e-6) for name in ("pacejka, x_m = 0.01 m/s", "lugre")]
    assert [measure.is_met for measure in measures] == [False] * 5
    assert [measure.baselines[0].name.split(":")[0] for measure in measures] == ["not built"] * 5
    assert measures[-1].baselines[0].name.endswith("(friction-fmus build lugre --native)")
    with pytest.raises(c_host.MissingToolError, match="not installed: a C compiler"):
        native.time_cvode("smd", 1e-6)
    monkeypatch.setattr(c_host, "COMPILER", "false")  # one that finds no header
    with pytest.raises(c_host.MissingToolError, match="not installed: SUNDIALS"):
        native.time_cvode("smd", 1e-6)
    assert "not measured" in "".join(row[3] for row in benchmark_table(measures).rows())


@pytest.mark.skipif(c_host.COMPILER is None, reason="there is no C compiler on this machine: install gcc")
def test_a_run_refused_by_an_fmu_in_c_reports_its_message(both_backends):
    library = c_host.load_library(both_backends / "native" / "stickslip.fmu")
    with pytest.raises(HarnessError, match=r"m = -1\.0 kg is refused"):
        native.time_runs(library, RunSpec(library.file, ("x",), {"m": -1.0}, stop=16.0, equal_steps=10))


EXPLICIT_EVENTS = [
    scene
    for scene in model_exchange.DRIVEN_SCENARIOS
    if not scene.case.problem.is_stiff or str(scene) == "pacejka-0.01, ramps"
]
LATE = [scene for scene in model_exchange.LATE_SCENARIOS if scene.has_ramps and not scene.case.problem.is_stiff]


@pytest.mark.skipif(c_host.COMPILER is None, reason="there is no C compiler on this machine: install gcc")
@pytest.mark.parametrize(
    "scene",
    [
        *model_exchange.DEFAULT_SCENARIOS,
        *(pytest.param(scene, marks=pytest.mark.campaign) for scene in (*EXPLICIT_EVENTS, *LATE)),
    ],
    ids=str,
)
def test_model_exchange_errors_match_cvode_with_explicit_events(scene, both_backends):
    """At most three times as large, also with jumps and ramps of the input and a late start: the error is that of
    the solver."""
    measure = model_exchange.error_ratio_to_cvode(scene, model_exchange.TOLERANCES if scene.is_default else (1e-8,))
    if "not installed: SUNDIALS" in measure.baselines[0].name:
        pytest.skip(measure.baselines[0].name)
    assert measure.target == 3.0
    assert 0.0 < measure.value <= 3.0, measure.baselines


@pytest.mark.parametrize("scene", model_exchange.COMPARED_SCENARIOS, ids=str)
def test_model_exchange_and_co_simulation_agree_and_count_the_same_events(scene, both_backends):
    """Also at ties, where the last bit or physics decides."""
    assert model_exchange.difference_from_cosimulation(scene).is_met


FMUSIM = """#!{python}
# The command line of fmusim 0.8, by its source
import argparse, json
parser = argparse.ArgumentParser(allow_abbrev=False)
simulate = parser.add_subparsers(required=True).add_parser("simulate", allow_abbrev=False)
simulate.add_argument("fmu_file")
for name in ("start-time", "stop-time", "tolerance", "output-interval"):
    simulate.add_argument(f"--{{name}}", type=float)
for name in ("input-file", "output-file"):
    simulate.add_argument(f"--{{name}}")
simulate.add_argument("--start-value", dest="values", action="append", type=lambda text: text.split("=", 1), default=[])
simulate.add_argument("--interface-type", choices=["me", "cs"])
simulate.add_argument("--solver", choices=["euler", "cvode"])
given = parser.parse_args()
open(given.output_file, "w").write("time,{columns}\\n0.0,{row}\\n" + f"{{given.stop_time}},{row}\\n")
given.inputs = open(given.input_file).readline().strip() if given.input_file else ""
json.dump(vars(given), open(__file__ + ".json", "w"))
"""


@pytest.mark.parametrize("number", [0, -1])
def test_fmusim_is_called_by_its_present_command_line(both_backends, tmp_path, monkeypatch, number):
    """Start values are one word, name=value; the last scene has inputs."""
    scenes = [
        scene for scene in (*model_exchange.DEFAULT_SCENARIOS, *model_exchange.DRIVEN_SCENARIOS) if not scene.has_ramps
    ]
    scene, program = scenes[number], tmp_path / "fmusim"
    names = scene.case.run.outputs
    program.write_text(
        FMUSIM.format(python=sys.executable, columns=",".join(names), row=",".join("1.5" for _ in names))
    )
    program.chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path), os.pathsep)
    trajectory = model_exchange.run_fmusim(scene, 1e-8)
    arguments = json.loads((tmp_path / "fmusim.json").read_text())
    assert (arguments["interface_type"], arguments["solver"], arguments["tolerance"]) == ("me", "cvode", 1e-8)
    assert dict(arguments["values"]) == {name: repr(value) for name, value in scene.run.values.items()}
    assert arguments["inputs"] == ",".join(scene.run.inputs or ())
    assert trajectory.columns[names[0]].tolist() == [1.5, 1.5]


@pytest.mark.skipif(c_host.COMPILER is None, reason="there is no C compiler on this machine: install gcc")
def test_a_model_exchange_call_is_timed_against_that_of_a_reference_fmu(both_backends, tmp_path, monkeypatch):
    """A project FMU replaces the Reference FMU, whose sources are not available; the table says so."""
    assert model_exchange.call_overhead("smd").baselines[0].name.startswith("not found: Reference-FMUs")
    sled = c_host.load_library(both_backends / "native" / "stickslip.fmu")
    monkeypatch.setattr(model_exchange, "build_bouncing_ball", lambda acceleration: sled)
    monkeypatch.setattr(model_exchange, "REPEATS", 10)
    monkeypatch.setattr(model_exchange, "BOUNCING_BALL_SIZES", (3, 2))
    monkeypatch.setattr(model_exchange, "BOUNCING_BALL_START", {"x0": 0.1, "v0": 0.3})
    measure = model_exchange.call_overhead("stickslip")
    assert 0.0 < measure.value < 100.0
    assert len(measure.baselines) == 9


REFERENCE_FMU = {  # a Reference FMU with just the files that the benchmark copies and compiles
    "include/model.h": """
typedef struct { double h, v, g, e; } ModelInstance;
typedef int Status;
#define M(variable) comp->variable
Status getDerivatives(ModelInstance *comp, double dx[], size_t nx);
""",
    "BouncingBall/config.h": '#define INSTANTIATION_TOKEN "{1}"',
    "BouncingBall/model.c": """
#include <stddef.h>
#include "model.h"
Status getDerivatives(ModelInstance *comp, double dx[], size_t nx)
{
    dx[0] = M(v);
    dx[1] = M(g);
    return nx != 2;
}
""",
    "src/cosimulation.c": "typedef int nothing;",
    "src/fmi2Functions.c": """
#include <stddef.h>
#include "model.h"
__attribute__((visibility("default"))) double ask(double x, double v, double force, double mass)
{
    ModelInstance it = {x, v, force, mass};
    double dx[2];
    return getDerivatives(&it, dx, 2) || dx[0] != v ? 0.0 : dx[1];
}
""",
}


@pytest.mark.skipif(c_host.COMPILER is None, reason="there is no C compiler on this machine: install gcc")
def test_a_reference_fmu_gets_the_acceleration_of_each_model(tmp_path, monkeypatch):
    for file, text in REFERENCE_FMU.items():
        (tmp_path / file).parent.mkdir(exist_ok=True)
        (tmp_path / file).write_text(text + "\n")
    monkeypatch.setattr(model_exchange, "REFERENCE_FMUS", tmp_path)
    values = {"x": 0.1, "v": 0.3, "force": -2.0, "mass": 4.0}
    for name in model_exchange.MODELS:
        equation = model_exchange.SETTINGS["acceleration"][name]
        ask = ctypes.CDLL(str(model_exchange.build_bouncing_ball(equation).file)).ask
        ask.restype, ask.argtypes = ctypes.c_double, [ctypes.c_double] * len(values)
        assert ask(*values.values()) == pytest.approx(eval(equation, {"sin": sin, "atan": atan, **values}), rel=1e-14)
    model_exchange.build_bouncing_ball.cache_clear()
