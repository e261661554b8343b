"""Which columns of a table are the time and the motion, what was measured, and in which unit.

A heading tells name and unit, as in `x [mm]`, `theta (deg)`, `Linear Acceleration z (m/s^2)` or `x / mm`.  The unit
tells the quantity, otherwise the name does; both may be overruled.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..errors import SceneError, unknown_name_message
from .record import QUANTITIES, Record, check_record
from .table_files import Cells, Table, load_table
from .text_table import GROUPED_NUMBER, MISSING, TIMESTAMP
from .timestamps import parse_timestamps, undo_time_rounding
from .units import COUNT_NAMES, TIMES, find_unit, parse_per_count, time_unit_size

HEADING = re.compile(r"^\s*(.*?)\s*(?:[\[(]([^\[\]()]*(?:\([^()]*\))?)[\])])?\s*$")
SLASH_HEADING = re.compile(r"^\s*(.*?)\s+(?:/|in)\s+(\S+)\s*$")
BRACKET_HEADING = re.compile(r"^(.*?)\s*[\[(]([^\[\]()]+)[\])]\s*(.*)$")  # of which run follows, as in `x (mm) Run #1`
TIME_NAME = re.compile(
    r"^(t|times?|zeit|temps|tiempo|tid|timestamp|datetime|date|elapsed|seconds|epoch)(?![^\W_])|(time|zeit|stamp)$",
    re.I,
)
DATE_NAME = re.compile(r"^(date|datum)\b", re.I)
MAX_PLAUSIBLE_TIME = 1e11  # s: the year 5138
QUANTITY_NAMES = (
    re.compile(
        r"^(x|y|z|s|theta|phi|pos|position|displacement|disp|angle|weg|winkel|laser|encoder|height|distance)\b", re.I
    ),
    re.compile(r"^(v|vel|velocity|speed|omega|gyro|gyroscope|rate)\b|velocity|gyroscope|speed", re.I),
    re.compile(r"^(a|acc|accel|accelerometer|alpha|a[xyz])\b|acceleration|accelerometer|accel|^a_|^acc", re.I),
)
EXPONENT = re.compile("[dD](?=[-+0-9])")  # of Fortran
MAGNITUDE_NAME = re.compile(r"\b(abs|absolute|magnitude|norm)\b", re.I)  # of a vector: it has no sign
MAX_MISSING_SHARE = 0.2  # share of the samples
RATE_SUFFIXES = ("", "/s", "/s2")  # what the unit of a derivative adds to that of the position


@dataclass(frozen=True)
class ColumnOptions:
    """What the user says about the columns: their headings (`names` where the file has none), the quantity, and the
    units that stand above those in the file."""

    time: str | None = None
    position: str | None = None
    quantity: str | None = None
    unit: str | None = None
    time_unit: str | None = None
    per_count: str | None = None
    names: str | None = None
    begin: float = -np.inf
    end: float = np.inf


@dataclass(frozen=True)
class Column:
    """A column at its place in a table: its heading as it stands in the file, and the name and the unit in that."""

    index: int
    heading: str
    name: str
    unit: str | None

    @property
    def order(self) -> int | None:
        """The order of the derivative that the heading tells, by its unit or else by its name."""
        found = find_unit(self.unit) if self.unit else None
        return found.order if found else order_from_name(self.name)


def read_record(source: str, columns: ColumnOptions, name: str) -> Record:
    """The record in a file, from `columns.begin` to `columns.end` in s; SceneError in one sentence if it is not one."""
    return record_of(load_table(source, columns.names), columns, name)


def record_of(table: Table, columns: ColumnOptions, name: str) -> Record:
    """The same of a table that has been read."""
    if len(table.column_headings) < 2:
        raise SceneError(f"{table.name} has one column that is not empty; time and position are needed")
    if not any(table.column_headings):
        raise SceneError(f"{table.name} has no heading; name its columns, as in --columns 't [s],x [mm]'")
    parts = [Column(place, head, *split_heading(head)) for place, head in enumerate(table.column_headings)]
    clock = find_time_column(table, parts, columns)
    signal, notes = find_signal_column(table, parts, columns, clock)
    label, unit = signal.name or signal.heading, columns.unit or signal.unit
    x = parse_numbers(table, signal.index)
    order, base, size, guessed = resolve_unit(label, unit, columns, table.name)
    t = read_times(table, clock, columns)
    if columns.time is None and not (TIME_NAME.search(clock.name) or clock.unit):
        notes.append(f"{clock.heading} is taken for the time; --time takes another.")
    keep = np.isfinite(t) & np.isfinite(x)
    missing = int(len(t) - keep.sum())
    if missing > MAX_MISSING_SHARE * len(t):
        raise SceneError(f"{table.name}: {missing} of {len(t)} rows have no number for {clock.heading} or {label}")
    if missing:
        notes.append(f"{missing} of {len(t)} rows have a missing cell and are left out.")
    t, rounded = undo_time_rounding(t)
    notes += filter(None, (rounded, guessed))
    t, x = t[keep], size * x[keep]
    record = Record(name, t, x, base + RATE_SUFFIXES[order], order, base, tuple(notes)).select(
        columns.begin, columns.end
    )
    check_record(record)
    return record


def read_numeric(path: Path) -> tuple[tuple[str, ...], np.ndarray]:
    """Headings and numbers (rows, columns) of a file that has nothing but numbers; NaN where one is missing."""
    table = load_table(str(path))
    if not all(table.column_headings):
        raise SceneError(f"{table.name} has no heading; its first line must name the columns, as in t [s],x [mm]")
    return table.column_headings, np.column_stack([parse_numbers(table, i) for i in range(len(table.column_headings))])


def split_heading(head: str) -> tuple[str, str | None]:
    """Name and unit of a heading: x [mm], x / mm, x_mm, millis."""
    found = HEADING.match(head)
    name, unit = (found[1], found[2]) if found else (head, None)
    if unit is None:
        for found in (SLASH_HEADING.match(name), BRACKET_HEADING.match(name)):
            if found and (find_unit(found[2]) or time_unit_size(found[2])):
                return " ".join(filter(None, (found[1], *found.groups()[2:]))), found[2]
        words = re.split(r"[ _,:]+|(?<=[a-z])(?=[A-Z])", name)
        for i in range(1, len(words)):
            first, last = " ".join(words[:i]), "/".join(words[i:])
            if (
                time_unit_size(last)
                if TIME_NAME.search(first)
                else len(last) > 1 and last.lower() != "in" and find_unit(last)
            ):
                return first, last
        if len(name) > 1 and name.lower() not in ("in", "min") and (time_unit_size(name) or find_unit(name)):
            return name, name
    return name, unit or None


def find_column(asked: str, table: Table, parts: Sequence[Column]) -> Column:
    """The column of that heading: as it stands in the file, or by its name without the unit."""
    for heads in (
        list(table.column_headings),
        [head.strip() for head in table.column_headings],
        [part.name for part in parts],
    ):
        for fold in (str, str.lower):
            matches = [part for part, head in zip(parts, heads, strict=True) if fold(head) == fold(asked)]
            if matches:
                return matches[0]
    raise SceneError(f"{table.name}: {unknown_name_message('column', asked, filter(None, table.column_headings))}")


def find_time_column(table: Table, parts: Sequence[Column], columns: ColumnOptions) -> Column:
    """The one that is asked for, named or measured as a time; otherwise the first that has a heading."""
    if columns.time is not None:
        return find_column(columns.time, table, parts)
    clocks = [part for part in parts if TIME_NAME.search(part.name)]
    clocks = [part for part in clocks if not DATE_NAME.search(part.name)] or clocks
    measured = [part for part in parts if part.unit and time_unit_size(part.unit) and find_unit(part.unit) is None]
    both = [part for part in clocks if part in measured]
    return (both or clocks or measured or [part for part in parts if part.heading])[0]


def find_signal_column(
    table: Table, parts: Sequence[Column], columns: ColumnOptions, clock: Column
) -> tuple[Column, list[str]]:
    """The column of the motion: a position rather than a velocity or an acceleration; of several the liveliest."""
    if columns.position is not None:
        return find_column(columns.position, table, parts), []
    others = [part for part in parts if part is not clock]
    others = [part for part in others if part.heading and not TIME_NAME.search(part.name)] or others
    later = (part.index for part in parts[clock.index + 1 :] if TIME_NAME.search(part.name))
    next_t = next(later, len(parts))  # of several runs beside each other that of this time
    others = [part for part in others if clock.index < part.index < next_t] or others
    if columns.quantity is not None:
        wanted: int | None = QUANTITIES.index(columns.quantity)
    else:
        wanted = min((part.order for part in others if part.order is not None), default=None)
    chosen = [part for part in others if part.order == wanted]
    chosen = [part for part in chosen if not MAGNITUDE_NAME.search(part.name)] or chosen or others
    if chosen[0].order is None:
        return chosen[0], []  # nothing is known of any: the first
    first = [part for part in chosen if part.unit == chosen[0].unit]
    if len(first) == 1 or (wanted == 0 and first[0].name.lower() in ("x", "theta")):
        return first[0], []
    spans = [np.nanstd(parse_numbers(table, part.index, strict=False)) for part in first]
    best = first[int(np.argmax(spans))]
    names = ", ".join(part.heading for part in first)
    return best, [f"Of {names} the one that moves most is taken: {best.heading}; --position takes another."]


def order_from_name(name: str) -> int | None:
    """The order of the derivative that a name tells."""
    return next((order for order in (2, 1, 0) if QUANTITY_NAMES[order].search(name)), None)


def resolve_unit(name: str, unit: str | None, columns: ColumnOptions, file: str) -> tuple[int, str, float, str]:
    """Order, base unit and size in it of a column, and what had to be guessed."""
    asked = None if columns.quantity is None else QUANTITIES.index(columns.quantity)
    named, size = order_from_name(name), 1.0
    if columns.per_count is not None:
        size, unit = parse_per_count(columns.per_count)
    if unit is None:
        hint = {None: "--unit mm or deg", 0: "--unit mm or deg", 1: "--unit mm/s or deg/s", 2: "--unit m/s2 or g"}
        raise SceneError(
            f"{name} has no unit in the heading of {file}; name it, as in {hint[named if asked is None else asked]}"
        )
    if unit.lower() in COUNT_NAMES:
        raise SceneError(f"{name} is in {unit}; say what one of them is, as in --per-count 0.36deg or 0.001mm")
    found = find_unit(unit)
    if found is None:
        told = next((order for order in (asked, named) if order is not None), None)
        order, rate = told or 0, RATE_SUFFIXES[told or 0]
        base = unit.removesuffix(rate) if unit.endswith(rate) else f"{unit}.s{order if order > 1 else ''}"
        doubt = (
            f"{name} in {unit} is taken for a position, in {unit}; --quantity velocity or acceleration says otherwise."
        )
        return order, base, 1.0, doubt if told is None else ""
    order = found.order if asked is None else asked
    if asked is not None and asked != found.order:
        raise SceneError(
            f"--quantity {columns.quantity}: {unit}, the unit of {name}, is that of {with_article(QUANTITIES[found.order])}"
        )
    if named is not None and found.order < named and asked is None and columns.unit is None:
        raise SceneError(
            f"{name} has the name of {with_article(QUANTITIES[named])} and the unit of {with_article(QUANTITIES[found.order])}, {unit}: say "
            "--quantity, and --unit where the one in the file is wrong"
        )
    return order, found.base, size * found.size, ""


def with_article(noun: str) -> str:
    return f"{'an' if noun[0] in 'aeiou' else 'a'} {noun}"


def read_times(table: Table, clock: Column, columns: ColumnOptions) -> np.ndarray:
    """Times (n,) in s."""
    cells = table.columns[clock.index]
    first = next((cell for cell in cells if isinstance(cell, str) and cell), None)
    if first is not None and ":" in first and TIMESTAMP.match(first):
        return parse_timestamps(cells, table.name)  # type: ignore[arg-type]
    unit = columns.time_unit or clock.unit
    size = time_unit_size(unit or "s")  # s: every simulation program and nearly every instrument
    if unit and not size:
        raise SceneError(unknown_name_message(f"unit of {clock.name}", unit, TIMES))
    t = parse_numbers(table, clock.index)
    some = t[np.isfinite(t)]
    if unit is None and len(some) and ((some == np.round(some)).all() or some.max() > MAX_PLAUSIBLE_TIME):
        raise SceneError(
            f"{table.name}: {clock.name} has whole or huge numbers and no unit: say what one is, as in --time-unit ms, "
            "s, or 0.01s of samples that are counted"
        )
    return t * size


def parse_numbers(table: Table, i: int, strict: bool = True) -> np.ndarray:
    """The numbers (n,) of a column, NaN where one is missing; SceneError where a cell is neither, if `strict`."""
    cells: Cells = table.columns[i]
    if isinstance(cells, np.ndarray):
        return cells
    try:
        everywhere = all("," in cell for cell in cells)
        return np.array([cell.replace(",", ".") for cell in cells] if everywhere else cells, dtype=float)
    except ValueError:
        pass
    found = np.full(len(cells), np.nan)
    there = [cell for cell in cells if cell.lower() not in MISSING]
    commas = [cell for cell in there if "," in cell]
    thousands = len(commas) < len(there) and all(
        GROUPED_NUMBER.match(cell) and cell.strip("+-")[0] != "0" for cell in commas
    )
    for at, cell in enumerate(cells):
        if cell.lower() in MISSING:
            continue
        grouped = GROUPED_NUMBER.match(cell)
        if grouped and (grouped[2] or grouped[3] or grouped[1] == "'" or (grouped[1] == "," and thousands)):
            cell = cell.replace(grouped[1], "")
        try:
            found[at] = float(EXPONENT.sub("e", cell.replace(",", ".")))
        except ValueError:
            if strict:
                row = f"row {table.line + 1 + at}, column {table.column_headings[i]}"
                raise SceneError(f"{table.name}: '{cell[:40]}' in {row}, is not a number") from None
    return found
