"""Two problems from the literature, solved by the runtime and by peer solvers.

1. Block on a belt with friction that decreases with the relative speed (R. I. Leine, Bifurcations in Discontinuous
   Mechanical Systems of Filippov-Type, 2000).
2. Chattering: friction so strong that the mass stops for good within half a second.  With sign(v) no solver finishes;
   with modes it is a single event.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache, partial
from math import sqrt
from pathlib import Path

import numpy as np

from ...errors import HarnessError
from ...process.subprocess_runner import run_module
from ...process.temporary_directory import temporary_directory
from ...references import peer_solvers
from ...references.literature_problems import (
    BeltBlock,
    ChatteringOscillator,
    ChatteringOscillatorSign,
    SmoothedBeltBlock,
)
from ...references.ode_problem import OdeProblem
from ...running.embedded_model import EmbeddedModel, load_model_class, method_numbers
from ...running.solution import Solution
from ...scenes.fmu_files import find_fmu

LIMIT = 20_000  # right-hand side evaluations after which a run counts as failed
RUNTIME, EVENTS = "this runtime", "events"


@dataclass(frozen=True)
class LiteratureRun:
    """One solver: `error` is the larger of the final errors of position (m) and speed (m/s); or the failure."""

    problem: str
    solver: str
    method: str
    rtol: float
    evaluations: int | None
    error: float
    failure: str = ""


# Final state of the block in the frame of the belt.  Two methods at 1e-12 agree in these digits; the published values,
# x = -0.2992525 and v = -0.6308870 in the fixed frame, agree in all their digits.
BLOCK = (-0.29925249924 - 50.0 * 0.2, -0.63088695537 - 0.2)
CLASSIC = (sqrt(125.0) - 10.0, 0.0)  # x = -10 + 10 cos t + 5 sin t until its first turning point
TIGHT = {"RK23": 1e-6, "ode23": 1e-6, "DOP853": 1e-10, "dop853": 1e-10}  # 1e-8 for the others


def solve_all() -> Iterator[LiteratureRun]:
    """Solve both problems with every method of the runtime, then with the peer solvers."""
    name = "block on a belt"
    yield from runtime_runs(name, block_model(), {}, BeltBlock.stop, BLOCK)
    yield from peer_runs(
        name, BeltBlock(), BLOCK, EVENTS, {"scipy": ("RK23", "RK45", "DOP853", "LSODA"), "cvode": ("Adams",)}
    )
    yield from peer_runs(name, SmoothedBeltBlock(), BLOCK, "arctan(1e6 v)", {"scipy": ("RK45", "LSODA")})
    name, values = "chattering classic", {"m": 1.0, "k": 1.0, "f": 10.0, "x0": 0.0, "v0": 5.0}
    yield from runtime_runs(name, load_model_class(find_fmu("coulomb")), values, ChatteringOscillator.stop, CLASSIC)
    yield from peer_runs(name, ChatteringOscillator(), CLASSIC, EVENTS, {"scipy": ("RK23", "RK45", "LSODA")})
    yield from peer_runs(
        name, ChatteringOscillatorSign(), CLASSIC, "plain sign(v)", {"scipy": ("RK23", "RK45", "LSODA", "Radau")}
    )


@cache
def block_model() -> type:
    """Build the FMU of block.py and return the model class in it."""
    with temporary_directory("block-") as folder:
        done = run_module("build_fmus", "", str(Path(__file__).with_name("block.py")), "--out", str(folder))
        if done.returncode:
            raise HarnessError(f"cannot build the block on a belt: {(done.stderr.splitlines() or ['?'])[-1]}")
        return load_model_class(folder / "block.fmu")


def runtime_runs(
    name: str, model: type, values: dict[str, float], stop: float, end: tuple[float, float]
) -> Iterator[LiteratureRun]:
    """Solve a model with every method of the runtime, up to the stop time in s."""
    for method in method_numbers(model):
        rtol = TIGHT.get(method, 1e-8)
        run = EmbeddedModel.create(model, values, method, rtol, 1e-3 * rtol)
        yield make_run(partial(LiteratureRun, name, RUNTIME, method, rtol), partial(run.solve, [0.0, stop]), end)


def peer_runs(
    name: str, problem: OdeProblem, end: tuple[float, float], event_handling: str, methods: dict[str, tuple[str, ...]]
) -> Iterator[LiteratureRun]:
    """Solve a problem with the installed peer solvers."""
    times = np.array([0.0, problem.stop])
    for peer in (peer for peer in methods if peer not in peer_solvers.missing_packages()):
        for method in methods[peer]:
            rtol = TIGHT.get(method, 1e-8)
            solve = partial(
                peer_solvers.solve,
                peer,
                method,
                problem,
                times,
                rtol,
                1e-3 * rtol,
                peer_solvers.limit_evaluations(LIMIT),
            )
            yield make_run(partial(LiteratureRun, name, f"{peer}, {event_handling}", method, rtol), solve, end)


def make_run(
    begin: Callable[..., LiteratureRun], solve: Callable[[], Solution], end: tuple[float, float]
) -> LiteratureRun:
    """Return one row of the table."""
    try:
        answer = solve()
    except HarnessError as error:
        return begin(None, float("nan"), str(error))
    return begin(answer.evaluations, float(np.abs(answer.states[-1] - end).max()))
