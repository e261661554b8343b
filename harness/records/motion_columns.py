"""The motion in a table: the column of a position, a velocity or an acceleration, and its unit.

The quantity follows from the unit in the heading, otherwise from the name. Options override both.
"""

from collections.abc import Sequence

import numpy as np

from ..arguments import QUANTITIES
from ..errors import SceneError, command_text, option_text
from .columns import (
    Column,
    ColumnOptions,
    describe_choice,
    find_column,
    list_columns,
    no_time_message,
    parse_numbers,
)
from .extraction import Source, extract, find_time_axis, has_times
from .motion import NO_UNIT, RATE_SUFFIXES, Motion, check_samples
from .samples import leave_out_saturated
from .table_files import Table
from .units import (
    COUNT_NAMES,
    FORCE_NAME,
    MAGNITUDE_NAME,
    TIME_NAME,
    find_unit,
    is_force_unit,
    order_from_name,
    split_count,
)

EXAMPLE_UNITS = (("mm", "deg"), ("mm/s", "deg/s"), ("m/s2", "g"))  # by the order of the derivative


def extract_motion(name: str, table: Table, options: ColumnOptions) -> Motion:
    """Return the motion in a table; SceneError if it contains none."""
    candidates = list_columns(table)
    axis = find_time_axis(table, candidates, options, options.column)
    if axis.interval is None and options.time is None:
        refuse_friction_curve(table, candidates, axis.column)
    if not has_times(axis):
        raise SceneError(no_time_message(table))
    if axis.interval is None and len(candidates) < 2 and axis.column is not None:
        raise SceneError(
            f"{table.name} has only one column that is not empty, {axis.column.heading}; time and position are required"
        )
    column, choice = find_signal_column(table, candidates, options, axis.column)
    notes = [*table.notes, *choice]
    if not any(table.column_headings) and len(candidates) > 1:
        times = "" if axis.column is None or axis.interval else f"{axis.column.heading} is used as time in s and "
        headings = option_text("headings")
        notes.insert(0, f"The file has no headings: {times}{column.heading} is the signal; {headings} names them.")
    x = parse_numbers(table, column.index)
    others = [part.heading for part in candidates if part not in (axis.column, column)]
    if others and options.column is None and len(np.unique(x[np.isfinite(x)])) == 1:
        raise SceneError(
            f"{table.name}: {column.heading} does not move; select another column by {option_text('column')}: "
            f"{', '.join(others)}"
        )
    label = column.name or column.heading
    order, base, size, assumption = resolve_unit(label, options.unit or column.unit, options, table.name)
    unit = base + RATE_SUFFIXES[order]
    samples = extract(name, table, axis, candidates, {"x": Source(column, size)}, {"x": unit}, options)
    notes += [*samples.notes, *filter(None, [assumption])]
    motion = leave_out_saturated(Motion(name, samples.t, samples.columns["x"], unit, order, base, tuple(notes)))
    check_samples(name, motion.t, motion.x, motion.quantity)
    return motion


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


def find_signal_column(
    table: Table, candidates: Sequence[Column], columns: ColumnOptions, time_column: Column | None
) -> tuple[Column, list[str]]:
    """Return the motion column and notes on the choice.

    A position is preferred to a velocity or an acceleration. Of several, the one with the largest deviation is chosen,
    with units and without; columns that only rise or only fall, as counters do, are chosen last.  The note names the
    others, and columns that neither their unit nor their name excludes.
    """
    if columns.column is not None:
        return find_column(columns.column, table, candidates), []
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
    unit_group = [part for part in motions if part.unit == motions[0].unit]
    unknown = [part for part in others if part.order is None and not part.unit and part not in motions]
    rivals = [*motions, *unknown]
    if order == 0 and unit_group[0].name.lower() in ("x", "theta"):
        return unit_group[0], describe_choice(unit_group[0], rivals, "its name is that of a position", "column")
    if len(unit_group) == 1:
        reason = "it comes first" if order is None else f"it has the name or unit of {with_article(QUANTITIES[order])}"
        return unit_group[0], describe_choice(unit_group[0], rivals, reason, "column")
    samples = [parse_numbers(table, part.index, strict=False) for part in unit_group]
    swings = [x if np.any(np.diff(x) < 0) and np.any(np.diff(x) > 0) else np.zeros(1) for x in samples]  # no counter
    most_varying = unit_group[int(np.argmax([np.nanstd(x) for x in swings]))]
    return most_varying, describe_choice(most_varying, rivals, "it varies most", "column")


def resolve_unit(name: str, unit: str | None, columns: ColumnOptions, file: str) -> tuple[int, str, float, str]:
    """Return the order, base unit and SI factor of a column, and a note on an assumption."""
    requested_order = None if columns.quantity is None else QUANTITIES.index(columns.quantity)
    order_of_name = order_from_name(name)
    size, unit = (1.0, None) if unit is None else split_count(unit)
    assumption = f"is assumed to be a position; {option_text('quantity', 'velocity')} or acceleration overrides this."
    if unit is None:
        order = requested_order if requested_order is not None else order_of_name or 0
        example, alternative = EXAMPLE_UNITS[order]
        note = (
            f"{name} has no unit in {file}: omega and zeta need none, the other values are in its own units, and "
            f"forces are left out; set it, as in {option_text('unit', example)} or {alternative}."
        )
        if requested_order is None and order_of_name is None:
            note += f" {name} {assumption}"
        return order, NO_UNIT, size, note
    if unit.lower() in COUNT_NAMES:
        example = option_text("unit", "0.36deg")
        raise SceneError(f"{name} is in {unit}; set the size of one count, as in {example}")
    known_unit = find_unit(unit)
    if known_unit is None:
        indicated_order = next((order for order in (requested_order, order_of_name) if order is not None), None)
        order, rate = indicated_order or 0, RATE_SUFFIXES[indicated_order or 0]
        base = unit.removesuffix(rate) if unit.endswith(rate) else f"{unit}.s{order if order > 1 else ''}"
        return order, base, 1.0, f"{name} in {unit} {assumption}" if indicated_order is None else ""
    order = known_unit.order if requested_order is None else requested_order
    if requested_order is not None and requested_order != known_unit.order:
        raise SceneError(
            f"{option_text('quantity', columns.quantity)}: {unit}, the unit of {name}, measures "
            f"{with_article(QUANTITIES[known_unit.order])}"
        )
    if (
        order_of_name is not None
        and known_unit.order < order_of_name
        and requested_order is None
        and columns.unit is None
    ):
        raise SceneError(
            f"{name} has the name of {with_article(QUANTITIES[order_of_name])} and the unit of "
            f"{with_article(QUANTITIES[known_unit.order])}, {unit}: set {option_text('quantity')}, and "
            f"{option_text('unit')} if that in the file is wrong"
        )
    return order, known_unit.base, size * known_unit.size, ""


def with_article(noun: str) -> str:
    """Return a noun with its indefinite article."""
    return f"{'an' if noun[0] in 'aeiou' else 'a'} {noun}"
