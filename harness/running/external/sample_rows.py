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
from ..variable_values import REAL_TYPES

INTEGER_TYPES = ("Integer", "Enumeration", "Int8", "UInt8", "Int16", "UInt16", "Int32", "UInt32", "Int64", "UInt64")
ROW_FORMATS = {  # what one element is in a row; a text is the number of its line in the file of texts
    **dict.fromkeys(REAL_TYPES, "d"),
    **dict.fromkeys((*INTEGER_TYPES, "Boolean", "String"), "q"),
    "UInt64": "Q",
}
NUMPY_TYPES = {"d": np.float64, "q": np.int64, "Q": np.uint64}

ShapedVariable = tuple[Any, tuple[int, ...]]  # a variable, and its shape


@dataclass(frozen=True)
class SampleRows:
    """The `columns` name to (n,) of a pass, over `time` (n,) in s."""

    time: np.ndarray
    columns: dict[str, np.ndarray]


def element_names(name: str, shape: tuple[int, ...]) -> list[str]:
    """The names of a variable's elements, counted from 1 and row by row, as in turn[1,2]; its own if it is a scalar."""
    if not shape:
        return [name]
    return [f"{name}[{','.join(str(i + 1) for i in place)}]" for place in np.ndindex(shape)]


def group_by_type(chosen: Sequence[ShapedVariable]) -> dict[str, list[ShapedVariable]]:
    """The variables by type, which is how they are read and how they stand in a row."""
    types = dict.fromkeys(variable.type for variable, _ in chosen)
    return {each: [(variable, shape) for variable, shape in chosen if variable.type == each] for each in types}


def row_layout(chosen: Sequence[ShapedVariable]) -> dict[str, str]:
    """What stands in a row after the time: names, and the format of each."""
    groups = group_by_type(chosen).items()
    return {
        name: ROW_FORMATS[kind]
        for kind, group in groups
        for variable, shape in group
        for name in element_names(variable.name, shape)
    }


class RowRecorder:
    """Writes the rows of one pass."""

    def __init__(
        self, fmu: Any, version: str, chosen: Sequence[ShapedVariable], path: Path, texts: "StringTable"
    ) -> None:
        form = row_layout(chosen)
        self.names, self.row, self.texts = [*form], struct.Struct("<d" + "".join(form.values())), texts
        self.file = path.open("wb", buffering=0)
        self.reads = []
        for kind, group in group_by_type(chosen).items():
            getter = getattr(fmu, "get" + {"Enumeration": "Integer" if version == "2.0" else "Int64"}.get(kind, kind))
            if kind == "String" and version != "2.0":
                getter = partial(get_strings_fmi3, fmu)
            references = [variable.valueReference for variable, _ in group]
            count = sum(len(element_names("", shape)) for _, shape in group)
            self.reads.append((kind, getter, (references,) if version == "2.0" else (references, count)))

    def record(self, t: float) -> None:
        """Write the present row; HarnessError if a number in it is not finite."""
        row: list[Any] = []
        for kind, getter, asked in self.reads:
            row += map(self.texts.index_of, getter(*asked)) if kind == "String" else getter(*asked)
        for name, value in zip(self.names, row, strict=True):
            if not isfinite(value):
                raise HarnessError(f"{name} is {value} at t = {t:.9g} s")
        self.file.write(self.row.pack(t, *row))


def get_strings_fmi3(fmu: Any, references: list[int], count: int) -> list[bytes | None]:
    """fmi3GetString as it answers: FMU3.getString wants UTF-8, and no null pointer."""
    values = (fmi3String * count)()
    fmu.fmi3GetString(
        fmu.component, (fmi3ValueReference * len(references))(*references), len(references), values, count
    )
    return list(values)


class StringTable:
    """The texts there have been, each a line of a file."""

    def __init__(self, path: Path) -> None:
        self.file, self.indices = path.open("w", encoding="utf-8", buffering=1), dict[str, int]()

    def index_of(self, text: bytes | str | None) -> int:
        text = text.decode("utf-8", "replace") if isinstance(text, bytes) else text or ""
        if text not in self.indices:
            self.indices[text] = len(self.indices)
            self.file.write(json.dumps(text) + "\n")
        return self.indices[text]


def read_rows(path: Path, chosen: Sequence[ShapedVariable]) -> SampleRows:
    """The rows of a pass; of one that was cut off, nothing."""
    form = row_layout(chosen)
    dtype = np.dtype([(str(i), NUMPY_TYPES[kind]) for i, kind in enumerate(("d", *form.values()))])
    data = path.read_bytes()
    rows = np.frombuffer(data[: len(data) // dtype.itemsize * dtype.itemsize], dtype)
    time, *columns = (rows[name] for name in dtype.names or ())
    return SampleRows(time, dict(zip(form, columns, strict=True)))
