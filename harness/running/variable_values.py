"""What a variable of an FMU takes: numbers, truths, enumerations by label, texts, and arrays of them; and its unit."""

from contextlib import suppress
from math import prod
from typing import Any

import numpy as np

from ..errors import SceneError, format_value, unknown_name_message
from ..scenes.assignments import NumberWithText
from ..scenes.schema import is_number

REAL_TYPES = ("Real", "Float64", "Float32")
BOOLEANS = {"true": True, "false": False, 1: True, 0: False}


def convert_value(variable: Any, value: Any, shape: tuple[int, ...] = ()) -> Any:
    """What is set for a value: for an array of that shape a list, row by row; SceneError if it is not allowed."""
    if shape:
        texts = value.replace(",", " ").split() if isinstance(value, str) else []
        parts = [*map(parse_element, texts)] or np.ravel(value).tolist()
        if len(parts) != prod(shape):
            has = f"{variable.name} = {format_value(value)} has {len(parts)} elements"
            raise SceneError(f"{has}, not {' x '.join(map(str, shape))}; name them row by row, with commas between")
        return [convert_value(variable, part) for part in parts]
    if variable.type == "Enumeration":
        items = enumeration_labels(variable)
        numbers = {label: number for number, label in items.items()}
        number = numbers.get(value) if isinstance(value, str) else value
        if not is_number(number) or number not in items:
            raise SceneError(unknown_name_message(f"value of {variable.name}", value, numbers))
        return int(number)
    if variable.type == "Boolean":
        truth = value.lower() if isinstance(value, str) else value
        if not isinstance(truth, str | float | int) or truth not in BOOLEANS:
            raise SceneError(f"{variable.name} = {format_value(value)} is no truth; allowed: true, false")
        return BOOLEANS[truth]
    if variable.type == "String":
        text = getattr(value, "text", value)
        if not isinstance(text, str):
            raise SceneError(f"{variable.name} = {format_value(value)} is not a text")
        return text
    if variable.type in ("Binary", "Clock"):
        raise SceneError(f"{variable.name} is of type {variable.type}, which is not set here; leave it out")
    return convert_number(variable, value)


def parse_element(text: str) -> float | str:
    """A number as it is written, or the text if it is none."""
    try:
        return NumberWithText(text)
    except ValueError:
        return text


def convert_number(variable: Any, value: Any) -> float | int:
    """A number, within the bounds of its variable and of its type."""
    whole = variable.type not in REAL_TYPES
    low, high = find_bound(variable, "min"), find_bound(variable, "max")
    if whole:
        kind = np.iinfo({"Integer": "int32"}.get(variable.type, variable.type.lower()))
        low, high = max(kind.min if low is None else low, kind.min), min(kind.max if high is None else high, kind.max)
        text = getattr(value, "text", "")
        value = int(text) if text.lstrip("+-").isdecimal() else value  # of which a float holds 53 bits
    inside = is_number(value) and (low is None or low <= value) and (high is None or value <= high)
    if not inside or (whole and not float(value).is_integer()):
        words = [f"{word} {limit!r}" for word, limit in (("at least", low), ("at most", high)) if limit is not None]
        allowed = " and ".join(words) + (f" {variable_unit(variable)}" if variable_unit(variable) else "")
        if whole or not words:
            allowed = ", ".join([f"any {'whole' if whole else 'finite'} number", *([allowed] if words else [])])
        raise SceneError(f"{variable.name} = {format_value(value)} is outside its range; allowed: {allowed}")
    return int(value) if whole else float(value)


def find_bound(variable: Any, which: str) -> float | int | None:
    """A bound from the XML, if there is one, of the variable or of its type."""
    text = getattr(variable, which) or getattr(variable.declaredType, which, None)
    whole = variable.type not in REAL_TYPES and str(text).lstrip("+-").isdecimal()
    return None if text is None else int(text) if whole else float(text)


def effective_value(variable: Any, value: Any) -> Any:
    """A parameter's value as a result tells it: a number, a label or a text."""
    if variable.type == "Enumeration":
        return enumeration_labels(variable).get(int(value), value) if value is not None else value
    with suppress(TypeError, ValueError):
        return float(value) if isinstance(value, str) and variable.type != "String" else value
    return value


def enumeration_labels(variable: Any) -> dict[int, str]:
    """The names of an enumeration's values."""
    return {int(item.value): item.name for item in getattr(variable.declaredType, "items", ())}


def variable_unit(variable: Any) -> str:
    """The unit that a variable or its type names; without one for counts, modes and ratios."""
    found = variable.unit or (variable.declaredType.unit if variable.declaredType is not None else None)
    return "" if found in (None, "1") else found
