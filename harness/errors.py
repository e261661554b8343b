"""Exceptions with an exit status, and texts of error messages."""

from collections.abc import Collection, Iterable
from difflib import get_close_matches
from importlib import import_module
from os.path import basename, exists, splitext
from typing import Any

MAX_VALUE_LENGTH = 100  # characters of a value in a message
MAX_LISTED_NAMES = 100  # names listed in a message


class HarnessError(Exception):
    """A run or an analysis failed. The text is a sentence for the user."""

    status = 1


class SceneError(HarnessError):
    """The scene or another input is invalid."""

    status = 2


def first_line(error: Exception) -> str:
    """Return the first line of an exception's text, or its class name if the text is empty."""
    return str(error).splitlines()[0] if str(error) else type(error).__name__


def format_value(value: object) -> str:
    """Return the repr of a value in one line, cut to `MAX_VALUE_LENGTH` characters."""
    try:
        text = " ".join(line.strip() for line in repr(value).splitlines())
    except (RecursionError, ValueError):  # ValueError: an integer of thousands of digits
        return "the given value"
    return text if len(text) <= MAX_VALUE_LENGTH else f"{text[:MAX_VALUE_LENGTH]}... ({len(text)} characters)"


def unknown_name_message(category: str, name: object, allowed: Iterable[str]) -> str:
    """Return the message about a name that is not allowed, with the nearest allowed name.

    Parameters
    ----------
    category : str
        Category of the name, as in "output" or "scene".
    name : object
        The invalid name.
    allowed : iterable of str
        The valid names.
    """
    allowed_names, quoted = sorted(allowed), format_value(name)
    close = get_close_matches(quoted.strip("'"), allowed_names, n=1)
    hint = f" (nearest: '{close[0]}')" if close else ""
    more = f" and {len(allowed_names) - MAX_LISTED_NAMES} more" if len(allowed_names) > MAX_LISTED_NAMES else ""
    return f"unknown {category} {quoted}{hint}; allowed: {', '.join(allowed_names[:MAX_LISTED_NAMES]) or 'none'}{more}"


def unknown_source_message(category: str, source: str, allowed: Iterable[str], other: str = "") -> str:
    """Return the message about a source that is not an allowed name, and about a path that does not exist.

    Parameters
    ----------
    category, allowed
        As in `unknown_name_message`.
    source : str
        The invalid name or path.
    other : str
        Other allowed sources, as in ", or the path of a .toml file".
    """
    message = unknown_name_message(category, source, allowed) + other
    if exists(source):
        return message
    is_path = bool(splitext(source)[1]) or basename(source) != source
    quoted = format_value(source)
    return f"{quoted} does not exist; {message}" if is_path else f"{message}; no file or folder {quoted} exists"


def check_names(category: str, names: Iterable[str], allowed: Collection[str]) -> None:
    """Raise SceneError for the first name that is not allowed."""
    for name in names:
        if name not in allowed:
            raise SceneError(unknown_name_message(category, name, allowed))


def install_command(extra: str) -> str:
    """Return the command that adds an extra to the installed project, whether it is a clone or a wheel."""
    return f"python -m pip install 'friction-fmus[{extra}]'"


def import_optional(package: str, purpose: str, extra: str) -> Any:
    """Import an optional package.

    Raises
    ------
    HarnessError
        If the package is not installed; the message names the extra that installs it.
    """
    try:
        return import_module(package)
    except ModuleNotFoundError:
        raise HarnessError(f"{purpose} needs {package}, which is not installed: {install_command(extra)}") from None
