"""Work-precision: what accuracy costs, in run time and in right-hand sides, for every method, law and peer.

As in the SciML benchmarks: the relative and the absolute tolerance are swept together, the time is the best of
several runs after a warm-up, and a run that failed is a gap.  Every solver answers at the same common points.
Errors are relative to the largest of the motion (see reference.py).  Integration error is that against the true
solution of the run's own law; `beside_dry` is the whole error, that of the law included.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from math import isnan, nan
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from ...errors import HarnessError
from ...references import peer_solvers
from ...references.certification import certify_default_run
from ...references.certified_reference import ReferenceCase, compute_errors, load_reference
from ...references.models import CASES
from ...references.ode_problem import UnspecifiedProblem
from ...running import fmi3
from ...running.embedded_model import EmbeddedModel, load_model_class, method_numbers
from ...running.fmi2 import simulate
from ...running.run_spec import RunSpec
from ...running.solution import Solution
from ...running.timing import time_call
from ...scenes.fmu_files import find_fmu

MAX_REPEATS = 20  # timed runs of one point

FMU, FMPY = "FMU", "fmpy"  # the FMU's own code in this process; the FMU through fmpy
CS, ME = "FMI 3.0 CS", "FMI 3.0 ME"  # the FMI 3.0 FMU through fmpy, in co-simulation and in model exchange
FMI3_INTERFACES = {CS: fmi3.CO_SIMULATION, ME: fmi3.MODEL_EXCHANGE}


@dataclass(frozen=True)
class SweepSettings:
    """How far a sweep goes: `timeout` in s is for one run, and where one takes longer tighter ones are not tried;
    `budget` in s is for the timed runs of one point; solvers are told apart by run times that differ `clear` times."""

    tolerances: tuple[float, ...]
    timeout: float
    budget: float
    min_ratio: float = 0.0


FULL = SweepSettings(tuple(float(f"1e-{n}") for n in range(2, 13)), 0.5, 0.04)
QUICK = SweepSettings((1e-3, 1e-6, 1e-9), 0.1, 0.005, min_ratio=1.5)


@dataclass(frozen=True)
class Point:
    """One solver at one tolerance (rtol NaN for a closed form; either NaN for the FMU's own choice): run time in s,
    right-hand sides and Jacobians, errors as in reference.Errors, the largest error beside dry friction; or the
    failure, and no numbers."""

    case: str
    tool: str
    method: str
    rtol: float
    atol: float
    seconds: float = nan
    evaluations: int | None = None
    final: float = nan
    rms: float = nan
    largest: float = nan
    events: float | None = None
    beside_dry: float | None = None
    failure: str = ""


@dataclass(frozen=True)
class SolverJob:
    """How one solver is asked: `run(rtol, extent)` gives its answer and the run time in s, None if there is nothing
    to ask.  `absolute` is atol as a share of rtol, NaN for the FMU's own choice; to fail is an error where `must` is
    set, else a gap.  Where it is not `swept` it is asked once, with rtol 0."""

    tool: str
    method: str
    absolute: float
    run: Callable[[float, SweepSettings], tuple[Solution, float] | None]
    must_succeed: bool = False
    is_swept: bool = True


@dataclass(frozen=True)
class Study:
    """All points of one model, its cases in order."""

    model: str
    cases: tuple[ReferenceCase, ...]
    points: tuple[Point, ...]

    def curve(self, case: ReferenceCase, tool: str, method: str) -> list[Point]:
        """The points of one solver that did not fail, in the order of the sweep."""
        mine = (case.name, tool, method)
        return [p for p in self.points if (p.case, p.tool, p.method) == mine and not p.failure]

    def solvers(self, case: ReferenceCase) -> list[tuple[str, str]]:
        """Tool and method of every curve of a case, in order."""
        return list(dict.fromkeys((point.tool, point.method) for point in self.points if point.case == case.name))

    def exchange_errors(self) -> dict[float, dict[str, float]]:
        """By relative tolerance, the largest error of every case in model exchange, NaN where that failed; nothing
        where the FMI 3.0 FMU is not built."""
        found: dict[float, dict[str, float]] = {}
        for point in self.points:
            if point.tool == ME and not isnan(point.rtol):
                found.setdefault(point.rtol, {})[point.case] = point.largest
        return found


def study_model(model: str, extent: SweepSettings, report: Callable[[float], None]) -> Study:
    """Sweep every case of a model, of ours by its name or of anybody by the path of its file; told how far it is as a
    share."""
    file = find_fmu(model)
    carried = load_model_class(file)
    cases = tuple(case for case in CASES if case.model == model) or (default_case(model, file, carried),)
    work = [(case, job) for case in cases for job in solver_jobs(case, carried, file)]
    points: list[Point] = []
    for done, (case, job) in enumerate(work):
        points += sweep_tolerances(case, job, extent)
        report((done + 1) / len(work))
    return Study(file.stem, cases, tuple(points))


def default_case(model: str, file: Path, carried: Any) -> ReferenceCase:
    """The default run of a model that nobody has written a second time: its certified result lies beside the file, or
    two methods agree about it."""
    beside = file.with_suffix(".csv").is_file()
    truth = load_reference(file.stem, file.parent) if beside else certify_default_run(carried, file)
    law, outputs = "default run", tuple(carried.states)
    return ReferenceCase(file.stem, model, law, truth, UnspecifiedProblem(float(truth.times[-1])), outputs=outputs)


@dataclass(frozen=True)
class CaseRunner:
    """The ways to ask about a case: the model that its FMU carries, that FMU in a file, its sibling, and peers.  Each
    takes rtol and an extent, and gives the answer with the run time in s."""

    case: ReferenceCase
    carried: Any
    file: Path

    @property
    def times(self) -> np.ndarray:
        return self.case.reference.times

    def run_inside(
        self, method: str, taken: dict[float, float], rtol: float, extent: SweepSettings
    ) -> tuple[Solution, float]:
        """The FMU's own code, in this process."""
        run, times = EmbeddedModel.create(self.carried, self.case.values, method, rtol), self.times.tolist()
        answer = run.solve(times, extent.timeout)
        taken[rtol] = best_time(partial(run.compute_states, times), extent.budget)
        return answer, taken[rtol]

    def run_through_fmpy(
        self, method: str, taken: dict[float, float], rtol: float, extent: SweepSettings
    ) -> tuple[Solution, float] | None:
        """The FMU through fmpy, states recorded; only where it did not fail without fmpy, then it must not."""
        if rtol not in taken:
            return None
        outputs, tolerance = self.case.outputs, {"solver.rtol": rtol} if rtol else {}
        values: dict[str, float | str] = {**self.case.values, **tolerance, "solver.method": method}
        grid, repeat = float(self.times[1]), repeats(taken[rtol], extent.budget)
        run = simulate(RunSpec(self.file, outputs, values, grid=grid, follow=False, repeat=repeat))
        assert run.statistics  # ours tell it
        columns = np.column_stack([run.columns[name] for name in outputs])
        return Solution(columns, None, run.statistics.evaluations), run.statistics.seconds

    def run_fmi3(self, tool: str, rtol: float, extent: SweepSettings) -> tuple[Solution, float]:
        """The FMI 3.0 FMU through fmpy, states recorded, and in model exchange every change of mode; the run time is
        that of fmpy's simulate_fmu on a live instance.  In co-simulation the FMU never hears of the tolerance."""
        outputs, stop, step = self.case.outputs, float(self.times[-1]), float(self.times[1])
        marks = tuple(self.carried.contacts) if tool == ME and self.case.reference.modes else ()
        with fmi3.open_fmi3_instance(fmi3.fmi3_path(self.file), FMI3_INTERFACES[tool]) as fmu:
            run = partial(fmu.simulate, self.case.values, outputs + marks, stop, step, rtol or None)
            found = run(extent.timeout)
            seconds = best_time(run, extent.budget)
        events = found.find_changes(*marks) if marks else None
        return Solution(found.sample_at(self.times, outputs), events, found.evaluations), seconds

    def run_peer(self, peer: str, method: str, rtol: float, extent: SweepSettings) -> tuple[Solution, float]:
        """Somebody else's solver."""
        problem = self.case.problem
        ask = partial(peer_solvers.solve, peer, method, problem, self.times, rtol, problem.atol_factor * rtol)
        return ask(peer_solvers.limit_run_time(extent.timeout)), best_time(ask, extent.budget)


def solver_jobs(case: ReferenceCase, carried: Any, file: Path) -> Iterator[SolverJob]:
    """Every solver that is asked about a case."""
    ask, absolute = CaseRunner(case, carried, file), case.problem.atol_factor
    for method in method_numbers(carried):
        if not (method == "exact" and case.is_chattering):
            taken: dict[float, float] = {}  # run time in s by rtol, from the first of the two for the second
            is_swept = method != "exact"
            yield SolverJob(FMU, method, nan, partial(ask.run_inside, method, taken), is_swept=is_swept)
            yield SolverJob(FMPY, method, nan, partial(ask.run_through_fmpy, method, taken), True, is_swept)
    if not case.is_chattering:
        usual = {number: name for name, number in method_numbers(carried).items()}[carried().solver.method]
        for tool, method, is_swept in ((CS, usual, False), (ME, "fmpy's CVode", fmi3.fmi3_path(file).is_file())):
            yield SolverJob(tool, method, nan, partial(ask.run_fmi3, tool), is_swept=is_swept)
        absent = (
            peer_solvers.PACKAGES if isinstance(case.problem, UnspecifiedProblem) else peer_solvers.missing_packages()
        )
        for peer, methods in (
            ("scipy", peer_solvers.SCIPY),
            ("cvode", ("BDF",) if case.problem.is_stiff else ("Adams",)),
        ):
            for method in methods if peer not in absent else ():
                yield SolverJob(peer, method, absolute, partial(ask.run_peer, peer, method))


def sweep_tolerances(case: ReferenceCase, job: SolverJob, extent: SweepSettings) -> Iterator[Point]:
    """One solver over all tolerances, from loose to tight."""
    truth, dry = case.reference, load_reference(case.dry_friction_reference) if case.dry_friction_reference else None
    given_up = ""
    for rtol in extent.tolerances if job.is_swept else (nan,):
        point = partial(Point, case.name, job.tool, job.method, rtol, job.absolute * rtol)
        if given_up:
            yield point(failure=f"not tried: {given_up}")
            continue
        begun = perf_counter()
        try:
            found = job.run(0.0 if isnan(rtol) else rtol, extent)
        except HarnessError as error:
            if job.must_succeed:
                raise
            if perf_counter() - begun > 0.5 * extent.timeout:
                given_up = f"at rtol {rtol:g} it was only {error}"
            yield point(failure=str(error))
            continue
        if not found:
            continue
        answer, seconds = found
        beside_dry = compute_errors(answer, dry).largest if dry else None
        yield point(seconds, answer.evaluations, **vars(compute_errors(answer, truth)), beside_dry=beside_dry)


def best_time(call: Callable[[], object], budget: float) -> float:
    """The time of the fastest of several calls, in s."""
    found = [time_call(call)]
    found += [time_call(call) for _ in range(repeats(found[0], budget) - 1)]
    return min(found)


def repeats(once: float, budget: float) -> int:
    """How often to run what takes `once` s within the budget in s."""
    return 1 if once > 4 * budget else max(2, min(MAX_REPEATS, int(budget / once)))
