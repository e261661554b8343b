"""Checkpoint of a sweep: a SQLite database of its finished runs, so that an interrupted sweep can resume.

Blocks of runs are written in one transaction each, so a block that a kill or a loss of power cuts off is not in it.
"""

import sqlite3
from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Self

import numpy as np

from ...errors import HarnessError

TABLES = (
    "CREATE TABLE IF NOT EXISTS blocks (first INTEGER PRIMARY KEY, size INTEGER NOT NULL, content BLOB NOT NULL)",
    "CREATE TABLE IF NOT EXISTS failures (run INTEGER PRIMARY KEY, message TEXT NOT NULL)",
)


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
    """Values and error messages of the finished runs of a sweep.

    Parameters
    ----------
    path : pathlib.Path
        File of the database.
    runs, columns : int
        Number of runs, and of values per run.

    Attributes
    ----------
    n_done : int
        Number of finished and failed runs.
    damaged : bool
        Whether an existing file was damaged, so that its runs are not used.
    """

    def __init__(self, path: Path, runs: int, columns: int) -> None:
        self.path, self.runs, self.columns = path, runs, columns
        self.n_done, self.damaged = 0, False

    @contextmanager
    def open(self) -> Iterator[Self]:
        """Open the database, and lock it until the end; delete it then if no run is done.

        Raises
        ------
        HarnessError
            If another command has it open, or it cannot be used.
        """
        with self.convert_errors():
            self.path.parent.mkdir(parents=True, exist_ok=True)
            try:
                self.connection = self.connect()
            except sqlite3.DatabaseError as error:
                if isinstance(error, sqlite3.OperationalError):
                    raise
                self.damaged = True
                self.delete()
                self.connection = self.connect()
        try:
            with closing(self.connection):
                yield self
        finally:
            if not self.n_done:
                self.delete()

    def connect(self) -> sqlite3.Connection:
        """Return a connection that has locked the database; sqlite3.DatabaseError if its content is damaged."""
        connection = sqlite3.connect(self.path, timeout=0)
        try:
            connection.execute("PRAGMA locking_mode = EXCLUSIVE")
            connection.execute("BEGIN EXCLUSIVE")
            for table in TABLES:
                connection.execute(table)
            connection.commit()
            (state,) = connection.execute("PRAGMA quick_check(1)").fetchone()
            blocks = connection.execute("SELECT first, size, length(content) FROM blocks ORDER BY first").fetchall()
            end = 0
            for first, size, length in blocks:
                if first < end or length != size * self.columns * 8:
                    state = "invalid blocks"
                end = first + size
            if state != "ok" or end > self.runs:
                raise sqlite3.DatabaseError(state)
        except BaseException:
            connection.close()
            raise
        self.n_done = sum(size for _, size, _ in blocks)
        return connection

    @contextmanager
    def convert_errors(self) -> Iterator[None]:
        """Convert errors of the database and of its file to HarnessError."""
        try:
            yield
        except (OSError, sqlite3.Error) as error:
            if getattr(error, "sqlite_errorcode", None) == sqlite3.SQLITE_BUSY:
                raise HarnessError("another command runs this sweep; wait until it has finished") from None
            reason = error.strerror if isinstance(error, OSError) else error
            raise HarnessError(f"cannot use the checkpoint {self.path}: {reason}") from None

    @property
    def missing_spans(self) -> list[tuple[int, int]]:
        """Return the ranges of runs (first, end) that are not finished."""
        spans, end = [], 0
        with self.convert_errors():
            for first, size in self.connection.execute("SELECT first, size FROM blocks ORDER BY first"):
                spans += [(end, first)] if first > end else []
                end = first + size
        return spans + ([(end, self.runs)] if end < self.runs else [])

    def add(self, block: RunBlock) -> None:
        """Write the runs of a block."""
        content = np.ascontiguousarray(block.values, "<f8").tobytes()
        failures = [(block.first + index, message) for index, message in block.messages.items()]
        with self.convert_errors(), self.connection:
            self.connection.execute("INSERT INTO blocks VALUES (?, ?, ?)", (block.first, len(block.values), content))
            self.connection.executemany("INSERT INTO failures VALUES (?, ?)", failures)
        self.n_done += len(block.values)

    def blocks(self) -> Iterator[RunBlock]:
        """Yield all runs in order."""
        with self.convert_errors():
            for first, size, content in self.connection.execute("SELECT * FROM blocks ORDER BY first"):
                failures = self.connection.execute(
                    "SELECT run, message FROM failures WHERE run >= ? AND run < ?", (first, first + size)
                )
                values = np.frombuffer(content, "<f8").reshape(size, self.columns)
                yield RunBlock(first, values, {run - first: message for run, message in failures})

    def delete(self) -> None:
        """Delete the closed database, and the journal that a killed command may have left."""
        for path in (self.path, self.path.with_name(f"{self.path.name}-journal")):
            path.unlink(missing_ok=True)
