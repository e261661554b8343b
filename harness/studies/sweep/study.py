"""Runs of a sweep: one FMU, many points, many workers, and a checkpoint that survives a kill.

Every finished block of runs is written to the checkpoint, so that the same command resumes an interrupted sweep.
Results do not depend on the worker or the order of execution, and only the blocks in progress are held in memory.  A
run that kills its worker is located by bisection and reported.
"""

import json
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
from .checkpoint import Checkpoint, RunBlock
from .cluster import DaskCluster, connect_cluster
from .runner import SweepSpec
from .sampling import SweepPoints
from .worker import BlockResult, run_block, unload

MAX_BLOCK_SIZE = 10_000  # runs
BLOCK_TIME = 0.5  # target run time of a block in s
SHARES = 4  # minimum number of blocks per worker, to balance the load
MAX_DEATHS = 200
WORKER_DIED = "the process died in this run"

Span = tuple[int, int]  # range of runs: first, and one after the last


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


def run_pending(
    sweep: Sweep, checkpoint: Checkpoint, scheduler: str | None, workers: int | None, report: Callable[[float], None]
) -> float:
    """Do the missing runs and write them to the checkpoint; return the elapsed time in s."""
    start = perf_counter()
    pending = checkpoint.missing_spans
    if not pending:
        return 0.0
    try:
        with open_workers(scheduler, workers, sum(last - first for first, last in pending)) as pool:
            for block in Dispatcher(sweep, pool, pending).completed_blocks():
                checkpoint.add(block)
                report(checkpoint.n_done / len(sweep.points))
    except BaseException as error:  # an interrupt may cause any exception
        if not (RECEIVED_SIGNALS or isinstance(error, KeyboardInterrupt)):
            raise
        state = f"{checkpoint.n_done} of {len(sweep.points)} runs are finished"
        raise CommandInterruptedError(f"interrupted: {state}; repeat the command to resume") from None
    return perf_counter() - start


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
        return
    if workers is None:
        try:
            yield InProcess()
        finally:
            unload()
        return
    with WorkerPool(min(workers, runs)) as pool:
        yield pool


class Dispatcher:
    """Distributes the runs of a sweep to workers, in blocks that grow until each takes half a second."""

    def __init__(self, sweep: Sweep, workers: WorkerPool | DaskCluster | InProcess, pending: list[Span]) -> None:
        self.sweep, self.workers, self.pending = sweep, workers, pending[::-1]
        self.size = 1
        self.running: dict[Future[BlockResult | None], Span] = {}
        self.suspects: list[Span] = []  # blocks in which a worker died
        self.is_isolated = False  # whether a suspect runs, with no other block
        self.deaths = 0

    def completed_blocks(self) -> Iterator[RunBlock]:
        """Yield blocks as workers finish them."""
        while self.pending or self.suspects or self.running:
            check_interrupt()
            self.dispatch()
            for future in self.workers.wait_for_any(self.running):
                yield from self.handle_result(future, self.running.pop(future))

    def dispatch(self) -> None:
        """Keep every worker busy, with one block in reserve."""
        while not self.is_isolated and len(self.running) < 2 * max(1, self.workers.size):
            if self.suspects and not self.running:
                self.is_isolated = True
                self.submit_block(self.suspects.pop())
            elif self.pending and not self.suspects:
                self.submit_block(self.next_span())
            else:
                return

    def next_span(self) -> Span:
        """Return the next block of the remaining runs."""
        first, last = self.pending.pop()
        share = sum(last - first for first, last in [*self.pending, (first, last)]) // (
            SHARES * max(1, self.workers.size)
        )
        end = min(last, first + max(1, min(self.size, share)))
        if end < last:
            self.pending.append((end, last))
        return first, end

    def submit_block(self, span: Span, fmu: bytes = b"") -> None:
        sweep = self.sweep
        self.running[self.workers.submit(run_block, sweep.points.coordinates(*span), sweep.runs, sweep.digest, fmu)] = (
            span
        )

    def handle_result(self, future: "Future[BlockResult | None]", span: Span) -> Iterator[RunBlock]:
        """Handle a finished block, or the death of its worker."""
        first, last = span
        try:
            result = future.result()
        except self.workers.death_errors:
            if self.is_isolated and last - first == 1:
                self.requeue([])
                yield RunBlock(first, np.full((1, self.sweep.columns), np.nan), {0: WORKER_DIED})
            else:
                middle = (first + last) // 2
                self.requeue([(first, middle), (middle, last)] if self.is_isolated else [span])
        except HarnessError:
            raise
        except Exception as error:  # such as a missing package or lack of memory
            raise HarnessError(f"a worker failed: {type(error).__name__}: {error}") from None
        else:
            if result is None:
                self.submit_block(span, self.sweep.fmu)
                return
            self.is_isolated = False
            elapsed = max(result.seconds, 1e-9)
            self.size = max(1, min(MAX_BLOCK_SIZE, 10 * self.size, round((last - first) / elapsed * BLOCK_TIME)))
            yield RunBlock(first, result.values, result.messages)

    def requeue(self, spans: list[Span]) -> None:
        """Put the blocks of a dead worker back into the queue."""
        self.is_isolated, self.deaths = False, self.deaths + 1
        if self.deaths > MAX_DEATHS:
            raise HarnessError(f"workers died {self.deaths} times; repeat the command to resume")
        self.suspects += spans
