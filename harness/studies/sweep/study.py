"""What happens over many parameters: one FMU, many points, many workers, and a journal that survives a kill.

Every block of runs that is finished is written to the journal beside the results, so the same command after an
interruption does only what is left.  The rows do not depend on who ran them, nor in which order, and no more of them
is held in memory than a worker has under way.  A run during which its worker dies is found by halves, and told.
"""

import json
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from functools import cached_property
from hashlib import sha256
from pathlib import Path
from time import perf_counter

import numpy as np

from ...errors import HarnessError
from ...process.interrupt import RECEIVED_SIGNALS, CommandInterruptedError, check_interrupt
from ...process.temporary_directory import temporary_directory
from ...process.worker_pool import WorkerPool
from .cluster import Cluster, cluster
from .hands import Work, unload, work
from .journal import Block, Journal
from .rerun import Runs
from .space import Points

LONGEST_BLOCK = 10_000  # runs
BLOCK_TIME = 0.5  # s that a block is to take
SHARES = 4  # blocks that each worker is to have at least, so that none waits for the last one
MOST_DEATHS = 200
DIED = "the process died in this run"

Span = tuple[int, int]  # numbers of runs: the first, and the one behind the last


@dataclass(frozen=True)
class Sweep:
    """The `runs` at `points`; a row has so many `columns`."""

    runs: Runs
    points: Points
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


def perform(sweep: Sweep, kept: Journal, scheduler: str | None, workers: int, report: Callable[[float], None]) -> float:
    """Do the runs that are left, into the journal; returns what that took, in s, the start of the workers included."""
    begun = perf_counter()
    left = kept.left
    if not left:
        return 0.0
    try:
        with crew(scheduler, workers, sum(last - first for first, last in left)) as hands, kept.open():
            for block in Shift(sweep, hands, left).finished():
                kept.add(block)
                report(kept.done / len(sweep.points))
    except BaseException as error:  # what an interrupt makes fail may say anything
        if not (RECEIVED_SIGNALS or isinstance(error, KeyboardInterrupt)):
            raise
        if not kept.done:
            kept.forget()
        state = f"{kept.done} of {len(sweep.points)} runs are kept"
        raise CommandInterruptedError(f"interrupted: {state}; the same command does the rest") from None
    return perf_counter() - begun


@contextmanager
def crew(scheduler: str | None, workers: int, runs: int) -> Iterator[WorkerPool | Cluster]:
    """Those who do the runs: processes of this machine, or the cluster of a scheduler."""
    if scheduler is not None:
        with cluster(scheduler, unload) as found:
            yield found
        return
    with temporary_directory("sweep-") as folder:
        hands = WorkerPool(min(workers, runs), folder, [Work.__module__])
        try:
            yield hands
        finally:
            hands.kill()


class Shift:
    """The runs of a sweep on their way through the workers, in blocks that grow until each takes half a second."""

    def __init__(self, sweep: Sweep, hands: WorkerPool | Cluster, left: list[Span]) -> None:
        self.sweep, self.hands, self.left = sweep, hands, left[::-1]
        self.size = 1
        self.busy: dict[Future[Work | None], Span] = {}
        self.suspects: list[Span] = []  # blocks during which a worker died
        self.alone = False  # whether one of these is tried, with nothing beside it
        self.deaths = 0

    def finished(self) -> Iterator[Block]:
        """The blocks as workers finish them."""
        while self.left or self.suspects or self.busy:
            check_interrupt()
            self.deal()
            for future in self.hands.wait_for_any(self.busy):
                yield from self.answered(future, self.busy.pop(future))

    def deal(self) -> None:
        """Give the workers what they can do, and one block more each."""
        while not self.alone and len(self.busy) < 2 * max(1, self.hands.size):
            if self.suspects and not self.busy:
                self.alone = True
                self.ask(self.suspects.pop())
            elif self.left and not self.suspects:
                self.ask(self.next())
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

    def ask(self, span: Span, fmu: bytes = b"") -> None:
        sweep = self.sweep
        self.busy[self.hands.submit(work, sweep.points.between(*span), sweep.runs, sweep.digest, fmu)] = span

    def answered(self, future: "Future[Work | None]", span: Span) -> Iterator[Block]:
        """What has become of a block."""
        first, last = span
        try:
            found = future.result()
        except self.hands.death_errors:
            if self.alone and last - first == 1:
                self.bury([])
                yield Block(first, np.full((1, self.sweep.columns), np.nan), {0: DIED})
            else:
                middle = (first + last) // 2
                self.bury([(first, middle), (middle, last)] if self.alone else [span])
        except HarnessError:
            raise
        except Exception as error:  # whatever kept a worker from working: no harness there, no memory
            raise HarnessError(f"a worker failed: {type(error).__name__}: {error}") from None
        else:
            if found is None:
                self.ask(span, self.sweep.fmu)
                return
            self.alone = False
            taken = max(found.seconds, 1e-9)
            self.size = max(1, min(LONGEST_BLOCK, 10 * self.size, round((last - first) / taken * BLOCK_TIME)))
            yield Block(first, found.values, found.sentences)

    def bury(self, spans: list[Span]) -> None:
        """A worker has died: what it had under way is to be done again."""
        self.alone, self.deaths = False, self.deaths + 1
        if self.deaths > MOST_DEATHS:
            raise HarnessError(f"workers died {self.deaths} times; the same command goes on where this one ends")
        self.suspects += spans
