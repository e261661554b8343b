"""Reads tables from files: text, spreadsheets (.xlsx, .xls, .ods), MATLAB .mat, numpy .npz, or any of them gzipped.

The format is detected from the first bytes, so standard input works for all of them.
"""

import gzip
import io
import sys
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path
from typing import Any
from zipfile import ZipFile

import numpy as np

from ..errors import HarnessError, SceneError, first_line, format_value
from . import text_table

INSTALL_COMMAND = "python -m pip install 'friction-fmus[records]'"
Cells = list[Any] | np.ndarray


@dataclass(frozen=True)
class Table:
    """Columns of a file with their headings, which may be empty; `line` is the line number before the first row."""

    name: str
    column_headings: tuple[str, ...]
    columns: tuple[Cells, ...]
    line: int = 0


def load_table(source: str, headings: str | None = None) -> Table:
    """Load the table in a file.

    Parameters
    ----------
    source : str
        Path; "-" for standard input.
    headings : str, optional
        Headings, separated by commas, that replace those in the file.

    Raises
    ------
    SceneError
        If the file contains no table.
    """
    path = Path(source)
    name = "standard input" if source == "-" else path.name
    data = sys.stdin.buffer.read() if source == "-" else read_content(path)
    if not data.strip():
        raise SceneError(f"{name} is empty")
    try:
        table = parse_table_file(data, name)
    except HarnessError:
        raise
    except ImportError as error:
        raise SceneError(f"{name} needs {error.name} to be read: {INSTALL_COMMAND}") from None
    except Exception as error:  # the readers raise arbitrary exceptions for damaged files
        raise SceneError(f"{name} cannot be read: {first_line(error)}") from None
    if headings is None:
        return table
    names = tuple(part.strip() for part in headings.split(","))
    if len(names) != len(table.columns):
        raise SceneError(
            f"--columns names {len(names)} columns, and {name} has {len(table.columns)} that are not empty"
        )
    return Table(name, names, table.columns, table.line)


def read_content(path: Path) -> bytes:
    """Return the bytes of a file."""
    try:
        return path.read_bytes()
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        matches = []
        if isinstance(error, FileNotFoundError) and path.parent.is_dir():
            matches = get_close_matches(path.name, [sibling.name for sibling in path.parent.iterdir()], n=1)
        hint = f" (nearest: '{matches[0]}')" if matches else ""
        raise SceneError(f"cannot read {path}: {reason}{hint}") from None


def parse_table_file(data: bytes, name: str) -> Table:
    """Parse a table in any format."""
    if data.startswith(b"\x1f\x8b"):
        return parse_table_file(gzip.decompress(data), name)
    if data.startswith(b"PK"):
        with ZipFile(io.BytesIO(data)) as archive:
            tables = [member for member in archive.namelist() if member.lower().endswith((".csv", ".tsv", ".txt"))]
        if tables:
            raise SceneError(
                f"{name} is an archive: unpack it and specify a file in it, as in {format_value(tables[0])}"
            )
        return table_from_arrays(read_npz(data), name) if b".npy" in data[:200] else read_workbook(data, name)
    if data.startswith(b"\xd0\xcf\x11\xe0"):
        return read_workbook(data, name)
    if data.startswith((b"MATLAB 7.3", b"\x89HDF")):
        return table_from_arrays(read_hdf5(data), name)
    if data.startswith(b"MATLAB 5.0"):
        return table_from_arrays(read_mat(data), name)
    heads, rows, line = text_table.parse_text_table(data, name)
    return table_from_rows(heads, rows, line, name)


def table_from_rows(headings: list[str], rows: list[list[Any]], line: int, name: str) -> Table:
    """Return a table from its rows. Short rows are padded; columns without heading and values are dropped."""
    width = max(len(headings), len(rows[0]))
    for number, row in enumerate(rows, line + 1):
        if len(row) > width and any(str(cell).strip() for cell in row[width:]):
            raise SceneError(f"{name}: row {number} has {len(row)} cells where the heading has {width}")
    columns = zip(*(row if len(row) == width else [*row, *[""] * width][:width] for row in rows), strict=True)
    headings = [*headings, *[""] * (width - len(headings))]
    middle = slice(len(rows) // 2, len(rows) // 2 + text_table.SAMPLE_LINES)
    columns_with_headings = [(h, list(c)) for h, c in zip(headings, columns, strict=True) if any(c if h else c[middle])]
    return Table(
        name, tuple(head for head, _ in columns_with_headings), tuple(cells for _, cells in columns_with_headings), line
    )


def read_workbook(data: bytes, name: str) -> Table:
    """Return the longest table in the sheets of a workbook."""
    from python_calamine import CalamineWorkbook

    workbook = CalamineWorkbook.from_filelike(io.BytesIO(data))
    candidates = []
    for sheet_name in workbook.sheet_names:
        rows = [[str(cell).strip() for cell in row] for row in workbook.get_sheet_by_name(sheet_name).to_python()]
        first_row = text_table.find_first_number_row(rows)
        if first_row is not None:
            candidates.append((rows, first_row))
    if not candidates:
        raise SceneError(f"{name} has no sheet with a heading and rows of numbers")
    rows, first_row = max(candidates, key=lambda sheet_name: len(sheet_name[0]) - sheet_name[1])
    return table_from_rows(
        text_table.find_headings(rows[:first_row], len(rows[first_row])), rows[first_row:], first_row, name
    )


def read_npz(data: bytes) -> dict[str, Any]:
    """Return the arrays of a .npz file."""
    with np.load(io.BytesIO(data), allow_pickle=False) as archive:
        return {name: archive[name] for name in archive.files}


def read_mat(data: bytes) -> dict[str, Any]:
    """Return the variables of a .mat file up to version 7.2."""
    from scipy.io import loadmat

    return {key: value for key, value in loadmat(io.BytesIO(data), simplify_cells=True).items() if key[:2] != "__"}


def read_hdf5(data: bytes) -> dict[str, Any]:
    """Return the numeric data sets of an HDF5 file, such as a .mat file of version 7.3."""
    import h5py

    datasets: dict[str, Any] = {}

    def visit(path: str, item: Any) -> None:
        if isinstance(item, h5py.Dataset) and item.dtype.kind in "fiu" and not path.startswith("#"):
            datasets[path.replace("/", ".")] = item[()]

    with h5py.File(io.BytesIO(data), "r") as file:
        file.visititems(visit)
    return datasets


def table_from_arrays(arrays: dict[str, Any], name: str) -> Table:
    """Return a table from named arrays: vectors and columns of matrices with the most frequent length."""
    columns: list[tuple[str, np.ndarray]] = []
    for key, value in flatten_arrays(arrays):
        if value.ndim == 1 or min(value.shape) == 1:
            columns.append((key, value.ravel()))
        elif value.ndim == 2:
            matrix = value if value.shape[0] >= value.shape[1] else value.T
            columns += [(f"{key}{i + 1}", matrix[:, i]) for i in range(matrix.shape[1])]
    lengths = [len(values) for _, values in columns if len(values) > 2]
    length = max(lengths, key=lambda n: (lengths.count(n), n), default=0)
    selected = [(key, values) for key, values in columns if len(values) == length]
    if len(selected) < 2:
        raise SceneError(
            f"{name} has no two arrays of equal length; time and position are required (it has {', '.join(arrays)})"
        )
    return Table(name, tuple(key for key, _ in selected), tuple(values for _, values in selected))


def flatten_arrays(values: dict[str, Any], prefix: str = "") -> list[tuple[str, np.ndarray]]:
    """Return numeric arrays by name, those in structures as structure.field."""
    arrays = []
    for key, value in values.items():
        if isinstance(value, dict):
            arrays += flatten_arrays(value, f"{prefix}{key}.")
        elif isinstance(value, np.ndarray) and value.dtype.kind in "fiub" and 1 <= value.ndim <= 2 and value.size:
            arrays.append((prefix + key, value.astype(float)))
    return arrays
