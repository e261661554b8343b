"""The benchmark's run times: the best of several after a warm-up, peers in the same run and the same process."""

from collections.abc import Callable
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from ...references import peer_solvers
from ...references.models import MODELS
from ...references.models.pacejka import Pacejka
from ...references.models.smd import Smd
from ...references.models.stickslip import Stickslip
from ...references.ode_problem import OdeProblem
from ...running import stepping_loops
from ...running.description import read_description
from ...running.embedded_model import EmbeddedModel, load_model_class
from ...running.stepping_loops import COMMUNICATION_STEPS
from ...running.timing import time_call, time_fastest_call
from ...scenes.fmu_files import find_fmu
from .benchmark import Baseline, Benchmark
from .empty_fmu import build_empty_fmu

RTOL, ATOL = 1e-6, 1e-9
RUNS = 10_000
STEPS = 500  # of a peer, to take the mean of


def speed_benchmarks() -> list[Callable[[], Benchmark]]:
    """What to measure, in the order of the design's table."""
    sled = load_model_class(find_fmu("stickslip"))
    pacejka = partial(
        time_in_process, "pacejka", load_model_class(find_fmu("pacejka")), "rodas", 8e-3, ("Radau", "BDF")
    )
    return [
        partial(time_in_process, "stickslip", sled, "exact", 0.5e-3, ("RK23", "Adams"), Stickslip(), {}),
        *(partial(pacejka, Pacejka(x_m), {"x_m": x_m}) for x_m in (1e-2, 1e-3)),
        partial(time_one_step, load_model_class(find_fmu("smd"))),
        *(partial(time_communication_step, model) for model in MODELS),
        partial(time_many_runs, sled),
    ]


def time_in_process(
    model: str,
    carried: type,
    method: str,
    reach: float,
    rivals: tuple[str, str],
    problem: OdeProblem,
    values: dict[str, float],
) -> Benchmark:
    """One run with 1600 points, without fmpy; `rivals` are methods of scipy and of CVODE."""
    times = np.linspace(0.0, problem.stop, COMMUNICATION_STEPS + 1)
    mine = EmbeddedModel.create(carried, values, method, RTOL, ATOL)
    seconds = time_fastest_call(partial(mine.compute_states, times.tolist()), 20)
    beside = []
    for peer, name in zip(("scipy", "cvode"), rivals, strict=True):
        if peer in peer_solvers.missing_packages():
            beside.append(Baseline(f"{peer} {name}: {peer_solvers.missing_packages()[peer]} is not installed"))
        else:
            ask = partial(peer_solvers.solve, peer, name, problem, times, RTOL, ATOL)
            beside.append(Baseline(f"{peer} {name} at {RTOL:g}", time_fastest_call(ask, 3)))
    setting = ", ".join([model, *(f"{name} {value:g}" for name, value in values.items()), method])
    return Benchmark(
        f"{setting}: {problem.stop:g} s, {COMMUNICATION_STEPS} points, inside Python",
        seconds,
        "s",
        reach,
        tuple(beside),
    )


def time_one_step(carried: type) -> Benchmark:
    """One step of ode23 on the smooth model, and one of scipy's RK23."""
    from scipy.integrate import RK23

    problem, rtol = Smd(), 1e-8
    mine = EmbeddedModel.create(carried, {}, "ode23", rtol, 1e-3 * rtol)
    seconds = time_fastest_call(partial(mine.compute_states, [0.0, problem.stop]), 10)
    solver = mine.model.solver
    solver.report(mine.model.events)
    rival: Any = RK23(problem.rates(1), 0.0, problem.start, problem.stop, rtol=rtol, atol=1e-3 * rtol)

    def steps() -> None:
        for _ in range(STEPS):
            rival.step()

    peer = Baseline("scipy RK23", time_fastest_call(steps, 5) / STEPS)
    return Benchmark("smd, ode23: one step", seconds / (solver.steps + solver.rejected), "s", 2e-6, (peer,))


def time_communication_step(model: str) -> Benchmark:
    """A communication step through fmpy with all outputs recorded, as a multiple of that of an empty FMU."""
    mine = find_fmu(model)
    with TemporaryDirectory(prefix="fmu-") as folder:
        found = read_description(find_fmu(model))
        stop = float(found.defaultExperiment.stopTime)
        variables = found.modelVariables
        kinds = {v.name: "Integer" if v.type == "Integer" else "Real" for v in variables}
        traits = [(kinds[v.name], v.name, v.causality, v.variability) for v in variables]
        nothing = build_empty_fmu(f"Empty{model.capitalize()}", traits, stop, Path(folder))
        ways = [
            (loop, fmu)
            for loop in (stepping_loops.time_fmpy_loop, stepping_loops.time_direct_loop)
            for fmu in (mine, nothing)
        ]
        turns = []
        for _ in range(3):  # in turns: what else runs on the machine hits all
            turns.append(
                [stepping_loops.time_per_step(loop(fmu, COMMUNICATION_STEPS), loop(fmu, 1)) for loop, fmu in ways]
            )
    usual, empty, lean, lean_empty = map(min, zip(*turns, strict=True))
    beside = (
        Baseline("this FMU", usual),
        Baseline("empty pythonfmu FMU", empty),
        Baseline("this FMU in the harness's loop", lean),
        Baseline("empty pythonfmu FMU there", lean_empty),
    )
    what = f"{model}: communication step through fmpy, ratio to an empty one"
    return Benchmark(what, usual / empty, "1", 1.25, beside)


def time_many_runs(carried: type) -> Benchmark:
    """10 000 runs of the sled with as many speeds of the driver: final state and number of events."""
    model = carried()
    solver = model.solver

    def one(v_driver: float) -> tuple[float, float, int]:
        model.v_driver = v_driver
        model.prepare()
        solver.start(model, 0.0, *model.initial_state(0.0), model.stop_time, model.tolerance)
        solver.advance(model, model.stop_time)
        solver.report(model.events)
        return solver.x, solver.v, model.events.count

    seconds = time_call(lambda: [one(0.02 + 3e-6 * i) for i in range(RUNS)])
    problem = Stickslip()
    ask = partial(peer_solvers.solve, "scipy", "RK23", problem, np.array([0.0, problem.stop]), RTOL, ATOL)
    rival = Baseline(f"scipy RK23 at {RTOL:g}, one run times {RUNS}", RUNS * time_fastest_call(ask, 5))
    return Benchmark(f"stickslip, exact: {RUNS} runs of {problem.stop:g} s, one core", seconds, "s", 10.0, (rival,))
