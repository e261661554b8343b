"""Several signals over time from one file, converted to given units."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from ..errors import SceneError
from .columns import (
    Column,
    ColumnOptions,
    describe_further_runs,
    find_column,
    find_time_column,
    is_time_column,
    list_columns,
    no_time_message,
    parse_numbers,
    read_times,
)
from .headings import split_heading
from .record import MIN_SAMPLES, Record, check_record
from .samples import find_saturated, mark_dropouts, mark_sentinels, undo_time_rounding
from .table_files import Table, load_table
from .units import conversion_factor

MAX_MISSING_SHARE = 0.2  # of the rows


@dataclass(frozen=True)
class SignalSource:
    """Source of a signal: the heading of its column, and the unit to convert to (empty for a ratio or a count)."""

    heading: str
    unit: str


@dataclass(frozen=True)
class SignalTable:
    """Signals (n,) by name over the times (n,) in s, and notes on assumptions made when reading."""

    name: str
    t: np.ndarray
    columns: Mapping[str, np.ndarray]
    notes: tuple[str, ...] = ()


def read_signals(source: str, sources: Mapping[str, SignalSource], options: ColumnOptions, name: str) -> SignalTable:
    """Read signals from a file.

    Parameters
    ----------
    source : str
        Path of the file; "-" for standard input.
    sources : mapping
        The column and unit of each signal, by the name of the signal.
    options : ColumnOptions
        Options for the time: its column, unit, sampling rate and range.
    name : str
        Name of the record.

    Raises
    ------
    SceneError
        If the file lacks a column, or its numbers or units do not fit.
    """
    return parse_signals(load_table(source, options.names), sources, options, name)


def parse_signals(table: Table, sources: Mapping[str, SignalSource], options: ColumnOptions, name: str) -> SignalTable:
    """Return the signals in a table; see `read_signals`."""
    notes, candidates = list(table.notes), list_columns(table)
    selected = {signal: find_signal(source.heading, table, candidates) for signal, source in sources.items()}
    first = min((column for column, _ in selected.values()), key=lambda column: column.index)
    time_column = find_time_column(table, candidates, replace(options, position=first.heading))
    interval = 1 / options.rate if options.rate else None if time_column else table.interval
    if interval is None and time_column is None:
        raise SceneError(no_time_message(table))
    if interval is not None or time_column is None:
        t = np.arange(len(table.columns[first.index])) * (interval or 0.0)
    else:
        t = read_times(table, time_column, options).copy()
        notes += mark_sentinels(t, time_column.heading)
        if options.time is None and any(table.column_headings) and not is_time_column(time_column):
            notes.append(f"{time_column.heading} is used as time; --time selects another column.")
        if options.time is None:
            notes += describe_further_runs(candidates, time_column, first)
    columns = {}
    for signal, (column, unit) in selected.items():
        x, remarks = mark_missing(parse_numbers(table, column.index), column.heading)
        notes += remarks
        factor, note = unit_factor(column, unit, sources[signal].unit, signal, table.name)
        notes += note
        columns[signal] = factor * x
    return select_complete_rows(name, t, columns, options, notes)


def mark_missing(values: np.ndarray, name: str) -> tuple[np.ndarray, list[str]]:
    """Return values (n,) with NaN for marks of missing samples, and remarks on these and on a saturated sensor.

    A value that most samples have is that at rest, not a mark: the speed of a body that sticks is often exactly 0.
    """
    x = values.copy()
    notes = mark_sentinels(x, name)
    marked = x.copy()
    dropouts = mark_dropouts(marked, name)
    if np.mean(np.isnan(marked) & ~np.isnan(x)) <= MAX_MISSING_SHARE:
        x, notes = marked, notes + dropouts
    finite = x[np.isfinite(x)]
    for sign in (1.0, -1.0):
        is_saturated, peaks = find_saturated(sign * finite) if len(finite) else (finite, 0)
        if peaks:
            notes.append(
                f"{name} is exactly {finite[is_saturated][0]:.6g} in {int(is_saturated.sum())} of {len(x)} samples, in "
                f"{peaks} peaks: if the sensor was saturated there, leave these cells empty."
            )
    return x, notes


def find_signal(heading: str, table: Table, candidates: list[Column]) -> tuple[Column, str | None]:
    """Return the column with a heading, and its unit. As "laser [mm]", the heading overrides the unit of the file."""
    try:
        column = find_column(heading, table, candidates)
    except SceneError:
        name, unit = split_heading(heading)
        if unit is None or name == heading:
            raise
        return find_column(name, table, candidates), unit
    return column, column.unit


def unit_factor(column: Column, unit: str | None, target: str, signal: str, file: str) -> tuple[float, list[str]]:
    """Return the factor from the unit of a column to that of the FMU, and a note if the unit is assumed."""
    if not unit:
        note = f"{column.heading} has no unit in {file}: {target} is assumed, the unit of {signal} in the FMU."
        return 1.0, [note] if target else []
    factor = conversion_factor(unit, target or "1")
    if factor is None:
        raise SceneError(
            f"{column.name} is in {unit}, and {signal} of the FMU in {target or '1'}: give a column of the same "
            f"quantity, or the right unit, as in --observe '{signal}={column.name} [{target or '1'}]'"
        )
    return factor, []


def select_complete_rows(
    name: str, t: np.ndarray, columns: dict[str, np.ndarray], options: ColumnOptions, notes: list[str]
) -> SignalTable:
    """Return the rows that have a time in the range of the options and all signals."""
    complete = np.isfinite(t) & np.all([np.isfinite(x) for x in columns.values()], axis=0)
    filled_rows = np.flatnonzero(np.isfinite(t) & np.any([np.isfinite(x) for x in columns.values()], axis=0))
    length = int(filled_rows[-1]) + 1 if len(filled_rows) else 0  # the table may continue with a longer run
    empty_tail = int(np.isfinite(t[length:]).sum())
    t, rounding = undo_time_rounding(t[:length])
    if empty_tail:
        notes.append(f"The last {empty_tail} rows have a time and no signal; they are left out.")
    complete = complete[:length] & (t >= options.begin) & (t <= options.end)
    in_range = int(((t >= options.begin) & (t <= options.end)).sum())
    missing = in_range - int(complete.sum())
    if missing > MAX_MISSING_SHARE * max(in_range, 1):
        raise SceneError(f"{name}: {missing} of {in_range} rows lack a time or a signal: give other columns")
    if missing:
        notes.append(f"{missing} of {in_range} rows have a missing cell and are skipped.")
    if rounding:
        notes.append(rounding)
    t = t[complete]
    columns = {signal: x[:length][complete] for signal, x in columns.items()}
    if len(t) < MIN_SAMPLES:
        raise SceneError(f"{name} has {len(t)} samples in this interval; at least {MIN_SAMPLES} are required")
    for x in columns.values():
        check_record(Record(name, t, x))
    return SignalTable(name, t, columns, tuple(notes))
