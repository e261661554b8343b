"""Assignments on the command line: NAME=VALUE."""

from collections.abc import Iterable

from ..errors import MAX_VALUE_LENGTH, SceneError


class NumberWithText(float):
    """Number with its original text, for string variables and integers beyond the precision of a float."""

    def __new__(cls, text: str) -> "NumberWithText":
        number = super().__new__(cls, text)
        number.text = text
        return number

    text: str


def parse_assignments(texts: Iterable[str]) -> dict[str, float | str]:
    """Return the values by name of assignments; raise SceneError if one name has several."""
    values = dict[str, float | str]()
    for name, value in map(parse_assignment, texts):
        if name in values:
            raise SceneError(f"--set names {name[:MAX_VALUE_LENGTH]} twice: give it one value")
        values[name] = value
    return values


def parse_assignment(text: str) -> tuple[str, float | str]:
    """Return name and value of an assignment such as k=100 or solver.method=ode23."""
    name, separator, value = text.partition("=")
    if not separator or not name.strip() or not value.strip():
        raise SceneError(
            f"--set {text[:MAX_VALUE_LENGTH]} is not an assignment; write it as in k=100 or solver.method=ode23"
        )
    try:
        return name.strip(), NumberWithText(value.strip())
    except ValueError:
        return name.strip(), value.strip()
