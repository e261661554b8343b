"""The table in a file of any kind: text, spreadsheet (.xlsx, .xls, .ods), MATLAB's .mat of either sort, numpy's .npz;
any of them packed by gzip.

The kind is told by the first bytes, so that standard input can be any of them.
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
    """The columns of a file by their headings, which may be empty; `line` is the number of the line or row before
    them."""

    name: str
    column_headings: tuple[str, ...]
    columns: tuple[Cells, ...]
    line: int = 0


def load_table(source: str, names: str | None = None) -> Table:
    """The table of the file `source`, or of standard input where that is "-"; `names` are the headings, with commas
    between, where the file has none.  SceneError in one sentence where there is none."""
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
    except Exception as error:  # those who wrote the readers raise what they meet in a damaged file
        raise SceneError(f"{name} cannot be read: {first_line(error)}") from None
    if names is None:
        return table
    heads = tuple(part.strip() for part in names.split(","))
    if len(heads) != len(table.columns):
        raise SceneError(
            f"--columns names {len(heads)} columns, and {name} has {len(table.columns)} that are not empty"
        )
    return Table(name, heads, table.columns, table.line)


def read_content(path: Path) -> bytes:
    """The bytes of a file."""
    try:
        return path.read_bytes()
    except (OSError, ValueError) as error:
        said = getattr(error, "strerror", None) or str(error)
        near = []
        if isinstance(error, FileNotFoundError) and path.parent.is_dir():
            near = get_close_matches(path.name, [each.name for each in path.parent.iterdir()], n=1)
        hint = f" (nearest: '{near[0]}')" if near else ""
        raise SceneError(f"cannot read {path}: {said}{hint}") from None


def parse_table_file(data: bytes, name: str) -> Table:
    """The table in these bytes."""
    if data.startswith(b"\x1f\x8b"):
        return parse_table_file(gzip.decompress(data), name)
    if data.startswith(b"PK"):
        with ZipFile(io.BytesIO(data)) as archive:
            tables = [member for member in archive.namelist() if member.lower().endswith((".csv", ".tsv", ".txt"))]
        if tables:
            raise SceneError(f"{name} is an archive: unpack it and name what is in it, as in {format_value(tables[0])}")
        return table_from_arrays(read_npz(data), name) if b".npy" in data[:200] else read_workbook(data, name)
    if data.startswith(b"\xd0\xcf\x11\xe0"):
        return read_workbook(data, name)
    if data.startswith((b"MATLAB 7.3", b"\x89HDF")):
        return table_from_arrays(read_hdf5(data), name)
    if data.startswith(b"MATLAB 5.0"):
        return table_from_arrays(read_mat(data), name)
    heads, rows, line = text_table.parse_text_table(data, name)
    return table_from_rows(heads, rows, line, name)


def table_from_rows(heads: list[str], rows: list[list[Any]], line: int, name: str) -> Table:
    """A table from its rows; what a short row lacks is missing, and what only stands beside the first rows is left."""
    width = max(len(heads), len(rows[0]))
    for number, row in enumerate(rows, line + 1):
        if len(row) > width and any(str(cell).strip() for cell in row[width:]):
            raise SceneError(f"{name}: row {number} has {len(row)} cells where the heading has {width}")
    columns = zip(*(row if len(row) == width else [*row, *[""] * width][:width] for row in rows), strict=True)
    heads = [*heads, *[""] * (width - len(heads))]
    middle = slice(len(rows) // 2, len(rows) // 2 + text_table.SAMPLE_LINES)
    kept = [(h, list(c)) for h, c in zip(heads, columns, strict=True) if any(c if h else c[middle])]
    return Table(name, tuple(head for head, _ in kept), tuple(cells for _, cells in kept), line)


def read_workbook(data: bytes, name: str) -> Table:
    """The longest table in the sheets of a workbook, the first of equal ones."""
    from python_calamine import CalamineWorkbook

    book = CalamineWorkbook.from_filelike(io.BytesIO(data))
    found = []
    for each in book.sheet_names:
        rows = [[str(cell).strip() for cell in row] for row in book.get_sheet_by_name(each).to_python()]
        first = text_table.find_first_number_row(rows)
        if first is not None:
            found.append((rows, first))
    if not found:
        raise SceneError(f"{name} has no sheet with a heading and rows of numbers")
    rows, first = max(found, key=lambda each: len(each[0]) - each[1])
    return table_from_rows(text_table.find_headings(rows[:first], len(rows[first])), rows[first:], first, name)


def read_npz(data: bytes) -> dict[str, Any]:
    with np.load(io.BytesIO(data), allow_pickle=False) as found:
        return {name: found[name] for name in found.files}


def read_mat(data: bytes) -> dict[str, Any]:
    from scipy.io import loadmat

    return {key: value for key, value in loadmat(io.BytesIO(data), simplify_cells=True).items() if key[:2] != "__"}


def read_hdf5(data: bytes) -> dict[str, Any]:
    """The data sets of an HDF5 file, as MATLAB writes them since version 7.3."""
    import h5py

    found: dict[str, Any] = {}

    def visit(path: str, item: Any) -> None:
        if isinstance(item, h5py.Dataset) and item.dtype.kind in "fiu" and not path.startswith("#"):
            found[path.replace("/", ".")] = item[()]

    with h5py.File(io.BytesIO(data), "r") as file:
        file.visititems(visit)
    return found


def table_from_arrays(found: dict[str, Any], name: str) -> Table:
    """The columns among named arrays: vectors, and matrices by their columns, of the length that most have."""
    columns: list[tuple[str, np.ndarray]] = []
    for key, value in flatten_arrays(found):
        if value.ndim == 1 or min(value.shape) == 1:
            columns.append((key, value.ravel()))
        elif value.ndim == 2:
            tall = value if value.shape[0] >= value.shape[1] else value.T
            columns += [(f"{key}{i + 1}", tall[:, i]) for i in range(tall.shape[1])]
    lengths = [len(values) for _, values in columns if len(values) > 2]
    length = max(lengths, key=lambda n: (lengths.count(n), n), default=0)
    kept = [(key, values) for key, values in columns if len(values) == length]
    if len(kept) < 2:
        raise SceneError(
            f"{name} has no two arrays of one length; time and position are needed (it has {', '.join(found)})"
        )
    return Table(name, tuple(key for key, _ in kept), tuple(values for _, values in kept))


def flatten_arrays(found: dict[str, Any], above: str = "") -> list[tuple[str, np.ndarray]]:
    """Arrays of numbers by name, those inside of structures as structure.field."""
    arrays = []
    for key, value in found.items():
        if isinstance(value, dict):
            arrays += flatten_arrays(value, f"{above}{key}.")
        elif isinstance(value, np.ndarray) and value.dtype.kind in "fiub" and 1 <= value.ndim <= 2 and value.size:
            arrays.append((above + key, value.astype(float)))
    return arrays
