"""A measured record: the columns of a table, and how they are read."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Self

import numpy as np

from ..arguments import FINITE, check_arguments, check_interval
from ..errors import SceneError, option_text
from .columns import Column, ColumnOptions, find_column_and_unit, list_columns, no_time_message
from .extraction import Samples, Source, extract, find_time_axis, has_times, mark_missing_output
from .friction_curve import CurveColumns, extract_curve
from .motion import Motion
from .motion_columns import extract_motion
from .table_files import Table, load_table
from .units import conversion_factor, split_count


@dataclass(frozen=True)
class SignalSource:
    """Source of a signal: the heading of its column, and the unit to convert to (empty for a ratio or a count).

    An input (`is_input`) keeps every sample: commanded zeros and plateaus are no marks of missing samples.
    """

    heading: str
    unit: str
    is_input: bool = False


@dataclass(frozen=True, eq=False, repr=False)
class Record:
    """A measured record, as `read_record` returns it: `identify_decay`, `identify_curve`, `fit` and `compare` take it.

    Attributes
    ----------
    name : str
        Name of the record.
    table : Table
        All columns, as they are in the file.
    options : ColumnOptions
        How the columns are read.
    parameters : mapping
        Values of the parameters of the run that the record stems from, by name; empty for a measurement.
    """

    name: str
    table: Table
    options: ColumnOptions = field(default_factory=ColumnOptions)
    parameters: Mapping[str, object] = field(default_factory=dict)

    @cached_property
    def motion(self) -> Motion:
        """Return the motion in SI units; SceneError if there is none."""
        return extract_motion(self.name, self.table, self.options)

    @property
    def t(self) -> np.ndarray:
        """Return the times (n,) of the motion in s, increasing."""
        return self.motion.t

    @property
    def x(self) -> np.ndarray:
        """Return the samples (n,) of the motion in `unit`."""
        return self.motion.x

    @property
    def unit(self) -> str:
        """Return the unit of the motion: an SI unit, or that of a sensor."""
        return self.motion.unit

    @property
    def quantity(self) -> str:
        """Return the measured quantity: position, velocity or acceleration."""
        return self.motion.quantity

    @property
    def order(self) -> int:
        """Return the order of the derivative of the position that was measured: 0, 1 or 2."""
        return self.motion.order

    @property
    def base(self) -> str:
        """Return the unit of the position: m, rad, or that of a sensor."""
        return self.motion.base

    @property
    def notes(self) -> tuple[str, ...]:
        """Return what was assumed and left out when the motion was read."""
        return self.motion.notes

    def __repr__(self) -> str:
        return f"<Record of {self.name}: {', '.join(filter(None, self.table.column_headings)) or 'no headings'}>"

    @check_arguments(begin=FINITE, end=FINITE)
    def select(self, begin: float, end: float) -> Self:
        """Return the part of the record from `begin` to `end` in s; SceneError if `begin` is not before `end`."""
        check_interval(begin, end)
        first, last = self.options.interval
        return replace(self, options=replace(self.options, begin=max(begin, first), end=min(end, last)))

    def check(self) -> None:
        """Raise SceneError if the record holds neither a motion nor a friction curve."""
        try:
            self.motion  # noqa: B018 - reads it
        except SceneError as error:
            try:
                self.curve(CurveColumns())
            except SceneError:
                raise error from None

    def curve(self, columns: CurveColumns) -> Samples:
        """Return the friction over velocity; SceneError if there is none."""
        return extract_curve(self.name, self.table, self.options, columns)

    def signals(self, sources: Mapping[str, SignalSource]) -> Samples:
        """Return signals in given units.

        Parameters
        ----------
        sources : mapping
            The column and unit of each signal, by the name of the signal.

        Raises
        ------
        SceneError
            If the table lacks a column, or its numbers or units do not fit.
        """
        table, candidates, notes = self.table, list_columns(self.table), []
        columns: dict[str, Source] = {}
        for signal, source in sources.items():
            column, unit = find_column_and_unit(source.heading, table, candidates)
            factor, note = self.unit_factor(column, unit, source, signal)
            columns[signal] = Source(column, factor, mark_missing_output, source.is_input)
            notes += note
        first = min((source.column for source in columns.values()), key=lambda column: column.index)
        axis = find_time_axis(table, candidates, self.options, first.heading)
        if not has_times(axis):
            raise SceneError(no_time_message(table))
        units = {signal: source.unit for signal, source in sources.items()}
        samples = extract(self.name, table, axis, candidates, columns, units, self.options)
        return replace(samples, notes=(*table.notes, *notes, *samples.notes))

    def unit_factor(
        self, column: Column, unit: str | None, source: SignalSource, signal: str
    ) -> tuple[float, list[str]]:
        """Return the factor from the unit of a column to that of the FMU, and a note if the unit is assumed."""
        options, size = self.options, 1.0
        if not source.is_input and options.column in (None, column.heading, column.name):  # the motion of the record
            unit = options.unit or unit
        if unit:
            size, unit = split_count(unit)
        target = source.unit
        if not unit:
            file = self.table.name
            note = f"{column.heading} has no unit in {file}: {target} is assumed, the unit of {signal} in the FMU."
            return 1.0, [note] if target else []
        factor = conversion_factor(unit, target or "1")
        if factor is None:
            heading = f"{column.name} [{target or '1'}]"
            example = option_text("inputs" if source.is_input else "observe", {signal: heading})
            raise SceneError(
                f"{column.name} is in {unit}, and {signal} of the FMU in {target or '1'}: give a column of the same "
                f"quantity, or the right unit, as in {example}"
            )
        return size * factor, []


def load_record(source: str, options: ColumnOptions) -> Record:
    """Load a record from a file; SceneError if it contains no table.

    Parameters
    ----------
    source : str
        Path of the file; "-" for standard input.
    options : ColumnOptions
        How the columns are read.
    """
    name = "stdin" if source == "-" else Path(source).stem.encode("utf-8", "replace").decode()
    return Record(name, load_table(source, options.headings), options)
