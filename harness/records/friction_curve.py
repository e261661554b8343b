"""Friction over velocity in a table: points, or a record over time.

A column of velocities or positions and a column of forces, torques or motor currents are found by their headings and
units, or named. A table with a column of times is a record over time.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..errors import SceneError, format_value, option_text
from .columns import (
    Column,
    ColumnOptions,
    describe_choice,
    find_column_and_unit,
    find_time_column,
    find_time_columns,
    list_columns,
    no_time_message,
)
from .extraction import Samples, Source, TimeAxis, extract, has_times
from .samples import mark_sentinels
from .table_files import Table
from .units import FORCE_NAME, conversion_factor, find_unit, force_unit_size, is_force_unit, time_unit_size, unit_size

FRICTION_NAME = re.compile(r"friction|reibung", re.I)
CURRENT_NAME = re.compile(r"^(i|iq|current|strom)(?![^\W_])", re.I)
TORQUE_NAME = re.compile(r"^(tau|torque|moment|drehmoment)(?![^\W_])", re.I)
ROTATION_NAME = re.compile(r"^(theta|phi|angle|winkel|omega|gyro\w*|drehzahl|rpm)(?![^\W_])|angular", re.I)
FORCE_UNITS = {"m/s": "N", "rad/s": "N.m"}
POSITION, VELOCITY, FORCE = "position", "velocity", "force"  # names of the samples


@dataclass(frozen=True)
class CurveColumns:
    """Columns of friction over velocity.

    Attributes
    ----------
    velocity, position, force, current : str or None
        Headings. A heading may state the unit, as in "v [mm/s]"; without any, columns are found by name and unit.
    constant : str or None
        Force or torque per current, with its unit, as in "0.12 N.m/A".
    is_points : bool
        Whether the rows are points even if the table has times.
    """

    velocity: str | None = None
    position: str | None = None
    force: str | None = None
    current: str | None = None
    constant: str | None = None
    is_points: bool = False


def extract_curve(name: str, table: Table, options: ColumnOptions, columns: CurveColumns) -> Samples:
    """Return the friction over velocity in a table: a velocity or a position, and a force, in SI units.

    Raises
    ------
    SceneError
        If it has none.
    """
    check_options(columns)
    candidates = list_columns(table)
    motion, motion_unit, is_position = find_motion(table, candidates, columns, options)
    axis = find_curve_axis(table, candidates, columns, options, motion)
    used_columns = [column for column in (motion, axis.column) if column]
    force, force_unit, is_current = find_force(table, candidates, columns, used_columns)
    reason = rotation_reason(motion, force, force_unit, is_current, columns.constant)
    velocity_unit, motion_size, motion_notes = resolve_motion(motion, motion_unit, is_position, reason)
    if columns.constant is not None and not is_current:
        example = option_text("current", "i")
        raise SceneError(f"constant has no effect, because {force.heading} is no current: name it, as in {example}")
    unit, force_size, force_notes = resolve_force(force, force_unit, is_current, velocity_unit, columns.constant)
    if is_position and not has_times(axis):
        raise SceneError(f"{motion.heading} is a position: {no_time_message(table)}")
    if not has_times(axis) and options.interval != (-np.inf, np.inf):
        raise SceneError("begin and end have no effect on points without times")
    sources = {
        POSITION if is_position else VELOCITY: Source(motion, motion_size, mark_sentinels),
        FORCE: Source(force, force_size, mark_sentinels),
    }
    units = {POSITION: velocity_unit.removesuffix("/s"), VELOCITY: velocity_unit, FORCE: unit}
    samples = extract(name, table, axis, candidates, sources, units, options)
    runs = find_time_columns(candidates)[1:]  # another remark names their columns
    others = [part for part in candidates if part not in (motion, force, axis.column) and not runs]
    forces = [part for part in others if (is_force_unit(part.unit) if part.unit else FORCE_NAME.search(part.name))]
    choice = []
    if columns.velocity is None and columns.position is None:
        motions = [part for part in others if part.order == motion.order and part not in forces]
        choice += describe_choice(motion, [motion, *motions], "it comes first", "velocity")
    if columns.force is None and columns.current is None and not is_current:
        choice += describe_choice(force, [force, *forces], "it is named friction, or is the first force", "force")
    return replace(samples, notes=(*table.notes, *choice, *motion_notes, *force_notes, *samples.notes))


def check_options(columns: CurveColumns) -> None:
    """Raise SceneError for options that exclude each other."""
    for option, alternative in (("velocity", "position"), ("force", "current")):
        if getattr(columns, option) is not None and getattr(columns, alternative) is not None:
            raise SceneError(f"{option} and {alternative} are both given: leave one of them out")
    if columns.current is not None and columns.constant is None:
        example = option_text("constant", "0.12 N.m/A")
        raise SceneError(f"a current needs the constant of the motor, as in {example}")
    if columns.position is not None and columns.is_points:
        raise SceneError("points need a column of velocities, not of positions")


def find_curve_axis(
    table: Table, candidates: Sequence[Column], columns: CurveColumns, options: ColumnOptions, motion: Column
) -> TimeAxis:
    """Return the times of a table; those of points are neither a column nor an interval."""
    if columns.is_points:
        return TimeAxis(None, None)
    if options.rate:
        return TimeAxis(None, 1 / options.rate)
    others = [part for part in candidates if part is not motion and may_be_time(part)]
    if options.time is not None:
        return TimeAxis(find_time_column(table, candidates, options), None)
    if others and (columns.position is not None or find_time_columns(others)):
        return TimeAxis(find_time_column(table, others, replace(options, column=None)), None)
    return TimeAxis(None, table.interval)


def may_be_time(column: Column) -> bool:
    """Return whether a column may have times: T is a torque, unless its unit is one of time."""
    return bool(time_unit_size(column.unit)) if column.unit else column.name != "T"


def find_motion(
    table: Table, candidates: Sequence[Column], columns: CurveColumns, options: ColumnOptions
) -> tuple[Column, str | None, bool]:
    """Return the column of velocities or positions, its unit, and whether it has positions."""
    for heading, is_position in ((columns.velocity, False), (columns.position, True)):
        if heading is not None:
            return *find_column_and_unit(heading, table, list(candidates)), is_position
    times = find_time_columns([part for part in candidates if may_be_time(part)])
    for order in (1, 0) if times or options.rate else (1,):
        for part in candidates:
            if part not in times and part.order == order and not FORCE_NAME.search(part.name):
                return part, part.unit, order == 0
    names = ", ".join(filter(None, (part.heading for part in candidates)))
    example = option_text("velocity", "v")
    raise SceneError(f"{table.name} has no column of velocities (it has {names}): name it, as in {example}")


def find_force(
    table: Table, candidates: Sequence[Column], columns: CurveColumns, used_columns: Sequence[Column]
) -> tuple[Column, str | None, bool]:
    """Return the column of forces or currents, its unit, and whether it has currents."""
    for heading, is_current in ((columns.force, False), (columns.current, True)):
        if heading is not None:
            return *find_column_and_unit(heading, table, list(candidates)), is_current
    others = [part for part in candidates if all(part.index != column.index for column in used_columns)]
    by_unit = [part for part in others if part.unit and is_force_unit(part.unit)]
    by_unit.sort(key=lambda part: not FRICTION_NAME.search(part.name))  # friction before the other forces of a run
    by_name = [part for part in others if FORCE_NAME.search(part.name)]
    times = [part for part in find_time_columns(by_name) if may_be_time(part)]
    by_name.sort(key=lambda part: part in times)  # t may be a torque if nothing else is one
    if columns.constant is not None:
        for part in others:
            if CURRENT_NAME.search(part.name) or (part.unit and conversion_factor(part.unit, "A")):
                return part, part.unit, True
    for part in (*by_unit, *by_name):
        return part, part.unit, False
    names = ", ".join(filter(None, (part.heading for part in candidates)))
    example = option_text("force", "F")
    raise SceneError(f"{table.name} has no column of forces (it has {names}): name it, as in {example}")


def rotation_reason(
    motion: Column, force: Column, force_unit: str | None, is_current: bool, constant: str | None
) -> str:
    """Return why a motion without a unit is a rotation; empty if it is none.

    The unit of the force, or of the constant of the motor, outranks the names of both columns.
    """
    unit, text = (force_unit, force.heading) if not is_current else (None, "")
    if is_current and constant is not None:
        unit, text = parse_constant(constant)[1], "the constant"
    for base, is_rotation in (("N.m", True), ("N", False)):
        if unit and conversion_factor(unit, f"{base}/A" if is_current else base) is not None:
            return f"{text} is in {unit}" if is_rotation else ""
    if ROTATION_NAME.search(motion.name):
        return "its name is that of a rotation"
    return f"{force.heading} is a torque" if TORQUE_NAME.search(force.name) else ""


def resolve_motion(column: Column, unit: str | None, is_position: bool, rotation: str) -> tuple[str, float, list[str]]:
    """Return the SI unit of the velocity, the size of the unit of the column, and notes.

    `rotation` is why a motion without a unit is a rotation; empty if it is none.
    """
    if unit is None:
        length, name = "rad" if rotation else "m", "a position" if is_position else "a velocity"
        base = length if is_position else f"{length}/s"
        reason = f", because {rotation}" if rotation else ""
        return f"{length}/s", 1.0, [f"{column.heading} has no unit: {name} in {base} is assumed{reason}."]
    motion = find_unit(unit)
    if motion is None or motion.order != (0 if is_position else 1):
        expected = "a position, as m, mm or deg" if is_position else "a velocity, as m/s, mm/s, rad/s or rpm"
        raise SceneError(f"{column.name} is in {unit}, which is not the unit of {expected}")
    return f"{motion.base}/s", motion.size, []


def resolve_force(
    column: Column, unit: str | None, is_current: bool, velocity_unit: str, constant: str | None
) -> tuple[str, float, list[str]]:
    """Return the SI unit of the force, the size of the unit of the column, and notes."""
    base = FORCE_UNITS[velocity_unit]
    motion = f"the velocity is in {velocity_unit}"
    if is_current:
        size = 1.0 if unit is None else conversion_factor(unit, "A")
        if size is None:
            raise SceneError(f"{column.name} is in {unit}, which is not the unit of a current, as A or mA")
        number, constant_unit = parse_constant(str(constant))
        factor = conversion_factor(constant_unit, f"{base}/A")
        if factor is None:
            raise SceneError(f"constant {format_value(constant)} does not fit, because {motion}: give it in {base}/A")
        note = [f"{column.heading} has no unit: A is assumed."] if unit is None else []
        return base, number * factor * size, note
    if unit is None:
        return base, 1.0, [f"{column.heading} has no unit: {base} is assumed, because {motion}."]
    size = force_unit_size(unit, base)
    if size is None:
        raise SceneError(
            f"{column.name} is in {unit}, and {motion}: give a force with a velocity in m/s, or a torque with one in "
            "rad/s, or set the right unit, as in "
            f"{option_text('force', f'{column.name} [{base}]')}"
        )
    return base, size, []


def parse_constant(text: str) -> tuple[float, str]:
    """Return number and unit of the constant of a motor, as in 0.12 N.m/A or 'kt [N.m/A]'."""
    match = re.fullmatch(r"\s*([-+]?[0-9.]+(?:[eE][-+]?[0-9]+)?)\s*\[?\s*(\S.*?)\]?\s*", text)
    try:
        number = float(match[1]) if match else 0.0
    except ValueError:
        number = 0.0
    if not match or not number or not np.isfinite(number) or unit_size(match[2]) is None:
        raise SceneError(f"constant {format_value(text)}: give a number other than 0 and a unit, as in 0.12 N.m/A")
    return number, match[2]
