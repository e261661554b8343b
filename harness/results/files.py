"""How results are written: CSV with units in its headings, and JSON."""

import csv
import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import fields, is_dataclass
from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np


def column_heading(name: str, unit: str) -> str:
    """A name with its unit, as in `x [m]`; without one for counts and modes."""
    return f"{name} [{unit}]" if unit else name


def write_csv(path: Path, heads: Sequence[str], columns: Sequence[np.ndarray]) -> None:
    """A CSV file of equally long columns; every number reads back to the last bit."""
    write_csv_rows(path, heads, zip(*(column.tolist() for column in columns), strict=True))


def write_signals(path: Path, time: np.ndarray, columns: Mapping[str, np.ndarray], units: Mapping[str, str]) -> None:
    """The same of columns (n,) by name, with their units, over the time (n,) in s."""
    heads = ["t [s]", *(column_heading(name, units[name]) for name in columns)]
    write_csv(path, heads, [time, *columns.values()])


def write_csv_rows(path: Path, heads: Sequence[str], rows: Iterable[Sequence[object]], first: str = "") -> None:
    """The same of rows, below a `first` line if there is one; None is left empty."""
    with path.open("w", encoding="utf-8", newline="") as file:
        file.write(first)
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(heads)
        writer.writerows(rows)


def to_json(result: Any) -> str:
    """A result of dataclasses, dicts, lists, texts and numbers as JSON in ASCII, which every terminal and file takes;
    what is not finite is null there."""
    return json.dumps(replace_nonfinite(result), indent=1, allow_nan=False)


def replace_nonfinite(result: Any) -> Any:
    """The result with None for numbers that JSON does not know."""
    if is_dataclass(result):
        return {each.name: replace_nonfinite(getattr(result, each.name)) for each in fields(result)}
    if isinstance(result, dict):
        return {name: replace_nonfinite(value) for name, value in result.items()}
    if isinstance(result, list | tuple):
        return [replace_nonfinite(value) for value in result]
    if isinstance(result, Path):
        return str(result)
    return None if isinstance(result, float) and not isfinite(result) else result
