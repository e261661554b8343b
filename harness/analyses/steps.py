"""Step sizes of the solver: count, sizes, rejected steps, and how far they collapse at reversals of the motion."""

import numpy as np

from ..errors import HarnessError
from ..results.quantity import AnalysisResult, step_size_quantities
from ..simulation.signals import column_of_role
from ..simulation.trajectory import Trajectory

NEIGHBOUR_STEPS = 5  # steps on either side of a reversal that count as near it


def analyse(run: Trajectory) -> AnalysisResult:
    """Measure the step sizes of a run that follows its solver; HarnessError if it does not."""
    if run.steps is None or not len(run.steps.h):
        raise HarnessError("the analysis 'steps' needs a run that follows the solver's own steps: set follow = true")
    h = run.steps.h
    collapse = None
    if "velocity" in run.motion_outputs:
        collapse = step_collapse(run.steps.t, h, run.time, column_of_role(run, "velocity"))
    return AnalysisResult(step_size_quantities(h, int(run.steps.rejected.sum()), collapse))


def step_collapse(ends: np.ndarray, h: np.ndarray, t: np.ndarray, v: np.ndarray) -> float | None:
    """Return the median step divided by the median of the smallest steps near reversals; None without a reversal.

    A reversal is a change of sign of the velocity; samples at rest are skipped.

    Parameters
    ----------
    ends : numpy.ndarray
        Bounds (n + 1,) of the steps in s.
    h : numpy.ndarray
        Step sizes (n,) in s.
    t, v : numpy.ndarray
        Sample times (m,) in s and velocities (m,).
    """
    moving_samples = np.flatnonzero(v)
    reversals = moving_samples[1:][np.diff(np.sign(v[moving_samples])) != 0]
    if not len(reversals):
        return None
    at = np.clip(np.searchsorted(ends, t[reversals]) - 1, 0, len(h) - 1)
    smallest = [h[max(i - NEIGHBOUR_STEPS, 0) : i + NEIGHBOUR_STEPS + 1].min() for i in at]
    return float(np.median(h) / np.median(smallest))
