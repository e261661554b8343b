"""Assignments on the command line: NAME=VALUE,..."""

from collections.abc import Iterable

from ..errors import MAX_VALUE_LENGTH, SceneError, format_value


class NumberWithText(float):
    """Number with its original text, for string variables and integers beyond the precision of a float."""

    def __new__(cls, text: str) -> "NumberWithText":
        number = super().__new__(cls, text)
        number.text = text
        return number

    text: str


def parse_assignments(option: str, texts: Iterable[str]) -> dict[str, float | str]:
    """Return the values by name of the assignments of an option, as in "k=100,solver.method=ode23".

    A part without = belongs to the value before it, as in "mu.y=1,2,3" for an array.

    Raises
    ------
    SceneError
        If a text is not an assignment, or one name has several values.
    """
    values = dict[str, float | str]()
    for text in texts:
        for name, value in map(parse_assignment, split_assignments(text)):
            if not name or value == "":
                raise SceneError(f"{option} {format_value(text)} is not an assignment: write it as in k=100,m=3")
            if name in values:
                raise SceneError(f"{option} names {name[:MAX_VALUE_LENGTH]} twice: give it one value")
            values[name] = value
    return values


def split_assignments(text: str) -> list[str]:
    """Return the assignments in a text; a part without = belongs to the one before it."""
    assignments: list[str] = []
    for part in text.split(","):
        if "=" in part or not assignments:
            assignments.append(part)
        else:
            assignments[-1] += f",{part}"
    return assignments


def parse_assignment(text: str) -> tuple[str, float | str]:
    """Return name and value of an assignment; the value is empty if there is none."""
    name, _, value = map(str.strip, text.partition("="))
    try:
        return name, NumberWithText(value)
    except ValueError:
        return name, value
