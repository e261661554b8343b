"""Outcomes of cases, and step counts that are bounded by stability."""

import math
from dataclasses import dataclass

import numpy as np

from ...simulation.trajectory import Trajectory
from .cases import StabilityCase

FINISHED, REFUSED, WRONG = "finished", "refused", "wrong"


@dataclass(frozen=True)
class CaseOutcome:
    """Outcome of a case.

    Attributes
    ----------
    case : StabilityCase
        The case.
    ended : str
        FINISHED, REFUSED or WRONG.
    text : str
        Message of the FMU, or reason why the outcome is wrong.
    error : float
        Largest error relative to the largest value; NaN if undefined.
    energy_rise : float
        Rise of the energy without external work, relative to its largest value; NaN if undefined.
    motion : Trajectory or None
        Run of the case, if it finished.
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
