"""Worker of a sweep: runs blocks of points with a loaded FMU instance."""

from contextlib import ExitStack
from dataclasses import dataclass, replace
from threading import Lock
from time import perf_counter

import numpy as np

from ...process.temporary_directory import temporary_directory
from .runner import Runner, SweepSpec, open_runner

BUSY = Lock()  # a pythonfmu FMU must be used by one thread at a time
LOADED: dict[tuple[str, str], Runner] = {}  # the runner of the current sweep, by its specification and FMU
RESOURCES = ExitStack()  # of this runner


@dataclass(frozen=True)
class BlockResult:
    """Results of a block.

    Attributes
    ----------
    values : numpy.ndarray
        Measures (runs, columns); NaN for failed runs.
    messages : dict
        Error messages by index in the block.
    seconds : float
        Run time in s.
    """

    values: np.ndarray
    messages: dict[int, str]
    seconds: float


def run_block(points: np.ndarray, runs: SweepSpec, digest: str, fmu: bytes) -> BlockResult | None:
    """Run a block with the FMU of this digest; return None if that FMU is neither loaded nor passed in `fmu`."""
    with BUSY:
        runner = LOADED.get((repr(runs), digest))
        if not runner:
            if not fmu:
                return None
            runner = load(runs, digest, fmu)
        start = perf_counter()
        values, messages = np.full((len(points), len(runner.columns)), np.nan), {}
        for i, point in enumerate(points.tolist()):
            measures = runner.run(point)
            if isinstance(measures, str):
                messages[i] = measures
            else:
                values[i] = measures
        return BlockResult(values, messages, perf_counter() - start)


def load(runs: SweepSpec, digest: str, fmu: bytes) -> Runner:
    """Load the runner of another sweep and free the previous one."""
    free()
    file = RESOURCES.enter_context(temporary_directory("sweep-")) / f"{runs.run.model}.fmu"
    file.write_bytes(fmu)
    local = replace(runs, run=replace(runs.run, fmu=file))
    LOADED[repr(runs), digest] = runner = RESOURCES.enter_context(open_runner(local))
    return runner


def free() -> None:
    LOADED.clear()
    RESOURCES.close()


def unload() -> None:
    """Free the instance and remove its files."""
    with BUSY:
        free()
