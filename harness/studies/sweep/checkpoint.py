"""Finished runs of a sweep, in memory and in a file from which an interrupted sweep resumes.

The file has a line of JSON for each block of runs: the number of its first run, the values of its runs, and the error
messages by index in the block. A kill or a full disk may cut off the last line, whose runs are then repeated.
"""

import json
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Self

import numpy as np

from ...errors import HarnessError
from ...process.temporary_directory import lock_path


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
        self.path, self.shape, self.damaged = path, (runs, columns), False
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
            self.damaged = True
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
