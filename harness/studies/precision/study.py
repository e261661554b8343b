"""Work-precision studies: run time and right-hand side evaluations over the error, for every method, law and peer.

As in the SciML benchmarks, relative and absolute tolerance are varied together, the run time is the best of several
runs after a warm-up, and a failed run is a gap.  All solvers are evaluated at the same times.  Errors are relative to
the largest value of the motion.  The integration error refers to the exact solution for the friction law of the run;
`beside_dry` is the total error against dry friction, which includes the error of the law.

The error of an approximate friction law against true stick and slip is measured beside the integration error within the
law.  It quantifies published observations: with the magic formula the sled creeps instead of sticking, and its
acceleration is not symmetric; bristles creep, too.  The law sign has no model error: in the limit of small steps it is
dry friction (A. F. Filippov, Differential Equations with Discontinuous Righthand Sides, 1988).  Bristles and a block
that sticks are compared in one scene, as by D. A. Haessig and B. Friedland, On the modeling and simulation of friction,
J. Dyn. Syst. Meas. Control 113 (1991) 354-362.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from math import isnan, nan
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from ...analyses.slip import upward_crossings
from ...errors import HarnessError, install_command
from ...references import peer_solvers
from ...references.certification import solve_by_two_methods
from ...references.certified_reference import POINTS, ReferenceCase, compute_errors, load_reference
from ...references.models import CASES
from ...references.ode_problem import OdeProblem, RhsFunction, UnspecifiedProblem
from ...references.peer_solvers import CS, FMPY, FMU, ME, missing_packages
from ...scenes.fmu_files import build_command, find_fmu, fmi3_path
from ...scenes.run_spec import RunSpec
from ...simulation.embedded_model import EmbeddedModel, load_model_class, load_more_model, method_numbers
from ...simulation.runner import run_own_fmu
from ...simulation.signals import Signals, sample_at
from ...simulation.solution import Solution
from ...simulation.timing import time_call
from .result import LawDeviation, Point, PrecisionCase, PrecisionResult

MAX_REPEATS = 20  # maximum number of timed runs per point
FINE = 16001  # points used to find peaks and slips
TOLERANCE = 1e-8
CHATTERING_METHOD = "ode45"  # the closed form covers the hybrid law only
BRISTLES = {"lugre": "LuGre", "elastoplastic": "elasto-plastic"}  # models of fmus/more and their laws


@dataclass(frozen=True)
class SweepSettings:
    """Extent of a study.

    Attributes
    ----------
    tolerances
        Relative tolerances, from loose to tight.
    timeout
        Time limit of a run in s; after a slower one, tighter tolerances are skipped.
    budget
        Time in s for the repeated runs of one point.
    min_ratio
        Ratio of run times from which solvers are distinguished.
    """

    tolerances: tuple[float, ...]
    timeout: float
    budget: float
    min_ratio: float = 0.0


FULL = SweepSettings(tuple(float(f"1e-{n}") for n in range(2, 13)), 0.5, 0.04)
QUICK = SweepSettings((1e-3, 1e-6, 1e-9), 0.1, 0.005, min_ratio=1.5)


@dataclass(frozen=True)
class SolverJob:
    """Runs of one solver.

    Attributes
    ----------
    tool, method
        Solver.
    absolute
        Ratio of atol to rtol; NaN for that of the FMU.
    run
        Function of rtol and settings; returns the solution and the run time in s, or None to skip.
    must_succeed
        Whether a failed run is an error; otherwise it is a gap.
    is_swept
        Whether the tolerance varies; otherwise there is one run with rtol 0.
    """

    tool: str
    method: str
    absolute: float
    run: Callable[[float, SweepSettings], tuple[Solution, float] | None]
    must_succeed: bool = False
    is_swept: bool = True


def measure_precision(model: str, settings: SweepSettings, report: Callable[[float], None]) -> PrecisionResult:
    """Measure error against run time of a model, given by name or by the path of its file.

    Parameters
    ----------
    report : callable
        Receives the finished share.
    """
    file = find_fmu(model)
    model_class = load_model_class(file)
    cases = tuple(case for case in CASES if case.model == model) or (default_case(model, file, model_class),)
    tasks = [(case, job) for case in cases for job in solver_jobs(case, model_class, file)]
    points: list[Point] = []
    for index, (case, job) in enumerate(tasks):
        points += sweep_tolerances(case, job, settings)
        report((index + 1) / len(tasks))
    measured_cases = tuple(
        PrecisionCase(case.name, case.law, dict(case.run.values), case.is_chattering) for case in cases
    )
    deviations = [compare_with_dry_friction(case, model_class) for case in cases if case.dry_friction_reference]
    if model == "stickslip":
        deviations += [compare_bristles(name, law, load_more_model(name)) for name, law in BRISTLES.items()]
    notes = describe_failures(file.stem, points)
    return PrecisionResult(file.stem, measured_cases, tuple(points), tuple(deviations), settings.min_ratio, notes)


def describe_failures(model: str, points: Sequence[Point]) -> tuple[str, ...]:
    """Return sentences on the runs that failed, that were not built, and on solvers that are not installed."""
    runs = [point for point in points if not (point.failure and isnan(point.rtol))]
    n_failed = sum(bool(point.failure) for point in runs)
    counts = [f"{model}: {n_failed} of {len(runs)} runs failed; see {model}/points.csv"] * bool(n_failed)
    reasons = [*dict.fromkeys(point.failure for point in points if point.failure and isnan(point.rtol))]
    if packages := missing_packages():
        names = ", ".join(f"{package} ({peer})" for peer, package in packages.items())
        reasons.append(f"not installed: {names}, {install_command('peers')}")
    return (*counts, *([f"Not run: {'; '.join(reasons)}"] if reasons else ()))


def default_case(model: str, file: Path, model_class: Any) -> ReferenceCase:
    """Return the default run of a user model, with its certified result or the solution on which two methods agree."""
    has_reference = file.with_suffix(".csv").is_file()
    truth = load_reference(file.stem, file.parent) if has_reference else solve_by_two_methods(model_class, file)
    law, outputs = "default run", tuple(model_class.states)
    return ReferenceCase(file.stem, RunSpec(file, outputs), law, truth, UnspecifiedProblem(float(truth.times[-1])))


@dataclass(frozen=True)
class CaseRunner:
    """Runs a case in different ways; each takes rtol and settings, and returns the solution and the run time in s."""

    case: ReferenceCase
    model_class: Any
    file: Path

    @property
    def times(self) -> np.ndarray:
        return self.case.reference.times

    def run_inside(
        self, method: str, run_times: dict[float, float], rtol: float, settings: SweepSettings
    ) -> tuple[Solution, float]:
        """Run the code of the FMU in this process."""
        run, times = EmbeddedModel.create(self.model_class, self.case.run.values, method, rtol), self.times.tolist()
        answer = run.solve(times, settings.timeout)
        run_times[rtol] = best_time(partial(run.compute_states, times), settings.budget)
        return answer, run_times[rtol]

    def run_through_fmpy(
        self, method: str, run_times: dict[float, float], rtol: float, settings: SweepSettings
    ) -> tuple[Solution, float] | None:
        """Run the FMU through fmpy, if the run in this process succeeded."""
        if rtol not in run_times:
            return None
        case_run, tolerance = self.case.run, {"solver.rtol": rtol} if rtol else {}
        values = {**case_run.values, **tolerance, "solver.method": method}
        grid, repeat = float(self.times[1]), repeats(run_times[rtol], settings.budget)
        run = run_own_fmu(replace(case_run, fmu=self.file, values=values, grid=grid, follow=False, repeat=repeat))
        assert run.statistics  # FMUs of this project report it
        columns = np.column_stack([run.columns[name] for name in case_run.outputs])
        return Solution(self.times, columns, None, run.statistics.evaluations), run.statistics.seconds

    def run_fmi3(self, tool: str, rtol: float, settings: SweepSettings) -> tuple[Solution, float]:
        """Run the FMI 3.0 FMU with its own solver and tolerance, or by model exchange.

        In model exchange, changes of mode are recorded.
        """
        file, grid, stop, exchange = fmi3_path(self.file), float(self.times[1]), float(self.times[-1]), tool == ME
        states = self.case.run.outputs
        modes = tuple(self.model_class.contacts) if exchange and self.case.reference.modes else ()
        spec = replace(self.case.run, fmu=file, outputs=states + modes, stop=stop, grid=grid, follow=False)
        spec = replace(spec, exchange=True, tolerance=rtol) if exchange else spec
        if not file.is_file():
            raise HarnessError(f"not built: {file} ({build_command(self.file, '--fmi 3')})")
        recording = run_own_fmu(spec, limit_run_time(settings.timeout, stop))
        assert recording.statistics  # FMUs of this project report it
        repeat = repeats(recording.statistics.seconds, settings.budget)
        statistics = run_own_fmu(replace(spec, repeat=repeat)).statistics
        assert statistics
        events = find_changes(recording, *modes) if modes else None
        motion, evaluations = sample_at(recording, self.times, states), recording.statistics.evaluations
        solution = Solution(self.times, motion, events, evaluations)
        return solution, min(statistics.seconds, recording.statistics.seconds)

    def run_peer(self, peer: str, method: str, rtol: float, settings: SweepSettings) -> tuple[Solution, float]:
        """Run a peer solver."""
        problem = self.case.problem
        solve = partial(peer_solvers.solve, peer, method, problem, self.times, rtol, problem.atol_factor * rtol)
        return solve(peer_solvers.limit_run_time(settings.timeout)), best_time(solve, settings.budget)


def limit_run_time(timeout: float, stop: float) -> Callable[[float], None]:
    """Return a progress callback that raises HarnessError after `timeout` s of a run to `stop`, in s."""
    start = perf_counter()

    def check(share: float) -> None:
        if perf_counter() - start > timeout:
            raise HarnessError(f"at t = {share * stop:.3g} s after {timeout:g} s of run time")

    return check


def solver_jobs(case: ReferenceCase, model_class: Any, file: Path) -> Iterator[SolverJob]:
    """Yield the runs of every solver for a case."""
    runner, absolute = CaseRunner(case, model_class, file), case.problem.atol_factor
    for method in method_numbers(model_class):
        if not (method == "exact" and case.is_chattering):
            run_times: dict[float, float] = {}  # run times in s by rtol, passed from the first job to the second
            is_swept = method != "exact"
            yield SolverJob(FMU, method, nan, partial(runner.run_inside, method, run_times), is_swept=is_swept)
            yield SolverJob(FMPY, method, nan, partial(runner.run_through_fmpy, method, run_times), True, is_swept)
    if not case.is_chattering:
        names = {number: name for name, number in method_numbers(model_class).items()}
        default_method = names[model_class.solver_class.method.start]
        for tool, method, is_swept in ((CS, default_method, False), (ME, "fmpy's CVode", fmi3_path(file).is_file())):
            yield SolverJob(tool, method, nan, partial(runner.run_fmi3, tool), is_swept=is_swept)
        excluded_peers = peer_solvers.PACKAGES if isinstance(case.problem, UnspecifiedProblem) else missing_packages()
        for peer, methods in (
            ("scipy", peer_solvers.SCIPY),
            ("cvode", ("BDF",) if case.problem.is_stiff else ("Adams",)),
        ):
            for method in methods if peer not in excluded_peers else ():
                yield SolverJob(peer, method, absolute, partial(runner.run_peer, peer, method))


def sweep_tolerances(case: ReferenceCase, job: SolverJob, settings: SweepSettings) -> Iterator[Point]:
    """Run one solver for all tolerances, from loose to tight."""
    reference, dry = (
        case.reference,
        load_reference(case.dry_friction_reference) if case.dry_friction_reference else None,
    )
    skip_reason = ""
    for rtol in settings.tolerances if job.is_swept else (nan,):
        point = partial(Point, case.name, job.tool, job.method, rtol, job.absolute * rtol)
        if skip_reason:
            yield point(failure=f"skipped: {skip_reason}")
            continue
        start = perf_counter()
        try:
            result = job.run(0.0 if isnan(rtol) else rtol, settings)
        except HarnessError as error:
            if job.must_succeed:
                raise
            if perf_counter() - start > 0.5 * settings.timeout:
                skip_reason = f"at rtol {rtol:g} the run stopped {error}"
            yield point(failure=str(error))
            continue
        if not result:
            continue
        solution, seconds = result
        beside_dry = compute_errors(solution, dry).largest if dry else None
        yield point(seconds, solution.evaluations, **vars(compute_errors(solution, reference)), beside_dry=beside_dry)


def best_time(call: Callable[[], object], budget: float) -> float:
    """Return the time in s of the fastest of several calls."""
    times = [time_call(call)]
    times += [time_call(call) for _ in range(repeats(times[0], budget) - 1)]
    return min(times)


def repeats(call_time: float, budget: float) -> int:
    """Return how often a call of `call_time` s is repeated within a budget in s."""
    return 1 if call_time > 4 * budget else max(2, min(MAX_REPEATS, int(budget / call_time)))


def find_changes(signals: Signals, name: str) -> list[tuple[float, int]]:
    """Return every change of an integer output as (time in s, new value)."""
    values = signals[name]
    after = np.flatnonzero(np.diff(values)) + 1
    return list(zip(signals.time[after].tolist(), values[after].tolist(), strict=True))


class DryBlock(OdeProblem):
    """The mass of the models with bristles, pulled through a spring, with Coulomb and viscous friction that sticks."""

    start, stop, has_dry_friction = (0.0, 0.0), 20.0, True
    k, v_driver, F_c, F_s, sigma_2 = 2.0, 0.1, 1.0, 1.5, 0.4

    def rates(self, mode: int) -> RhsFunction:
        k, speed, sliding, damping = self.k, self.v_driver, mode * self.F_c, self.sigma_2
        return lambda t, y: (y[1], k * (speed * t - y[0]) - sliding - damping * y[1])

    def static_load(self, t: float, x: float) -> tuple[float, float, float]:
        return self.k * (self.v_driver * t - x), self.k * self.v_driver, self.F_s


def compare_with_dry_friction(case: ReferenceCase, model: type) -> LawDeviation:
    """Compare the law of a case with dry friction; `model` is the class in the FMU."""
    assert case.dry_friction_reference is not None
    law_reference, dry_reference = load_reference(case.reference_source), load_reference(case.dry_friction_reference)
    deviation = compute_errors(replace(law_reference, events=None), dry_reference)
    method = CHATTERING_METHOD if case.is_chattering else None
    own_run = EmbeddedModel.create(model, case.run.values, method, 0.0).solve(law_reference.times.tolist())
    make_result = partial(
        LawDeviation,
        case.model,
        case.name,
        case.law,
        deviation.final,
        deviation.rms,
        deviation.largest,
        integration=compute_errors(own_run, law_reference).largest,
    )
    is_sticking = stuck_points(dry_reference)
    if not is_sticking.any():
        return make_result(None, None, None)
    creep = float(np.median(np.abs(law_reference.states[is_sticking, 1])))
    if case.problem.has_dry_friction:
        return make_result(creep, float(np.mean(np.diff([t for t, mode in law_reference.modes if mode]))), None)
    times = np.linspace(0.0, case.problem.stop, FINE)
    run = EmbeddedModel.create(model, case.run.values, None, TOLERANCE)
    motion = run.compute_states(times.tolist())
    rates = case.problem.rates(1)
    a = [rates(t, y)[1] for t, y in zip(times.tolist(), motion, strict=True)]
    slips = upward_crossings(times, np.array(motion)[:, 1] - run.model.v_driver)
    return make_result(creep, float(np.mean(np.diff(slips))), max(a) / -min(a))


def compare_bristles(name: str, law: str, model: type) -> LawDeviation:
    """Compare a model of fmus/more with bristles, in its default run, with a block that sticks."""
    reference, dry = load_reference(f"more/{name}"), solve_dry_block()
    bristles = replace(reference, states=reference.states[:, :2], events=None)
    deviation = compute_errors(bristles, dry)
    own_run = EmbeddedModel.create(model, {}, None, 0.0).solve(reference.times.tolist())
    times = np.linspace(0.0, float(reference.times[-1]), FINE)
    fine_run = EmbeddedModel.create(model, {}, None, TOLERANCE)
    motion = np.array(fine_run.compute_states(times.tolist()))
    slips = upward_crossings(times, motion[:, 1] - fine_run.model.v_driver)
    return LawDeviation(
        name,
        name,
        law,
        deviation.final,
        deviation.rms,
        deviation.largest,
        creep=float(np.median(np.abs(bristles.states[stuck_points(dry), 1]))),
        period=float(np.mean(np.diff(slips))),
        asymmetry=None,
        integration=compute_errors(own_run, reference).largest,
    )


@cache
def solve_dry_block() -> Solution:
    """Return the motion of the block that sticks, in the default run of the models with bristles."""
    solution = peer_solvers.solve("scipy", "DOP853", DryBlock(), np.linspace(0.0, DryBlock.stop, POINTS), 3e-14, 1e-17)
    return replace(solution, start_mode=0)


def stuck_points(truth: Solution) -> np.ndarray:
    """Return for each time (n,) of a reference whether the body is stuck."""
    starts, modes = zip(*truth.modes, strict=True)
    return np.array(modes)[np.searchsorted(starts, truth.times, side="right") - 1] == 0
