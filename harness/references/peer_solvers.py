"""Other people's solvers on the same problems, each in its best use: restarted at every change of mode.

scipy's solve_ivp, and CVODE of SUNDIALS through scikit-sundae; both get the Jacobian where they want it.
"""

import warnings
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from importlib.util import find_spec
from itertools import count
from time import perf_counter
from typing import Any

import numpy as np

from ..errors import HarnessError
from ..running.solution import Solution
from .ode_problem import OdeProblem, RhsFunction, StateVector

SCIPY = ("RK23", "RK45", "DOP853", "Radau", "LSODA")
IMPLICIT = ("Radau", "LSODA", "BDF")  # those that ask for a Jacobian
PACKAGES = {"scipy": ("scipy", "scipy"), "cvode": ("sksundae", "scikit-sundae")}  # module, and name to install


RhsWrapper = Callable[[RhsFunction], RhsFunction]


def without_limit(rates: RhsFunction) -> RhsFunction:
    """As they are: counting costs time."""
    return rates


def limit_evaluations(limit: int) -> RhsWrapper:
    """Right-hand sides that end the run after so many of them, all together."""
    calls = count(1)
    return raise_when(lambda: next(calls) > limit, f"{limit} right-hand sides")


def limit_run_time(seconds: float) -> RhsWrapper:
    """Right-hand sides that end the run after so many seconds from now."""
    end = perf_counter() + seconds
    return raise_when(lambda: perf_counter() > end, f"{seconds:g} s of run time")


def raise_when(over: Callable[[], bool], after: str) -> RhsWrapper:
    """Right-hand sides that end the run when it is `over`."""

    def watched(rates: RhsFunction) -> RhsFunction:
        def asked(t: float, y: StateVector) -> tuple[float, float]:
            if over():
                raise HarnessError(f"at t = {t:.3g} s after {after}")
            return rates(t, y)

        return asked

    return watched


@dataclass(frozen=True)
class SolverTask:
    """What a peer is to solve, and how."""

    method: str
    problem: OdeProblem
    watched: RhsWrapper
    rtol: float
    atol: float


@dataclass(frozen=True)
class ModeInterval:
    """One mode: samples (n, 2) at the points passed, the end in s, the state there, and whether v came to zero."""

    samples: np.ndarray
    end: float
    state: tuple[float, float]
    turned: bool
    evaluations: int


def missing_packages() -> dict[str, str]:
    """The peers that are not installed, each with the package that brings it."""
    return {peer: package for peer, (module, package) in PACKAGES.items() if find_spec(module) is None}


def solve(
    peer: str,
    method: str,
    problem: OdeProblem,
    times: np.ndarray,
    rtol: float,
    atol: float,
    watched: RhsWrapper = without_limit,
) -> Solution:
    """The motion at `times` (n,), which begin at 0 and end at the stop; HarnessError says why there is none."""
    ask = partial(
        {"scipy": solve_with_scipy, "cvode": solve_with_cvode}[peer], SolverTask(method, problem, watched, rtol, atol)
    )
    t, state = 0.0, problem.start
    mode = problem.resolve_mode(t, *state)
    motion = np.empty((len(times), 2))
    motion[0] = state
    events: list[tuple[float, int]] = []
    evaluations, done = 0, 1  # samples made
    while t < problem.stop:
        if mode:
            part = ask(mode, t, state, times[done:])
            motion[done : done + len(part.samples)] = part.samples
            done += len(part.samples)
            evaluations += part.evaluations
            t, state = part.end, part.state
            if part.turned:
                mode = problem.resolve_mode(t, state[0], 0.0)
                events.append((t, mode))
        else:
            release, mode = problem.breakaway(t, state[0])
            t = min(release, problem.stop)
            passed = int(np.searchsorted(times, t, side="right"))
            motion[done:passed] = state
            done = max(done, passed)
            if release <= problem.stop:
                events.append((t, mode))
    return Solution(motion, events if problem.has_dry_friction else None, evaluations)


def solve_with_scipy(
    task: SolverTask, mode: int, t: float, state: tuple[float, float], times: np.ndarray
) -> ModeInterval:
    """One mode through solve_ivp."""
    from scipy.integrate import solve_ivp

    problem = task.problem

    def standstill(t: float, y: np.ndarray) -> float:
        return y[1]

    standstill.terminal, standstill.direction = True, -mode  # type: ignore[attr-defined]
    options: dict[str, Any] = {"t_eval": times, "rtol": task.rtol, "atol": task.atol}
    if problem.has_dry_friction:
        options["events"] = standstill
    if task.method in IMPLICIT:
        options["jac"] = problem.jacobian(mode)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # a failure is told by its status
        run = solve_ivp(task.watched(problem.rates(mode)), (t, problem.stop), state, task.method, **options)
    if run.status < 0:
        raise HarnessError(run.message.splitlines()[0])
    evaluations = int(run.nfev + run.njev)
    samples = np.reshape(run.y, (2, -1)).T  # a list where there are none
    if run.status == 1:
        end = float(run.t_events[0][-1])
        return ModeInterval(samples, end, (float(run.y_events[0][-1][0]), 0.0), True, evaluations)
    return ModeInterval(samples, problem.stop, tuple(run.y[:, -1].tolist()), False, evaluations)


def solve_with_cvode(
    task: SolverTask, mode: int, t: float, state: tuple[float, float], times: np.ndarray
) -> ModeInterval:
    """One mode through CVODE."""
    from sksundae.cvode import CVODE as Solver

    problem, method = task.problem, task.method
    rates = task.watched(problem.rates(mode))
    jacobian = problem.jacobian(mode) if method in IMPLICIT else None

    def fill(t: float, y: np.ndarray, slope: np.ndarray) -> None:
        slope[0], slope[1] = rates(t, y)

    def fill_matrix(t: float, y: np.ndarray, slope: np.ndarray, matrix: np.ndarray) -> None:
        assert jacobian is not None
        matrix[:] = jacobian(t, y)

    def standstill(t: float, y: np.ndarray, guard: np.ndarray) -> None:
        guard[0] = y[1]

    standstill.terminal, standstill.direction = [True], [-mode]  # type: ignore[attr-defined]
    options = {"eventsfn": standstill, "num_events": 1} if problem.has_dry_friction else {}
    if jacobian is not None:
        options["jacfn"] = fill_matrix
    solver = Solver(fill, method=method, rtol=task.rtol, atol=task.atol, max_num_steps=1_000_000, **options)
    run = solver.solve(np.append(t, times), np.array(state))
    if not run.success:
        raise HarnessError(str(run.message).splitlines()[0])
    evaluations = int(run.nfev + run.njev)
    if run.t_events is not None and len(run.t_events):
        end = float(run.t_events[-1])
        passed = int(np.searchsorted(times, end, side="right"))
        return ModeInterval(run.y[1 : passed + 1], end, (float(run.y_events[-1][0]), 0.0), True, evaluations)
    samples = run.y[1:] if len(times) > 1 else run.y[-1:]  # between two points it shows its own steps
    return ModeInterval(samples, problem.stop, tuple(run.y[-1].tolist()), False, evaluations)
