"""The solver's own steps: how many, how large, how many refused, and how they collapse where the motion reverses."""

import numpy as np

from ..errors import HarnessError
from ..results.quantity import AnalysisResult
from ..results.step_sizes import step_size_quantities
from ..running.trajectory import Trajectory

NEIGHBOUR_STEPS = 5  # steps on either side of a reversal that belong to it


def analyse(run: Trajectory) -> AnalysisResult:
    """The step sizes of a run that followed its solver."""
    if run.steps is None or not len(run.steps.h):
        raise HarnessError("the analysis 'steps' needs a run that follows the solver's own steps: add follow = true")
    h = run.steps.h
    collapse = None
    if "velocity" in run.spec.motion_outputs:
        collapse = step_collapse(run.steps.t, h, run.time, run.column_of_role("velocity"))
    return AnalysisResult(step_size_quantities(h, int(run.steps.rejected.sum()), collapse))


def step_collapse(ends: np.ndarray, h: np.ndarray, t: np.ndarray, v: np.ndarray) -> float | None:
    """The median step over the median of the smallest steps near the reversals of v (m,) at t (m,).

    `ends` (n + 1,) bounds the steps h (n,).  A reversal is a change of sign, rests skipped; None without any.
    """
    moving = np.flatnonzero(v)
    reversals = moving[1:][np.diff(np.sign(v[moving])) != 0]
    if not len(reversals):
        return None
    at = np.clip(np.searchsorted(ends, t[reversals]) - 1, 0, len(h) - 1)
    smallest = [h[max(i - NEIGHBOUR_STEPS, 0) : i + NEIGHBOUR_STEPS + 1].min() for i in at]
    return float(np.median(h) / np.median(smallest))
