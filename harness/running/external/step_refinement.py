"""Refinement of steps until two results agree, which estimates the error of an external FMU.

Co-simulation halves the communication step; model exchange divides the solver tolerance by ten. If halving changes
nothing, the FMU has internal steps; their error can only be estimated if a smaller tolerance, passed at the start,
changes the result.
"""

from collections.abc import Callable
from dataclasses import dataclass
from math import ceil, inf
from typing import Any

import numpy as np

from ...scenes.run_spec import RunSpec
from ..recorder import Columns
from ..stepping import TimeGrid

# names of files in the directory of results
STRINGS_FILE = "strings"
ROWS_PREFIX = "rows-"  # followed by the number of a run
COARSEST_STEPS = 64  # communication steps of the coarsest run by default
MAX_STEPS = 2**18  # communication steps
STEPS_TO_SEE_INTERNAL_STEP = 2**12  # communication steps that make internal steps visible
MIN_OUTPUT_STEPS = 512  # minimum number of output points
MAX_TOLERANCE_REDUCTIONS = 6  # of model exchange
TOLERANCE_FACTOR = 0.1  # tolerance passed to the FMU, relative to that of the run
MIN_TOLERANCE = 1e-13  # of any solver


@dataclass(frozen=True)
class RefinementRun:
    """A run: its number, time (n,) in s and columns (n,) by name.

    If it is incomplete, `message` contains the reason: the FMU terminated the simulation, refused a step, or failed.
    """

    number: int
    time: np.ndarray
    columns: Columns
    message: str = ""
    terminated: bool = False
    step_refused: bool = False


@dataclass(frozen=True)
class RefinementResult:
    """Result of a refinement.

    Attributes
    ----------
    run_number : int or None
        Number of the selected run; None if there is none.
    note : str
        Accuracy of the run.
    failure : str
        Reason why the run is incomplete; empty if it is complete.
    """

    run_number: int | None
    note: str
    failure: str = ""


RunFunction = Callable[[float, float], RefinementRun]  # (communication step in s, tolerance)


def coarsest_grid(spec: RunSpec) -> TimeGrid:
    """Return the points of the coarsest run.

    The steps of all other runs are integer fractions of its steps, so every run has these points.
    """
    assert spec.start is not None
    assert spec.stop is not None  # of a resolved run
    duration = spec.stop - spec.start
    return TimeGrid(spec.start, spec.stop, min(spec.grid, duration) if spec.grid else duration / COARSEST_STEPS)


def refine(spec: RunSpec, description: Any, run: RunFunction) -> RefinementResult:
    """Run the FMU with refined steps and select a run.

    Parameters
    ----------
    spec : RunSpec
        The run, with its start and stop.
    description : ModelDescription
        Model description of the FMU.
    run : callable
        Runs the FMU with a communication step in s and a tolerance; returns a RefinementRun.
    """
    duration = coarsest_grid(spec).duration
    requested_step = None if spec.follow else spec.grid or (inf if len(spec.times) else None)
    if spec.exchange:
        return refine_tolerance(spec, requested_step or integer_fraction(spec, MIN_OUTPUT_STEPS), run)
    fixed_step = declared_step(description)
    if fixed_step:
        fixed_run = run(communication_step(fixed_step, duration), solver_tolerance(spec))
        return accept_run(fixed_run, f"declared fixed internal step of {fixed_step:g} s, error unknown")
    if requested_step:
        requested_run = run(requested_step, solver_tolerance(spec))
        requested = f"step of {requested_step:g} s" if requested_step < inf else "times"
        return accept_run(requested_run, f"requested communication {requested}, error unknown")
    result = refine_steps(spec, run)
    default_step = description.defaultExperiment.stepSize if description.defaultExperiment else None
    if result.run_number is None and default_step:  # no run advanced by a step
        default_run = run(float(default_step), solver_tolerance(spec))
        if not default_run.message:
            note = f"declared communication step of {float(default_step):g} s, error unknown"
            return accept_run(default_run, f"{note}: {result.failure}")
    return result


def declared_step(description: Any) -> float | None:
    """Return the fixed internal step in s that an FMU declares for co-simulation; None without a valid one."""
    try:
        fixed_step = float(description.coSimulation.fixedInternalStepSize or 0.0)
    except ValueError:
        return None
    return fixed_step if 0.0 < fixed_step < inf else None


def communication_step(fixed_step: float, duration: float) -> float:
    """Return the shortest multiple of a fixed internal step in s with at most `MAX_STEPS` steps."""
    return fixed_step * ceil(duration / fixed_step / MAX_STEPS)


def integer_fraction(spec: RunSpec, steps: int) -> float:
    """Return the longest integer fraction in s of the coarsest communication step with at least `steps` steps."""
    grid = coarsest_grid(spec)
    return grid.h / ceil(steps * grid.h / grid.duration)


def accept_run(result: RefinementRun, note: str) -> RefinementResult:
    """Select a run."""
    return RefinementResult(result.number, note, result.message)


def solver_tolerance(spec: RunSpec) -> float:
    """Return the tolerance to pass to an FMU with its own solver."""
    return TOLERANCE_FACTOR * spec.tolerance


def refine_steps(spec: RunSpec, run: RunFunction) -> RefinementResult:
    """Halve the communication step until two results agree at the times of the coarsest run."""
    coarsest, difference = coarsest_grid(spec), inf
    duration, h = coarsest.duration, coarsest.h
    previous: RefinementRun | None = None
    while h >= min(duration / MAX_STEPS, coarsest.h / 2):
        current = run(h, solver_tolerance(spec))
        if current.message and not (current.terminated or current.step_refused):
            return keep_longest_run(previous, current)
        if previous and not (current.step_refused or previous.step_refused):
            difference = max_difference(previous, current, spec)
            if difference == 0.0:
                return refine_solver_tolerance(spec, h, current, run)
            if difference <= spec.tolerance and h <= duration / MIN_OUTPUT_STEPS:
                return accept_run(
                    current, f"communication step {h:.4g} s; halving it changes no output by more than {difference:.2g}"
                )
        previous, h = current, h / 2
    if current.step_refused:
        return keep_longest_run(None, current)
    change = f"the last halving, to {round(duration / (2 * h))} communication steps,"
    return no_agreement(change, current, difference, spec)


def no_agreement(change: str, current: RefinementRun, difference: float, spec: RunSpec) -> RefinementResult:
    """Select the last run and report that it differs from the previous one."""
    message = f"{change} still changes an output by {difference:.2g} of its largest value"
    return RefinementResult(current.number, "", f"{message}, more than the tolerance of {spec.tolerance:g}; raise rtol")


def keep_longest_run(previous: RefinementRun | None, current: RefinementRun) -> RefinementResult:
    """Report why the last run is incomplete and select the longer of the two."""
    candidates = [run for run in (current, previous) if run and len(run.time) > 1]
    longest = max(candidates, key=lambda run: float(run.time[-1]), default=None)
    return RefinementResult(longest.number if longest else None, "", current.message)


def refine_solver_tolerance(spec: RunSpec, h: float, current: RefinementRun, run: RunFunction) -> RefinementResult:
    """Reduce the tolerance passed to the FMU after halving the communication step changed nothing."""
    if not any(np.ptp(column) for column in current.columns.values()):
        return accept_run(current, f"communication step {h:.4g} s; no output changes")
    tolerance = solver_tolerance(spec)
    short_step = min(integer_fraction(spec, STEPS_TO_SEE_INTERNAL_STEP), coarsest_grid(spec).h / 4)
    for _ in range(3):
        tolerance = max(tolerance / 100, MIN_TOLERANCE)
        refined = run(short_step, tolerance)
        if refined.message and not refined.terminated:
            return keep_longest_run(current, refined)
        difference = max_difference(current, refined, spec)
        if difference == 0.0:
            fixed_step = find_fixed_step(refined)
            kind = f"fixed internal step of {fixed_step:.3g} s" if fixed_step else "internal steps"
            reason = "neither shorter communication steps nor a smaller tolerance change the result"
            return accept_run(refined, f"{kind}, error unknown: {reason}")
        if difference <= spec.tolerance:
            note = f"internal steps, controlled by a tolerance of {tolerance:.2g}"
            return accept_run(refined, f"{note}; a hundred times that changes no output by more than {difference:.2g}")
        current = refined
    return no_agreement(f"a reduction of its tolerance by 100, to {tolerance:.2g},", current, difference, spec)


def find_fixed_step(samples: RefinementRun) -> float | None:
    """Return the fixed internal step of an FMU in s, or None.

    It is visible if outputs are constant between equidistant times.
    """
    changes = np.zeros(len(samples.time) - 1, bool)
    for column in samples.columns.values():
        if column.dtype.kind == "f":
            changes |= np.diff(column) != 0
    indices = np.flatnonzero(changes)
    gaps = np.diff(indices)
    if len(indices) < 3 or gaps.min() < 2 or np.ptp(gaps) > 1:
        return None
    return float((samples.time[indices[-1]] - samples.time[indices[0]]) / (len(indices) - 1))


def refine_tolerance(spec: RunSpec, h: float, run: RunFunction) -> RefinementResult:
    """Divide the solver tolerance by ten until two results agree at the output points."""
    rtol, difference = spec.tolerance, inf
    previous: RefinementRun | None = None
    for _ in range(MAX_TOLERANCE_REDUCTIONS):
        current = run(h, rtol)
        if current.message and not current.terminated:
            return keep_longest_run(previous, current)
        if previous:
            difference = max_difference(previous, current, spec)
            if difference <= spec.tolerance:
                note = (
                    f"fmpy's CVode at rtol {rtol:.2g}; ten times that changes no output by more than {difference:.2g}"
                )
                return accept_run(current, note)
        previous, rtol = current, max(rtol / 10, MIN_TOLERANCE)
    return no_agreement("a reduction of the tolerance of fmpy's CVode by 10", current, difference, spec)


@np.errstate(over="ignore")  # a warning of numpy would appear as output of the FMU
def max_difference(first: RefinementRun, second: RefinementRun, spec: RunSpec) -> float:
    """Return the largest difference of two runs at the coarsest times, relative to each variable's largest value."""
    grid = coarsest_grid(spec)
    end = min(run.time[-1] if len(run.time) else grid.start for run in (first, second))
    tolerance = 1e-9 * grid.duration
    times = np.append(np.arange(grid.start, grid.stop - tolerance, grid.h), grid.stop)
    times = times[times <= end + tolerance]
    if len(times) < 2:
        return inf
    largest = 0.0
    for name, column in second.columns.items():
        left, right = (
            first.columns[name][last_rows_before(first.time, times)].astype(float),
            column[last_rows_before(second.time, times)].astype(float),
        )
        scale = float(np.abs(right).max())
        largest = max(largest, float(np.abs(left - right).max()) / scale if scale else float(np.abs(left).max() > 0))
    return largest


def last_rows_before(time: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Return the index of the last row at or just before each time."""
    tolerance = 1e-9 * (time[-1] - time[0])
    return np.searchsorted(time, times + tolerance, "right") - 1
