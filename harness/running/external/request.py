"""Request to the child process that runs an external FMU, and its result; both in JSON."""

from dataclasses import dataclass, field
from typing import Any

# names of files in the directory
RESULT_FILE, PROGRESS_FILE, OUTPUT_FILE, TIMEOUT_FILE, STRINGS_FILE = (
    "result.json",
    "progress",
    "output",
    "timeout",
    "strings",
)
ROWS_PREFIX = "rows-"  # followed by the number of a run
COARSEST_STEPS = 64  # communication steps of the coarsest run by default


@dataclass(frozen=True)
class ExternalRunRequest:
    """Request to run an unpacked FMU and write rows of its outputs.

    Attributes
    ----------
    folder : str
        Directory of the unpacked FMU.
    directory : str
        Directory for results.
    exchange : bool
        Model exchange instead of co-simulation.
    start, stop : float
        Times in s.
    tolerance : float
        Tolerance for the agreement of two results.
    timeout : float
        Time limit of one FMI call in s.
    grid : float or None
        Communication step in s; None to refine it.
    coarsest_step : float or None
        Communication step of the coarsest run in s; None for `COARSEST_STEPS` equal ones. The steps of all other runs
        are whole fractions of it, so that every run has its communication points.
    values : dict
        Values to set, by variable name.
    outputs : dict
        Shapes of the outputs, by variable name.
    """

    folder: str
    directory: str
    exchange: bool
    start: float
    stop: float
    tolerance: float
    timeout: float
    grid: float | None = None
    coarsest_step: float | None = None
    values: dict[str, Any] = field(default_factory=dict)
    outputs: dict[str, list[int]] = field(default_factory=dict)
    inputs: dict[str, list[float]] = field(default_factory=dict)

    @property
    def longest_step(self) -> float:
        """Return the communication step of the coarsest run in s."""
        return self.coarsest_step or (self.stop - self.start) / COARSEST_STEPS


@dataclass(frozen=True)
class RefinementResult:
    """Selected run, None if there is none; a note on its accuracy; the reason for failure, empty if it is complete."""

    run_number: int | None
    note: str
    failure: str = ""
