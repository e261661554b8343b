"""Benchmarks of stiff friction: the run time of the method radau9 at equal error, against SUNDIALS CVODE.

Both are FMUs in the C host, so both times include the calls of FMI.  Each runs at many tolerances.  The run time at an
error is that of the loosest tolerance from which on all tighter ones have at most this error, interpolated between two
tolerances; the fastest run with such an error would be one that errs little by luck.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache, partial
from math import inf, nan
from pathlib import Path

import numpy as np

from harness.errors import HarnessError
from harness.references.certified_reference import POINTS, load_reference, relative_errors
from harness.references.models.pacejka import PacejkaProblem
from harness.references.peer_solvers import solve
from harness.scenes.run_spec import RunSpec

from ..c_host import Library, load_library
from ..stepping_loops import COMMUNICATION_STEPS
from .benchmark import SETTINGS, Baseline, Benchmark
from .native import Measurement, build_cvode_fmu, built_fmu, measure_or_skip, time_runs

RADAU9 = 6  # of solver.method
SPEED_RATIOS = {float(error): ratio for error, ratio in SETTINGS["stiff"].items()}
TOLERANCES: tuple[float, ...] = tuple((10.0 ** -np.arange(2.0, 14.1, 0.5)).tolist())
ATOL_SHARES = (1.0, 0.01)  # absolute tolerances of CVODE, as multiples of rtol and the smallest scale of the states
LEAST_REPEATS, MOST_REPEATS, RUN_TIME = 5, 100, 0.1  # of one setting; s in all, as far as these allow
Runs = list[tuple[float, float]]  # run time in s, and largest error relative to the largest of each state


@dataclass(frozen=True)
class StiffCase:
    """A run of a model.

    Attributes
    ----------
    run : the model, its values, and the states among its outputs
    scale : smallest scale of the states, m or m/s: the absolute tolerances are relative to it
    reference_source : name of the certified reference; empty if there is none
    """

    run: RunSpec
    scale: float
    reference_source: str


def sled_case(x_m: float, reference_source: str) -> StiffCase:
    """Return the sled on a belt with the velocity scale x_m in m/s."""
    return StiffCase(RunSpec(Path("pacejka.fmu"), ("x", "v"), {"x_m": x_m}), x_m, reference_source)


CASES = {
    "pacejka, x_m = 0.01 m/s": sled_case(0.01, "pacejka"),
    "pacejka, x_m = 0.0001 m/s": sled_case(0.0001, "pacejka-0.0001"),
    "pacejka, x_m = 1e-6 m/s": sled_case(1e-6, ""),
    "lugre": StiffCase(RunSpec(Path("lugre.fmu"), ("x", "v", "z")), 1e-5, "more/lugre"),
}


def stiff_benchmarks() -> list[Callable[[], Benchmark]]:
    """Return the benchmarks: each case at each error."""
    return [partial(compare_at_equal_error, name, error) for name in CASES for error in SPEED_RATIOS]


def compare_at_equal_error(name: str, error: float) -> Benchmark:
    """Measure the run time at an error; the target is a share of that of CVODE."""

    def figures() -> Measurement:
        own_time = time_at_error(run_fmu(name), error)
        peer_time = min(time_at_error(runs, error) for runs in run_cvode(name))
        # missed if no run of radau9 reaches the error
        target = peer_time / SPEED_RATIOS[error] if own_time < inf else nan
        return own_time, target, (Baseline("CVODE FMU, the fastest of BDF and Adams", peer_time),)

    return measure_or_skip(f"{name}, native: radau9 at error {error:.0e}, C host", "s", figures)


def time_at_error(runs: Runs, error: float) -> float:
    """Return the run time in s at an error, given runs from loose to tight tolerances; infinite if none reaches it."""
    if not runs:
        return inf
    seconds, errors = np.array(runs).T
    reliable = np.maximum.accumulate(errors[::-1])  # largest error of this and all tighter tolerances
    return float(np.exp(np.interp(np.log(error), np.log(reliable), np.log(seconds[::-1]), left=inf)))


# Cached, because the errors of a case share their runs.


@cache
def run_fmu(name: str) -> Runs:
    """Run the built FMU with radau9 at all tolerances."""
    case = CASES[name]
    library = load_library(built_fmu(case.run.model, "native"))
    tolerances = [{"solver.rtol": rtol, "solver.atol": rtol * case.scale} for rtol in TOLERANCES]
    if "x_m" in case.run.values:  # the FMU has this scale by default, for the speed alone
        tolerances = [{"solver.rtol": rtol} for rtol in TOLERANCES]
    return time_runs_of(case, library, [{"solver.method": RADAU9, **values} for values in tolerances])


@cache
def run_cvode(name: str) -> list[Runs]:
    """Run the CVODE FMU at all tolerances, with BDF and Adams and each absolute tolerance."""
    case = CASES[name]
    return [
        time_runs_of(case, library, [{"rtol": rtol, "atol": rtol * case.scale * share} for rtol in TOLERANCES])
        for library in (build_cvode_fmu(case.run.model), build_cvode_fmu(case.run.model, adams=True))
        for share in ATOL_SHARES
    ]


def time_runs_of(case: StiffCase, library: Library, settings: list[dict[str, float]]) -> Runs:
    """Return the runs that do not fail."""
    times, truth = reference_motion(case)
    runs: Runs = []
    for values in settings:
        run = replace(
            case.run,
            values={**case.run.values, **values},
            stop=float(times[-1]),
            equal_steps=COMMUNICATION_STEPS,
        )
        try:
            repeat = min(max(int(RUN_TIME / time_runs(library, run).seconds), LEAST_REPEATS), MOST_REPEATS)
            timing = time_runs(library, replace(run, repeat=repeat))
        except HarnessError:  # a tolerance is too loose or too tight for the solver
            continue
        rows = timing.rows[:: COMMUNICATION_STEPS // (len(times) - 1)]
        runs.append((timing.seconds, float(relative_errors(rows, truth).max())))
    return runs


def reference_motion(case: StiffCase) -> tuple[np.ndarray, np.ndarray]:
    """Return times (n,) in s and states (n, states) of the certified reference, or by scipy's Radau, in 20 s."""
    if case.reference_source:
        reference = load_reference(case.reference_source)
        return reference.times, reference.states
    return solve_by_radau(case.run.values["x_m"])


@cache
def solve_by_radau(x_m: float) -> tuple[np.ndarray, np.ndarray]:
    """Return times (n,) in s and states (n, 2) of the sled; the error is about 1e-11."""
    problem = PacejkaProblem(x_m)
    times = np.linspace(0.0, problem.stop, POINTS)
    return times, solve("scipy", "Radau", problem, times, 1e-11, 1e-17).states
