"""How exact somebody's FMU is, which does not tell its error: runs of ever shorter steps, until two results agree.

By co-simulation the communication steps are halved, by model exchange the tolerance of the solver is taken ten times
smaller.  Where halving changes nothing at all, the FMU has steps of its own, and its error cannot be seen from outside;
unless a smaller tolerance, which it is told at the start, does change something.
"""

from collections.abc import Callable
from math import ceil, inf
from typing import Any

import numpy as np

from .refinement_run import RefinementRun
from .request import ExternalRunRequest, RefinementResult
from .sample_rows import SampleRows

MAX_STEPS = 2**18  # communication steps
STEPS_TO_SEE_INTERNAL_STEP = 2**12  # communication steps in which a step of the FMU's own shows
MIN_OUTPUT_STEPS = 512  # communication steps at least, to draw and to measure by
MAX_TOLERANCE_REDUCTIONS = 6  # of the tolerance of model exchange, at most
TOLERANCE_FACTOR, MIN_TOLERANCE = (
    0.1,
    1e-13,
)  # the tolerance that an FMU is told, as a share of ours; that of any solver

RunFunction = Callable[[float, float], RefinementRun]  # with a communication step in s, and a tolerance


def refine(asked: ExternalRunRequest, found: Any, run: RunFunction) -> RefinementResult:
    """The pass to take, with what is known of its error."""
    span = asked.stop - asked.start
    if asked.exchange:
        return refine_tolerance(
            asked, asked.grid or span / (asked.coarsest * ceil(MIN_OUTPUT_STEPS / asked.coarsest)), run
        )
    own = float(found.coSimulation.fixedInternalStepSize or 0.0)
    if own > 0.0:
        one = run(own * ceil(span / own / MAX_STEPS), solver_tolerance(asked))
        return accept_run(one, f"its own step is fixed, at {own:g} s as it declares, its error unknown")
    if asked.grid:
        one = run(asked.grid, solver_tolerance(asked))
        return accept_run(one, f"communication step {asked.grid:g} s, as asked, its error unknown")
    answer = refine_steps(asked, run)
    usual = found.defaultExperiment.stepSize if found.defaultExperiment else None
    if answer.run_number is None and usual:  # it has not taken one step
        one = run(float(usual), solver_tolerance(asked))
        if not one.message:
            declared = f"communication step {float(usual):g} s, as it declares, its error unknown"
            return accept_run(one, f"{declared}: {answer.failure}")
    return answer


def accept_run(one: RefinementRun, note: str) -> RefinementResult:
    return RefinementResult(one.number, note, one.message)


def solver_tolerance(asked: ExternalRunRequest) -> float:
    """The tolerance for an FMU with a solver of its own."""
    return TOLERANCE_FACTOR * asked.tolerance


def refine_steps(asked: ExternalRunRequest, run: RunFunction) -> RefinementResult:
    """Communication steps are halved until two results agree at the times of the coarsest."""
    span, steps, off = asked.stop - asked.start, asked.coarsest, inf
    before: RefinementRun | None = None
    while steps <= max(MAX_STEPS, 2 * asked.coarsest):
        now = run(span / steps, solver_tolerance(asked))
        if now.message and not (now.terminated or now.step_refused):
            return keep_longest_run(before, now)
        if before and not (now.step_refused or before.step_refused):
            off = max_difference(before.rows, now.rows, asked)
            if off == 0.0:
                return refine_solver_tolerance(asked, span / steps, now, run)
            if off <= asked.tolerance and steps >= MIN_OUTPUT_STEPS:
                h = span / steps
                return accept_run(
                    now, f"communication step {h:.4g} s; half of it changes no output by more than {off:.2g}"
                )
        before, steps = now, 2 * steps
    if now.step_refused:
        return keep_longest_run(None, now)
    return no_agreement(f"the last halving, to {steps // 2} communication steps,", now, off, asked)


def no_agreement(what: str, now: RefinementRun, off: float, asked: ExternalRunRequest) -> RefinementResult:
    """The last pass, and that it does not agree with the one before."""
    change = f"{what} still changes an output by {off:.2g} of its largest value"
    return RefinementResult(
        now.number, "", f"{change}, more than the tolerance of {asked.tolerance:g}; raise --tolerance"
    )


def keep_longest_run(before: RefinementRun | None, now: RefinementRun) -> RefinementResult:
    """Why the last pass is not whole, with the one of the two that came farther."""
    begun = [each for each in (now, before) if each and len(each.rows.time) > 1]
    best = max(begun, key=lambda each: float(each.rows.time[-1]), default=None)
    return RefinementResult(best.number if best else None, "", now.message)


def refine_solver_tolerance(
    asked: ExternalRunRequest, h: float, now: RefinementRun, run: RunFunction
) -> RefinementResult:
    """Halving has changed nothing at all."""
    if not any(np.ptp(column) for column in now.rows.columns.values()):
        return accept_run(now, f"communication step {h:.4g} s; no output changes")
    tolerance = solver_tolerance(asked)
    for _ in range(3):
        tolerance = max(tolerance / 100, MIN_TOLERANCE)
        finer = run((asked.stop - asked.start) / max(STEPS_TO_SEE_INTERNAL_STEP, 4 * asked.coarsest), tolerance)
        if finer.message and not finer.terminated:
            return keep_longest_run(now, finer)
        off = max_difference(now.rows, finer.rows, asked)
        if off == 0.0:
            own = find_fixed_step(finer.rows)
            what = f"its own step is fixed, at {own:.3g} s" if own else "it takes steps of its own"
            change = "neither shorter communication steps nor a smaller tolerance change anything at all"
            return accept_run(finer, f"{what}, its error unknown: {change}")
        if off <= asked.tolerance:
            note = f"it takes steps of its own, by the tolerance that it is told, {tolerance:.2g}"
            return accept_run(finer, f"{note}; a hundred times as much changes no output by more than {off:.2g}")
        now = finer
    return no_agreement(f"a hundredth of the tolerance that it is told, {tolerance:.2g},", now, off, asked)


def find_fixed_step(rows: SampleRows) -> float | None:
    """The own step of an FMU in s, seen where its numbers stand still between even times; None if they do not."""
    moves = np.zeros(len(rows.time) - 1, bool)
    for column in rows.columns.values():
        if column.dtype.kind == "f":
            moves |= np.diff(column) != 0
    at = np.flatnonzero(moves)
    gaps = np.diff(at)
    if len(at) < 3 or gaps.min() < 2 or np.ptp(gaps) > 1:
        return None
    return float((rows.time[at[-1]] - rows.time[at[0]]) / (len(at) - 1))


def refine_tolerance(asked: ExternalRunRequest, h: float, run: RunFunction) -> RefinementResult:
    """The tolerance of the solver is taken ten times smaller until two results agree at the points."""
    rtol, off = asked.tolerance, inf
    before: RefinementRun | None = None
    for _ in range(MAX_TOLERANCE_REDUCTIONS):
        now = run(h, rtol)
        if now.message and not now.terminated:
            return keep_longest_run(before, now)
        if before:
            off = max_difference(before.rows, now.rows, asked)
            if off <= asked.tolerance:
                what = f"fmpy's CVode at rtol {rtol:.2g}; ten times as much changes no output by more than {off:.2g}"
                return accept_run(now, what)
        before, rtol = now, max(rtol / 10, MIN_TOLERANCE)
    return no_agreement("a tenth of the tolerance of fmpy's CVode", now, off, asked)


@np.errstate(over="ignore")  # what numpy says of that would be told as printed by the FMU
def max_difference(one: SampleRows, two: SampleRows, asked: ExternalRunRequest) -> float:
    """The largest difference of two passes, as a share of each variable's largest value, at the coarsest times."""
    end = min(each.time[-1] if len(each.time) else asked.start for each in (one, two))
    at = np.linspace(asked.start, asked.stop, asked.coarsest + 1)
    at = at[at <= end + 1e-9 * (asked.stop - asked.start)]
    if len(at) < 2:
        return inf
    worst = 0.0
    for name, column in two.columns.items():
        left, right = (
            one.columns[name][last_rows_before(one.time, at)].astype(float),
            column[last_rows_before(two.time, at)].astype(float),
        )
        size = float(np.abs(right).max())
        worst = max(worst, float(np.abs(left - right).max()) / size if size else float(np.abs(left).max() > 0))
    return worst


def last_rows_before(time: np.ndarray, at: np.ndarray) -> np.ndarray:
    """The last rows at the times, or just before."""
    near = 1e-9 * (time[-1] - time[0])
    return np.searchsorted(time, at + near, "right") - 1
