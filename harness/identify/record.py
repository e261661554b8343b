"""A measured record: time and position or angle, with or without speed, read from a text file with columns.

A heading tells the unit of its column, as in `x [mm]` or `theta (deg)`.  Lengths, angles and times that are known
here are turned into SI; any other unit (a sensor's volts) is kept as it is.
"""

import csv
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..errors import SceneError, unknown

TIMES = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "min": 60.0}
LENGTHS = {"m": 1.0, "mm": 1e-3, "cm": 1e-2, "um": 1e-6, "µm": 1e-6, "in": 0.0254}
ANGLES = {"rad": 1.0, "deg": np.pi / 180, "°": np.pi / 180, "mrad": 1e-3}
POSITIONS = ("x", "theta", "position", "displacement", "angle")
SPEEDS = ("v", "omega", "velocity", "speed")
HEADING = re.compile(r"^\s*(.*?)\s*(?:[\[(](.*)[\])])?\s*$")
FEWEST = 12  # samples


@dataclass(frozen=True)
class Record:
    """Positions `x` (n,) in `unit` at the times `t` (n,) in s, rising; `v` (n,) in `unit`/s where it was recorded."""

    name: str
    t: np.ndarray
    x: np.ndarray
    v: np.ndarray | None
    unit: str


@dataclass(frozen=True)
class Columns:
    """What the user says about the columns: their headings, and the units that stand above those in the file."""

    time: str | None = None
    position: str | None = None
    velocity: str | None = None
    unit: str | None = None
    time_unit: str | None = None
    begin: float = -np.inf
    end: float = np.inf


def read(path: Path, columns: Columns) -> Record:
    """The record in a file, from `columns.begin` to `columns.end` in s; SceneError in one sentence if it is not one."""
    heads, table = parse(path)
    names, units = zip(*(HEADING.match(head).groups() for head in heads), strict=True)  # type: ignore[union-attr]
    i_t = place(columns.time, names, ())
    i_t = 0 if i_t is None else i_t
    i_x = place(columns.position, names, POSITIONS)
    i_x = int(i_t == 0) if i_x is None else i_x
    i_v = place(columns.velocity, names, SPEEDS)
    time_unit, unit = columns.time_unit or units[i_t], columns.unit or units[i_x]
    if time_unit is None:
        time_unit = "s"  # every simulation program and nearly every instrument
    if time_unit not in TIMES:
        raise SceneError(unknown(f"unit of {names[i_t]}", time_unit, TIMES))
    if unit is None:
        raise SceneError(f"{names[i_x]} has no unit in the heading of {path.name}; name it, as in --unit mm")
    size, base = (LENGTHS | ANGLES).get(unit, 1.0), unit
    if unit in LENGTHS or unit in ANGLES:
        base = "m" if unit in LENGTHS else "rad"
    t, x = table[:, i_t] * TIMES[time_unit], table[:, i_x] * size
    v = None if i_v is None else table[:, i_v] * speed_size(names[i_v], units[i_v], unit, time_unit)
    inside = (t >= columns.begin) & (t <= columns.end)
    record = Record(path.stem, t[inside], x[inside], None if v is None else v[inside], base)
    check(record)
    return record


def place(wanted: str | None, names: tuple[str, ...], usual: tuple[str, ...]) -> int | None:
    """Which column is meant: the one named, or one of a usual name."""
    if wanted is not None:
        if wanted not in names:
            raise SceneError(unknown("column", wanted, names))
        return names.index(wanted)
    return next((i for i, name in enumerate(names) if name.lower() in usual), None)


def speed_size(name: str, found: str | None, unit: str, time_unit: str) -> float:
    """The size of one unit of speed; without one in the heading it is that of position over time."""
    over, _, under = (found or f"{unit}/{time_unit}").partition("/")
    sizes = LENGTHS | ANGLES | {unit: (LENGTHS | ANGLES).get(unit, 1.0)}
    if over not in sizes or under not in TIMES:
        raise SceneError(f"the unit of {name}, '{found}', is not one of position over time, as in {unit}/s")
    return sizes[over] / TIMES[under]


def parse(path: Path) -> tuple[list[str], np.ndarray]:
    """Headings and numbers (rows, columns) of a text file; commas, semicolons, tabs or blanks stand between them.

    A file with semicolons or tabs may have decimal commas.  Lines that begin with # are left out.
    """
    try:
        lines = [line for line in path.read_text(encoding="utf-8-sig").splitlines() if line.strip()]
    except OSError as error:
        raise SceneError(f"cannot read {path}: {error.strerror}") from None
    except UnicodeDecodeError:
        raise SceneError(f"{path.name} is not a text file in UTF-8") from None
    lines = [line for line in lines if not line.lstrip().startswith("#")]
    if len(lines) < 2:
        raise SceneError(f"{path.name} has no table: a heading and rows of numbers are needed")
    mark = next((mark for mark in ("\t", ";", ",") if mark in lines[1]), None)
    rows = list(csv.reader(lines, delimiter=mark)) if mark else [line.split() for line in lines]
    if mark in ("\t", ";"):
        rows[1:] = [[cell.replace(",", ".") for cell in row] for row in rows[1:]]
    heads = [head.strip() for head in rows[0]]
    if all(is_number(head) for head in heads):
        raise SceneError(f"{path.name} has no heading; its first line must name the columns, as in t [s],x [mm]")
    if len(heads) < 2:
        raise SceneError(f"{path.name} has one column; time and position are needed")
    for number, row in enumerate(rows[1:], 2):
        if len(row) != len(heads):
            raise SceneError(f"{path.name}: row {number} has {len(row)} cells where the heading has {len(heads)}")
        for head, cell in zip(heads, row, strict=True):
            if not is_number(cell):
                raise SceneError(f"{path.name}: '{cell}' in row {number}, column {head}, is not a number")
    return heads, np.array(rows[1:], float)


def is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def check(record: Record) -> None:
    """Samples enough, finite, and later each than the one before."""
    if len(record.t) < FEWEST:
        raise SceneError(f"{record.name} has {len(record.t)} samples in this stretch; {FEWEST} or more are needed")
    for name, values in (("time", record.t), ("position", record.x), ("speed", record.v)):
        if values is not None and not np.isfinite(values).all():
            raise SceneError(f"{record.name}: {name} is not finite in sample {int(np.argmin(np.isfinite(values)))}")
    late = np.flatnonzero(np.diff(record.t) <= 0)
    if len(late):
        at = float(record.t[late[0]])
        raise SceneError(f"{record.name}: time does not rise after t = {at!r} s; sort the rows, one for each time")
