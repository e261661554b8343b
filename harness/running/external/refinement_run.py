"""One pass, from start to stop, and how it may end before."""

from dataclasses import dataclass

from .sample_rows import SampleRows


@dataclass(frozen=True)
class TimeGrid:
    """From `start` to `stop` in steps of `h`, all in s."""

    start: float
    stop: float
    h: float

    def progress(self, t: float) -> float:
        """How far a time is, as a share of it."""
        return (t - self.start) / (self.stop - self.start)


@dataclass(frozen=True)
class RefinementRun:
    """The number of a pass, its rows, and the sentence why it is not whole, empty if it is: the FMU has `ended` itself,
    has `refused` a step, or has failed."""

    number: int
    rows: SampleRows
    message: str = ""
    terminated: bool = False
    step_refused: bool = False


class TerminatedError(Exception):
    """The FMU has ended the simulation, at `t` in s if it tells."""

    def __init__(self, t: float | None, how: str) -> None:
        super().__init__(f"it ends itself: {how}")
        self.t = t


class StepRefusedError(Exception):
    """The FMU does not take a step of this size; it may take a shorter one."""
