"""Problems from the literature, solved by the runtime; the first two by peer solvers, too.

They are an oscillator that chatters, and a block on a belt.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import astuple, dataclass, fields
from functools import partial
from math import atan, copysign, fabs, pi, sqrt
from pathlib import Path

import numpy as np

from benchmarks import command_line
from benchmarks.references.den_hartog import SteadyMotion, steady_motion_with_stops, steady_motion_without_stops
from harness.errors import HarnessError
from harness.references import peer_solvers
from harness.references.certified_reference import FOLDER, load_reference
from harness.references.models.coulomb import CoulombProblem
from harness.references.ode_problem import JacobianFunction, OdeProblem, RhsFunction
from harness.results.files import column_heading, write_csv_rows
from harness.results.folder import replace_folder
from harness.results.provenance import write_provenance
from harness.results.quantity import format_power
from harness.results.summary import ResultColumn, ResultTable, Summary, SummaryTable, write_summary
from harness.scenes.fmu_files import find_fmu
from harness.simulation.embedded_model import EmbeddedModel, load_model_class, load_more_model, method_numbers
from harness.simulation.solution import Solution


class ChatteringOscillator(CoulombProblem):
    """Classic chattering problem: strong friction stops the mass within half a second and holds it."""

    start, stop = (0.0, 5.0), 10.0 * pi
    m, k, f = 1.0, 1.0, 10.0


class ChatteringOscillatorSign(ChatteringOscillator):
    """The same problem with sign(v): one equation without modes, in which the mass never stops."""

    has_dry_friction = False

    def rates(self, mode: int) -> RhsFunction:
        return lambda t, y: (y[1], -y[0] - (copysign(10.0, y[1]) if y[1] else 0.0))

    jacobian = OdeProblem.jacobian


class BeltBlock(OdeProblem):
    """Block on a belt (R. I. Leine, Bifurcations in Discontinuous Mechanical Systems of Filippov-Type, 2000).

    m = k = F_s = 1 in SI units.  In the frame of the belt, y = x - 0.2 t, the block sticks where its velocity is zero:

    y'' = -(y + 0.2 t) - sign(v)/(1 + 3 |v|),    stuck while |y + 0.2 t| <= 1
    """

    start, stop, has_dry_friction = (1.067, -0.2), 50.0, True

    def rates(self, mode: int) -> RhsFunction:
        return lambda t, y: (y[1], -(y[0] + 0.2 * t) - mode / (1 + 3 * mode * y[1]))

    def jacobian(self, mode: int) -> JacobianFunction | None:
        return lambda t, y: [[0.0, 1.0], [-1.0, 3 / (1 + 3 * mode * y[1]) ** 2]]

    def static_load(self, t: float, x: float) -> tuple[float, float, float]:
        return -(x + 0.2 * t), -0.2, 1.0


class SmoothedBeltBlock(BeltBlock):
    """Block on a belt with friction smoothed to a steep arctan: it creeps where it should stick."""

    has_dry_friction = False
    steepness = 1e6  # s/m

    def rates(self, mode: int) -> RhsFunction:
        share, steepness = 2 / pi, self.steepness
        return lambda t, y: (
            y[1],
            -(y[0] + 0.2 * t) - share * atan(steepness * y[1]) / (1 + 3 * fabs(y[1])),
        )

    jacobian = OdeProblem.jacobian


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


COLUMNS = (
    ResultColumn("solver", "{0.solver}", is_text=True),
    ResultColumn("method", "{0.method}", is_text=True),
    ResultColumn("rtol", lambda run: format_power(run.rtol)),
    ResultColumn("calls", lambda run: "-" if run.evaluations is None else str(run.evaluations)),
    ResultColumn("error [SI]", lambda run: run.failure or f"{run.error:.1e}"),
)


def literature_table(runs: Sequence[LiteratureRun]) -> ResultTable:
    """Return the table of literature problems."""
    title = "problems from the literature: right-hand side calls and final error"
    return ResultTable(runs, COLUMNS, title, group=lambda run: (run.problem,))
