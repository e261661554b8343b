"""Journal of a sweep: a file with one line and checksum per finished block, so that an interrupted sweep can resume.

Only the positions of the blocks are held in memory.
"""

import json
from base64 import b64decode, b64encode
from bisect import bisect, insort
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from zlib import crc32

import numpy as np

from ...errors import HarnessError


@dataclass(frozen=True)
class JournalBlock:
    """Runs from number `first` on: `values` (runs, columns), NaN for failed runs, and error `messages` by index."""

    first: int
    values: np.ndarray
    messages: dict[int, str]

    @property
    def last(self) -> int:
        """Return the number after that of the last run."""
        return self.first + len(self.values)

    def to_line(self) -> bytes:
        values = b64encode(self.values.astype("<f8").tobytes()).decode()
        text = json.dumps([self.first, len(self.values), values, self.messages])
        return f"{crc32(text.encode()):08x} {text}\n".encode()


def parse_block(line: bytes, columns: int) -> JournalBlock | None:
    """Parse a line; None if it is damaged."""
    checksum, _, text = line.rstrip(b"\n").partition(b" ")
    if checksum != f"{crc32(text):08x}".encode():
        return None
    try:
        first, count, values, messages = json.loads(text)
        table = np.frombuffer(b64decode(values), "<f8").reshape(count, columns)
    except (ValueError, TypeError):  # a valid checksum, but another content
        return None
    return JournalBlock(first, table, {int(place): sentence for place, sentence in messages.items()})


class Journal:
    """Journal file of a sweep with `runs` runs of `columns` values.

    `damaged` counts damaged lines, except an incomplete last line.
    """

    def __init__(self, path: Path, runs: int, columns: int) -> None:
        self.path, self.runs, self.columns = path, runs, columns
        self.places: list[tuple[int, int, int]] = []  # sorted: first run, end, and file position of each block
        self.damaged = self.end = 0
        with self.os_errors_reported():
            self.read()

    @contextmanager
    def os_errors_reported(self) -> Iterator[None]:
        """Convert OSError to HarnessError."""
        try:
            yield
        except OSError as error:
            raise HarnessError(f"cannot use the journal {self.path}: {error.strerror}") from None

    def read(self) -> None:
        """Read the positions of the blocks."""
        if not self.path.exists():
            return
        with self.path.open("rb") as file:
            for line in file:
                if not line.endswith(b"\n"):
                    break
                block = parse_block(line, self.columns)
                if block and self.fits(block):
                    insort(self.places, (block.first, block.last, self.end))
                else:
                    self.damaged += 1
                self.end += len(line)

    def fits(self, block: JournalBlock) -> bool:
        """Return whether the runs of a block are in range and not in another block."""
        index = bisect(self.places, (block.first,))
        low = self.places[index - 1][1] if index else 0
        high = self.places[index][0] if index < len(self.places) else self.runs
        return low <= block.first < block.last <= high

    @property
    def n_done(self) -> int:
        return sum(last - first for first, last, _ in self.places)

    @property
    def missing_spans(self) -> list[tuple[int, int]]:
        """Return the ranges of runs (first, end) that are not finished."""
        edges = [0, *(edge for first, last, _ in self.places for edge in (first, last)), self.runs]
        return [(first, last) for first, last in zip(edges[::2], edges[1::2], strict=True) if first < last]

    @contextmanager
    def open(self) -> Iterator[None]:
        """Open the file for writing, without an incomplete last line."""
        with self.os_errors_reported():
            self.path.parent.mkdir(parents=True, exist_ok=True)
            self.file = self.path.open("ab")
        try:
            with self.os_errors_reported():
                self.file.truncate(self.end)
            yield
        finally:
            with suppress(OSError):  # a full disk was reported already
                self.file.close()

    def add(self, new: JournalBlock) -> None:
        line = new.to_line()
        with self.os_errors_reported():
            self.file.write(line)
            self.file.flush()
        insort(self.places, (new.first, new.last, self.end))
        self.end += len(line)

    def blocks(self) -> Iterator[JournalBlock]:
        """Yield all blocks in the order of their runs."""
        with self.os_errors_reported(), self.path.open("rb") as file:
            for *_, position in self.places:
                file.seek(position)
                block = parse_block(file.readline(), self.columns)
                if not block:
                    raise HarnessError(
                        f"the journal {self.path} was changed by another process; repeat the command to resume"
                    )
                yield block

    def delete(self) -> None:
        """Delete the file."""
        self.path.unlink(missing_ok=True)
