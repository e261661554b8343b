"""A value as it is written on the command line: NAME=VALUE."""

from ..errors import LONGEST, SceneError


def assigned(text: str) -> tuple[str, float | str]:
    """Name and value of a text like k=100 or solver.method=ode23."""
    name, mark, value = text.partition("=")
    if not mark or not name.strip() or not value.strip():
        raise SceneError(f"--set {text[:LONGEST]} is not understood; write it as in k=100 or solver.method=ode23")
    try:
        return name.strip(), float(value)
    except ValueError:
        return name.strip(), value.strip()
