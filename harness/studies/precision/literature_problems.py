"""External anchors: two problems of other people, solved by the runtime, with the peers beside it.

1. The block on a belt, whose friction falls with the relative speed (R. I. Leine, Bifurcations in Discontinuous
   Mechanical Systems of Filippov-Type, 2000).
2. The chattering classic: friction so strong that the mass stops for good within half a second.  As plain sign(v)
   it never comes to an end, with any solver; with modes it is one event.
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

LIMIT = 20_000  # right-hand sides after which a run counts as without end
RUNTIME, EVENTS = "this runtime", "events"


@dataclass(frozen=True)
class LiteratureRun:
    """One solver: `error` is the larger of those of position (m) and speed (m/s) at the end; or the failure."""

    problem: str
    solver: str
    method: str
    rtol: float
    evaluations: int | None
    error: float
    failure: str = ""


# End of the block in the belt's frame; two methods at 1e-12 agree in these digits, and the published figures, x =
# -0.2992525 and v = -0.6308870 in the room's frame, in all of theirs.
BLOCK = (-0.29925249924 - 50.0 * 0.2, -0.63088695537 - 0.2)
CLASSIC = (sqrt(125.0) - 10.0, 0.0)  # x = -10 + 10 cos t + 5 sin t up to its first turning point
TIGHT = {"RK23": 1e-6, "ode23": 1e-6, "DOP853": 1e-10, "dop853": 1e-10}  # and 1e-8 for the others


def solve_all() -> Iterator[LiteratureRun]:
    """Both anchors with every method of the runtime, then with the peers."""
    name = "block on a belt"
    yield from runtime(name, block_model(), {}, BeltBlock.stop, BLOCK)
    yield from others(
        name, BeltBlock(), BLOCK, EVENTS, {"scipy": ("RK23", "RK45", "DOP853", "LSODA"), "cvode": ("Adams",)}
    )
    yield from others(name, SmoothedBeltBlock(), BLOCK, "arctan(1e6 v)", {"scipy": ("RK45", "LSODA")})
    name, values = "chattering classic", {"m": 1.0, "k": 1.0, "f": 10.0, "x0": 0.0, "v0": 5.0}
    yield from runtime(name, load_model_class(find_fmu("coulomb")), values, ChatteringOscillator.stop, CLASSIC)
    yield from others(name, ChatteringOscillator(), CLASSIC, EVENTS, {"scipy": ("RK23", "RK45", "LSODA")})
    yield from others(
        name, ChatteringOscillatorSign(), CLASSIC, "plain sign(v)", {"scipy": ("RK23", "RK45", "LSODA", "Radau")}
    )


@cache
def block_model() -> type:
    """The model of the block, inside the FMU that is built of block.py on the spot."""
    with temporary_directory("block-") as folder:
        done = run_module("build_fmus", "", str(Path(__file__).with_name("block.py")), "--out", str(folder))
        if done.returncode:
            raise HarnessError(f"the block on a belt cannot be built: {(done.stderr.splitlines() or ['?'])[-1]}")
        return load_model_class(folder / "block.fmu")


def runtime(
    name: str, model: type, values: dict[str, float], stop: float, end: tuple[float, float]
) -> Iterator[LiteratureRun]:
    """Every method that the runtime offers for a model, up to the stop in s."""
    for method in method_numbers(model):
        rtol = TIGHT.get(method, 1e-8)
        run = EmbeddedModel.create(model, values, method, rtol, 1e-3 * rtol)
        yield row(partial(LiteratureRun, name, RUNTIME, method, rtol), partial(run.solve, [0.0, stop]), end)


def others(
    name: str, problem: OdeProblem, end: tuple[float, float], way: str, methods: dict[str, tuple[str, ...]]
) -> Iterator[LiteratureRun]:
    """The peers that are installed."""
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
            yield row(partial(LiteratureRun, name, f"{peer}, {way}", method, rtol), solve, end)


def row(begin: Callable[..., LiteratureRun], solve: Callable[[], Solution], end: tuple[float, float]) -> LiteratureRun:
    """One line of the table."""
    try:
        answer = solve()
    except HarnessError as error:
        return begin(None, float("nan"), str(error))
    return begin(answer.evaluations, float(np.abs(answer.states[-1] - end).max()))
