"""What happens over many parameters: one FMU, many points, many workers, and a journal that survives a kill.

Every block of runs that is finished is written to the journal beside the results, so the same command after an
interruption does only what is left.  The rows do not depend on who ran them, nor in which order, and no more of them
is held in memory than a worker has under way.  A run during which its worker dies is found by halves, and told.
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
from ...process.temporary_directory import temporary_directory
from ...process.worker_pool import WorkerPool
from .cluster import DaskCluster, connect_cluster
from .journal import Block, Journal
from .runner import SweepSpec
from .sampling import SweepPoints
from .worker import BlockResult, run_block, unload

MAX_BLOCK_SIZE = 10_000  # runs
BLOCK_TIME = 0.5  # s that a block is to take
SHARES = 4  # blocks that each worker is to have at least, so that none waits for the last one
MAX_DEATHS = 200
WORKER_DIED = "the process died in this run"

Span = tuple[int, int]  # numbers of runs: the first, and the one behind the last


@dataclass(frozen=True)
class Sweep:
    """The `runs` at `points`; a row has so many `columns`."""

    runs: SweepSpec
    points: SweepPoints
    fmu: bytes
    columns: int

    @cached_property
    def digest(self) -> str:
        """SHA-256 of the FMU, in hexadecimal."""
        return sha256(self.fmu).hexdigest()

    @cached_property
    def key(self) -> str:
        """What tells this sweep from any other."""
        whole = [asdict(self.runs), asdict(self.points), self.digest]
        return sha256(json.dumps(whole, sort_keys=True).encode()).hexdigest()[:16]

    def journal(self, folder: Path) -> Journal:
        return Journal(folder / f".{self.key}.journal", len(self.points), self.columns)


def perform(
    sweep: Sweep, kept: Journal, scheduler: str | None, workers: int | None, report: Callable[[float], None]
) -> float:
    """Do the runs that are left, into the journal; returns what that took, in s, the start of the workers included."""
    begun = perf_counter()
    left = kept.missing_spans
    if not left:
        return 0.0
    try:
        with open_workers(scheduler, workers, sum(last - first for first, last in left)) as hands, kept.open():
            for block in Dispatcher(sweep, hands, left).completed_blocks():
                kept.add(block)
                report(kept.n_done / len(sweep.points))
    except BaseException as error:  # what an interrupt makes fail may say anything
        if not (RECEIVED_SIGNALS or isinstance(error, KeyboardInterrupt)):
            raise
        if not kept.n_done:
            kept.delete()
        state = f"{kept.n_done} of {len(sweep.points)} runs are kept"
        raise CommandInterruptedError(f"interrupted: {state}; the same command does the rest") from None
    return perf_counter() - begun


class InProcess:
    """Runs tasks at once in this process, for callers that do not want worker processes."""

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
    """Those who do the runs: processes of this machine, or the cluster of a scheduler."""
    if scheduler is not None:
        with connect_cluster(scheduler, unload) as found:
            yield found
        return
    if workers is None:
        try:
            yield InProcess()
        finally:
            unload()
        return
    with temporary_directory("sweep-") as folder:
        hands = WorkerPool(min(workers, runs), folder, [BlockResult.__module__])
        try:
            yield hands
        finally:
            hands.kill()


class Dispatcher:
    """The runs of a sweep on their way through the workers, in blocks that grow until each takes half a second."""

    def __init__(self, sweep: Sweep, hands: WorkerPool | DaskCluster | InProcess, left: list[Span]) -> None:
        self.sweep, self.hands, self.left = sweep, hands, left[::-1]
        self.size = 1
        self.busy: dict[Future[BlockResult | None], Span] = {}
        self.suspects: list[Span] = []  # blocks during which a worker died
        self.alone = False  # whether one of these is tried, with nothing beside it
        self.deaths = 0

    def completed_blocks(self) -> Iterator[Block]:
        """The blocks as workers finish them."""
        while self.left or self.suspects or self.busy:
            check_interrupt()
            self.dispatch()
            for future in self.hands.wait_for_any(self.busy):
                yield from self.handle_result(future, self.busy.pop(future))

    def dispatch(self) -> None:
        """Give the workers what they can do, and one block more each."""
        while not self.alone and len(self.busy) < 2 * max(1, self.hands.size):
            if self.suspects and not self.busy:
                self.alone = True
                self.submit_block(self.suspects.pop())
            elif self.left and not self.suspects:
                self.submit_block(self.next())
            else:
                return

    def next(self) -> Span:
        """The next block of those that are left."""
        first, last = self.left.pop()
        share = sum(last - first for first, last in [*self.left, (first, last)]) // (SHARES * max(1, self.hands.size))
        end = min(last, first + max(1, min(self.size, share)))
        if end < last:
            self.left.append((end, last))
        return first, end

    def submit_block(self, span: Span, fmu: bytes = b"") -> None:
        sweep = self.sweep
        self.busy[self.hands.submit(run_block, sweep.points.coordinates(*span), sweep.runs, sweep.digest, fmu)] = span

    def handle_result(self, future: "Future[BlockResult | None]", span: Span) -> Iterator[Block]:
        """What has become of a block."""
        first, last = span
        try:
            found = future.result()
        except self.hands.death_errors:
            if self.alone and last - first == 1:
                self.requeue([])
                yield Block(first, np.full((1, self.sweep.columns), np.nan), {0: WORKER_DIED})
            else:
                middle = (first + last) // 2
                self.requeue([(first, middle), (middle, last)] if self.alone else [span])
        except HarnessError:
            raise
        except Exception as error:  # whatever kept a worker from working: no harness there, no memory
            raise HarnessError(f"a worker failed: {type(error).__name__}: {error}") from None
        else:
            if found is None:
                self.submit_block(span, self.sweep.fmu)
                return
            self.alone = False
            taken = max(found.seconds, 1e-9)
            self.size = max(1, min(MAX_BLOCK_SIZE, 10 * self.size, round((last - first) / taken * BLOCK_TIME)))
            yield Block(first, found.values, found.messages)

    def requeue(self, spans: list[Span]) -> None:
        """A worker has died: what it had under way is to be done again."""
        self.alone, self.deaths = False, self.deaths + 1
        if self.deaths > MAX_DEATHS:
            raise HarnessError(f"workers died {self.deaths} times; the same command goes on where this one ends")
        self.suspects += spans
