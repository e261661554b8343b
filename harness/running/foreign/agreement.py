"""How exact somebody's FMU is, which does not tell its error: runs of ever shorter steps, until two results agree.

By co-simulation the communication steps are halved, by model exchange the tolerance of the solver is taken ten times
smaller.  Where halving changes nothing at all, the FMU has steps of its own, and its error cannot be seen from outside;
unless a smaller tolerance, which it is told at the start, does change something.
"""

from collections.abc import Callable
from math import ceil, inf
from typing import Any

import numpy as np

from .passes import Pass
from .request import Answer, Request
from .rows import Rows

FINEST = 2**18  # communication steps
SEEN = 2**12  # communication steps in which a step of the FMU's own shows
POINTS = 512  # communication steps at least, to draw and to measure by
TENTHS = 6  # of the tolerance of model exchange, at most
SHARP, SHARPEST = 0.1, 1e-13  # the tolerance that an FMU is told, as a share of ours; that of any solver

Run = Callable[[float, float], Pass]  # with a communication step in s, and a tolerance


def agreed(asked: Request, found: Any, run: Run) -> Answer:
    """The pass to take, with what is known of its error."""
    span = asked.stop - asked.start
    if asked.exchange:
        return by_tolerance(asked, asked.grid or span / (asked.coarsest * ceil(POINTS / asked.coarsest)), run)
    own = float(found.coSimulation.fixedInternalStepSize or 0.0)
    if own > 0.0:
        one = run(own * ceil(span / own / FINEST), told(asked))
        return taken(one, f"its own step is fixed, at {own:g} s as it declares, its error unknown")
    if asked.grid:
        one = run(asked.grid, told(asked))
        return taken(one, f"communication step {asked.grid:g} s, as asked, its error unknown")
    answer = by_halving(asked, run)
    usual = found.defaultExperiment.stepSize if found.defaultExperiment else None
    if answer.taken is None and usual:  # it has not taken one step
        one = run(float(usual), told(asked))
        if not one.sentence:
            declared = f"communication step {float(usual):g} s, as it declares, its error unknown"
            return taken(one, f"{declared}: {answer.failed}")
    return answer


def taken(one: Pass, note: str) -> Answer:
    return Answer(one.number, note, one.sentence)


def told(asked: Request) -> float:
    """The tolerance for an FMU with a solver of its own."""
    return SHARP * asked.tolerance


def by_halving(asked: Request, run: Run) -> Answer:
    """Communication steps are halved until two results agree at the times of the coarsest."""
    span, steps, off = asked.stop - asked.start, asked.coarsest, inf
    before: Pass | None = None
    while steps <= max(FINEST, 2 * asked.coarsest):
        now = run(span / steps, told(asked))
        if now.sentence and not (now.ended or now.refused):
            return farthest(before, now)
        if before and not (now.refused or before.refused):
            off = apart(before.rows, now.rows, asked)
            if off == 0.0:
                return unmoved(asked, span / steps, now, run)
            if off <= asked.tolerance and steps >= POINTS:
                h = span / steps
                return taken(now, f"communication step {h:.4g} s; half of it changes no output by more than {off:.2g}")
        before, steps = now, 2 * steps
    if now.refused:
        return farthest(None, now)
    return apart_still(f"the last halving, to {steps // 2} communication steps,", now, off, asked)


def apart_still(what: str, now: Pass, off: float, asked: Request) -> Answer:
    """The last pass, and that it does not agree with the one before."""
    change = f"{what} still changes an output by {off:.2g} of its largest value"
    return Answer(now.number, "", f"{change}, more than the tolerance of {asked.tolerance:g}; raise --tolerance")


def farthest(before: Pass | None, now: Pass) -> Answer:
    """Why the last pass is not whole, with the one of the two that came farther."""
    begun = [each for each in (now, before) if each and len(each.rows.time) > 1]
    best = max(begun, key=lambda each: float(each.rows.time[-1]), default=None)
    return Answer(best.number if best else None, "", now.sentence)


def unmoved(asked: Request, h: float, now: Pass, run: Run) -> Answer:
    """Halving has changed nothing at all."""
    if not any(np.ptp(column) for column in now.rows.columns.values()):
        return taken(now, f"communication step {h:.4g} s; no output changes")
    tolerance = told(asked)
    for _ in range(3):
        tolerance = max(tolerance / 100, SHARPEST)
        finer = run((asked.stop - asked.start) / max(SEEN, 4 * asked.coarsest), tolerance)
        if finer.sentence and not finer.ended:
            return farthest(now, finer)
        off = apart(now.rows, finer.rows, asked)
        if off == 0.0:
            own = fixed(finer.rows)
            what = f"its own step is fixed, at {own:.3g} s" if own else "it takes steps of its own"
            change = "neither shorter communication steps nor a smaller tolerance change anything at all"
            return taken(finer, f"{what}, its error unknown: {change}")
        if off <= asked.tolerance:
            note = f"it takes steps of its own, by the tolerance that it is told, {tolerance:.2g}"
            return taken(finer, f"{note}; a hundred times as much changes no output by more than {off:.2g}")
        now = finer
    return apart_still(f"a hundredth of the tolerance that it is told, {tolerance:.2g},", now, off, asked)


def fixed(rows: Rows) -> float | None:
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


def by_tolerance(asked: Request, h: float, run: Run) -> Answer:
    """The tolerance of the solver is taken ten times smaller until two results agree at the points."""
    rtol, off = asked.tolerance, inf
    before: Pass | None = None
    for _ in range(TENTHS):
        now = run(h, rtol)
        if now.sentence and not now.ended:
            return farthest(before, now)
        if before:
            off = apart(before.rows, now.rows, asked)
            if off <= asked.tolerance:
                what = f"fmpy's CVode at rtol {rtol:.2g}; ten times as much changes no output by more than {off:.2g}"
                return taken(now, what)
        before, rtol = now, max(rtol / 10, SHARPEST)
    return apart_still("a tenth of the tolerance of fmpy's CVode", now, off, asked)


@np.errstate(over="ignore")  # what numpy says of that would be told as printed by the FMU
def apart(one: Rows, two: Rows, asked: Request) -> float:
    """The largest difference of two passes, as a share of each variable's largest value, at the coarsest times."""
    end = min(each.time[-1] if len(each.time) else asked.start for each in (one, two))
    at = np.linspace(asked.start, asked.stop, asked.coarsest + 1)
    at = at[at <= end + 1e-9 * (asked.stop - asked.start)]
    if len(at) < 2:
        return inf
    worst = 0.0
    for name, column in two.columns.items():
        left, right = one.columns[name][last(one.time, at)].astype(float), column[last(two.time, at)].astype(float)
        size = float(np.abs(right).max())
        worst = max(worst, float(np.abs(left - right).max()) / size if size else float(np.abs(left).max() > 0))
    return worst


def last(time: np.ndarray, at: np.ndarray) -> np.ndarray:
    """The last rows at the times, or just before."""
    near = 1e-9 * (time[-1] - time[0])
    return np.searchsorted(time, at + near, "right") - 1
