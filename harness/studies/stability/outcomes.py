"""Outcomes of cases, and step counts that are bounded by stability."""

import math
from dataclasses import dataclass

import numpy as np

from ...running.trajectory import Trajectory
from .cases import StabilityCase

FINISHED, REFUSED, WRONG = "finished", "refused", "wrong"


@dataclass(frozen=True)
class CaseOutcome:
    """Outcome of a case: `ended` is finished, refused or wrong; `text` is the message of the FMU or the reason.

    `error` and `energy_rise` (without external work) are relative to the largest values; NaN if undefined.
    """

    case: StabilityCase
    ended: str
    text: str
    error: float = math.nan
    energy_rise: float = math.nan
    motion: Trajectory | None = None

    @property
    def steps(self) -> int:
        """Return the number of accepted steps of the run."""
        return self.motion.statistics.steps if self.motion and self.motion.statistics else 0

    @property
    def expected(self) -> str:
        case = self.case
        if case.inject_nonfinite:
            return "refused, naming each variable"
        if case.expected_message:
            return f"refused: {case.expected_message}"
        return f"finished within {case.max_error:g}{', or refused' * case.may_be_refused}"

    @property
    def has_passed(self) -> bool:
        """Return whether the case ended as expected."""
        if self.case.may_be_refused and self.ended != WRONG:
            return True
        return self.ended == (REFUSED if self.case.inject_nonfinite or self.case.expected_message else FINISHED)


@dataclass(frozen=True)
class StabilityRegion:
    """Number of `steps` (n,) of a method over x_m in m/s (`stiffness`, (n,)), with the slope in log-log scale.

    The slope is that of the two stiffest scenes: -1 for an explicit method at its stability limit, 0 without limit.
    """

    method: str
    stiffness: np.ndarray
    steps: np.ndarray
    slope: float
