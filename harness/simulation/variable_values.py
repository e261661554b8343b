"""Conversion of values for FMU variables: numbers, Booleans, enumerations, strings and arrays; units and ranges."""

from contextlib import suppress
from math import prod
from typing import Any

import numpy as np

from ..arguments import FINITE
from ..errors import SceneError, format_value, unknown_name_message
from ..scenes.assignments import NumberWithText

REAL_TYPES = ("Real", "Float64", "Float32")
BOOLEANS = {"true": True, "false": False, 1: True, 0: False}


class ExclusiveBound(str):
    """The attribute `min` or `max` of a variable whose value is excluded. FMI itself has inclusive bounds only."""


def convert_value(variable: Any, value: Any, shape: tuple[int, ...] = ()) -> Any:
    """Convert a value for an FMU variable; for an array return a list in row-major order.

    Raises
    ------
    SceneError
        If the value is not allowed.
    """
    if shape:
        texts = value.replace(",", " ").split() if isinstance(value, str) else []
        parts = [*map(parse_element, texts)] or np.ravel(value).tolist()
        if len(parts) != prod(shape):
            expected = " x ".join(map(str, shape))
            raise SceneError(
                f"{variable.name} = {format_value(value)} has {len(parts)} elements, not {expected}; separate them by "
                "commas, row by row"
            )
        return [convert_value(variable, part) for part in parts]
    if variable.type == "Enumeration":
        items = enumeration_labels(variable)
        numbers = {label: number for number, label in items.items()}
        number = numbers.get(value) if isinstance(value, str) else value
        if not FINITE.accepts(number) or number not in items:
            raise SceneError(unknown_name_message(f"value of {variable.name}", value, numbers))
        return int(number)
    if variable.type == "Boolean":
        boolean = value.lower() if isinstance(value, str) else value
        if not isinstance(boolean, str | float | int) or boolean not in BOOLEANS:
            raise SceneError(f"{variable.name} = {format_value(value)} is not a Boolean; use true or false")
        return BOOLEANS[boolean]
    if variable.type == "String":
        text = getattr(value, "text", value)
        if not isinstance(text, str):
            raise SceneError(f"{variable.name} = {format_value(value)} is not a string")
        return text
    if variable.type in ("Binary", "Clock"):
        raise SceneError(f"{variable.name} is of type {variable.type}, which cannot be set; remove it")
    return convert_number(variable, value)


def parse_element(text: str) -> float | str:
    """Return a number with its text, or the text if it is not a number."""
    try:
        return NumberWithText(text)
    except ValueError:
        return text


def convert_number(variable: Any, value: Any) -> float | int:
    """Convert a number and check the bounds of its variable and of its type."""
    is_integer = variable.type not in REAL_TYPES
    if isinstance(value, str):
        hint = "; write it without quotes" if isinstance(parse_element(value), float) else ""
        raise SceneError(f"{variable.name} = {format_value(value)} is a text, not a number{hint}")
    if not isinstance(value, int | float) or isinstance(value, bool):
        raise SceneError(f"{variable.name} = {format_value(value)} must be one number")
    low, high = find_bound(variable, "min"), find_bound(variable, "max")
    excludes_low, excludes_high = (isinstance(bound, ExclusiveBound) for bound in (variable.min, variable.max))
    if is_integer:
        limits = np.iinfo({"Integer": "int32"}.get(variable.type, variable.type.lower()))
        low, high = (
            max(limits.min if low is None else low, limits.min),
            min(limits.max if high is None else high, limits.max),
        )
        text = getattr(value, "text", "")
        value = int(text) if text.lstrip("+-").isdecimal() else value  # a float holds 53 bits only
    in_range = FINITE.accepts(value) and (low is None or low <= value) and (high is None or value <= high)
    in_range = in_range and not (excludes_low and value == low) and not (excludes_high and value == high)
    if not in_range or (is_integer and not float(value).is_integer()):
        low_word, high_word = "above" if excludes_low else "at least", "below" if excludes_high else "at most"
        bounds = [f"{word} {limit!r}" for word, limit in ((low_word, low), (high_word, high)) if limit is not None]
        range_text = " and ".join(bounds) + (f" {variable_unit(variable)}" if variable_unit(variable) else "")
        if is_integer or not bounds:
            range_text = ", ".join(
                [f"any {'whole' if is_integer else 'finite'} number", *([range_text] if bounds else [])]
            )
        raise SceneError(f"{variable.name} = {format_value(value)} is outside its range; allowed: {range_text}")
    return int(value) if is_integer else float(value)


def find_bound(variable: Any, attribute: str) -> float | int | None:
    """Return the bound "min" or "max" of a variable or of its type, or None."""
    text = getattr(variable, attribute) or getattr(variable.declaredType, attribute, None)
    is_integer = variable.type not in REAL_TYPES and str(text).lstrip("+-").isdecimal()
    return None if text is None else int(text) if is_integer else float(text)


def effective_value(variable: Any, value: Any) -> Any:
    """Return a parameter's value for results: a number, a label or a text."""
    if variable.type == "Enumeration":
        return enumeration_labels(variable).get(int(value), value) if value is not None else value
    with suppress(TypeError, ValueError):
        return float(value) if isinstance(value, str) and variable.type != "String" else value
    return value


def enumeration_labels(variable: Any) -> dict[int, str]:
    """Return the labels of an enumeration by number."""
    return {int(item.value): item.name for item in getattr(variable.declaredType, "items", ())}


def variable_unit(variable: Any) -> str:
    """Return the unit of a variable or its type; empty for counts, modes and ratios."""
    unit = variable.unit or (variable.declaredType.unit if variable.declaredType is not None else None)
    return "" if unit in (None, "1") else unit
