"""Distribution of the runs of a sweep to workers, with a checkpoint.

Results do not depend on the worker or the order of execution. A run that kills its worker is located by bisection.

The checkpoint holds the finished runs, in memory and in a file from which an interrupted sweep resumes. The file has
a line of JSON for each block of runs: the number of its first run, the values of its runs, and the error messages by
index in the block. A kill or a full disk may cut off the last line, whose runs are then repeated.
"""

import json
import logging
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from contextlib import ExitStack, contextmanager
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from hashlib import sha256
from pathlib import Path
from time import perf_counter
from typing import Self

import numpy as np

from ...analyses.measured_runs import BlockResult, SweepSpec, run_block, unload
from ...errors import HarnessError
from ...process.interrupt import RECEIVED_SIGNALS, CommandInterruptedError, check_interrupt
from ...process.temporary_directory import lock_path, temporary_directory
from ...process.workers import Workers, open_workers
from .sampling import SweepPoints


class Checkpoint:
    """Values and error messages of the finished runs of a sweep.

    Parameters
    ----------
    path : pathlib.Path
        File of the finished runs.
    runs, columns : int
        Number of runs, and of values per run.

    Attributes
    ----------
    values : numpy.ndarray
        Values (runs, columns); NaN for runs that failed or are not finished.
    messages : dict
        Error messages by the number of the run.
    is_done : numpy.ndarray
        Whether each run (runs,) is finished.
    damaged : bool
        Whether an existing file was damaged, so that its runs are not used.
    """

    def __init__(self, path: Path, runs: int, columns: int) -> None:
        self.path, self.shape, self.is_damaged = path, (runs, columns), False
        self.clear()

    def clear(self) -> None:
        """Discard all runs."""
        self.values = np.full(self.shape, np.nan)
        self.messages: dict[int, str] = {}
        self.is_done = np.zeros(self.shape[0], bool)

    @property
    def n_done(self) -> int:
        """Return the number of finished and failed runs."""
        return int(np.count_nonzero(self.is_done))

    @property
    def missing_spans(self) -> list[tuple[int, int]]:
        """Return the ranges of runs (first, end) that are not finished."""
        edges = np.flatnonzero(np.diff(np.concatenate([[0], ~self.is_done, [0]])))
        return [(int(first), int(end)) for first, end in edges.reshape(-1, 2)]

    @contextmanager
    def open(self) -> Iterator[Self]:
        """Read the finished runs, and lock the file until the end; delete it then if no run is finished.

        Raises
        ------
        HarnessError
            If another command has it open, or it cannot be used.
        """
        with ExitStack() as resources:
            with self.convert_errors():
                self.path.parent.mkdir(parents=True, exist_ok=True)
                self.file = resources.enter_context(self.path.open("ab", buffering=0))
                resources.enter_context(lock_path(self.path))
                resources.callback(self.delete_if_empty)
                self.read()
            yield self

    @contextmanager
    def convert_errors(self) -> Iterator[None]:
        """Convert errors of the file to HarnessError."""
        try:
            yield
        except BlockingIOError:
            raise HarnessError("another command runs this sweep; wait until it has finished") from None
        except OSError as error:
            raise HarnessError(f"cannot use the checkpoint {self.path}: {error.strerror}") from None

    def read(self) -> None:
        """Read the finished runs, and cut off an incomplete last line; empty the file if a line is invalid."""
        lines = self.path.read_bytes().splitlines(keepends=True)
        complete = [line for line in lines if line.endswith(b"\n")]
        try:
            for line in complete:
                self.store(*json.loads(line))
        except (ValueError, TypeError, AttributeError, RecursionError):
            self.is_damaged = True
            self.clear()
            complete = []
        self.file.truncate(sum(map(len, complete)))

    def store(self, first: int, values: list[list[float]], messages: dict[str, str]) -> None:
        """Store a block of runs in memory; ValueError if it does not fit."""
        end, (runs, columns) = first + len(values), self.shape
        block = np.array(values, float)
        if not 0 <= first < end <= runs or block.shape != (end - first, columns) or self.is_done[first:end].any():
            raise ValueError("the block does not fit")
        self.values[first:end], self.is_done[first:end] = block, True
        self.messages |= {first + int(index): message for index, message in messages.items()}

    def add(self, first: int, values: np.ndarray, messages: dict[int, str]) -> None:
        """Append a block of runs to the file, and store it in memory."""
        block = first, values.tolist(), {str(index): message for index, message in messages.items()}
        line = memoryview(f"{json.dumps(block)}\n".encode())
        with self.convert_errors():
            while line:  # a disk that gets full takes a part of it, and refuses the rest
                line = line[self.file.write(line) :]
        self.store(*block)

    def delete(self) -> None:
        """Delete the file."""
        self.path.unlink(missing_ok=True)

    def delete_if_empty(self) -> None:
        """Delete the file if no run is finished."""
        if not self.n_done:
            self.delete()


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
        identity = [run, self.runs.varied_names, self.runs.measures, asdict(self.points), self.digest]
        return sha256(json.dumps(identity, sort_keys=True).encode()).hexdigest()[:16]

    def checkpoint(self, folder: Path) -> Checkpoint:
        return Checkpoint(folder / f".{self.key}.checkpoint", len(self.points), self.columns)


def run_pending(
    sweep: Sweep,
    checkpoint: Checkpoint,
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
        with stored_fmu(sweep) as runs, open_workers(workers, total - checkpoint.n_done) as pool:
            for first, values, messages in completed_blocks(sweep, runs, pool, spans):
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


@contextmanager
def stored_fmu(sweep: Sweep) -> Iterator[SweepSpec]:
    """Store the FMU, whose file may be replaced during the sweep; return the settings of runs of the stored FMU."""
    with temporary_directory("sweep-") as folder:
        file = folder / sweep.runs.run.fmu.name
        file.write_bytes(sweep.fmu)
        try:
            yield replace(sweep.runs, run=replace(sweep.runs.run, fmu=file))
        finally:
            unload()


def completed_blocks(
    sweep: Sweep, runs: SweepSpec, workers: Workers, spans: list[Span]
) -> Iterator[tuple[int, np.ndarray, dict[int, str]]]:
    """Do the runs of all spans in blocks that grow until each takes half a second.

    Every worker has one block in reserve. A block whose worker died is halved, down to the run that kills it, which is
    repeated once, because the system may have killed the worker for lack of memory.

    Yields
    ------
    first, values, messages : int, numpy.ndarray, dict
        Number of the first run of a finished block, its values (runs, columns), and error messages by index.
    """
    pending_spans, repeated_runs, running_spans = spans[::-1], set[int](), dict[Future[BlockResult], Span]()
    size, deaths = 1, 0
    while pending_spans or running_spans:
        check_interrupt()
        while pending_spans and len(running_spans) < 2 * workers.size:
            share = sum(end - first for first, end in pending_spans) // (SHARES * workers.size)
            first, last = pending_spans.pop()
            end = min(last, first + max(1, min(size, share)))
            pending_spans += [(end, last)] if end < last else []
            running_spans[workers.submit(run_block, sweep.points.coordinates(first, end), runs)] = first, end
        for future in workers.wait_for_any(running_spans):
            first, end = running_spans.pop(future)
            try:
                result = future.result()
            except workers.death_errors:
                deaths += 1
                if deaths > MAX_DEATHS:
                    raise HarnessError(f"workers died {deaths} times") from None
                if end > first + 1:
                    middle = (first + end) // 2
                    pending_spans += [(first, middle), (middle, end)]
                elif first in repeated_runs:
                    yield first, np.full((1, sweep.columns), np.nan), {0: WORKER_DIED}
                else:
                    repeated_runs.add(first)
                    pending_spans.append((first, end))
            except HarnessError:
                raise
            except Exception as error:  # such as a missing package or lack of memory
                raise HarnessError(f"a worker failed: {type(error).__name__}: {error}") from None
            else:
                elapsed = max(result.seconds, 1e-9)
                size = max(1, min(MAX_BLOCK_SIZE, 10 * size, round((end - first) / elapsed * BLOCK_TIME)))
                yield first, result.values, result.messages
