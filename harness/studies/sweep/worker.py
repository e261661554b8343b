"""What a worker does: run a block of points with the instance that it keeps."""

from contextlib import ExitStack
from dataclasses import dataclass
from threading import Lock
from time import perf_counter

import numpy as np

from ...process.temporary_directory import temporary_directory
from .runner import Runner, SweepSpec, open_runner

BUSY = Lock()  # an FMU of pythonfmu is one thread's at a time
LOADED: dict[tuple[SweepSpec, str], Runner] = {}  # the instance of the present sweep
HELD = ExitStack()  # what frees it


@dataclass(frozen=True)
class BlockResult:
    """The measures of a block, (runs, columns), NaN where a run failed; the sentences of these, by their place; and
    what the runs took, in s."""

    values: np.ndarray
    messages: dict[int, str]
    seconds: float


def run_block(points: np.ndarray, runs: SweepSpec, digest: str, fmu: bytes) -> BlockResult | None:
    """The work on a block, with the FMU of that digest; None if it is neither held nor given."""
    with BUSY:
        runner = LOADED.get((runs, digest))
        if not runner:
            if not fmu:
                return None
            runner = load(runs, digest, fmu)
        begun = perf_counter()
        values, messages = np.full((len(points), len(runner.columns)), np.nan), {}
        for i, point in enumerate(points.tolist()):
            measured = runner.run(point)
            if isinstance(measured, str):
                messages[i] = measured
            else:
                values[i] = measured
        return BlockResult(values, messages, perf_counter() - begun)


def load(runs: SweepSpec, digest: str, fmu: bytes) -> Runner:
    """The runner of another sweep; the one before is freed."""
    free()
    file = HELD.enter_context(temporary_directory("sweep-")) / f"{runs.model}.fmu"
    file.write_bytes(fmu)
    LOADED[runs, digest] = found = HELD.enter_context(open_runner(runs, file))
    return found


def free() -> None:
    LOADED.clear()
    HELD.close()


def unload() -> None:
    """Free the instance and remove its files."""
    with BUSY:
        free()
