"""Reader of spreadsheets, .mat, HDF5 and Parquet files in a worker process with limited memory.

Some files make the libraries for these formats end the process: a cell in the last row and column of a sheet makes
python-calamine allocate 549 GB, and scipy reads beyond the end of some damaged .mat files.
"""

import os
from dataclasses import dataclass
from typing import Any

from ..errors import HarnessError, SceneError, first_line
from ..process.temporary_directory import temporary_directory
from ..process.worker import WorkerCallError, WorkerDiedError, WorkerTimeoutError, call_once
from . import size_limits, text_table

MEMORY_PROBLEM = (
    "it is damaged, has cells far from its table, or needs more than "
    f"{size_limits.MAX_MEMORY >> 30} GB of memory; save its columns as .csv"
)


@dataclass(frozen=True)
class ReadRequest:
    """A file to read: its path, its name in messages, and its format, `workbook` or that of an array file."""

    path: str
    name: str
    format: str


def read_in_child(data: bytes, name: str, file_format: str) -> dict[str, Any]:
    """Return the result of `read_workbook` or `read_arrays` for a file.

    Raises
    ------
    SceneError
        If the file cannot be read.
    ImportError
        If the library for the format is not installed.
    """
    timeout = size_limits.MAX_READING_TIME
    with temporary_directory("record-") as folder:
        path = folder / "record"
        path.write_bytes(data)
        try:
            request = ReadRequest(str(path), name, file_format)
            contents: dict[str, Any] = call_once(read_file, request, timeout=timeout, memory=size_limits.MAX_MEMORY)
        except WorkerTimeoutError:
            raise SceneError(f"{name} takes longer than {timeout:g} s to read: save its columns as .csv") from None
        except (WorkerDiedError, WorkerCallError):  # where its memory did not suffice for the imports of this module
            raise SceneError(f"{name} cannot be read: {MEMORY_PROBLEM}") from None
    if "library" in contents:
        raise ImportError(name=contents["library"])
    return contents


def read_file(request: ReadRequest) -> dict[str, Any]:
    """Return the contents of a file, or the `library` that is missing."""
    try:
        return read_workbook(request) if request.format == "workbook" else read_arrays(request)
    except HarnessError:
        raise
    except ImportError as error:
        return {"library": error.name}
    except MemoryError:
        raise SceneError(f"{request.name} cannot be read: {MEMORY_PROBLEM}") from None
    except Exception as error:  # the readers raise arbitrary exceptions for damaged files
        raise SceneError(f"{request.name} cannot be read: {first_line(error)}") from None


def read_workbook(request: ReadRequest) -> dict[str, Any]:
    """Return headings and rows of the longest table, the number of the row before it, and the sheets with tables."""
    from python_calamine import CalamineWorkbook

    candidates = []
    workbook = CalamineWorkbook.from_path(request.path)
    for sheet_name in workbook.sheet_names:
        rows = [[str(cell).strip() for cell in row] for row in workbook.get_sheet_by_name(sheet_name).to_python()]
        first_row = text_table.find_first_number_row(rows)
        if first_row is None and not any(any(row[1:]) for row in rows):
            rows = [row[:1] for row in rows]
            first_row = text_table.find_first_number_row(rows, min_width=1)
        if first_row is not None:
            candidates.append((rows, first_row, sheet_name))
    if not candidates:
        raise SceneError(f"{request.name} has no sheet with a heading and rows of numbers")
    rows, first_row, _ = max(candidates, key=lambda sheet: len(sheet[0]) - sheet[1])
    headings = text_table.find_headings(rows[:first_row], len(rows[first_row]))
    sheets = [sheet_name for _, _, sheet_name in candidates]
    return {"headings": headings, "rows": rows[first_row:], "line": first_row, "sheets": sheets}


def read_arrays(request: ReadRequest) -> dict[str, Any]:
    """Return the columns of an array file, and the names of all its entries."""
    os.environ["OPENBLAS_NUM_THREADS"] = "1"  # each thread would reserve some of the memory
    from . import array_files

    with open(request.path, "rb") as file:
        arrays = array_files.READERS[request.format](file.read(), request.name)
    columns = [
        (column.name, array_files.as_list(column.values), column.unit) for column in array_files.list_columns(arrays)
    ]
    return {"columns": columns, "names": [*filter(None, arrays)]}
