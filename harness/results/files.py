"""Files of results: CSV with units in the headings, JSON, and data.npz with the dataclasses and arrays of a result.

The types in data.npz come from the annotations of the class that is read, never from the file, and nothing in it is
executed.
"""

import csv
import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import fields, is_dataclass
from math import isfinite
from pathlib import Path
from types import NoneType, UnionType
from typing import Annotated, Any, TypeVar, Union, get_args, get_origin, get_type_hints

import numpy as np

from ..errors import SceneError, first_line


def column_heading(name: str, unit: str) -> str:
    """Return a name with its unit, as in `x [m]`; without a unit for counts and modes."""
    return f"{name} [{unit}]" if unit else name


def write_csv(path: Path, headings: Sequence[str], columns: Sequence[np.ndarray]) -> None:
    """Write columns of equal length to a CSV file; every number reads back exactly."""
    write_csv_rows(path, headings, zip(*(column.tolist() for column in columns), strict=True))


def write_signals(path: Path, time: np.ndarray, columns: Mapping[str, np.ndarray], units: Mapping[str, str]) -> None:
    """Write signals (n,) by name over time (n,) in s to a CSV file with units."""
    headings = ["t [s]", *(column_heading(name, units[name]) for name in columns)]
    write_csv(path, headings, [time, *columns.values()])


def write_csv_rows(path: Path, headings: Sequence[str], rows: Iterable[Sequence[object]], first: str = "") -> None:
    """Write rows to a CSV file, below an optional `first` line; None becomes an empty cell."""
    with path.open("w", encoding="utf-8", newline="") as file:
        file.write(first)
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(headings)
        writer.writerows(rows)


def to_json(result: Any) -> str:
    """Return dataclasses, dicts, lists, arrays, texts and numbers as ASCII JSON; nonfinite numbers become null."""
    return json.dumps(replace_nonfinite(result), indent=1, allow_nan=False)


def replace_nonfinite(result: Any) -> Any:
    """Convert a result to plain types, with None for nonfinite numbers."""
    if is_dataclass(result):
        return {field.name: replace_nonfinite(getattr(result, field.name)) for field in fields(result)}
    if isinstance(result, dict):
        return {name: replace_nonfinite(value) for name, value in result.items()}
    if isinstance(result, list | tuple):
        return [replace_nonfinite(value) for value in result]
    if isinstance(result, np.ndarray):
        return replace_nonfinite(result.tolist())
    if isinstance(result, Path):
        return str(result)
    return None if isinstance(result, float) and not isfinite(result) else result


DATA_FILE = "data.npz"
CONTENT, ARRAY = "content", "array "  # name of the JSON in the file, and of the index of an array in the JSON
T = TypeVar("T")


def write_data(result: Any, file: Path) -> None:
    """Write a dataclass of numbers, texts, paths, arrays, and containers and dataclasses of these."""
    arrays: list[np.ndarray] = []
    content = json.dumps(simplify(result, arrays))
    named_arrays: dict[str, Any] = {CONTENT: np.array(content)} | {str(i): array for i, array in enumerate(arrays)}
    with file.open("wb") as stream:
        np.savez(stream, **named_arrays)


def read_data(kind: type[T], file: Path) -> T:
    """Read a dataclass of this class.

    Raises
    ------
    SceneError
        If the file is damaged, or of another class or version.
    """
    try:
        with file.open("rb") as stream, np.load(stream, allow_pickle=False) as archive:
            result: T = rebuild(kind, json.loads(str(archive[CONTENT])), archive)
        return result
    except Exception as error:  # a damaged file may cause any exception in zipfile and numpy
        reason = first_line(error) or type(error).__name__
        raise SceneError(f"{file} cannot be read ({reason}): write it again") from None


def simplify(value: Any, arrays: list[np.ndarray]) -> Any:
    """Return a value as JSON; an array is appended to `arrays` and replaced by its index."""
    if is_dataclass(value):
        return {field.name: simplify(getattr(value, field.name), arrays) for field in fields(value) if field.init}
    if isinstance(value, Mapping):
        return [[simplify(key, arrays), simplify(item, arrays)] for key, item in value.items()]
    if isinstance(value, list | tuple):
        return [simplify(item, arrays) for item in value]
    if isinstance(value, np.ndarray):
        arrays.append(value)
        return {ARRAY: len(arrays) - 1}
    if isinstance(value, Path):
        return str(value)
    return value.item() if isinstance(value, np.generic) else value


def rebuild(kind: Any, value: Any, arrays: Any) -> Any:
    """Return the value of a type from its JSON."""
    if isinstance(value, dict) and ARRAY in value:
        return arrays[str(value[ARRAY])]
    origin, parameters = get_origin(kind), get_args(kind)
    if origin is Annotated:
        return rebuild(parameters[0], value, arrays)
    if origin in (Union, UnionType):
        if value is None and NoneType in parameters:
            return None
        kinds = [item for item in parameters if item is not NoneType]
        return rebuild(next((item for item in kinds if has_fields(item, value)), kinds[0]), value, arrays)
    if is_dataclass(kind):
        types = get_type_hints(kind, include_extras=True)
        names = [field.name for field in fields(kind) if field.init]
        return kind(**{name: rebuild(types[name], value[name], arrays) for name in names})  # type: ignore[operator]
    if origin in (dict, Mapping):
        return {rebuild(parameters[0], key, arrays): rebuild(parameters[1], item, arrays) for key, item in value}
    if origin is tuple and parameters[-1] is not Ellipsis:
        return tuple(rebuild(item, element, arrays) for item, element in zip(parameters, value, strict=True))
    if origin in (tuple, list):
        return origin(rebuild(parameters[0], item, arrays) for item in value)
    return Path(value) if kind is Path else value


def has_fields(kind: Any, value: Any) -> bool:
    """Return whether the JSON of a dataclass has the fields of a class."""
    return is_dataclass(kind) and isinstance(value, dict) and {*value} == {field.name for field in fields(kind)}
