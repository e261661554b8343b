"""The finished runs of one sweep in a file, block by block, each a line with its checksum: what a kill leaves is kept.

Only where the blocks lie is held in memory.
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
class Block:
    """Runs from number `first` on: their `values` (runs, columns), NaN where a run failed, and the `sentences` that
    say why, by the place in the block."""

    first: int
    values: np.ndarray
    messages: dict[int, str]

    @property
    def last(self) -> int:
        """The number behind that of its last run."""
        return self.first + len(self.values)

    def to_line(self) -> bytes:
        values = b64encode(self.values.astype("<f8").tobytes()).decode()
        text = json.dumps([self.first, len(self.values), values, self.messages])
        return f"{crc32(text.encode()):08x} {text}\n".encode()


def block(line: bytes, columns: int) -> Block | None:
    """The block of a line, None if it holds none."""
    checksum, _, text = line.rstrip(b"\n").partition(b" ")
    if checksum != f"{crc32(text):08x}".encode():
        return None
    try:
        first, count, values, messages = json.loads(text)
        table = np.frombuffer(b64decode(values), "<f8").reshape(count, columns)
    except (ValueError, TypeError):  # of a journal that somebody else wrote
        return None
    return Block(first, table, {int(place): sentence for place, sentence in messages.items()})


class Journal:
    """The journal at a path, of rows of so many `columns`.

    `damaged` counts the lines that are none, but for the last: a kill cut it off.
    """

    def __init__(self, path: Path, runs: int, columns: int) -> None:
        self.path, self.runs, self.columns = path, runs, columns
        self.places: list[tuple[int, int, int]] = []  # of each block in order: its first and last number, where it is
        self.damaged = self.end = 0
        with self.os_errors_reported():
            self.read()

    @contextmanager
    def os_errors_reported(self) -> Iterator[None]:
        """What the file system refuses becomes one sentence."""
        try:
            yield
        except OSError as error:
            raise HarnessError(f"the journal {self.path} cannot be used: {error.strerror}") from None

    def read(self) -> None:
        """Find the blocks that are there."""
        if not self.path.exists():
            return
        with self.path.open("rb") as file:
            for line in file:
                if not line.endswith(b"\n"):
                    break
                found = block(line, self.columns)
                if found and self.fits(found):
                    insort(self.places, (found.first, found.last, self.end))
                else:
                    self.damaged += 1
                self.end += len(line)

    def fits(self, found: Block) -> bool:
        """Whether a block holds runs of this sweep that no other one holds."""
        at = bisect(self.places, (found.first,))
        low = self.places[at - 1][1] if at else 0
        high = self.places[at][0] if at < len(self.places) else self.runs
        return low <= found.first < found.last <= high

    @property
    def n_done(self) -> int:
        return sum(last - first for first, last, _ in self.places)

    @property
    def missing_spans(self) -> list[tuple[int, int]]:
        """The spans of runs, first and last, that no block holds."""
        edges = [0, *(edge for first, last, _ in self.places for edge in (first, last)), self.runs]
        return [(first, last) for first, last in zip(edges[::2], edges[1::2], strict=True) if first < last]

    @contextmanager
    def open(self) -> Iterator[None]:
        """Keep the file open for writing, without the line that was cut off."""
        with self.os_errors_reported():
            self.path.parent.mkdir(parents=True, exist_ok=True)
            self.file = self.path.open("ab")
        try:
            with self.os_errors_reported():
                self.file.truncate(self.end)
            yield
        finally:
            with suppress(OSError):  # of a full disk, which was told
                self.file.close()

    def add(self, new: Block) -> None:
        line = new.to_line()
        with self.os_errors_reported():
            self.file.write(line)
            self.file.flush()
        insort(self.places, (new.first, new.last, self.end))
        self.end += len(line)

    def blocks(self) -> Iterator[Block]:
        """All blocks, in the order of their runs."""
        with self.os_errors_reported(), self.path.open("rb") as file:
            for *_, at in self.places:
                file.seek(at)
                found = block(file.readline(), self.columns)
                if not found:
                    raise HarnessError(f"the journal {self.path} was changed meanwhile; the same command does the rest")
                yield found

    def delete(self) -> None:
        """Remove the file."""
        self.path.unlink(missing_ok=True)
