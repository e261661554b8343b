"""The solver's own steps: how many, how large, how many refused, and how they collapse where the motion reverses."""

from dataclasses import dataclass

import numpy as np

from ..errors import HarnessError
from ..results.quantity import Quantity
from ..running.run import Run

NEAR = 5  # steps on either side of a reversal that belong to it


@dataclass(frozen=True)
class StepSizes:
    """Number of time points, sizes in s, refused share of all tried; `collapse` is None where nothing reverses."""

    count: int
    mean: float
    smallest: float
    largest: float
    refused: float
    collapse: float | None

    @property
    def quantities(self) -> tuple[Quantity, ...]:
        found = [
            Quantity("steps", self.count, "", "steps (time points)"),
            Quantity("mean_step", self.mean, "s", "mean step"),
            Quantity("smallest_step", self.smallest, "s", "smallest step"),
            Quantity("largest_step", self.largest, "s", "largest step"),
            Quantity("refused", self.refused, "1", "share of refused steps"),
        ]
        if self.collapse is not None:
            found.append(Quantity("collapse", self.collapse, "1", "collapse at reversals"))
        return tuple(found)


def analyse(run: Run) -> StepSizes:
    """The step sizes of a run that followed its solver."""
    if run.steps is None or not len(run.steps.h):
        raise HarnessError("the analysis 'steps' needs a run that follows the solver's own steps")
    h = run.steps.h
    refused = int(run.steps.rejected.sum())
    collapse = None
    if "velocity" in run.wanted.motion:
        collapse = collapse_at_reversals(run.steps.t, h, run.time, run.motion("velocity"))
    return StepSizes(
        count=len(h) + 1,
        mean=published_mean(h),
        smallest=float(h.min()),
        largest=float(h.max()),
        refused=refused / (refused + len(h)),
        collapse=collapse,
    )


def published_mean(h: np.ndarray) -> float:
    """The mean of the steps h (n,), the last one counted twice, as in the published figures."""
    return float((h.sum() + h[-1]) / (len(h) + 1))


def collapse_at_reversals(ends: np.ndarray, h: np.ndarray, t: np.ndarray, v: np.ndarray) -> float | None:
    """The median step over the median of the smallest steps near the reversals of v (m,) at t (m,).

    `ends` (n + 1,) bounds the steps h (n,).  A reversal is a change of sign, rests skipped; None without any.
    """
    moving = np.flatnonzero(v)
    reversals = moving[1:][np.diff(np.sign(v[moving])) != 0]
    if not len(reversals):
        return None
    at = np.clip(np.searchsorted(ends, t[reversals]) - 1, 0, len(h) - 1)
    smallest = [h[max(i - NEAR, 0) : i + NEAR + 1].min() for i in at]
    return float(np.median(h) / np.median(smallest))
