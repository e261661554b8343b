"""Refinement of steps until two results agree, which estimates the error of an external FMU.

Co-simulation halves the communication step; model exchange divides the solver tolerance by ten. If halving changes
nothing, the FMU has internal steps; their error can only be estimated if a smaller tolerance, passed at the start,
changes the result.

Where an output jumps in both runs, the times of the jump are compared, and not the values between them (jumps.py).

The changes of successive halvings give the order of convergence. Refinement stops early if the changes do not fall, or
if the order shows that the tolerance requires more than `MAX_STEPS` steps. The last run is then the result, with the
error that it achieves; it is a failure only if the user demanded the tolerance.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from math import ceil, inf, log2
from typing import Any

import numpy as np

from ...scenes.run_spec import RunSpec
from ..recorder import Columns
from ..stepping import TimeGrid
from .jumps import distance, find_jumps, is_between, match_jumps

# names of files in the directory of results
STRINGS_FILE = "strings"
ROWS_PREFIX = "rows-"  # followed by the number of a run
COARSEST_STEPS = 64  # communication steps of the coarsest run by default
MAX_STEPS = 2**18  # communication steps
STEPS_TO_SEE_INTERNAL_STEP = 2**12  # communication steps that make internal steps visible
MIN_OUTPUT_STEPS = 512  # minimum number of output points
STEPS_TO_SEE_STAGNATION = 2**13  # communication steps before changes that do not fall end a refinement
STEPS_TO_SEE_ORDER = 2**14  # communication steps before the order of convergence may end a refinement
STAGNATION_HALVINGS = 3  # successive halvings that together at least halve the changes, or refinement stops
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
    is_terminated: bool = False
    is_step_refused: bool = False


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
NoteCallback = Callable[[str], object]  # receives the current accuracy, for the display of the progress


@dataclass(frozen=True)
class Change:
    """Largest change from one run to the next.

    Attributes
    ----------
    size : float
        Change of an output relative to its largest value, or of the time of a jump relative to the run.
    name : str
        Name of the output; empty without a change.
    is_time : bool
        Whether the time of a jump changes.
    """

    size: float
    name: str = ""
    is_time: bool = False

    @property
    def reference(self) -> str:
        """Return what the change is relative to."""
        return f"the run, by which a jump of {self.name} moves" if self.is_time else f"the largest {self.name}"


@dataclass
class Convergence:
    """Changes of successive halvings of the step.

    Attributes
    ----------
    changes : list of Change
        Change by each halving.
    """

    changes: list[Change] = field(default_factory=list)

    @property
    def order(self) -> float | None:
        """Return the order of convergence that the last two changes show; None without two finite changes."""
        sizes = [change.size for change in self.changes[-2:]]
        if len(sizes) < 2 or not all(0.0 < size < inf for size in sizes):
            return None
        return log2(sizes[0] / sizes[1])

    @property
    def order_text(self) -> str:
        """Return the order as a text; empty if the changes do not fall regularly."""
        return "" if self.order is None or self.stagnates else f", order {self.order:.1f}"

    @property
    def error(self) -> float:
        """Return the estimated error of the last run.

        It is the last change if the order is at least 1, more if it is lower, and the largest of the last changes if
        these do not fall.
        """
        last, recent = self.changes[-1].size, max(change.size for change in self.changes[-STAGNATION_HALVINGS:])
        if self.order is None or (self.order >= 1.0 and not self.stagnates):
            return last
        return recent if self.stagnates or self.order <= 0.0 else last / (2.0**self.order - 1.0)

    @property
    def stagnates(self) -> bool:
        """Return whether the last halvings together did not even halve the changes."""
        sizes = [change.size for change in self.changes[-STAGNATION_HALVINGS - 1 :]]
        return len(sizes) > STAGNATION_HALVINGS and sizes[-1] > 0.5 * sizes[0]

    def halvings_to(self, tolerance: float) -> float:
        """Return how many more halvings the order requires to reach a tolerance; inf if the changes do not fall."""
        if self.order is None:
            return 0.0 if len(self.changes) < 2 else inf
        return log2(self.changes[-1].size / tolerance) / self.order if self.order > 0.0 else inf


def coarsest_grid(spec: RunSpec) -> TimeGrid:
    """Return the points of the coarsest run.

    The steps of all other runs are integer fractions of its steps, so every run has these points.
    """
    assert spec.start is not None
    assert spec.stop is not None  # of a resolved run
    duration = spec.stop - spec.start
    return TimeGrid(spec.start, spec.stop, min(spec.grid, duration) if spec.grid else duration / COARSEST_STEPS)


def refine(
    spec: RunSpec, description: Any, run: RunFunction, show: NoteCallback = lambda note: None
) -> RefinementResult:
    """Run the FMU with refined steps and select a run.

    Parameters
    ----------
    spec : RunSpec
        The run, with its start and stop.
    description : ModelDescription
        Model description of the FMU.
    run : callable
        Runs the FMU with a communication step in s and a tolerance; returns a RefinementRun.
    show : callable
        Receives the current accuracy.
    """
    duration = coarsest_grid(spec).duration
    requested_step = None if spec.follow else spec.grid or (inf if len(spec.times) else None)
    if spec.exchange:
        return refine_tolerance(spec, requested_step or integer_fraction(spec, MIN_OUTPUT_STEPS), run, show)
    fixed_step = declared_step(description)
    if fixed_step:
        fixed_run = run(communication_step(fixed_step, duration), solver_tolerance(spec))
        return accept_run(fixed_run, f"declared fixed internal step of {fixed_step:g} s, error unknown")
    if requested_step:
        requested_run = run(requested_step, solver_tolerance(spec))
        communication_text = f"step of {requested_step:g} s" if requested_step < inf else "times"
        return accept_run(requested_run, f"requested communication {communication_text}, error unknown")
    result = refine_steps(spec, run, show)
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
    return TOLERANCE_FACTOR * spec.rtol


def refine_steps(spec: RunSpec, run: RunFunction, show: NoteCallback) -> RefinementResult:
    """Halve the communication step until two results agree at the times of the coarsest run."""
    coarsest, convergence = coarsest_grid(spec), Convergence()
    duration, h = coarsest.duration, coarsest.h
    previous: RefinementRun | None = None
    while h >= min(duration / MAX_STEPS, coarsest.h / 2):
        current = run(h, solver_tolerance(spec))
        if current.message and not (current.is_terminated or current.is_step_refused):
            return keep_longest_run(previous, current)
        if previous and not (current.is_step_refused or previous.is_step_refused):
            change = largest_change(previous, current, spec)
            if change.size == 0.0:
                return refine_solver_tolerance(spec, h, current, run, show)
            convergence.changes.append(change)
            show(f"{duration / h:.0f} steps, error {convergence.error:.1g}")
            step = f"communication step {h:.4g} s"
            if change.size <= spec.rtol and h <= duration / MIN_OUTPUT_STEPS:
                note = f"{step}; halving it changes no output by more than {change.size:.2g}{convergence.order_text}"
                return accept_run(current, note)
            if reason := reason_to_stop(convergence, duration / h, spec.rtol):
                return accept_inexact_run(spec, current, step, convergence, find_internal_step(current) or reason)
        previous, h = current, h / 2
    if current.is_step_refused or not convergence.changes:
        return keep_longest_run(None, current)
    return accept_inexact_run(spec, current, step, convergence, f"more than {MAX_STEPS} steps are not taken")


def reason_to_stop(convergence: Convergence, steps: float, tolerance: float) -> str:
    """Return why further halving of the communication step cannot reach the tolerance; empty if it may."""
    if steps >= STEPS_TO_SEE_STAGNATION and convergence.stagnates:
        return "further halving does not reduce it"
    if steps >= STEPS_TO_SEE_ORDER:
        log_steps = log2(steps) + convergence.halvings_to(tolerance)
        if log_steps > log2(MAX_STEPS):
            count = f"about {2.0**log_steps:.1g}" if log_steps < 100 else "too many"
            return f"the tolerance of {tolerance:g} needs {count} steps"
    return ""


def accept_inexact_run(
    spec: RunSpec, current: RefinementRun, step: str, convergence: Convergence, reason: str
) -> RefinementResult:
    """Select a run that misses the tolerance: a result with its error, or a failure if the tolerance was demanded."""
    reference = convergence.changes[-1].reference
    error = f"error about {convergence.error:.2g} of {reference}{convergence.order_text}; {reason}"
    return accept_inexact(spec, current, f"{step}; {error}")


def accept_inexact(spec: RunSpec, current: RefinementRun, note: str) -> RefinementResult:
    """Select a run that misses the tolerance: a result, or a failure if the tolerance was demanded."""
    if spec.tolerance is None or current.message:
        return accept_run(current, note)
    return RefinementResult(current.number, note, f"the rtol of {spec.tolerance:g} is not reached: {note}; raise rtol")


def keep_longest_run(previous: RefinementRun | None, current: RefinementRun) -> RefinementResult:
    """Report why the last run is incomplete and select the longer of the two."""
    candidates = [run for run in (current, previous) if run and len(run.time) > 1]
    longest = max(candidates, key=lambda run: float(run.time[-1]), default=None)
    return RefinementResult(longest.number if longest else None, "", current.message)


def refine_solver_tolerance(
    spec: RunSpec, h: float, current: RefinementRun, run: RunFunction, show: NoteCallback
) -> RefinementResult:
    """Reduce the tolerance passed to the FMU after halving the communication step changed nothing."""
    if not any(np.ptp(column) for column in current.columns.values()):
        return accept_run(current, f"communication step {h:.4g} s; no output changes")
    tolerance, changes = solver_tolerance(spec), list[Change]()
    short_step = min(integer_fraction(spec, STEPS_TO_SEE_INTERNAL_STEP), coarsest_grid(spec).h / 4)
    for _ in range(3):
        tolerance = max(tolerance / 100, MIN_TOLERANCE)
        refined_run = run(short_step, tolerance)
        if refined_run.message and not refined_run.is_terminated:
            return keep_longest_run(current, refined_run)
        change = largest_change(current, refined_run, spec)
        if change.size == 0.0:
            kind = find_internal_step(refined_run) or "internal steps"
            reason = "neither shorter communication steps nor a smaller tolerance change the result"
            return accept_run(refined_run, f"{kind}, error unknown: {reason}")
        note = f"internal steps, controlled by a tolerance of {tolerance:.2g}"
        show(f"tolerance {tolerance:.1g}, error {change.size:.1g}")
        if change.size <= spec.rtol:
            return accept_run(
                refined_run, f"{note}; a hundred times that changes no output by more than {change.size:.2g}"
            )
        current = refined_run
        changes.append(change)
    return accept_inexact(spec, current, f"{note}; a hundred times that changes an output by {describe(changes[-1])}")


def find_internal_step(samples: RefinementRun) -> str:
    """Return a text with the fixed internal step of an FMU; empty if none is visible."""
    fixed_step = find_fixed_step(samples)
    return f"fixed internal step of {fixed_step:.3g} s" if fixed_step else ""


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


def refine_tolerance(spec: RunSpec, h: float, run: RunFunction, show: NoteCallback) -> RefinementResult:
    """Divide the solver tolerance by ten until two results agree at the output points."""
    rtol, change = spec.rtol, Change(inf)
    previous: RefinementRun | None = None
    for _ in range(MAX_TOLERANCE_REDUCTIONS):
        current = run(h, rtol)
        if current.message and not current.is_terminated:
            return keep_longest_run(previous, current)
        note = f"fmpy's CVode at rtol {rtol:.2g}"
        if previous:
            change = largest_change(previous, current, spec)
            show(f"rtol {rtol:.1g}, error {change.size:.1g}")
            if change.size <= spec.rtol:
                return accept_run(current, f"{note}; ten times that changes no output by more than {change.size:.2g}")
        previous, rtol = current, max(rtol / 10, MIN_TOLERANCE)
    return accept_inexact(spec, current, f"{note}; ten times that changes an output by {describe(change)}")


def describe(change: Change) -> str:
    """Return a change as a text."""
    return f"{change.size:.2g} of {change.reference}"


@np.errstate(over="ignore", invalid="ignore")  # a warning of numpy would appear as output of the FMU
def largest_change(first: RefinementRun, second: RefinementRun, spec: RunSpec) -> Change:
    """Return the largest difference of two runs at the coarsest times, relative to each variable's largest value.

    Of a jump that both runs have, the times are compared, and not the values between them.
    """
    grid = coarsest_grid(spec)
    end = min(run.time[-1] if len(run.time) else grid.start for run in (first, second))
    tolerance = 1e-9 * grid.duration
    times = np.append(np.arange(grid.start, grid.stop - tolerance, grid.h), grid.stop)
    times = times[times <= end + tolerance]
    if len(times) < 2:
        return Change(inf)
    largest = Change(0.0)
    for name, column in second.columns.items():
        left, right = (
            first.columns[name][last_rows_before(first.time, times)].astype(float),
            column[last_rows_before(second.time, times)].astype(float),
        )
        jumps = match_jumps(find_jumps(first.time, first.columns[name]), find_jumps(second.time, column), grid.h)
        shift = max((distance(*pair) for pair in jumps), default=0.0) / grid.duration
        scale, is_compared = float(np.abs(right).max()), ~is_between(times, jumps, tolerance)
        difference = float(np.abs(left - right).max(where=is_compared, initial=0.0))
        size = difference / scale if scale else float(difference > 0)
        largest = max(largest, Change(size, name), Change(shift, name, is_time=True), key=lambda change: change.size)
    return largest


def last_rows_before(time: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Return the index of the last row at or just before each time."""
    tolerance = 1e-9 * (time[-1] - time[0])
    return np.searchsorted(time, times + tolerance, "right") - 1
