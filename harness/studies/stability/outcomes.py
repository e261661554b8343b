"""How the cases end, and where a method's steps are bounded by stability."""

import math
from dataclasses import dataclass

import numpy as np

from ...running.fmu_session import CompletedRun
from .cases import StabilityCase

FINISHED, REFUSED, WRONG = "finished", "refused", "wrong"


@dataclass(frozen=True)
class CaseOutcome:
    """How a case ended: `ended` is finished, refused or wrong; `text` is the FMU's sentence, or what is wrong.

    `error` and `rise` (of energy that nobody put in) are shares of the largest values; NaN where there is none.
    """

    case: StabilityCase
    ended: str
    text: str
    error: float = math.nan
    energy_rise: float = math.nan
    motion: CompletedRun | None = None

    @property
    def expected(self) -> str:
        case = self.case
        if case.inject_nonfinite:
            return "refused, each by name"
        if case.expected_message:
            return f"refused: {case.expected_message}"
        return f"finished within {case.max_error:g}{', or refused' * case.may_be_refused}"

    @property
    def passed(self) -> bool:
        """Whether it ended as it should."""
        if self.case.may_be_refused and self.ended != WRONG:
            return True
        return self.ended == (REFUSED if self.case.inject_nonfinite or self.case.expected_message else FINISHED)


@dataclass(frozen=True)
class StabilityRegion:
    """Where a method's steps are bounded by stability: `steps` (n,) against `stiff` (n,), and the slope, log by log.

    The slope is that of the two stiffest scenes: -1 is an explicit method at its limit, 0 one that has none.
    """

    method: str
    stiffness: np.ndarray
    steps: np.ndarray
    slope: float
