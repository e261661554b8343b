"""Peer solvers: scipy's solve_ivp, and CVODE of SUNDIALS through scikit-sundae, on the same problems.

Each solver runs with its best settings: it is restarted at every change of mode, and implicit methods use the Jacobian.
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
from ..simulation.solution import Solution
from .ode_problem import OdeProblem, RhsFunction, StateVector

SCIPY = ("RK23", "RK45", "DOP853", "Radau", "LSODA")
IMPLICIT = ("Radau", "LSODA", "BDF")  # methods that take a Jacobian
FMU, FMPY = "FMU", "fmpy"  # code of the FMU in this process; FMU through fmpy
CS, ME = "FMI 3.0 CS", "FMI 3.0 ME"  # FMI 3.0 FMU through fmpy: co-simulation, model exchange
FMI3_TOOLS = (CS, ME)
PACKAGES = {"scipy": ("scipy", "scipy"), "cvode": ("sksundae", "scikit-sundae")}  # module, and name to install


RhsWrapper = Callable[[RhsFunction], RhsFunction]


def without_limit(rates: RhsFunction) -> RhsFunction:
    """Return the right-hand side unchanged, because counting evaluations takes time."""
    return rates


def limit_evaluations(limit: int) -> RhsWrapper:
    """Return a wrapper that stops a run after `limit` evaluations in total of all right-hand sides."""
    calls = count(1)
    return raise_when(lambda: next(calls) > limit, f"{limit} right-hand sides")


def limit_run_time(seconds: float) -> RhsWrapper:
    """Return a wrapper that stops a run when this time in s has passed since the call of this function."""
    end = perf_counter() + seconds
    return raise_when(lambda: perf_counter() > end, f"{seconds:g} s of run time")


def raise_when(is_exceeded: Callable[[], bool], limit: str) -> RhsWrapper:
    """Return a wrapper of right-hand sides that raises HarnessError once a limit is exceeded."""

    def wrapper(rates: RhsFunction) -> RhsFunction:
        def limited_rates(t: float, y: StateVector) -> tuple[float, float]:
            if is_exceeded():
                raise HarnessError(f"at t = {t:.3g} s after {limit}")
            return rates(t, y)

        return limited_rates

    return wrapper


@dataclass(frozen=True)
class SolverTask:
    """The problem, method and tolerances of a run, and the wrapper of its right-hand sides."""

    method: str
    problem: OdeProblem
    wrapper: RhsWrapper
    rtol: float
    atol: float


@dataclass(frozen=True)
class ModeInterval:
    """The solution while one mode holds.

    Attributes
    ----------
    samples : numpy.ndarray
        States (n, 2) at the output times in the interval.
    end : float
        Time in s at which the interval ends.
    state : (float, float)
        State at the end.
    has_stopped : bool
        Whether the velocity became zero.
    evaluations : int
        Number of evaluations of right-hand side and Jacobian.
    """

    samples: np.ndarray
    end: float
    state: tuple[float, float]
    has_stopped: bool
    evaluations: int


def missing_packages() -> dict[str, str]:
    """Return the package to install for each peer that is not installed."""
    return {peer: package for peer, (module, package) in PACKAGES.items() if find_spec(module) is None}


def solve(
    peer: str,
    method: str,
    problem: OdeProblem,
    times: np.ndarray,
    rtol: float,
    atol: float,
    wrapper: RhsWrapper = without_limit,
) -> Solution:
    """Solve a problem by a method of a peer.

    Parameters
    ----------
    times : numpy.ndarray
        Output times (n,), from 0 to the stop in s.

    Raises
    ------
    HarnessError
        If the solver fails or exceeds a limit.
    """
    task = SolverTask(method, problem, wrapper, rtol, atol)
    solve_mode = partial({"scipy": solve_with_scipy, "cvode": solve_with_cvode}[peer], task)
    t, state = 0.0, problem.start
    mode = problem.resolve_mode(t, *state)
    motion = np.empty((len(times), 2))
    motion[0] = state
    events: list[tuple[float, int]] = []
    evaluations, n_filled = 0, 1  # the first sample is filled
    while t < problem.stop:
        if mode:
            interval = solve_mode(mode, t, state, times[n_filled:])
            motion[n_filled : n_filled + len(interval.samples)] = interval.samples
            n_filled += len(interval.samples)
            evaluations += interval.evaluations
            t, state = interval.end, interval.state
            if interval.has_stopped:
                mode = problem.resolve_mode(t, state[0], 0.0)
                events.append((t, mode))
        else:
            breakaway, mode = problem.breakaway(t, state[0])
            t = min(breakaway, problem.stop)
            n_passed = int(np.searchsorted(times, t, side="right"))
            motion[n_filled:n_passed] = state
            n_filled = max(n_filled, n_passed)
            if breakaway <= problem.stop:
                events.append((t, mode))
    return Solution(times, motion, events if problem.has_dry_friction else None, evaluations)


def solve_with_scipy(
    task: SolverTask, mode: int, t: float, state: tuple[float, float], times: np.ndarray
) -> ModeInterval:
    """Solve one mode with solve_ivp."""
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
        warnings.simplefilter("ignore")  # the status reports a failure
        run = solve_ivp(task.wrapper(problem.rates(mode)), (t, problem.stop), state, task.method, **options)
    if run.status < 0:
        raise HarnessError(run.message.splitlines()[0])
    evaluations = int(run.nfev + run.njev)
    samples = np.reshape(run.y, (2, -1)).T  # without output times run.y is a list
    if run.status == 1:
        end = float(run.t_events[0][-1])
        return ModeInterval(samples, end, (float(run.y_events[0][-1][0]), 0.0), True, evaluations)
    return ModeInterval(samples, problem.stop, tuple(run.y[:, -1].tolist()), False, evaluations)


def solve_with_cvode(
    task: SolverTask, mode: int, t: float, state: tuple[float, float], times: np.ndarray
) -> ModeInterval:
    """Solve one mode with CVODE."""
    from sksundae.cvode import CVODE as Solver

    problem, method = task.problem, task.method
    rates = task.wrapper(problem.rates(mode))
    jacobian = problem.jacobian(mode) if method in IMPLICIT else None

    def fill_rates(t: float, y: np.ndarray, slope: np.ndarray) -> None:
        slope[0], slope[1] = rates(t, y)

    def fill_jacobian(t: float, y: np.ndarray, slope: np.ndarray, matrix: np.ndarray) -> None:
        assert jacobian is not None
        matrix[:] = jacobian(t, y)

    def standstill(t: float, y: np.ndarray, event: np.ndarray) -> None:
        event[0] = y[1]

    standstill.terminal, standstill.direction = [True], [-mode]  # type: ignore[attr-defined]
    options = {"eventsfn": standstill, "num_events": 1} if problem.has_dry_friction else {}
    if jacobian is not None:
        options["jacfn"] = fill_jacobian
    solver = Solver(fill_rates, method=method, rtol=task.rtol, atol=task.atol, max_num_steps=1_000_000, **options)
    run = solver.solve(np.append(t, times), np.array(state))
    if not run.success:
        raise HarnessError(str(run.message).splitlines()[0])
    evaluations = int(run.nfev + run.njev)
    if run.t_events is not None and len(run.t_events):
        end = float(run.t_events[-1])
        n_passed = int(np.searchsorted(times, end, side="right"))
        return ModeInterval(run.y[1 : n_passed + 1], end, (float(run.y_events[-1][0]), 0.0), True, evaluations)
    samples = run.y[1:] if len(times) > 1 else run.y[-1:]  # with two times CVODE returns its own steps
    return ModeInterval(samples, problem.stop, tuple(run.y[-1].tolist()), False, evaluations)
