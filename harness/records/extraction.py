"""Samples of several columns of a table at the same times: one pipeline for decays, friction curves and fits.

Times that a logger has rounded are made equidistant, rows are sorted by time, marks of missing samples and rows without
a sample are left out, and the rows of a time interval are selected.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ..errors import SceneError, option_text
from .columns import (
    Column,
    ColumnOptions,
    describe_further_runs,
    find_time_column,
    is_time_column,
    parse_numbers,
    read_times,
)
from .motion import check_samples, selection_text
from .samples import (
    find_repeated_times,
    find_saturation,
    mark_dropouts,
    mark_sentinels,
    sort_times,
    undo_time_rounding,
)
from .table_files import Table

MAX_MISSING_SHARE = 0.2  # of the rows


def mark_missing(values: np.ndarray, name: str) -> list[str]:
    """Replace marks of missing samples of a motion (n,) by NaN, in place, and return sentences about them."""
    return mark_sentinels(values, name) + mark_dropouts(values, name)


def mark_missing_output(values: np.ndarray, name: str) -> list[str]:
    """Replace marks of missing samples of a signal (n,) by NaN, in place; return sentences on them and on saturation.

    A value that most samples have is that at rest, not a mark: the speed of a body that sticks is often exactly 0.
    """
    notes = mark_sentinels(values, name)
    marked_values = values.copy()
    dropouts = mark_dropouts(marked_values, name)
    if np.mean(np.isnan(marked_values) & ~np.isnan(values)) <= MAX_MISSING_SHARE:
        values[:], notes = marked_values, notes + dropouts
    finite = values[np.isfinite(values)]
    for sign in (1.0, -1.0):
        is_saturated, peaks = find_saturation(sign * finite) if len(finite) else (finite, 0)
        if peaks:
            notes.append(
                f"{name} is exactly {finite[is_saturated][0]:.6g} in {int(is_saturated.sum())} of {len(values)} "
                f"samples, in {peaks} peaks: if the sensor was saturated there, leave these cells empty."
            )
    return notes


@dataclass(frozen=True)
class Source:
    """Source of a signal.

    Attributes
    ----------
    column : Column
        Column of the table.
    factor : float
        Factor from the unit of the column to that of the signal.
    mark : callable
        Replaces marks of missing samples by NaN, in place, and returns sentences about them.
    is_input : bool
        Whether the signal is an input, which keeps every sample: commanded zeros and plateaus are no marks.
    """

    column: Column
    factor: float = 1.0
    mark: Callable[[np.ndarray, str], list[str]] = mark_missing
    is_input: bool = False

    @property
    def label(self) -> str:
        """Return the name of the signal in messages."""
        return self.column.name or self.column.heading


@dataclass(frozen=True)
class TimeAxis:
    """Where the times of a table come from: a column, or a sampling interval in s; neither for points without times."""

    column: Column | None
    interval: float | None


@dataclass(frozen=True)
class Samples:
    """Signals at the same times.

    Attributes
    ----------
    name : str
        Name of the record.
    t : numpy.ndarray
        Times (n,) in s at which all measured signals have a value; empty for points without times.
    columns : mapping
        Measured signals (n,) by name.
    units : mapping
        Units of the signals by name.
    notes : tuple of str
        Assumptions made when reading.
    rows : numpy.ndarray
        Numbers (n,) of the rows in the file.
    input_t : numpy.ndarray
        All times (m,) in s from the first of `t` to the last; empty without inputs.
    inputs : mapping
        Inputs (m,) by name.
    sigma : mapping
        Standard deviations of the noise by signal, where they are known.
    """

    name: str
    t: np.ndarray
    columns: Mapping[str, np.ndarray]
    units: Mapping[str, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    rows: np.ndarray = field(default_factory=lambda: np.zeros(0, int))
    input_t: np.ndarray = field(default_factory=lambda: np.zeros(0))
    inputs: Mapping[str, np.ndarray] = field(default_factory=dict)
    sigma: Mapping[str, float] = field(default_factory=dict)

    @property
    def y(self) -> np.ndarray:
        """Return the measured signals (n, signals)."""
        return np.stack([*self.columns.values()], axis=1)


def find_time_axis(
    table: Table, candidates: Sequence[Column], options: ColumnOptions, signal: str | None = None
) -> TimeAxis:
    """Return the times of a table: its column, or its sampling interval.

    Parameters
    ----------
    signal : str, optional
        Heading of the signal, which selects one of several columns of times.
    """
    column = find_time_column(table, candidates, replace(options, column=signal))
    if options.rate:
        return TimeAxis(column, 1 / options.rate)
    return TimeAxis(column, None if column else table.interval)


def extract(
    name: str,
    table: Table,
    axis: TimeAxis,
    candidates: Sequence[Column],
    sources: Mapping[str, Source],
    units: Mapping[str, str],
    options: ColumnOptions,
) -> Samples:
    """Return the samples of columns of a table.

    Parameters
    ----------
    name : str
        Name of the record.
    axis : TimeAxis
        Times of the table; without any, the rows are points.
    candidates : sequence of Column
        All columns of the table.
    sources, units : mapping
        Column and unit of each signal, by its name.
    options : ColumnOptions
        Options for the times.

    Raises
    ------
    SceneError
        If too many rows lack a time or a signal, an input lacks a sample, or too few samples remain.
    """
    t, label, notes = read_axis(table, axis, candidates, sources, options)
    values = {signal: parse_numbers(table, source.column.index).copy() for signal, source in sources.items()}
    measured_signals = [signal for signal, source in sources.items() if not source.is_input]
    has_time, has_cells = (
        np.isfinite(t),
        np.isfinite(t) & np.all([np.isfinite(values[x]) for x in measured_signals], axis=0),
    )
    if axis.column:
        t = t.copy()
        notes += mark_sentinels(t, label)
    is_filled = np.flatnonzero(np.isfinite(t) & np.any([np.isfinite(x) for x in values.values()], axis=0))
    length = int(is_filled[-1]) + 1 if len(is_filled) else 0  # the table may continue with another run
    if axis.column and (tail := int(has_time[length:].sum())):
        rows_text = f"The last {tail} rows have" if tail > 1 else "The last row has"
        notes.append(f"{rows_text} a time and no signal, and {'are' if tail > 1 else 'is'} left out.")
    values = {signal: x[:length] for signal, x in values.items()}
    for signal in measured_signals:
        notes += sources[signal].mark(values[signal], sources[signal].label)
    t, rounding = undo_time_rounding(t[:length])
    order, sorting = sort_rows(t)
    t, has_cells, values = t[order], has_cells[order], {signal: x[order] for signal, x in values.items()}
    begin, end = options.interval
    is_used = (t >= begin) & (t <= end) | ~np.isfinite(t)
    is_complete = (
        is_used & np.isfinite(t) & np.all([np.isfinite(values[signal]) for signal in measured_signals], axis=0)
    )
    n_used, n_complete, n_filled = (int(mask.sum()) for mask in (is_used, is_complete, is_used & has_cells))
    if n_used - n_complete > MAX_MISSING_SHARE * n_used or not length:
        labels = [label] * bool(axis.column) + [sources[signal].label for signal in measured_signals]
        marks = notes[-1:] if n_complete < n_filled else []
        raise SceneError(
            f"{table.name}: {n_used - n_complete} of {n_used} rows have no number for {' or '.join(labels)}"
            + "".join(f": {note.rstrip('.')}" for note in marks)
        )
    if n_filled < n_used:
        notes.append(f"{n_used - n_filled} of {n_used} rows have a missing cell and are skipped.")
    rows = np.flatnonzero(is_complete)
    is_repeated, repetition = find_repeated_times(t[rows]) if has_times(axis) else (np.zeros(len(rows), bool), "")
    rows = rows[~is_repeated]
    notes += filter(None, [rounding, sorting, repetition])
    columns = {signal: sources[signal].factor * values[signal][rows] for signal in measured_signals}
    samples = Samples(name, t[rows], columns, units, tuple(notes), table.line + 1 + order[rows])
    if not has_times(axis):
        return replace(samples, t=t[:0])
    for x in columns.values():
        check_samples(name, samples.t, x)
    if len(measured_signals) == len(sources):
        return samples
    part = slice(rows[0], rows[-1] + 1)  # from the first measured sample to the last
    inputs = {signal: source.factor * values[signal][part] for signal, source in sources.items() if source.is_input}
    for signal, x in inputs.items():
        check_input(table, signal, sources[signal].label, t[part], x, table.line + 1 + order[part])
    is_first = np.append(True, np.diff(t[part]) != 0)  # of the samples at one time, which are equal
    inputs = {signal: x[is_first] for signal, x in inputs.items()}
    for x in inputs.values():
        check_samples(name, t[part][is_first], x)
    return replace(samples, input_t=t[part][is_first], inputs=inputs)


def has_times(axis: TimeAxis) -> bool:
    """Return whether the rows of a table have times."""
    return axis.column is not None or axis.interval is not None


def read_axis(
    table: Table,
    axis: TimeAxis,
    candidates: Sequence[Column],
    sources: Mapping[str, Source],
    options: ColumnOptions,
) -> tuple[np.ndarray, str, list[str]]:
    """Return the times (n,) in s, or the numbers of points without times; the label of the times; and notes."""
    first = min((source.column for source in sources.values()), key=lambda column: column.index)
    if axis.interval is not None or axis.column is None:
        return np.arange(len(table.columns[first.index])) * (axis.interval or 1.0), "the time", []
    notes = []
    if options.time is None:
        if any(table.column_headings) and not is_time_column(axis.column):
            notes.append(f"{axis.column.heading} is used as time; {option_text('time')} selects another column.")
        notes += describe_further_runs(candidates, axis.column, first)
    return read_times(table, axis.column, options), axis.column.heading, notes


def sort_rows(t: np.ndarray) -> tuple[np.ndarray, str]:
    """Return the order of rows by their times t (n,), without those that have none if they must be sorted."""
    timed_rows = np.flatnonzero(np.isfinite(t))
    order, note = sort_times(t[timed_rows])
    return (timed_rows[order], note) if note else (np.arange(len(t)), "")


def check_input(table: Table, signal: str, heading: str, t: np.ndarray, x: np.ndarray, rows: np.ndarray) -> None:
    """Raise SceneError if an input x (n,) lacks a sample at one of the times t (n,), or has two values at one.

    `rows` are the numbers (n,) of the rows in the file. Between its samples an input is interpolated, so a gap would
    drive the run with values that nobody measured.
    """
    gaps = np.flatnonzero(~(np.isfinite(t) & np.isfinite(x)))
    if len(gaps):
        quantity = "value" if np.isfinite(t[gaps[0]]) else "time"
        raise SceneError(
            f"{table.name}: {heading}, the input {signal}, has no {quantity} in row {rows[gaps[0]]}: fill the gap, or "
            f"select a part without gaps by {selection_text()}"
        )
    conflicts = np.flatnonzero((np.diff(t) == 0) & (np.diff(x) != 0))
    if len(conflicts):
        raise SceneError(
            f"{table.name}: {heading}, the input {signal}, has two values at t = {t[conflicts[0]]:.6g} s: keep one row "
            "for each time"
        )
