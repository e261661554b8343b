"""Run-time benchmarks: best of several runs after a warm-up, with peers in the same process."""

from collections.abc import Callable
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from harness.references import peer_solvers
from harness.references.models import MODELS
from harness.references.models.pacejka import PacejkaProblem
from harness.references.models.smd import SmdProblem
from harness.references.models.stickslip import StickslipProblem
from harness.references.ode_problem import OdeProblem
from harness.scenes.fmu_files import find_fmu
from harness.simulation.embedded_model import EmbeddedModel, create_run, load_model_class
from harness.simulation.fmu_archive import read_description
from harness.simulation.timing import time_call, time_fastest_call

from .. import stepping_loops
from ..stepping_loops import COMMUNICATION_STEPS
from .benchmark import Baseline, Benchmark
from .empty_fmu import build_empty_fmu

RTOL, ATOL = 1e-6, 1e-9
RUNS = 10_000
STEPS = 500  # of a peer, averaged


def speed_benchmarks() -> list[Callable[[], Benchmark]]:
    """Return the run-time benchmarks."""
    sled = load_model_class(find_fmu("stickslip"))
    pacejka = partial(
        time_in_process, "pacejka", load_model_class(find_fmu("pacejka")), "radau9", 8e-3, ("Radau", "BDF")
    )
    return [
        partial(time_in_process, "stickslip", sled, "exact", 0.5e-3, ("RK23", "Adams"), StickslipProblem(), {}),
        *(partial(pacejka, PacejkaProblem(x_m), {"x_m": x_m}) for x_m in (1e-2, 1e-3)),
        partial(time_one_step, load_model_class(find_fmu("smd"))),
        *(partial(time_communication_step, model) for model in MODELS),
        partial(time_many_runs, sled),
    ]


def time_in_process(
    model: str,
    model_class: type,
    method: str,
    target: float,
    peer_methods: tuple[str, str],
    problem: OdeProblem,
    values: dict[str, float],
) -> Benchmark:
    """Measure a run with 1600 points without fmpy; `peer_methods` are those of scipy and CVODE."""
    times = np.linspace(0.0, problem.stop, COMMUNICATION_STEPS + 1)
    embedded_model = EmbeddedModel.create(model_class, values, method, RTOL, ATOL)
    seconds = time_fastest_call(partial(embedded_model.compute_states, times.tolist()), 20)
    baselines = []
    for peer, name in zip(("scipy", "cvode"), peer_methods, strict=True):
        if peer in peer_solvers.missing_packages():
            baselines.append(Baseline(f"{peer} {name}: {peer_solvers.missing_packages()[peer]} is not installed"))
        else:
            solve = partial(peer_solvers.solve, peer, name, problem, times, RTOL, ATOL)
            baselines.append(Baseline(f"{peer} {name} at {RTOL:g}", time_fastest_call(solve, 3)))
    setting = ", ".join([model, *(f"{name} {value:g}" for name, value in values.items()), method])
    return Benchmark(
        f"{setting}: {problem.stop:g} s, {COMMUNICATION_STEPS} points, inside Python",
        seconds,
        "s",
        target,
        tuple(baselines),
    )


def time_one_step(model_class: type) -> Benchmark:
    """Measure one step of ode23 for the smooth model, against scipy's RK23."""
    from scipy.integrate import RK23

    problem, rtol = SmdProblem(), 1e-8
    embedded_model = EmbeddedModel.create(model_class, {}, "ode23", rtol, 1e-3 * rtol)
    seconds = time_fastest_call(partial(embedded_model.compute_states, [0.0, problem.stop]), 10)
    solver = embedded_model.run.solver
    solver.report(embedded_model.run.events)
    peer_solver: Any = RK23(problem.rates(1), 0.0, problem.start, problem.stop, rtol=rtol, atol=1e-3 * rtol)

    def steps() -> None:
        for _ in range(STEPS):
            peer_solver.step()

    peer = Baseline("scipy RK23", time_fastest_call(steps, 5) / STEPS)
    return Benchmark("smd, ode23: one step", seconds / (solver.steps + solver.rejected), "s", 2e-6, (peer,))


def time_communication_step(model: str) -> Benchmark:
    """Measure a communication step through fmpy with all outputs recorded, relative to that of an empty FMU."""
    fmu_file = find_fmu(model)
    with TemporaryDirectory(prefix="fmu-") as folder:
        fmu_description = read_description(find_fmu(model))
        stop = float(fmu_description.defaultExperiment.stopTime)
        variables = fmu_description.modelVariables
        kinds = {v.name: "Integer" if v.type == "Integer" else "Real" for v in variables}
        traits = [(kinds[v.name], v.name, v.causality, v.variability) for v in variables]
        empty_fmu = build_empty_fmu(f"Empty{model.capitalize()}", traits, stop, Path(folder))
        variants = [
            (loop, fmu)
            for loop in (stepping_loops.time_fmpy_loop, stepping_loops.time_direct_loop)
            for fmu in (fmu_file, empty_fmu)
        ]
        rounds = []
        for _ in range(3):  # alternating, so that other load affects all
            rounds.append(
                [stepping_loops.time_per_step(loop(fmu, COMMUNICATION_STEPS), loop(fmu, 1)) for loop, fmu in variants]
            )
    fmpy_time, empty, lean, lean_empty = map(min, zip(*rounds, strict=True))
    baselines = (
        Baseline("this FMU", fmpy_time),
        Baseline("empty pythonfmu FMU", empty),
        Baseline("this FMU in the loop of the harness", lean),
        Baseline("empty pythonfmu FMU in the loop of the harness", lean_empty),
    )
    name = f"{model}: communication step through fmpy, ratio to an empty one"
    return Benchmark(name, fmpy_time / empty, "1", 1.25, baselines)


def time_many_runs(model_class: type) -> Benchmark:
    """Measure 10 000 runs of the sled with different driver speeds: final state and number of events."""
    model = model_class()
    run = create_run(model)
    solver = run.solver

    def run_to_stop(v_driver: float) -> tuple[float, float, int]:
        model.v_driver = v_driver
        model.prepare()
        solver.start(model, 0.0, *model.initial_state(0.0), model.stop_time, model.tolerance)
        solver.advance(model, model.stop_time)
        solver.report(run.events)
        return solver.y_x, solver.y_v, run.events.count

    seconds = time_call(lambda: [run_to_stop(0.02 + 3e-6 * i) for i in range(RUNS)])
    problem = StickslipProblem()
    solve = partial(peer_solvers.solve, "scipy", "RK23", problem, np.array([0.0, problem.stop]), RTOL, ATOL)
    baseline = Baseline(f"scipy RK23 at {RTOL:g}, one run times {RUNS}", RUNS * time_fastest_call(solve, 5))
    return Benchmark(f"stickslip, exact: {RUNS} runs of {problem.stop:g} s, one core", seconds, "s", 10.0, (baseline,))
