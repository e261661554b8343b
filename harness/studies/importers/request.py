"""Requests to the adapters and their replies.

An adapter prints log messages of the FMU to standard error if the tool passes them on.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

from ...process.child_process import RequestServer


@dataclass(frozen=True)
class ImporterRequest:
    """A run of instances of one FMU with equal communication steps of `step` s, starting at t = 0."""

    fmu: str
    references: dict[str, int]  # value references of the variables below
    step: float
    steps: int
    outputs: list[str]
    instances: list[str] = field(default_factory=lambda: ["a"])
    values: dict[str, float] = field(default_factory=dict)  # set in the first instance before the run
    midrun_changes: dict[str, float] = field(default_factory=dict)  # set in the first instance after half of the steps
    connection: list[str] = field(default_factory=list)  # output of the first instance, input of the second
    rerun: bool = False  # reset and run again with start values
    reset_cycles: int = 0  # C program only: number of reset cycles to run instead; three last rows of each


@dataclass(frozen=True)
class ImporterReply:
    """Version of the tool, rows of values (one per communication point), rows of the rerun, and number of accepted
    steps."""

    version: str
    rows: list[list[float]]
    rerun: list[list[float]]
    accepted: int


def serve(run_request: Callable[[ImporterRequest], ImporterReply]) -> None:
    """Execute the requests of the parent."""
    RequestServer().serve(lambda request: run_request(ImporterRequest(**request)))
