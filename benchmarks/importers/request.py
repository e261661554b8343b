"""Requests to the adapters and their replies.

An adapter prints log messages of the FMU to standard error if the tool forwards them.
"""

from dataclasses import dataclass, field
from importlib import import_module

from harness.scenes.run_spec import RunSpec


@dataclass(frozen=True)
class ImporterRequest:
    """Run of instances of one FMU with equal communication steps from 0 s on; values are set in the first instance."""

    run: RunSpec
    references: dict[str, int]  # value references of all variables
    instances: list[str] = field(default_factory=lambda: ["a"])
    midrun_changes: dict[str, float] = field(default_factory=dict)  # set in the first instance after half of the steps
    connection: list[str] = field(default_factory=list)  # output of the first instance, input of the second
    rerun: bool = False  # reset and run again with start values
    reset_cycles: int = 0  # C program only: number of reset cycles to run instead; three last rows of each

    @property
    def step(self) -> float:
        """Return the communication step in s."""
        assert self.run.grid is not None
        return self.run.grid

    @property
    def steps(self) -> int:
        """Return the number of communication steps."""
        assert self.run.stop is not None
        return round(self.run.stop / self.step)


@dataclass(frozen=True)
class ImporterReply:
    """Reply of an adapter.

    Attributes
    ----------
    version : str
        Version of the tool.
    rows, rerun : list of list of float
        Rows of values at the communication points, of the run and of the rerun.
    n_accepted : int
        Number of accepted steps.
    """

    version: str
    rows: list[list[float]]
    rerun: list[list[float]]
    n_accepted: int


def run_in_adapter(module: str, request: ImporterRequest) -> ImporterReply:
    """Execute a request by the module of an adapter, in a worker process: importing some tools may end it."""
    reply: ImporterReply = import_module(module).run_request(request)
    return reply
