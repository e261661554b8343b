"""Columns of a table: their names and units, the one with the times, and their numbers.

Headings contain a name and a unit, as in `x [mm]`, `theta (deg)`, `Linear Acceleration z (m/s^2)` or `x / mm`.
"""

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..errors import SceneError, option_text, unknown_name_message
from .samples import parse_timestamps
from .table_files import Cells, Table, load_table
from .text_table import GROUPED_NUMBER, MISSING, TIMESTAMP
from .units import DATE_NAME, TIME_NAME, TIMES, find_unit, order_from_name, split_heading, time_unit_size

MAX_PLAUSIBLE_TIME = 1e11  # s: the year 5138
EXPONENT = re.compile("[dD](?=[-+0-9])")  # Fortran

MAX_LISTED = 8  # columns in a note: more say nothing to a reader


@dataclass(frozen=True)
class ColumnOptions:
    """Options for the columns of a file.

    Attributes
    ----------
    time, column : str or None
        Headings of the columns of times and of the motion; a unit in that of the times overrides that in the file.
    quantity : str or None
        Measured quantity: position, velocity or acceleration.
    unit : str or None
        Unit that overrides that in the file, or the size of one count of an encoder, as 0.36deg.
    headings : str or None
        Headings, separated by commas, for a file without headings.
    rate : float or None
        Sampling rate in Hz, which replaces the times in the file.
    begin, end : float or None
        Time interval in s; None for the start and the end of the record.
    """

    time: str | None = None
    column: str | None = None
    quantity: str | None = None
    unit: str | None = None
    headings: str | None = None
    rate: float | None = None
    begin: float | None = None
    end: float | None = None

    @property
    def interval(self) -> tuple[float, float]:
        """Return the time interval in s, with infinite ends where there is none."""
        return -np.inf if self.begin is None else self.begin, np.inf if self.end is None else self.end


@dataclass(frozen=True)
class Column:
    """Column of a table: index, heading, and the name and unit in the heading."""

    index: int
    heading: str
    name: str
    unit: str | None

    @property
    def order(self) -> int | None:
        """Return the order of the derivative that the unit, or else the name, indicates."""
        unit = find_unit(self.unit) if self.unit else None
        return unit.order if unit else order_from_name(self.name)


def list_columns(table: Table) -> list[Column]:
    """Return the columns of a table, with numbers after headings that occur twice, and names without any heading."""
    headings = list(table.column_headings)
    if not any(headings):
        headings = [f"column {i}" for i in range(1, len(headings) + 1)]
    counts: Counter[str] = Counter()
    candidates = []
    for index, heading in enumerate(headings):
        counts[heading] += 1
        number = f" #{counts[heading]}" if heading and counts[heading] > 1 else ""
        candidates.append(Column(index, heading + number, *split_heading(heading)))
    return candidates


def no_time_message(table: Table) -> str:
    """Return the message about a table without a column of times."""
    names = ", ".join(filter(None, table.column_headings))
    if len(table.column_headings) == 1:
        return (
            f"{table.name} has one column of numbers{f', {names},' if names else ''} and no times: set the sampling "
            f"rate in Hz, as in {option_text('rate', 100)}"
        )
    if not names:
        return (
            f"{table.name} has no heading; give the names of its columns, as in "
            f"{option_text('headings', 't [s],x [mm]')}, or the sampling rate in Hz, as in {option_text('rate', 100)}"
        )
    return (
        f"{table.name} has no column of times (it has {names}): name it, as in "
        f"{option_text('time', table.column_headings[0])}, or set the sampling rate in Hz, as in "
        f"{option_text('rate', 100)}"
    )


def read_numeric(path: Path) -> tuple[tuple[str, ...], np.ndarray]:
    """Return the headings and numbers (rows, columns) of a purely numeric file; NaN for missing cells."""
    table = load_table(str(path))
    if not all(table.column_headings):
        raise SceneError(
            f"{table.name} has no heading; its first line must contain the names of the columns, as in t [s],x [mm]"
        )
    if len(table.column_headings) < 2:
        raise SceneError(f"{table.name} has only one column that is not empty; time and a variable are required")
    return table.column_headings, np.column_stack([parse_numbers(table, i) for i in range(len(table.column_headings))])


def find_column_and_unit(heading: str, table: Table, candidates: Sequence[Column]) -> tuple[Column, str | None]:
    """Return the column with a heading, and its unit. As "laser [mm]", the heading overrides the unit of the file."""
    try:
        column = find_column(heading, table, candidates)
    except SceneError:
        name, unit = split_heading(heading)
        if unit is None or name == heading:
            raise
        return find_column(name, table, candidates), unit
    return column, column.unit


def find_column(heading: str, table: Table, candidates: Sequence[Column]) -> Column:
    """Return the column with a heading, given in full or without its unit."""
    for headings in (
        [part.heading for part in candidates],
        [part.heading.strip() for part in candidates],
        [part.name for part in candidates],
    ):
        for normalize in (str, str.lower):
            matches = [
                part for part, text in zip(candidates, headings, strict=True) if normalize(text) == normalize(heading)
            ]
            if matches:
                return matches[0]
    names = filter(None, (part.heading for part in candidates))
    raise SceneError(f"{table.name}: {unknown_name_message('column', heading, names)}")


def find_time_column(table: Table, candidates: Sequence[Column], columns: ColumnOptions) -> Column | None:
    """Return the requested time column; otherwise that with the name or unit of a time, or the first if it rises.

    Of several time columns, the nearest one before the requested signal is chosen, or the first.  None if there is
    none.
    """
    if columns.time is not None:
        return find_column_and_unit(columns.time, table, candidates)[0]
    time_columns = find_time_columns(candidates)
    if columns.rate and len(candidates) == 1:
        return None
    if time_columns:
        signal = None if columns.column is None else find_column(columns.column, table, candidates)
        return next((part for part in reversed(time_columns) if signal and part.index < signal.index), time_columns[0])
    first = next((part for part in candidates if part.heading), None)
    if first is None or len(candidates) < 2 or (first.unit and find_unit(first.unit)):
        return None
    cells = table.columns[first.index]
    if isinstance(cells, list) and any(TIMESTAMP.match(cell) and ":" in cell for cell in cells[:1]):
        return first
    t = parse_numbers(table, first.index, strict=False)
    t = t[np.isfinite(t)]
    if len(t) < 2 or (np.diff(t) <= 0).any():
        return None
    may_be_index = not any(table.column_headings) and columns.rate is None
    return None if may_be_index and (t == np.round(t)).all() else first


def describe_choice(column: Column, rivals: Sequence[Column], reason: str, option: str) -> list[str]:
    """Return a note on the choice of a column of several; none of one."""
    if len(rivals) < 2:
        return []
    names = [part.heading for part in rivals]
    headings_text = ", ".join(names) if len(names) <= MAX_LISTED else f"{', '.join(names[:MAX_LISTED])} and others"
    return [f"Of {headings_text}, {column.heading} is used, because {reason}; {option_text(option)} selects another."]


def find_time_columns(candidates: Sequence[Column]) -> list[Column]:
    """Return the columns with the name and the unit of a time, or else with the name, or else with the unit."""
    by_name = [part for part in candidates if TIME_NAME.search(part.name)]
    by_name = [part for part in by_name if not DATE_NAME.search(part.name)] or by_name
    by_unit = [part for part in candidates if part.unit and time_unit_size(part.unit) and find_unit(part.unit) is None]
    return [part for part in by_name if part in by_unit] or by_name or by_unit


def is_time_column(column: Column) -> bool:
    """Return whether a column has the name of a time, or a unit."""
    return bool(TIME_NAME.search(column.name) or column.unit)


def describe_further_runs(candidates: Sequence[Column], time_column: Column, motion_column: Column) -> list[str]:
    """Return a note if the table has several columns of times, each with signals after it."""
    time_columns = find_time_columns(candidates)
    ends = [*(part.index for part in time_columns[1:]), len(candidates)][: len(time_columns)]
    runs = [
        (part, candidates[part.index + 1])
        for part, end in zip(time_columns, ends, strict=True)
        if end > part.index + 1 and candidates[part.index + 1].heading
    ]
    others = [f"{part.heading} with {signal.heading}" for part, signal in runs if part is not time_column]
    if not others:
        return []
    next_time_column = next(part for part, _ in runs if part is not time_column)
    return [
        f"The table has {len(others) + 1} runs side by side: {time_column.heading} with {motion_column.heading} is "
        f"used, and {', '.join(others)} is not; {option_text('time', next_time_column.heading)} selects "
        "another."
    ]


def read_times(table: Table, time_column: Column, columns: ColumnOptions) -> np.ndarray:
    """Return times (n,) in s."""
    cells = table.columns[time_column.index]
    texts = () if isinstance(cells, np.ndarray) and cells.dtype.kind == "f" else cells
    first_text = next((cell for cell in texts if isinstance(cell, str) and cell), None)
    if first_text is not None and ":" in first_text and TIMESTAMP.match(first_text):
        return parse_timestamps(cells, table.name)  # type: ignore[arg-type]
    unit = time_column.unit
    if columns.time is not None:
        unit = find_column_and_unit(columns.time, table, list_columns(table))[1]
    size = time_unit_size(unit or "s")  # default s, as in nearly all programs and instruments
    if unit and not size:
        raise SceneError(unknown_name_message(f"unit of {time_column.name}", unit, TIMES))
    t = parse_numbers(table, time_column.index)
    finite = t[np.isfinite(t)]
    if unit is None and len(finite) and ((finite == np.round(finite)).all() or finite.max() > MAX_PLAUSIBLE_TIME):
        raise SceneError(
            f"{table.name}: {time_column.name} has integer or very large numbers and no unit: set one in "
            f"its heading, as in {time_column.name} [ms], or as in {option_text('time', f'{time_column.name} [ms]')}, "
            "or [0.01s] for sample numbers"
        )
    return t * size


def parse_numbers(table: Table, i: int, strict: bool = True) -> np.ndarray:
    """Return the numbers (n,) of a column, NaN for missing cells. The table caches them.

    Raises
    ------
    SceneError
        If `strict` and a cell is neither a number nor missing.
    """
    if i not in table.parsed_columns:
        table.parsed_columns[i] = parse_cells(table.columns[i])
    numbers, invalid = table.parsed_columns[i]
    if strict and invalid is not None:
        cell, heading, row = table.columns[i][invalid], table.column_headings[i], table.line + 1 + invalid
        if cell == heading:
            raise SceneError(f"{table.name}: row {row} repeats the headings: save each run in a separate file")
        raise SceneError(f"{table.name}: '{cell[:40]}' in row {row}, column {heading}, is not a number")
    return numbers


def parse_cells(cells: Cells) -> tuple[np.ndarray, int | None]:
    """Return the numbers (n,) in cells, NaN for other cells, and the index of the first invalid cell or None."""
    if isinstance(cells, np.ndarray):
        return cells, None
    try:
        has_commas = all("," in cell for cell in cells)
        return np.array([cell.replace(",", ".") for cell in cells] if has_commas else cells, dtype=float), None
    except ValueError:
        pass
    numbers, invalid = np.full(len(cells), np.nan), None
    present = [cell for cell in cells if cell.lower() not in MISSING]
    with_comma = [cell for cell in present if "," in cell]
    comma_groups = len(with_comma) < len(present) and all(
        GROUPED_NUMBER.match(cell) and cell.strip("+-")[0] != "0" for cell in with_comma
    )
    for index, cell in enumerate(cells):
        if cell.lower() in MISSING:
            continue
        group_match = GROUPED_NUMBER.match(cell)
        number = cell
        if group_match and (
            group_match[2] or group_match[3] or group_match[1] == "'" or (group_match[1] == "," and comma_groups)
        ):
            number = cell.replace(group_match[1], "")
        try:
            numbers[index] = float(EXPONENT.sub("e", number.replace(",", ".")))
        except ValueError:
            invalid = index if invalid is None else invalid
    return numbers, invalid
