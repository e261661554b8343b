"""Checkpoint of a sweep: one memory-mapped array with a status per run, so that an interrupted sweep can resume.

Values are written to the disk before the status that declares them valid. So every run with a status has its values,
even after a loss of power.
"""

import json
import os
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from ...errors import HarnessError
from ...process.temporary_directory import lock_path

MISSING, FINISHED, FAILED = 0, 1, 2  # status; a failed run has FAILED plus the position of its error message in bytes
BLOCK_SIZE = 1000  # runs read or written at a time


@dataclass(frozen=True)
class RunBlock:
    """Block of consecutive runs.

    Attributes
    ----------
    first : int
        Number of the first run.
    values : numpy.ndarray
        Values (runs, columns); NaN for failed runs.
    messages : dict
        Error messages by index in the block.
    """

    first: int
    values: np.ndarray
    messages: dict[int, str]

    @property
    def last(self) -> int:
        """Return the number after that of the last run."""
        return self.first + len(self.values)


class Checkpoint:
    """Values, status and error messages of `runs` runs, each with `columns` values, in two files.

    Parameters
    ----------
    path : pathlib.Path
        File of values and status. The error messages are in a file of the same name with the suffix ``.messages``.
    runs, columns : int
        Number of runs, and of values per run.

    Raises
    ------
    HarnessError
        If a file cannot be read.

    Attributes
    ----------
    damaged : bool
        Whether existing files were damaged, so that they are not used.
    n_done : int
        Number of finished and failed runs.
    """

    def __init__(self, path: Path, runs: int, columns: int) -> None:
        self.path, self.message_path, self.runs = path, path.with_suffix(".messages"), runs
        self.dtype = np.dtype([("status", "<i8"), ("values", "<f8", (columns,))])
        self.damaged, self.n_done = False, 0
        self.read()

    def read(self) -> None:
        """Read how many runs are done."""
        with self.convert_os_errors():
            self.unmap()
            exists = self.path.exists()
            is_intact = exists and self.is_intact()
            self.damaged |= exists and not is_intact
            self.n_done = int(np.count_nonzero(self.array["status"])) if is_intact else 0

    @contextmanager
    def convert_os_errors(self) -> Iterator[None]:
        """Convert OSError to HarnessError."""
        try:
            yield
        except OSError as error:
            raise HarnessError(f"cannot use the checkpoint {self.path}: {error.strerror}") from None

    def is_intact(self) -> bool:
        """Return whether the files have the size of this sweep, and the messages of all failed runs."""
        if self.path.stat().st_size != self.runs * self.dtype.itemsize:
            return False
        message_size = self.message_path.stat().st_size if self.message_path.exists() else 0
        return all(
            block["status"].min() >= MISSING and block["status"].max() < FAILED + message_size
            for block in self.array_blocks()
        )

    @cached_property
    def array(self) -> np.memmap:
        """Map the file: status and values of every run, (runs,)."""
        return np.memmap(self.path, self.dtype, "r+", shape=(self.runs,))

    def unmap(self) -> None:
        """Close the map, without which Windows neither deletes nor replaces the file."""
        self.__dict__.pop("array", None)

    def array_blocks(self) -> Iterator[np.ndarray]:
        """Yield parts of the array."""
        for first in range(0, self.runs, BLOCK_SIZE):
            yield self.array[first : first + BLOCK_SIZE]

    @property
    def missing_spans(self) -> list[tuple[int, int]]:
        """Return the ranges of runs (first, end) that are not finished."""
        if not self.n_done:
            return [(0, self.runs)]
        missing = np.zeros(self.runs + 2, bool)  # runs before the first and after the last one are not missing
        missing[1:-1] = self.array["status"] == MISSING
        edges = np.flatnonzero(np.diff(missing)).tolist()
        return list(zip(edges[::2], edges[1::2], strict=True))

    @contextmanager
    def open(self) -> Iterator[None]:
        """Open the files for writing; create them if there are none that can be used.

        At the end they are deleted if no run is done.  Raises HarnessError if another command has them open.
        """
        with ExitStack() as files:
            with self.convert_os_errors():
                self.path.parent.mkdir(parents=True, exist_ok=True)
                self.message_file = files.enter_context(self.message_path.open("ab"))
                try:
                    files.enter_context(lock_path(self.message_path))
                except BlockingIOError:
                    raise HarnessError("another command runs this sweep; wait until it has finished") from None
                self.read()  # again: another command may have finished runs meanwhile
                if not self.n_done:
                    self.create()
            try:
                yield
            finally:
                if not self.n_done:
                    self.message_file.close()
                    self.delete()

    def create(self) -> None:
        """Create the array, with the status MISSING for each run, and remove all messages.

        The file is filled with zeros: a full disk is an error here, but would end the process at a write to the map.
        """
        self.unmap()
        self.message_file.seek(0)
        self.message_file.truncate()
        try:
            with self.path.open("wb") as file:
                for first in range(0, self.runs, BLOCK_SIZE):
                    file.write(bytes(min(BLOCK_SIZE, self.runs - first) * self.dtype.itemsize))
        except OSError:
            self.delete()
            raise

    def add(self, block: RunBlock) -> None:
        """Write the runs of a block: messages and values first, then the status."""
        runs = self.array[block.first : block.last]
        status = np.full(len(runs), FINISHED)
        with self.convert_os_errors():
            for index, message in block.messages.items():
                status[index] = FAILED + self.message_file.tell()
                self.message_file.write(json.dumps(message).encode() + b"\n")
            if block.messages:
                self.message_file.flush()
                os.fsync(self.message_file.fileno())
            self.n_done += int(np.count_nonzero(runs["status"] == MISSING))
            runs["values"] = block.values
            self.array.flush()
            runs["status"] = status

    def messages(self, status: np.ndarray) -> list[str]:
        """Return the error message for each status, empty if the run did not fail."""
        failed = np.flatnonzero(status >= FAILED)
        sentences = [""] * len(status)
        if len(failed):
            try:
                with self.convert_os_errors(), self.message_path.open("rb") as file:
                    for index in failed:
                        file.seek(int(status[index]) - FAILED)
                        sentences[index] = json.loads(file.readline())
            except ValueError:
                raise HarnessError(f"{self.message_path} is damaged; delete it and repeat the sweep") from None
        return sentences

    def blocks(self) -> Iterator[RunBlock]:
        """Yield all runs in order."""
        first = 0
        for block in self.array_blocks():
            messages = {i: message for i, message in enumerate(self.messages(block["status"])) if message}
            yield RunBlock(first, np.array(block["values"]), messages)
            first += len(block)

    def delete(self) -> None:
        """Delete the files."""
        self.unmap()
        self.path.unlink(missing_ok=True)
        self.message_path.unlink(missing_ok=True)
