"""What the process that holds an FMU is asked, and what it answers; both as JSON."""

from dataclasses import dataclass, field
from typing import Any

RESULT_FILE, PROGRESS_FILE, OUTPUT_FILE, TIMEOUT_FILE, STRINGS_FILE = (
    "answer.json",
    "share",
    "said",
    "hung",
    "texts",
)  # files in the room
ROWS_PREFIX = "rows-"  # and the number of a pass
COARSEST_STEPS = 64  # communication steps


@dataclass(frozen=True)
class ExternalRunRequest:
    """Run the FMU that is unpacked in a `folder`, and write rows of its `outputs`, names with their shapes,
    into a `room`.

    The communication steps are those of the `grid` in s, or, None, ever shorter ones, so many in the `coarsest` pass,
    until two results agree to the `tolerance`.  A call that takes more than `timeout` s hangs.
    """

    folder: str
    directory: str
    exchange: bool
    start: float
    stop: float
    tolerance: float
    timeout: float
    grid: float | None = None
    coarsest: int = COARSEST_STEPS
    values: dict[str, Any] = field(default_factory=dict)
    outputs: dict[str, list[int]] = field(default_factory=dict)
    inputs: dict[str, list[float]] = field(default_factory=dict)


@dataclass(frozen=True)
class RefinementResult:
    """The number of the pass to take, None if there is none; how exact it is, and what it lacks, empty if nothing."""

    run_number: int | None
    note: str
    failure: str = ""
