"""What a player is asked, and how it answers: JSON over standard input and output, one request after another.

A player prints the FMU's log to standard error, if the tool hands it on, and what is returned here to standard output.
"""

import json
import os
import sys
from collections.abc import Callable
from dataclasses import asdict, dataclass, field

END = "\0"  # on standard error, of what is said while a request is carried out


@dataclass(frozen=True)
class ImporterRequest:
    """Equal communication steps of `step` s from t = 0 on, with instances of one FMU; Reals are written and read."""

    fmu: str
    references: dict[str, int]  # of the variables named below
    step: float
    steps: int
    outputs: list[str]
    instances: list[str] = field(default_factory=lambda: ["a"])
    values: dict[str, float] = field(default_factory=dict)  # of the first instance, before the run
    midrun_changes: dict[str, float] = field(default_factory=dict)  # of the first instance, after half of the steps
    connection: list[str] = field(default_factory=list)  # an output of the first instance, an input of the second
    rerun: bool = False  # afterwards run once more, from a reset, with the start values
    reset_cycles: int = 0  # the C program only: so many lives of one instance instead, three last rows of each


@dataclass(frozen=True)
class ImporterReply:
    """Rows of values, one a point in time, instance after instance; those of the run after a reset; how many steps the
    tool accepted.  Version of the tool."""

    version: str
    rows: list[list[float]]
    rerun: list[list[float]]
    accepted: int


def serve(run_request: Callable[[ImporterRequest], ImporterReply]) -> None:
    """Answer the requests on standard input, a line each; what a tool prints goes to standard error."""
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)
    for line in sys.stdin:
        print(json.dumps(asdict(run_request(ImporterRequest(**json.loads(line))))), file=answers, flush=True)
        print(END, end="", file=sys.stderr, flush=True)
