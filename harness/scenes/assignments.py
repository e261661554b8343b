"""A value as it is written on the command line: NAME=VALUE."""

from ..errors import MAX_VALUE_LENGTH, SceneError


class NumberWithText(float):
    """A number, with the `text` that stood for it: for a variable that is a text, or a long whole number."""

    def __new__(cls, text: str) -> "NumberWithText":
        number = super().__new__(cls, text)
        number.text = text
        return number

    text: str


def parse_assignment(text: str) -> tuple[str, float | str]:
    """Name and value of a text like k=100 or solver.method=ode23."""
    name, mark, value = text.partition("=")
    if not mark or not name.strip() or not value.strip():
        raise SceneError(
            f"--set {text[:MAX_VALUE_LENGTH]} is not understood; write it as in k=100 or solver.method=ode23"
        )
    try:
        return name.strip(), NumberWithText(value.strip())
    except ValueError:
        return name.strip(), value.strip()
