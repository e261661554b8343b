"""Reads the longest table in the sheets of a workbook (.xlsx, .xls, .ods), in a child process with limited memory.

The reader allocates memory for all cells between the first and the last, and ends its process if there is too little:
one cell in the last row and column of a sheet takes 549 GB.
"""

import json
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..errors import HarnessError, SceneError, first_line, optional
from ..process.subprocess_runner import SubprocessTimeoutError, run_module, serve_request
from ..process.temporary_directory import temporary_directory
from . import text_table

MAX_MEMORY = 4 << 30  # bytes
TIMEOUT = 120.0  # s
ANSWER_KEYS = ("headings", "rows", "line", "sheets")


@dataclass(frozen=True)
class WorkbookRequest:
    """Path of a workbook to read."""

    path: str


def read_workbook(data: bytes, name: str) -> tuple[list[str], list[list[str]], int, list[str]]:
    """Return headings, rows, the number of the row before the first one, and the names of the sheets with tables.

    Raises
    ------
    SceneError
        If the workbook has no table, or cannot be read.
    """
    optional("python_calamine", f"reading {name}", "records")
    with temporary_directory("workbook-") as folder:
        path = Path(folder) / "workbook"
        path.write_bytes(data)
        try:
            done = run_module(__name__, json.dumps({"path": str(path)}), timeout=TIMEOUT)
        except SubprocessTimeoutError:
            raise SceneError(f"{name} takes longer than {TIMEOUT:g} s to read: save its table as .csv") from None
    if done.returncode:
        raise SceneError(
            f"{name} cannot be read, or not with {MAX_MEMORY >> 30} GB of memory: delete cells far from its table, or "
            "save the table as .csv"
        )
    answer = json.loads(done.stdout)
    if "error" in answer:
        raise SceneError(f"{name} {answer['error']}")
    headings, rows, line, sheets = (answer[key] for key in ANSWER_KEYS)
    return headings, rows, line, sheets


def find_table(request: WorkbookRequest) -> dict[str, Any]:
    """Return the longest table of a workbook, or the error that ends a sentence with the name of the workbook."""
    from python_calamine import CalamineWorkbook

    candidates = []
    try:
        workbook = CalamineWorkbook.from_path(request.path)
        for sheet_name in workbook.sheet_names:
            rows = [[str(cell).strip() for cell in row] for row in workbook.get_sheet_by_name(sheet_name).to_python()]
            first_row = text_table.find_first_number_row(rows)
            if first_row is None:
                rows = [row[:1] for row in rows] if all(not any(row[1:]) for row in rows) else []
                first_row = text_table.find_first_number_row(rows, min_width=1)
            if first_row is not None:
                candidates.append((rows, first_row, sheet_name))
        if not candidates:
            return {"error": "has no sheet with a heading and rows of numbers"}
        rows, first_row, _ = max(candidates, key=lambda sheet: len(sheet[0]) - sheet[1])
        headings = text_table.find_headings(rows[:first_row], len(rows[first_row]))
    except HarnessError as error:
        return {"error": str(error)}
    except MemoryError:
        raise
    except Exception as error:  # the reader raises arbitrary exceptions for damaged files
        return {"error": f"cannot be read: {first_line(error)}"}
    sheets = [sheet_name for _, _, sheet_name in candidates]
    return dict(zip(ANSWER_KEYS, (headings, rows[first_row:], first_row, sheets), strict=True))


def limit_memory() -> None:
    """Limit the memory of this process, where the system can."""
    with suppress(ImportError, ValueError, OSError):
        import resource

        resource.setrlimit(resource.RLIMIT_AS, (MAX_MEMORY, MAX_MEMORY))


if __name__ == "__main__":
    limit_memory()
    serve_request(WorkbookRequest, find_table)
