"""CSV files with units in their headings, and JSON."""

import csv
import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import fields, is_dataclass
from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np


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
