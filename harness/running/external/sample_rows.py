"""Rows of recorded values, written to a file at once, so that a crash loses none."""

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
ROW_FORMATS = {  # struct format of one value; strings are stored as line numbers of the string table
    **dict.fromkeys(REAL_TYPES, "d"),
    **dict.fromkeys((*INTEGER_TYPES, "Boolean", "String"), "q"),
    "UInt64": "Q",
}
NUMPY_TYPES = {"d": np.float64, "q": np.int64, "Q": np.uint64}

ShapedVariable = tuple[Any, tuple[int, ...]]  # variable and shape


@dataclass(frozen=True)
class SampleRows:
    """Recorded `columns` (n,) by name over `time` (n,) in s."""

    time: np.ndarray
    columns: dict[str, np.ndarray]


def element_names(name: str, shape: tuple[int, ...]) -> list[str]:
    """Return the names of an array's elements in row-major order from 1, as in turn[1,2]; its name for a scalar."""
    if not shape:
        return [name]
    return [f"{name}[{','.join(str(i + 1) for i in index)}]" for index in np.ndindex(shape)]


def group_by_type(chosen: Sequence[ShapedVariable]) -> dict[str, list[ShapedVariable]]:
    """Group variables by type, the order in which they are read and stored in a row."""
    types = dict.fromkeys(variable.type for variable, _ in chosen)
    return {
        type_name: [(variable, shape) for variable, shape in chosen if variable.type == type_name]
        for type_name in types
    }


def row_layout(chosen: Sequence[ShapedVariable]) -> dict[str, str]:
    """Return the format of each column after the time, by name."""
    groups = group_by_type(chosen).items()
    return {
        name: ROW_FORMATS[type_name]
        for type_name, group in groups
        for variable, shape in group
        for name in element_names(variable.name, shape)
    }


class RowRecorder:
    """Writes the rows of one run."""

    def __init__(
        self, fmu: Any, version: str, chosen: Sequence[ShapedVariable], path: Path, texts: "StringTable"
    ) -> None:
        formats = row_layout(chosen)
        self.names, self.row, self.texts = [*formats], struct.Struct("<d" + "".join(formats.values())), texts
        self.file = path.open("wb", buffering=0)
        self.reads = []
        for type_name, group in group_by_type(chosen).items():
            getter = getattr(
                fmu, "get" + {"Enumeration": "Integer" if version == "2.0" else "Int64"}.get(type_name, type_name)
            )
            if type_name == "String" and version != "2.0":
                getter = partial(get_strings_fmi3, fmu)
            references = [variable.valueReference for variable, _ in group]
            count = sum(len(element_names("", shape)) for _, shape in group)
            self.reads.append((type_name, getter, (references,) if version == "2.0" else (references, count)))

    def record(self, t: float) -> None:
        """Write a row of present values; raise HarnessError if one is not finite."""
        row: list[Any] = []
        for type_name, getter, arguments in self.reads:
            row += map(self.texts.index_of, getter(*arguments)) if type_name == "String" else getter(*arguments)
        for name, value in zip(self.names, row, strict=True):
            if not isfinite(value):
                raise HarnessError(f"{name} is {value} at t = {t:.9g} s")
        self.file.write(self.row.pack(t, *row))


def get_strings_fmi3(fmu: Any, references: list[int], count: int) -> list[bytes | None]:
    """Call fmi3GetString directly: FMU3.getString fails for null pointers and invalid UTF-8."""
    values = (fmi3String * count)()
    fmu.fmi3GetString(
        fmu.component, (fmi3ValueReference * len(references))(*references), len(references), values, count
    )
    return list(values)


class StringTable:
    """Distinct strings, one per line of a file; rows contain line numbers."""

    def __init__(self, path: Path) -> None:
        self.file, self.indices = path.open("w", encoding="utf-8", buffering=1), dict[str, int]()

    def index_of(self, text: bytes | str | None) -> int:
        """Return the line number of a string; append the string if it is new."""
        text = text.decode("utf-8", "replace") if isinstance(text, bytes) else text or ""
        if text not in self.indices:
            self.indices[text] = len(self.indices)
            self.file.write(json.dumps(text) + "\n")
        return self.indices[text]


def read_rows(path: Path, chosen: Sequence[ShapedVariable]) -> SampleRows:
    """Read the rows of a run; ignore an incomplete last row."""
    formats = row_layout(chosen)
    dtype = np.dtype([(str(i), NUMPY_TYPES[kind]) for i, kind in enumerate(("d", *formats.values()))])
    data = path.read_bytes()
    rows = np.frombuffer(data[: len(data) // dtype.itemsize * dtype.itemsize], dtype)
    time, *columns = (rows[name] for name in dtype.names or ())
    return SampleRows(time, dict(zip(formats, columns, strict=True)))
