"""Selection of the time and motion columns of a table, the measured quantity, and its unit.

Headings contain a name and a unit, as in `x [mm]`, `theta (deg)`, `Linear Acceleration z (m/s^2)` or `x / mm`. The
quantity follows from the unit, otherwise from the name. Options override both.
"""

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..arguments import QUANTITIES
from ..errors import SceneError, command_text, option_text, unknown_name_message
from .headings import DATE_NAME, FORCE_NAME, MAGNITUDE_NAME, TIME_NAME, order_from_name, split_heading
from .record import Record, check_record
from .samples import (
    find_repeated_times,
    leave_out_saturated,
    mark_dropouts,
    mark_sentinels,
    parse_timestamps,
    sort_times,
    undo_time_rounding,
)
from .table_files import Cells, Table, load_table
from .text_table import GROUPED_NUMBER, MISSING, TIMESTAMP
from .units import COUNT_NAMES, TIMES, find_unit, is_force_unit, parse_per_count, time_unit_size

MAX_PLAUSIBLE_TIME = 1e11  # s: the year 5138
EXPONENT = re.compile("[dD](?=[-+0-9])")  # Fortran
MAX_MISSING_SHARE = 0.2  # share of the samples
NO_UNIT = "units"  # of a position without a unit
EXAMPLE_UNITS = (("mm", "deg"), ("mm/s", "deg/s"), ("m/s2", "g"))  # by the order of the derivative
RATE_SUFFIXES = ("", "/s", "/s2")  # appended to the unit of the position


@dataclass(frozen=True)
class ColumnOptions:
    """Options for the columns of a file.

    Attributes
    ----------
    time, position : str or None
        Headings of the time and motion columns.
    quantity : str or None
        Measured quantity: position, velocity or acceleration.
    unit, time_unit : str or None
        Units that override those in the file.
    per_count : str or None
        Size and unit of one count of an encoder.
    names : str or None
        Headings, separated by commas, for a file without headings.
    rate : float or None
        Sampling rate in Hz, which replaces the times in the file.
    begin, end : float or None
        Time interval in s; None for the start and the end of the record.
    """

    time: str | None = None
    position: str | None = None
    quantity: str | None = None
    unit: str | None = None
    time_unit: str | None = None
    per_count: str | None = None
    names: str | None = None
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


def read_record(source: str, columns: ColumnOptions, name: str) -> Record:
    """Read a record from a file.

    Parameters
    ----------
    source : str
        Path of the file; "-" for standard input.
    columns : ColumnOptions
        Options for the columns.
    name : str
        Name of the record.

    Raises
    ------
    SceneError
        If the file contains no record.
    """
    return parse_record(load_table(source, columns.names), columns, name)


def parse_record(table: Table, columns: ColumnOptions, name: str) -> Record:
    """Return the record in a table; raise SceneError if it contains none."""
    notes = list(table.notes)
    candidates = list_columns(table)
    time_column = find_time_column(table, candidates, columns)
    interval = 1 / columns.rate if columns.rate else None if time_column else table.interval
    if interval is None and columns.time is None:
        refuse_friction_curve(table, candidates, time_column)
    if time_column is None and interval is None:
        raise SceneError(no_time_message(table))
    if interval is None and len(candidates) < 2 and time_column is not None:
        raise SceneError(
            f"{table.name} has only one column that is not empty, {time_column.heading}; time and position are required"
        )
    motion_column, choice = find_signal_column(table, candidates, columns, time_column)
    notes += choice
    if not any(table.column_headings) and len(candidates) > 1:
        times = "" if time_column is None or interval else f"{time_column.heading} is used as time in s and "
        notes.insert(
            0,
            f"The file has no headings: {times}{motion_column.heading} is the signal; "
            f"{option_text('headings')} names them.",
        )
    elif time_column is not None and columns.time is None:
        notes += describe_further_runs(candidates, time_column, motion_column)
    label, unit = motion_column.name or motion_column.heading, columns.unit or motion_column.unit
    x = parse_numbers(table, motion_column.index).copy()
    others = [column.heading for column in candidates if column not in (time_column, motion_column)]
    if others and columns.position is None and len(np.unique(x[np.isfinite(x)])) == 1:
        raise SceneError(
            f"{table.name}: {motion_column.heading} does not move; select another column by {option_text('column')}: "
            f"{', '.join(others)}"
        )
    order, base, size, assumption = resolve_unit(label, unit, columns, table.name)
    if time_column is None or interval is not None:
        t, time_label = np.arange(len(x)) * (interval or 0.0), "the time"
    else:
        t, time_label = read_times(table, time_column, columns), time_column.heading
        if columns.time is None and any(table.column_headings) and not is_time_column(time_column):
            notes.append(f"{time_column.heading} is used as time; {option_text('time')} selects another column.")
    is_complete, gaps = find_complete_rows(t, x, (time_label, label), table.name)
    t, rounding = undo_time_rounding(t[: len(is_complete)])
    notes += filter(None, (*gaps, rounding, assumption))
    t, x = t[is_complete], size * x[: len(is_complete)][is_complete]
    order_of_time, sorting = sort_times(t)
    t, x = t[order_of_time], x[order_of_time]
    is_repeated, repetition = find_repeated_times(t)
    notes += filter(None, [sorting, repetition])
    t, x = t[~is_repeated], x[~is_repeated]
    record = Record(name, t, x, base + RATE_SUFFIXES[order], order, base, tuple(notes)).select(*columns.interval)
    record = leave_out_saturated(record)
    check_record(record)
    return record


def find_complete_rows(
    t: np.ndarray, x: np.ndarray, labels: tuple[str, str], file: str
) -> tuple[np.ndarray, list[str]]:
    """Return a mask of the rows with a time and a value, up to the last row with either, and notes on the others.

    Marks of missing samples become NaN in `t` and `x`.

    Raises
    ------
    SceneError
        If too many rows lack a time or a value.
    """
    is_used = np.isfinite(t) | np.isfinite(x)
    length = int(np.flatnonzero(is_used)[-1]) + 1 if is_used.any() else 0  # another run in the table may be longer
    empty = length - int((np.isfinite(t) & np.isfinite(x))[:length].sum())
    notes = [f"{empty} of {length} rows have a missing cell and are skipped."] if empty else []
    for values, label in zip((t, x), labels, strict=True):
        notes += mark_sentinels(values[:length], label)
    notes += mark_dropouts(x[:length], labels[1])
    is_complete = (np.isfinite(t) & np.isfinite(x))[:length]
    missing = length - int(is_complete.sum())
    if missing > MAX_MISSING_SHARE * length or not length:
        reason = "" if missing == empty else f": {notes[-1]}".rstrip(".")
        raise SceneError(f"{file}: {missing} of {length} rows have no number for {' or '.join(labels)}{reason}")
    return is_complete, notes


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


def refuse_friction_curve(table: Table, candidates: Sequence[Column], time_column: Column | None) -> None:
    """Raise SceneError if a table without times holds a force over a velocity."""
    if time_column is not None and time_column.order != 1:
        return
    velocity = next((part for part in candidates if part.order == 1), None)
    others = [part for part in candidates if part is not velocity]
    force = next((part for part in others if part.unit and is_force_unit(part.unit)), None)
    force = force or next((part for part in others if not part.unit and FORCE_NAME.search(part.name)), None)
    if velocity and force:
        raise SceneError(
            f"{table.name} has no times but a force over a velocity, {force.heading} over {velocity.heading}, and is "
            f"no decay: use {command_text('curve')}, or name the column of times, as in {option_text('time', 't')}"
        )


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
        return find_column(columns.time, table, candidates)
    time_columns = find_time_columns(candidates)
    if columns.rate and len(candidates) == 1:
        return None
    if time_columns:
        signal = None if columns.position is None else find_column(columns.position, table, candidates)
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
    may_be_index = not any(table.column_headings) and columns.time_unit is None and columns.rate is None
    return None if may_be_index and (t == np.round(t)).all() else first


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
    selected = next(part for part, _ in runs if part is not time_column)
    return [
        f"The table has {len(others) + 1} runs side by side: {time_column.heading} with {motion_column.heading} is "
        f"used, and {', '.join(others)} is not; {option_text('time', selected.heading)} selects "
        "another."
    ]


def find_signal_column(
    table: Table, candidates: Sequence[Column], columns: ColumnOptions, time_column: Column | None
) -> tuple[Column, list[str]]:
    """Return the motion column and notes on the choice.

    A position is preferred to a velocity or an acceleration. Of several, the one with the largest deviation is chosen.
    """
    if columns.position is not None:
        return find_column(columns.position, table, candidates), []
    others = [part for part in candidates if part is not time_column]
    others = [part for part in others if part.heading and not TIME_NAME.search(part.name)] or others
    if time_column is not None:
        next_times = (part.index for part in candidates[time_column.index + 1 :] if TIME_NAME.search(part.name))
        next_time = next(next_times, len(candidates))  # with several runs side by side, use that of this time column
        others = [part for part in others if time_column.index < part.index < next_time] or others
    if columns.quantity is not None:
        order: int | None = QUANTITIES.index(columns.quantity)
    else:
        order = min((part.order for part in others if part.order is not None), default=None)
    motions = [part for part in others if part.order == order]
    motions = [part for part in motions if not MAGNITUDE_NAME.search(part.name)] or motions or others
    if motions[0].order is None:
        return motions[0], []  # no heading indicates a quantity: use the first
    same_unit = [part for part in motions if part.unit == motions[0].unit]
    if len(same_unit) == 1 or (order == 0 and same_unit[0].name.lower() in ("x", "theta")):
        return same_unit[0], []
    deviations = [np.nanstd(parse_numbers(table, part.index, strict=False)) for part in same_unit]
    most_varying = same_unit[int(np.argmax(deviations))]
    names = ", ".join(part.heading for part in same_unit)
    note = (
        f"Of {names}, {most_varying.heading} is used, because it varies most; {option_text('column')} selects another."
    )
    return most_varying, [note]


def resolve_unit(name: str, unit: str | None, columns: ColumnOptions, file: str) -> tuple[int, str, float, str]:
    """Return the order, base unit and SI factor of a column, and a note on an assumption."""
    requested = None if columns.quantity is None else QUANTITIES.index(columns.quantity)
    order_of_name, size = order_from_name(name), 1.0
    assumption = f"is assumed to be a position; {option_text('quantity', 'velocity')} or acceleration overrides this."
    if columns.per_count is not None:
        size, unit = parse_per_count(columns.per_count)
    if unit is None:
        order = requested if requested is not None else order_of_name or 0
        example, alternative = EXAMPLE_UNITS[order]
        note = (
            f"{name} has no unit in {file}: omega and zeta need none, the other values are in its own units, and "
            f"forces are left out; set it, as in {option_text('unit', example)} or {alternative}."
        )
        if requested is None and order_of_name is None:
            note += f" {name} {assumption}"
        return order, NO_UNIT, size, note
    if unit.lower() in COUNT_NAMES:
        example = option_text("per_count", "0.36deg")
        raise SceneError(f"{name} is in {unit}; set the size of one count, as in {example}")
    known_unit = find_unit(unit)
    if known_unit is None:
        indicated = next((order for order in (requested, order_of_name) if order is not None), None)
        order, rate = indicated or 0, RATE_SUFFIXES[indicated or 0]
        base = unit.removesuffix(rate) if unit.endswith(rate) else f"{unit}.s{order if order > 1 else ''}"
        return order, base, 1.0, f"{name} in {unit} {assumption}" if indicated is None else ""
    order = known_unit.order if requested is None else requested
    if requested is not None and requested != known_unit.order:
        raise SceneError(
            f"{option_text('quantity', columns.quantity)}: {unit}, the unit of {name}, measures "
            f"{with_article(QUANTITIES[known_unit.order])}"
        )
    if order_of_name is not None and known_unit.order < order_of_name and requested is None and columns.unit is None:
        raise SceneError(
            f"{name} has the name of {with_article(QUANTITIES[order_of_name])} and the unit of "
            f"{with_article(QUANTITIES[known_unit.order])}, {unit}: set {option_text('quantity')}, and "
            f"{option_text('unit')} if that in the file is wrong"
        )
    return order, known_unit.base, size * known_unit.size, ""


def with_article(noun: str) -> str:
    """Return a noun with its indefinite article."""
    return f"{'an' if noun[0] in 'aeiou' else 'a'} {noun}"


def read_times(table: Table, time_column: Column, columns: ColumnOptions) -> np.ndarray:
    """Return times (n,) in s."""
    cells = table.columns[time_column.index]
    first_text = next((cell for cell in cells if isinstance(cell, str) and cell), None)
    if first_text is not None and ":" in first_text and TIMESTAMP.match(first_text):
        return parse_timestamps(cells, table.name)  # type: ignore[arg-type]
    unit = columns.time_unit or time_column.unit
    size = time_unit_size(unit or "s")  # default s, as in nearly all programs and instruments
    if unit and not size:
        raise SceneError(unknown_name_message(f"unit of {time_column.name}", unit, TIMES))
    t = parse_numbers(table, time_column.index)
    finite = t[np.isfinite(t)]
    if unit is None and len(finite) and ((finite == np.round(finite)).all() or finite.max() > MAX_PLAUSIBLE_TIME):
        raise SceneError(
            f"{table.name}: {time_column.name} has integer or very large numbers and no unit: set one in "
            f"its heading, as in {time_column.name} [ms], or as in {option_text('time_unit', 'ms')}, or 0.01s for "
            "sample numbers"
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
        grouped = GROUPED_NUMBER.match(cell)
        number = cell
        if grouped and (grouped[2] or grouped[3] or grouped[1] == "'" or (grouped[1] == "," and comma_groups)):
            number = cell.replace(grouped[1], "")
        try:
            numbers[index] = float(EXPONENT.sub("e", number.replace(",", ".")))
        except ValueError:
            invalid = index if invalid is None else invalid
    return numbers, invalid
