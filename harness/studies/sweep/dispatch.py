"""Distributes the runs of a sweep to workers.

Results do not depend on the worker or the order of execution. A run that kills its worker is located by bisection.
"""

import json
import logging
from collections.abc import Callable, Collection, Iterator
from concurrent.futures import Future
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from functools import cached_property
from hashlib import sha256
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from ...errors import HarnessError
from ...process.interrupt import RECEIVED_SIGNALS, CommandInterruptedError, check_interrupt
from ...process.worker import WorkerPool
from .checkpoint import Checkpoint
from .cluster import DaskCluster, connect_cluster
from .runner import SweepSpec
from .sampling import SweepPoints
from .worker import BlockResult, run_block, unload

LOG = logging.getLogger(__name__)
MAX_BLOCK_SIZE = 10_000  # runs
BLOCK_TIME = 0.5  # target run time of a block in s
SHARES = 4  # minimum number of blocks per worker, to balance the load
MAX_DEATHS = 200
WORKER_DIED = "the process died in this run"

Span = tuple[int, int]  # number of the first run, and the number after the last run


@dataclass(frozen=True)
class Sweep:
    """A sweep: the settings of its `runs`, its `points`, the content of the FMU, and the number of `columns`."""

    runs: SweepSpec
    points: SweepPoints
    fmu: bytes
    columns: int

    @cached_property
    def digest(self) -> str:
        """Return the SHA-256 of the FMU in hexadecimal."""
        return sha256(self.fmu).hexdigest()

    @cached_property
    def key(self) -> str:
        """Return a key that identifies the sweep."""
        run = self.runs.run.options | {"model": self.runs.run.model}  # the folder of the FMU does not matter
        identity = [run, self.runs.varied, self.runs.measures, asdict(self.points), self.digest]
        return sha256(json.dumps(identity, sort_keys=True).encode()).hexdigest()[:16]

    def checkpoint(self, folder: Path) -> Checkpoint:
        return Checkpoint(folder / f".{self.key}.checkpoint", len(self.points), self.columns)


class InProcess:
    """Runs tasks at once in this process, for callers without worker processes."""

    size = 1
    death_errors: tuple[type[Exception], ...] = ()

    def submit(self, function: Callable[..., Any], *arguments: Any) -> Future[Any]:
        """Call function(*arguments) and return its result as a finished future."""
        future: Future[Any] = Future()
        try:
            future.set_result(function(*arguments))
        except Exception as error:
            future.set_exception(error)
        return future

    def wait_for_any(self, futures: Collection[Future[Any]]) -> set[Future[Any]]:
        """Return the futures that are done, which are all."""
        return set(futures)


@contextmanager
def open_workers(
    scheduler: str | None, workers: int | None, runs: int
) -> Iterator[WorkerPool | DaskCluster | InProcess]:
    """Open the workers: processes on this machine, or the cluster of a scheduler."""
    if scheduler is not None:
        with connect_cluster(scheduler, unload) as connection:
            yield connection
    elif workers is None:
        try:
            yield InProcess()
        finally:
            unload()
    else:
        with WorkerPool(min(workers, runs)) as pool:
            yield pool


def run_pending(
    sweep: Sweep,
    checkpoint: Checkpoint,
    scheduler: str | None,
    workers: int | None,
    report: Callable[[float], None],
    resume: str,
) -> float:
    """Do the missing runs and add them to the checkpoint; return the elapsed time in s.

    `resume` states, in the message of a sweep that ends early, what becomes of the finished runs.
    """
    start, total = perf_counter(), len(sweep.points)
    spans = checkpoint.missing_spans
    if not spans:
        return 0.0
    try:
        with open_workers(scheduler, workers, total - checkpoint.n_done) as pool:
            for first, values, messages in completed_blocks(sweep, pool, spans):
                checkpoint.add(first, values, messages)
                LOG.debug("%d of %d runs are finished", checkpoint.n_done, total)
                report(checkpoint.n_done / total)
    except BaseException as error:  # an interrupt may cause any exception
        state = f"{checkpoint.n_done} of {total} runs are finished; {resume}"
        if RECEIVED_SIGNALS or isinstance(error, KeyboardInterrupt):
            raise CommandInterruptedError(f"interrupted: {state}") from None
        if isinstance(error, HarnessError) and checkpoint.n_done:
            raise HarnessError(f"{error}; {state}") from None
        raise
    return perf_counter() - start


def completed_blocks(
    sweep: Sweep, workers: WorkerPool | DaskCluster | InProcess, spans: list[Span]
) -> Iterator[tuple[int, np.ndarray, dict[int, str]]]:
    """Do the runs of all spans in blocks that grow until each takes half a second.

    Every worker has one block in reserve. A block whose worker died is a suspect: it is repeated while nothing else
    runs, because a cluster also blames blocks that waited for the same worker, and is halved if its worker dies again,
    down to the run that kills it.

    Yields
    ------
    first, values, messages : int, numpy.ndarray, dict
        Number of the first run of a finished block, its values (runs, columns), and error messages by index.
    """
    pending, suspects, running = spans[::-1], list[Span](), dict[Future[BlockResult | None], Span]()
    size, deaths, is_isolated = 1, 0, False

    def submit(first: int, end: int, fmu: bytes = b"") -> None:
        points = sweep.points.coordinates(first, end)
        running[workers.submit(run_block, points, sweep.runs, sweep.digest, fmu)] = first, end

    while pending or suspects or running:
        check_interrupt()
        if suspects and not running:
            is_isolated = True
            submit(*suspects.pop())
        while pending and not suspects and not is_isolated and len(running) < 2 * max(1, workers.size):
            share = sum(end - first for first, end in pending) // (SHARES * max(1, workers.size))
            first, last = pending.pop()
            end = min(last, first + max(1, min(size, share)))
            pending += [(end, last)] if end < last else []
            submit(first, end)
        for future in workers.wait_for_any(running):
            first, end = running.pop(future)
            try:
                result = future.result()
            except workers.death_errors:
                deaths += 1
                if deaths > MAX_DEATHS:
                    raise HarnessError(f"workers died {deaths} times") from None
                if is_isolated and end == first + 1:
                    yield first, np.full((1, sweep.columns), np.nan), {0: WORKER_DIED}
                else:
                    middle = (first + end) // 2
                    suspects += [(first, middle), (middle, end)] if is_isolated else [(first, end)]
                is_isolated = False
            except HarnessError:
                raise
            except Exception as error:  # such as a missing package or lack of memory
                raise HarnessError(f"a worker failed: {type(error).__name__}: {error}") from None
            else:
                if result is None:  # the worker does not have the FMU yet
                    submit(first, end, sweep.fmu)
                    continue
                is_isolated = False
                elapsed = max(result.seconds, 1e-9)
                size = max(1, min(MAX_BLOCK_SIZE, 10 * size, round((end - first) / elapsed * BLOCK_TIME)))
                yield first, result.values, result.messages
