"""Single runs of a step refinement, and early ends."""

from dataclasses import dataclass

from .sample_rows import SampleRows


@dataclass(frozen=True)
class TimeGrid:
    """Times from `start` to `stop` in steps of `h`, in s."""

    start: float
    stop: float
    h: float

    def progress(self, t: float) -> float:
        """Return the progress at a time, from 0 to 1."""
        return (t - self.start) / (self.stop - self.start)


@dataclass(frozen=True)
class RefinementRun:
    """Number and rows of a run. If it is incomplete, `message` contains the reason: the FMU terminated the simulation,
    refused a step, or failed.
    """

    number: int
    rows: SampleRows
    message: str = ""
    terminated: bool = False
    step_refused: bool = False


class TerminatedError(Exception):
    """The FMU terminated the simulation, at `t` in s if known."""

    def __init__(self, t: float | None, reason: str) -> None:
        super().__init__(f"it terminated the simulation: {reason}")
        self.t = t


class StepRefusedError(Exception):
    """The FMU rejected a step of this size; a shorter one may succeed."""
