"""What is recorded of somebody's FMU: a row of numbers for each time, written at once, so that a crash loses none."""

import json
import struct
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np
from fmpy.fmi3 import fmi3String, fmi3ValueReference

from ...errors import HarnessError
from ..values import REALS

WHOLES = ("Integer", "Enumeration", "Int8", "UInt8", "Int16", "UInt16", "Int32", "UInt32", "Int64", "UInt64")
RECORDED = {  # what one element is in a row; a text is the number of its line in the file of texts
    **dict.fromkeys(REALS, "d"),
    **dict.fromkeys((*WHOLES, "Boolean", "String"), "q"),
    "UInt64": "Q",
}
FORMATS = {"d": np.float64, "q": np.int64, "Q": np.uint64}

Shaped = tuple[Any, tuple[int, ...]]  # a variable, and its shape


@dataclass(frozen=True)
class Rows:
    """The `columns` name to (n,) of a pass, over `time` (n,) in s."""

    time: np.ndarray
    columns: dict[str, np.ndarray]


def elements(name: str, shape: tuple[int, ...]) -> list[str]:
    """The names of a variable's elements, counted from 1 and row by row, as in turn[1,2]; its own if it is a scalar."""
    if not shape:
        return [name]
    return [f"{name}[{','.join(str(i + 1) for i in place)}]" for place in np.ndindex(shape)]


def grouped(chosen: Sequence[Shaped]) -> dict[str, list[Shaped]]:
    """The variables by type, which is how they are read and how they stand in a row."""
    types = dict.fromkeys(variable.type for variable, _ in chosen)
    return {each: [(variable, shape) for variable, shape in chosen if variable.type == each] for each in types}


def layout(chosen: Sequence[Shaped]) -> dict[str, str]:
    """What stands in a row after the time: names, and the format of each."""
    groups = grouped(chosen).items()
    return {
        name: RECORDED[kind]
        for kind, group in groups
        for variable, shape in group
        for name in elements(variable.name, shape)
    }


class Recorder:
    """Writes the rows of one pass."""

    def __init__(self, fmu: Any, version: str, chosen: Sequence[Shaped], path: Path, texts: "Texts") -> None:
        form = layout(chosen)
        self.names, self.row, self.texts = [*form], struct.Struct("<d" + "".join(form.values())), texts
        self.file = path.open("wb", buffering=0)
        self.reads = []
        for kind, group in grouped(chosen).items():
            getter = getattr(fmu, "get" + {"Enumeration": "Integer" if version == "2.0" else "Int64"}.get(kind, kind))
            if kind == "String" and version != "2.0":
                getter = partial(texts3, fmu)
            references = [variable.valueReference for variable, _ in group]
            count = sum(len(elements("", shape)) for _, shape in group)
            self.reads.append((kind, getter, (references,) if version == "2.0" else (references, count)))

    def sample(self, t: float) -> None:
        """Write the present row; HarnessError if a number in it is not finite."""
        row: list[Any] = []
        for kind, getter, asked in self.reads:
            row += map(self.texts.number, getter(*asked)) if kind == "String" else getter(*asked)
        for name, value in zip(self.names, row, strict=True):
            if not isfinite(value):
                raise HarnessError(f"{name} is {value} at t = {t:.9g} s")
        self.file.write(self.row.pack(t, *row))


def texts3(fmu: Any, references: list[int], count: int) -> list[bytes | None]:
    """fmi3GetString as it answers: FMU3.getString wants UTF-8, and no null pointer."""
    values = (fmi3String * count)()
    fmu.fmi3GetString(
        fmu.component, (fmi3ValueReference * len(references))(*references), len(references), values, count
    )
    return list(values)


class Texts:
    """The texts there have been, each a line of a file."""

    def __init__(self, path: Path) -> None:
        self.file, self.numbers = path.open("w", encoding="utf-8", buffering=1), dict[str, int]()

    def number(self, text: bytes | str | None) -> int:
        text = text.decode("utf-8", "replace") if isinstance(text, bytes) else text or ""
        if text not in self.numbers:
            self.numbers[text] = len(self.numbers)
            self.file.write(json.dumps(text) + "\n")
        return self.numbers[text]


def read(path: Path, chosen: Sequence[Shaped]) -> Rows:
    """The rows of a pass; of one that was cut off, nothing."""
    form = layout(chosen)
    dtype = np.dtype([(str(i), FORMATS[kind]) for i, kind in enumerate(("d", *form.values()))])
    data = path.read_bytes()
    rows = np.frombuffer(data[: len(data) // dtype.itemsize * dtype.itemsize], dtype)
    time, *columns = (rows[name] for name in dtype.names or ())
    return Rows(time, dict(zip(form, columns, strict=True)))
