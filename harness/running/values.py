"""What a variable of an FMU takes: numbers, truths, enumerations by label, texts, and arrays of them; and its unit."""

from contextlib import suppress
from math import prod
from typing import Any

import numpy as np

from ..errors import SceneError, shown, unknown
from ..scenes.assigned import Written
from ..scenes.schema import is_number

REALS = ("Real", "Float64", "Float32")
TRUTHS = {"true": True, "false": False, 1: True, 0: False}


def accepted(variable: Any, value: Any, shape: tuple[int, ...] = ()) -> Any:
    """What is set for a value: for an array of that shape a list, row by row; SceneError if it is not allowed."""
    if shape:
        texts = value.replace(",", " ").split() if isinstance(value, str) else []
        parts = [*map(element, texts)] or np.ravel(value).tolist()
        if len(parts) != prod(shape):
            has = f"{variable.name} = {shown(value)} has {len(parts)} elements"
            raise SceneError(f"{has}, not {' x '.join(map(str, shape))}; name them row by row, with commas between")
        return [accepted(variable, part) for part in parts]
    if variable.type == "Enumeration":
        items = labels(variable)
        numbers = {label: number for number, label in items.items()}
        number = numbers.get(value) if isinstance(value, str) else value
        if not is_number(number) or number not in items:
            raise SceneError(unknown(f"value of {variable.name}", value, numbers))
        return int(number)
    if variable.type == "Boolean":
        truth = value.lower() if isinstance(value, str) else value
        if not isinstance(truth, str | float | int) or truth not in TRUTHS:
            raise SceneError(f"{variable.name} = {shown(value)} is no truth; allowed: true, false")
        return TRUTHS[truth]
    if variable.type == "String":
        text = getattr(value, "text", value)
        if not isinstance(text, str):
            raise SceneError(f"{variable.name} = {shown(value)} is not a text")
        return text
    if variable.type in ("Binary", "Clock"):
        raise SceneError(f"{variable.name} is of type {variable.type}, which is not set here; leave it out")
    return number_of(variable, value)


def element(text: str) -> float | str:
    """A number as it is written, or the text if it is none."""
    try:
        return Written(text)
    except ValueError:
        return text


def number_of(variable: Any, value: Any) -> float | int:
    """A number, within the bounds of its variable and of its type."""
    whole = variable.type not in REALS
    low, high = bound(variable, "min"), bound(variable, "max")
    if whole:
        kind = np.iinfo({"Integer": "int32"}.get(variable.type, variable.type.lower()))
        low, high = max(kind.min if low is None else low, kind.min), min(kind.max if high is None else high, kind.max)
        text = getattr(value, "text", "")
        value = int(text) if text.lstrip("+-").isdecimal() else value  # of which a float holds 53 bits
    inside = is_number(value) and (low is None or low <= value) and (high is None or value <= high)
    if not inside or (whole and not float(value).is_integer()):
        words = [f"{word} {limit!r}" for word, limit in (("at least", low), ("at most", high)) if limit is not None]
        allowed = " and ".join(words) + (f" {unit(variable)}" if unit(variable) else "")
        if whole or not words:
            allowed = ", ".join([f"any {'whole' if whole else 'finite'} number", *([allowed] if words else [])])
        raise SceneError(f"{variable.name} = {shown(value)} is outside its range; allowed: {allowed}")
    return int(value) if whole else float(value)


def bound(variable: Any, which: str) -> float | int | None:
    """A bound from the XML, if there is one, of the variable or of its type."""
    text = getattr(variable, which) or getattr(variable.declaredType, which, None)
    whole = variable.type not in REALS and str(text).lstrip("+-").isdecimal()
    return None if text is None else int(text) if whole else float(text)


def in_force(variable: Any, value: Any) -> Any:
    """A parameter's value as a result tells it: a number, a label or a text."""
    if variable.type == "Enumeration":
        return labels(variable).get(int(value), value) if value is not None else value
    with suppress(TypeError, ValueError):
        return float(value) if isinstance(value, str) and variable.type != "String" else value
    return value


def labels(variable: Any) -> dict[int, str]:
    """The names of an enumeration's values."""
    return {int(item.value): item.name for item in getattr(variable.declaredType, "items", ())}


def unit(variable: Any) -> str:
    """The unit that a variable or its type names; without one for counts, modes and ratios."""
    found = variable.unit or (variable.declaredType.unit if variable.declaredType is not None else None)
    return "" if found in (None, "1") else found
