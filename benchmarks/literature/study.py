"""Problems from the literature, solved by the runtime; the first two by peer solvers, too.

1. Block on a belt with friction that decreases with the relative speed (R. I. Leine, Bifurcations in Discontinuous
   Mechanical Systems of Filippov-Type, 2000).
2. Chattering: friction so strong that the mass stops for good within half a second.  With sign(v) no solver finishes;
   with modes it is a single event.
3. Stick-slip in closed form (E. Rabinowicz, Friction and Wear of Materials, chapter 4).
4. Stick-slip with LuGre friction, a stiff problem with a kink (C. Canudas de Wit et al., 1995).
5. Steady forced motion, with and without stops (J. P. Den Hartog, 1931).
6. Two sleds in a row, each with stick and slip.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import astuple, dataclass, fields
from functools import partial
from math import pi, sqrt
from pathlib import Path

import numpy as np

from benchmarks import command_line
from benchmarks.references.den_hartog import SteadyMotion, steady_motion_with_stops, steady_motion_without_stops
from harness.errors import HarnessError
from harness.references import peer_solvers
from harness.references.certified_reference import FOLDER, load_reference
from harness.references.ode_problem import OdeProblem
from harness.results.files import column_heading, write_csv_rows
from harness.results.folder import replace_folder
from harness.results.provenance import write_provenance
from harness.results.summary import Summary, SummaryTable, write_summary
from harness.scenes.fmu_files import find_fmu
from harness.simulation.embedded_model import EmbeddedModel, load_model_class, load_more_model, method_numbers
from harness.simulation.solution import Solution

from .problems import BeltBlock, ChatteringOscillator, ChatteringOscillatorSign, SmoothedBeltBlock

RESULT_FOLDER, FILE = Path("precision") / "literature", "final-errors.csv"  # beside the results of precision
UNITS = {"rtol": "1", "error": "SI"}  # of columns; SI means m and m/s
LIMIT = 20_000  # right-hand side evaluations after which a run counts as failed
RUNTIME, EVENTS = "this runtime", "events"


@dataclass(frozen=True)
class LiteratureRun:
    """One solver: `error` is the largest of the final errors of positions (m) and speeds (m/s); or the failure."""

    problem: str
    solver: str
    method: str
    rtol: float
    evaluations: int | None
    error: float
    failure: str = ""


# Final state of the block.  Two methods at 1e-12 agree in these digits; the published values, x = -0.2992525 and
# v = -0.6308870, agree in all their digits.
BLOCK = (-0.29925249924, -0.63088695537)
BLOCK_ON_BELT = (BLOCK[0] - 50.0 * 0.2, BLOCK[1] - 0.2)  # in the frame of the belt
SLIDING = {"m": 1.0, "k": 100.0, "f": 2.0, "P": 10.0, "Omega": 8.0}  # forced motion without stops
STOPPING = {"m": 1.0, "k": 100.0, "f": 6.0, "P": 10.0, "Omega": 5.0}  # and with two in each period
PERIODS = 20  # of the forced motion
CLASSIC = (sqrt(125.0) - 10.0, 0.0)  # x = -10 + 10 cos t + 5 sin t until its first turning point
TIGHT = {"RK23": 1e-6, "ode23": 1e-6, "DOP853": 1e-10, "dop853": 1e-10}  # 1e-8 for the others


def run_literature(out: Path) -> list[LiteratureRun]:
    """Solve all problems and write the results to out/precision/literature."""
    with replace_folder(out / RESULT_FOLDER, [FILE]) as folder:
        runs = list(solve_all())
        write_literature(runs, folder)
    return runs


def write_literature(runs: Sequence[LiteratureRun], folder: Path) -> None:
    """Write the table of the literature problems, its provenance and its summary."""
    headings = [column_heading(field.name, UNITS.get(field.name, "")) for field in fields(LiteratureRun)]
    cells = [[None if value != value else value for value in astuple(run)] for run in runs]
    write_csv_rows(folder / FILE, headings, cells)
    write_provenance(folder, [], command=command_line())
    rows = (
        ["" if value is None else f"{value:.4g}" if isinstance(value, float) else value for value in row]
        for row in cells
    )
    table = SummaryTable(tuple(headings), tuple(tuple(map(str, row)) for row in rows))
    write_summary(folder, Summary("precision", "Problems from the literature", tables=(table,)))


def solve_all() -> Iterator[LiteratureRun]:
    """Solve all problems with every method of the runtime, the first two with the peer solvers as well."""
    name = "block on a belt"
    yield from runtime_runs(name, load_more_model("belt"), {}, BeltBlock.stop, BLOCK)
    yield from peer_runs(
        name, BeltBlock(), BLOCK_ON_BELT, EVENTS, {"scipy": ("RK23", "RK45", "DOP853", "LSODA"), "cvode": ("Adams",)}
    )
    yield from peer_runs(name, SmoothedBeltBlock(), BLOCK_ON_BELT, "arctan(1e6 v)", {"scipy": ("RK45", "LSODA")})
    name, values = "chattering classic", {"m": 1.0, "k": 1.0, "f": 10.0, "x0": 0.0, "v0": 5.0}
    yield from runtime_runs(name, load_model_class(find_fmu("coulomb")), values, ChatteringOscillator.stop, CLASSIC)
    yield from peer_runs(name, ChatteringOscillator(), CLASSIC, EVENTS, {"scipy": ("RK23", "RK45", "LSODA")})
    yield from peer_runs(
        name, ChatteringOscillatorSign(), CLASSIC, "plain sign(v)", {"scipy": ("RK23", "RK45", "LSODA", "Radau")}
    )

    yield from certified_runs("stick-slip in closed form", load_model_class(find_fmu("stickslip")), "stickslip")
    yield from certified_runs("stick-slip with LuGre friction", load_more_model("lugre"), "more/lugre")
    yield from forced_runs("forced motion without stops", steady_motion_without_stops(**SLIDING), SLIDING)
    yield from forced_runs("forced motion with stops", steady_motion_with_stops(**STOPPING), STOPPING)
    yield from certified_runs("two sleds in a row", load_more_model("sleds"), "more/sleds")


def certified_runs(name: str, model: type, reference: str) -> Iterator[LiteratureRun]:
    """Solve the default run of a model with every method, and compare it with its certified result."""
    truth = load_reference(reference, FOLDER)
    yield from runtime_runs(name, model, {}, float(truth.times[-1]), tuple(truth.states[-1]))


def forced_runs(name: str, steady: SteadyMotion, values: dict[str, float]) -> Iterator[LiteratureRun]:
    """Solve forced motion with every method over some periods, from its largest displacement on."""
    values, stop = values | {"x0": steady.amplitude, "angle0": steady.phase}, 2.0 * PERIODS * pi / values["Omega"]
    yield from runtime_runs(name, load_more_model("forced"), values, stop, (steady.amplitude, 0.0))


def runtime_runs(
    name: str, model: type, values: dict[str, float], stop: float, end: tuple[float, ...]
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
    begin: Callable[..., LiteratureRun], solve: Callable[[], Solution], end: tuple[float, ...]
) -> LiteratureRun:
    """Return one row of the table."""
    try:
        answer = solve()
    except HarnessError as error:
        return begin(None, float("nan"), str(error))
    return begin(answer.evaluations, float(np.abs(answer.states[-1] - end).max()))
