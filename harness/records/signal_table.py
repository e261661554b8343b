"""Several signals over time from one file, converted to given units."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from ..errors import SceneError, option_text
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
from .record import MIN_SAMPLES, Record, check_record, selection_text
from .samples import find_repeated_times, find_saturated, mark_dropouts, mark_sentinels, undo_time_rounding
from .table_files import Table, load_table
from .units import conversion_factor

MAX_MISSING_SHARE = 0.2  # of the rows


@dataclass(frozen=True)
class SignalSource:
    """Source of a signal: the heading of its column, and the unit to convert to (empty for a ratio or a count).

    An input (`is_input`) keeps every sample: commanded zeros and plateaus are no marks of missing samples.
    """

    heading: str
    unit: str
    is_input: bool = False


@dataclass(frozen=True)
class SignalTable:
    """Signals of a record.

    Attributes
    ----------
    name : str
        Name of the record.
    t : numpy.ndarray
        Times (n,) in s at which all measured signals have a value.
    columns : mapping
        Measured signals (n,) by name.
    notes : tuple of str
        Assumptions made when reading.
    input_t : numpy.ndarray
        All times (m,) in s from the first of `t` to the last; empty without inputs.
    inputs : mapping
        Inputs (m,) by name.
    """

    name: str
    t: np.ndarray
    columns: Mapping[str, np.ndarray]
    notes: tuple[str, ...] = ()
    input_t: np.ndarray = field(default_factory=lambda: np.zeros(0))
    inputs: Mapping[str, np.ndarray] = field(default_factory=dict)


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
            notes.append(f"{time_column.heading} is used as time; {option_text('time')} selects another column.")
        if options.time is None:
            notes += describe_further_runs(candidates, time_column, first)
    columns = {}
    for signal, (column, unit) in selected.items():
        x = parse_numbers(table, column.index)
        if not sources[signal].is_input:
            x, remarks = mark_missing(x, column.heading)
            notes += remarks
        factor, note = unit_factor(column, unit, sources[signal], signal, table.name)
        notes += note
        columns[signal] = factor * x
    return select_rows(table, name, t, columns, sources, options, notes)


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


def unit_factor(
    column: Column, unit: str | None, source: SignalSource, signal: str, file: str
) -> tuple[float, list[str]]:
    """Return the factor from the unit of a column to that of the FMU, and a note if the unit is assumed."""
    target = source.unit
    if not unit:
        note = f"{column.heading} has no unit in {file}: {target} is assumed, the unit of {signal} in the FMU."
        return 1.0, [note] if target else []
    factor = conversion_factor(unit, target or "1")
    if factor is None:
        example = option_text("inputs" if source.is_input else "observe", {signal: f"{column.name} [{target or '1'}]"})
        raise SceneError(
            f"{column.name} is in {unit}, and {signal} of the FMU in {target or '1'}: give a column of the same "
            f"quantity, or the right unit, as in {example}"
        )
    return factor, []


def select_rows(
    table: Table,
    name: str,
    t: np.ndarray,
    columns: dict[str, np.ndarray],
    sources: Mapping[str, SignalSource],
    options: ColumnOptions,
    notes: list[str],
) -> SignalTable:
    """Return the rows in the range of the options that have a time and all measured signals, and those of the inputs.

    Raises
    ------
    SceneError
        If too many rows lack a measured signal, or if an input lacks a sample.
    """
    has_time, outputs = np.isfinite(t), [x for signal, x in columns.items() if not sources[signal].is_input]
    filled_rows = np.flatnonzero(has_time & np.any([np.isfinite(x) for x in columns.values()], axis=0))
    length = int(filled_rows[-1]) + 1 if len(filled_rows) else 0  # the table may continue with a longer run
    empty_tail = int(has_time[length:].sum())
    t, rounding = undo_time_rounding(t[:length])
    if empty_tail:
        notes.append(f"The last {empty_tail} rows have a time and no signal; they are left out.")
    begin, end = options.interval
    in_range = (t >= begin) & (t <= end)
    complete = in_range & np.all([np.isfinite(x[:length]) for x in outputs], axis=0)
    missing = int(in_range.sum() - complete.sum())
    if missing > MAX_MISSING_SHARE * max(int(in_range.sum()), 1):
        raise SceneError(f"{name}: {missing} of {in_range.sum()} rows lack a time or a signal: give other columns")
    if missing:
        notes.append(f"{missing} of {in_range.sum()} rows have a missing cell and are skipped.")
    if rounding:
        notes.append(rounding)
    rows = np.flatnonzero(complete)
    is_repeated, repetition = find_repeated_times(t[rows])
    notes += filter(None, [repetition])
    rows = rows[~is_repeated]
    if len(rows) < MIN_SAMPLES:
        raise SceneError(f"{name} has {len(rows)} samples in this interval; at least {MIN_SAMPLES} are required")
    signals = {signal: x[rows] for signal, x in columns.items() if not sources[signal].is_input}
    for x in signals.values():
        check_record(Record(name, t[rows], x))
    run = slice(rows[0], rows[-1] + 1)  # from the first measured sample to the last
    input_t, inputs = t[run], {signal: x[run] for signal, x in columns.items() if sources[signal].is_input}
    for signal, x in inputs.items():
        check_input(table, signal, sources[signal].heading, input_t, x, run.start)
    is_first = np.append(True, np.diff(input_t) != 0)  # of the samples at one time, which are equal
    input_t, inputs = input_t[is_first], {signal: x[is_first] for signal, x in inputs.items()}
    for x in inputs.values():
        check_record(Record(name, input_t, x))
    return SignalTable(name, t[rows], signals, tuple(notes), input_t if inputs else t[:0], inputs)


def check_input(table: Table, signal: str, heading: str, t: np.ndarray, x: np.ndarray, first: int) -> None:
    """Raise SceneError if an input x (n,) lacks a sample at one of the times t (n,), or has two values at one.

    `first` is the row of the table in which they begin. Between its samples an input is interpolated, so a gap would
    drive the run with values that nobody measured.
    """
    gaps = np.flatnonzero(~(np.isfinite(t) & np.isfinite(x)))
    if len(gaps):
        row, lacking = table.line + 1 + first + int(gaps[0]), "value" if np.isfinite(t[gaps[0]]) else "time"
        raise SceneError(
            f"{table.name}: {heading}, the input {signal}, has no {lacking} in row {row}: fill the gap, or select a "
            f"part without gaps by {selection_text()}"
        )
    doubled = np.flatnonzero((np.diff(t) == 0) & (np.diff(x) != 0))
    if len(doubled):
        raise SceneError(
            f"{table.name}: {heading}, the input {signal}, has two values at t = {t[doubled[0]]:.6g} s: keep one row "
            "for each time"
        )
