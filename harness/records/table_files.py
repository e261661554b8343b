"""Reader of tables in files: text, spreadsheets (.xlsx, .xls, .ods), MATLAB .mat, HDF5, numpy .npy and .npz, Parquet,
JSON, or any of them gzipped or alone in a .zip archive.

The format is detected from the first bytes, so standard input works for all of them.
"""

import io
import re
import sys
from dataclasses import dataclass, field, replace
from difflib import get_close_matches
from pathlib import Path
from typing import Any
from zipfile import ZipFile

import numpy as np

from ..errors import HarnessError, SceneError, first_line, format_value, install_command, option_text
from . import array_files, text_table
from .child_reader import read_in_child
from .size_limits import check_mat, check_zip, unpack_gzip

TEXT_SUFFIXES = (".csv", ".tsv", ".txt")
Cells = list[Any] | np.ndarray


@dataclass(frozen=True)
class Table:
    """Columns of a file.

    Attributes
    ----------
    name : str
        Name of the file.
    column_headings : tuple of str
        Headings; an empty text for a column without one.
    columns : tuple
        Cells (n,) of each column: numbers or texts.
    line : int
        Number of the line before the first row.
    interval : float or None
        Sampling interval in s, if the file has one and no times.
    notes : tuple of str
        Choices made when reading.
    parsed_columns : dict
        Cache of the numbers of a column by its index, and the index of its first cell that is no number.
    """

    name: str
    column_headings: tuple[str, ...]
    columns: tuple[Cells, ...]
    line: int = 0
    interval: float | None = None
    notes: tuple[str, ...] = ()
    parsed_columns: dict[int, tuple[np.ndarray, int | None]] = field(
        default_factory=dict, init=False, compare=False, repr=False
    )


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
        raise SceneError(f"{name} needs {error.name} to be read: {install_command('records')}") from None
    except Exception as error:  # the readers raise arbitrary exceptions for damaged files
        raise SceneError(f"{name} cannot be read: {first_line(error)}") from None
    if headings is None:
        return note_unnamed_columns(table)
    names = tuple(part.strip() for part in headings.split(","))
    if len(names) != len(table.columns):
        names_text = f"{option_text('headings')} names {len(names)} columns"
        raise SceneError(f"{names_text}, and {name} has {len(table.columns)} that are not empty")
    return replace(table, column_headings=names)


def note_unnamed_columns(table: Table) -> Table:
    """Return a table with a note if it has fewer names than columns: the names are those of the first columns."""
    headings = table.column_headings
    count = next((i for i in range(len(headings), 0, -1) if headings[i - 1]), 0)
    if count in (0, len(headings)):
        return table
    note = f"{table.name} names {count} of {len(headings)} columns: the names are taken for the first ones."
    return replace(table, notes=(*table.notes, note))


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
        data = unpack_gzip(data, name)
    if data.startswith(b"PK") and b".npy" not in data[:200]:
        with ZipFile(io.BytesIO(data)) as archive:
            check_zip(archive, name)
            member = find_member(archive.namelist(), name)
            data = data if member is None else archive.read(member)
    if data.startswith((b"PK", b"\xd0\xcf\x11\xe0")) and b".npy" not in data[:200]:
        return table_from_workbook(read_in_child(data, name, "workbook"), name)
    for magic, file_format in ARRAY_FORMATS:
        if data.startswith(magic):
            if file_format == "mat":
                check_mat(data, name)
            if file_format in ("npy", "npz"):  # numpy checks what it reads
                return table_from_arrays(array_files.READERS[file_format](data, name), name)
            contents = read_in_child(data, name, file_format)
            columns = [array_files.ArrayColumn(*column) for column in contents["columns"]]
            return table_from_columns(columns, contents["names"], name)
    if data.lstrip()[:1] in (b"{", b"["):
        arrays = array_files.read_json(text_table.decode_text(data, name))
        if arrays is not None:
            return table_from_arrays(arrays, name)
    headings, rows, line, interval, _ = text_table.parse_text_table(data, name)
    if isinstance(rows, np.ndarray):
        names = tuple(headings or [""] * rows.shape[1])
        table = Table(name, names, tuple(np.ascontiguousarray(rows.T)), line, interval)
    else:
        table = replace(table_from_rows(headings, rows, line, name), interval=interval)
    return note_title(
        table, "" if any(headings) or not line else text_table.decode_text(data, name).splitlines()[line - 1]
    )


def note_title(table: Table, above: str) -> Table:
    """Return a table with a note if the line above its numbers has one text, which may name any of its columns."""
    text = above.strip()
    if not text or any(map(text.count, ",;\t")) or text_table.is_comment(text) or len(table.columns) < 2:
        return table
    note = (
        f"{table.name} has one text, {format_value(text)}, above {len(table.columns)} columns: it is taken for a "
        f"title; {option_text('headings')} names the columns."
    )
    return replace(table, notes=(*table.notes, note))


ARRAY_FORMATS = (
    (b"\x93NUMPY", "npy"),
    (b"PK", "npz"),
    (b"\x89HDF", "hdf5"),
    (b"MATLAB", "mat"),
    (b"PAR1", "parquet"),
)


def find_member(names: list[str], name: str) -> str | None:
    """Return the only table in a .zip archive, or the raw data of phyphox; None if the archive is a workbook."""
    if any(member in ("[Content_Types].xml", "mimetype") for member in names):
        return None
    is_description = re.compile(r"(^|/)(meta|__MACOSX)/", re.I)
    tables = [
        member for member in names if member.lower().endswith(TEXT_SUFFIXES) and not is_description.search(member)
    ]
    raw = [member for member in tables if Path(member).stem.lower() == "raw data"]
    if len(tables) != 1 and len(raw) != 1:
        tables_text = (
            f"with {len(tables)} tables ({', '.join(tables[:5])})" if tables else "without a table (.csv, .txt)"
        )
        example = f": unpack it and specify a file in it, as in {format_value(tables[0])}" if tables else ""
        raise SceneError(f"{name} is an archive {tables_text}{example}")
    return tables[0] if len(tables) == 1 else raw[0]


def table_from_rows(headings: list[str], rows: list[list[Any]], line: int, name: str) -> Table:
    """Return a table from its rows. Short rows are padded; columns without heading and values are dropped."""
    width = max(len(headings), len(rows[0]))
    for number, row in enumerate(rows, line + 1):
        if len(row) > width and any(str(cell).strip() for cell in row[width:]):
            raise SceneError(f"{name}: row {number} has {len(row)} cells where the heading has {width}")
    columns = zip(*(row if len(row) == width else [*row, *[""] * width][:width] for row in rows), strict=True)
    headings = [*headings, *[""] * (width - len(headings))]
    middle = slice(len(rows) // 2, len(rows) // 2 + text_table.SAMPLE_LINES)
    headed_columns = [
        text_table.separate_units(heading, cells)
        for heading, cells in zip(headings, columns, strict=True)
        if any(cells if heading else cells[middle])
    ]
    return Table(
        name, tuple(heading for heading, _ in headed_columns), tuple(cells for _, cells in headed_columns), line
    )


def table_from_workbook(contents: dict[str, Any], name: str) -> Table:
    """Return the table of a workbook, with a note if several sheets have one."""
    table = table_from_rows(contents["headings"], contents["rows"], contents["line"], name)
    sheets = contents["sheets"]
    note = f"{name} has a table in several sheets ({', '.join(sheets)}): the longest is used."
    return replace(table, notes=(note,) if len(sheets) > 1 else ())


def table_from_arrays(arrays: dict[str, Any], name: str) -> Table:
    """Return a table from named arrays: vectors and columns of matrices with the most frequent length."""
    return table_from_columns(array_files.list_columns(arrays), [*filter(None, arrays)], name)


def table_from_columns(columns: list[array_files.ArrayColumn], names: list[str], name: str) -> Table:
    """Return a table from the columns of the most frequent length; `names` are those of all entries of the file."""
    lengths = [len(column.values) for column in columns if len(column.values) > 2]
    length = max(lengths, key=lambda n: (lengths.count(n), n), default=0)
    selected_columns = [column for column in columns if len(column.values) == length]
    if not selected_columns:
        raise SceneError(f"{name} has no array of numbers (it has {', '.join(names) or 'none'})")
    parents = {column.name.rpartition(".")[0] for column in selected_columns}
    prefix = f"{parents.pop()}." if len(parents) == 1 else ""
    headings = tuple(column.heading(prefix) for column in selected_columns)
    cells = (column.values for column in selected_columns)
    return Table(name, headings, tuple(c if isinstance(c[0], str) else np.asarray(c, float) for c in cells))
