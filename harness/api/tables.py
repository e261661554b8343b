"""Records from Python: files, tables of pandas and xarray, mappings, arrays and trajectories become a `Record`."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..arguments import PATH, Rule, row, to_array
from ..errors import SceneError, format_value

if TYPE_CHECKING:
    import numpy as np

    from ..records.columns import ColumnOptions
    from ..records.record import Record
    from ..records.table_files import Table
    from ..simulation.signals import Signals

KINDS = "a record, a file, a table of pandas or xarray, columns, a trajectory, or times and values as in (t, x)"
SIGNAL = "signal"  # heading of values without a name
UNNAMED = "the record"  # name of a record that is not a file


def is_frame(value: Any) -> bool:
    """Return whether a value is a DataFrame."""
    return hasattr(value, "columns") and hasattr(value, "index") and not is_signals(value)


def is_record(value: Any) -> bool:
    """Return whether a value is a record of `read_record`."""
    from ..records.record import Record

    return isinstance(value, Record)


def is_series(value: Any) -> bool:
    """Return whether a value is a Series."""
    return hasattr(value, "to_frame") and hasattr(value, "index")


def is_signals(value: Any) -> bool:
    """Return whether a value is a Trajectory, or signals of a comparison."""
    from ..simulation.signals import Signals

    return isinstance(value, Signals)


def is_xarray(value: Any) -> bool:
    """Return whether a value is a Dataset or a DataArray of xarray."""
    return hasattr(value, "coords") and hasattr(value, "to_dataframe")


def is_pair(value: Any) -> bool:
    """Return whether a value is a tuple of times and values, not of two records."""
    return isinstance(value, tuple) and len(value) == 2 and not any(map(has_columns, value))


def has_columns(value: Any) -> bool:
    """Return whether a value is a record by itself: a file, or a table whose columns have names."""
    return isinstance(value, str | Path | Mapping) or any(
        is_kind(value) for is_kind in (is_record, is_frame, is_series, is_signals, is_xarray)
    )


def record_source(value: Any) -> Any:
    """Return a record: a file by its path, columns as they are, and times and values as rows of numbers."""
    if isinstance(value, str | Path):
        return PATH.convert(value)
    if has_columns(value):
        return value
    if is_pair(value):
        return tuple(NUMBERS.check(name, item) for name, item in zip(("t", "x"), value, strict=True))
    return row(value)


def record_sources(value: Any) -> list[Any]:
    """Return records, one or several."""
    if is_pair(value) or has_columns(value) or not isinstance(value, list | tuple):
        value = [value]
    return [record_source(item) for item in value]


def side(value: Any) -> Any:
    """Return a side of a comparison: a record, or the name or path of what is run or read."""
    return record_source(value)


NUMBERS = Rule("a row of numbers, at least one", row)
RECORD = Rule(f"{KINDS}, or a row of values with their rate", record_source)
RECORDS = Rule(f"{KINDS}, or a list of these", record_sources)
SIDE = Rule("a name, a record, a file, a table of pandas or xarray, a mapping of columns, or a trajectory", side)


def to_record(source: Any, options: "ColumnOptions", heading: str = SIGNAL, needs_times: bool = True) -> "Record":
    """Return the record in a file, a table, a mapping, arrays or a trajectory.

    Parameters
    ----------
    options : ColumnOptions
        How its columns are read; those that are given replace those of a record.
    heading, needs_times
        As in `convert_to_table`.
    """
    from ..records.record import Record, load_record

    if is_record(source):
        replacements = {name: value for name, value in vars(options).items() if value is not None}
        record: Record = replace(source, options=replace(source.options, **replacements))
        return record
    if isinstance(source, str | Path):
        return load_record(str(source), options)
    table = convert_to_table(source, heading, options.rate, needs_times)
    if not has_columns(source) and not isinstance(source, tuple):  # its times follow from the rate
        options = replace(options, rate=None)
    if is_signals(source):
        return Record(source.name, table, options, getattr(source, "parameters", {}))
    return Record(table.name, table, options)


def convert_to_table(
    source: Any, heading: str = SIGNAL, rate: float | None = None, needs_times: bool = True
) -> "Table":
    """Return the table in a record that is not a file, with units in its headings.

    Parameters
    ----------
    source : DataFrame, Series, Dataset, DataArray, mapping, Trajectory, tuple or numpy.ndarray
        Variables of xarray have their unit in ``attrs["units"]``, and a DataFrame or a Series has those of its columns
        there. A named index is a column; an index of time deltas is the time in s, and so is the index of a Series.
        With `needs_times`, an unnamed index of floats that increase is the time in s if no column has times.
    heading : str
        Heading of values without a name.
    rate : float, optional
        Sampling rate in Hz of a row of values.
    needs_times : bool
        Whether the table is a record over time.

    Raises
    ------
    SceneError
        If a column is not a row of numbers or texts.
    """
    import numpy as np

    from ..records.columns import find_time_columns, list_columns

    if is_signals(source):
        return build_table({"t": source.time, **source.columns}, {"t": "s", **source.units})
    if is_series(source):
        name = heading if source.name is None else str(source.name)
        units = {"t": "s", name: unit_of(source, name)}
        return build_table({"t": to_array(source.index), name: to_array(source)}, units)
    if is_frame(source):
        columns = {str(name): to_column(str(name), source[name]) for name in source.columns}
        units = {name: unit_of(source, name) for name in columns}
        if is_time_delta(source.index):
            columns, units = {"t": to_array(source.index), **columns}, {"t": "s", **units}
        elif source.index.name is not None:
            index = str(source.index.name)
            columns, units = {index: to_array(source.index), **columns}, {index: unit_of(source, index), **units}
        table = build_table(columns, units)
        if needs_times and has_increasing_floats(source.index) and not find_time_columns(list_columns(table)):
            columns, units = {"t": to_array(source.index), **columns}, {"t": "s", **units}
            return replace(
                build_table(columns, units), notes=("The index of the table is taken as the column t in s.",)
            )
        return table
    if is_xarray(source):
        variables = list_variables(source, heading)
        units = {name: str(variable.attrs.get("units", "")) for name, variable in variables.items()}
        columns = {name: to_column(name, variable.to_numpy()) for name, variable in variables.items()}
        return build_table(columns, {name: "" if unit == "1" else unit for name, unit in units.items()})
    if isinstance(source, Mapping):
        return build_table({str(name): to_column(str(name), column) for name, column in source.items()}, {})
    if isinstance(source, tuple):
        return build_table(dict(zip(("t", heading), source, strict=True)), {"t": "s"})
    if rate is None:
        raise SceneError("the record is a row of values without times: give their rate in Hz, or (t, x)")
    return build_table({"t": np.arange(len(source)) / rate, heading: source}, {"t": "s"})


def list_variables(source: Any, heading: str = SIGNAL) -> dict[str, Any]:
    """Return the coordinates and variables of a Dataset or a DataArray of xarray by name.

    Raises
    ------
    SceneError
        If it has another number of dimensions than one.
    """
    dataset = source if hasattr(source, "data_vars") else source.to_dataset(name=source.name or heading)
    if len(dataset.dims) != 1:
        dimensions = ", ".join(map(str, dataset.dims)) or "none"
        raise SceneError(f"the table has the dimensions {dimensions}: select one, the time")
    return {str(name): dataset[name] for name in (*dataset.coords, *dataset.data_vars)}


def unit_of(source: Any, name: str) -> str:
    """Return the unit of a column of pandas; empty without one."""
    units = source.attrs.get("units", {})
    return str(units.get(name, "")) if isinstance(units, Mapping) else str(units)


def is_time_delta(values: Any) -> bool:
    """Return whether an array, an index or a column of pandas holds time deltas."""
    return getattr(getattr(values, "dtype", None), "kind", "") == "m"


def has_increasing_floats(index: Any) -> bool:
    """Return whether an index of pandas has no name, and floats that increase, none of them NaN."""
    import numpy as np

    is_float = index.name is None and getattr(index.dtype, "kind", "") == "f"
    return is_float and len(index) > 1 and bool((np.diff(to_array(index)) > 0).all())


def to_column(name: str, values: Any) -> "np.ndarray":
    """Return a column (n,), time deltas in the unit of its heading or in s; SceneError if they are no numbers."""
    from ..records.units import TIMES, split_heading

    try:
        column = to_array(values)
    except (OverflowError, TypeError, ValueError):
        raise SceneError(f"{name} = {format_value(values)} must be a row of numbers") from None
    return column / TIMES.get(split_heading(name)[1] or "s", 1.0) if is_time_delta(values) else column


def build_table(columns: "dict[str, np.ndarray]", units: dict[str, str]) -> "Table":
    """Return a table of columns (n,) by name; texts are parsed like those in a file."""
    from ..records.table_files import Table
    from ..results.files import column_heading

    if not columns:
        raise SceneError("the record has no columns")
    shape = next(iter(columns.values())).shape
    for name, column in columns.items():
        if column.ndim != 1 or column.shape != shape:
            raise SceneError(f"{name} has the shape {column.shape}: times and samples must be rows of the same length")
    if not shape[0]:
        raise SceneError("the record has no rows")
    cells = [
        column.astype(float) if column.dtype.kind in "fiub" else [str(cell) for cell in column]
        for column in columns.values()
    ]
    return Table(UNNAMED, tuple(column_heading(name, units.get(name, "")) for name in columns), tuple(cells))


def convert_to_signals(source: Any) -> "Signals":
    """Return the signals in a record that is not a file.

    Raises
    ------
    SceneError
        If a column is not a row of numbers, or the times do not rise.
    """
    import numpy as np

    from ..records.columns import ColumnOptions, find_column_and_unit, list_columns, parse_numbers
    from ..records.units import TIME_NAME, TIMES
    from ..simulation.signals import Signals

    if is_signals(source):
        signals: Signals = source
        return signals
    record = to_record(source, ColumnOptions())
    table, options = record.table, record.options
    candidates = list_columns(table)
    time_column = next((column for column in candidates if TIME_NAME.search(column.name)), candidates[0])
    if options.time is not None:
        time_column, time_unit = find_column_and_unit(options.time, table, candidates)
        time_column = replace(time_column, unit=time_unit)
    unit = time_column.unit or "s"
    if unit not in TIMES:
        raise SceneError(f"the times of the record are in {unit}: give them in {', '.join(TIMES)}")
    numbers = [parse_numbers(table, column.index, strict=False) for column in candidates]
    for column in candidates:
        if (row := table.parsed_columns[column.index][1]) is not None:
            text = format_value(table.columns[column.index][row])
            raise SceneError(
                f"the column {column.heading} of the record holds texts, as {text}: give numbers, or leave it out"
            )
    time = numbers[time_column.index] * TIMES[unit]
    if options.rate is not None:
        time = np.arange(len(time)) / options.rate
    if len(time) < 2 or not (np.isfinite(time).all() and (np.diff(time) >= 0).all()):
        raise SceneError("the times of the record must be at least two finite numbers that do not fall")
    begin, end = options.interval
    part = (time >= begin) & (time <= end)
    others = [column for column in candidates if column.index != time_column.index]
    columns = {column.name: numbers[column.index][part] for column in others}
    units = {column.name: column.unit or "" for column in candidates}
    return Signals(time[part], columns, units, label=record.name)
