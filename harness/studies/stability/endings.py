"""How the cases end, and where a method's steps are bounded by stability."""

import math
from dataclasses import dataclass

import numpy as np

from ...running.fmu_session import CompletedRun
from .cases import Trial

FINISHED, REFUSED, WRONG = "finished", "refused", "wrong"


@dataclass(frozen=True)
class Ending:
    """How a case ended: `ended` is finished, refused or wrong; `text` is the FMU's sentence, or what is wrong.

    `error` and `rise` (of energy that nobody put in) are shares of the largest values; NaN where there is none.
    """

    case: Trial
    ended: str
    text: str
    error: float = math.nan
    rise: float = math.nan
    motion: CompletedRun | None = None

    @property
    def expected(self) -> str:
        case = self.case
        if case.poison:
            return "refused, each by name"
        if case.refuse:
            return f"refused: {case.refuse}"
        return f"finished within {case.finish:g}{', or refused' * case.either}"

    @property
    def well(self) -> bool:
        """Whether it ended as it should."""
        if self.case.either and self.ended != WRONG:
            return True
        return self.ended == (REFUSED if self.case.poison or self.case.refuse else FINISHED)


@dataclass(frozen=True)
class Region:
    """Where a method's steps are bounded by stability: `steps` (n,) against `stiff` (n,), and the slope, log by log.

    The slope is that of the two stiffest scenes: -1 is an explicit method at its limit, 0 one that has none.
    """

    method: str
    stiff: np.ndarray
    steps: np.ndarray
    slope: float
