"""Exceptions with an exit status, and texts of error messages."""

import shlex
from collections.abc import Collection, Iterable, Mapping
from contextvars import ContextVar
from difflib import get_close_matches
from importlib import import_module
from os.path import basename, exists, splitext
from typing import Any

MAX_VALUE_LENGTH = 100  # characters of a value in a message
MAX_LISTED_NAMES = 100  # names listed in a message
COMMAND_LINE = ContextVar("command_line", default=False)  # whether a command runs, whose options messages name
OPTIONS = {"inputs": "input", "values": "set", "folder": "out"}  # by the argument, where the names differ
FUNCTIONS = {"curve": "identify_curve", "decay": "identify_decay"}  # by the command, where the names differ
OF_READ_RECORD = ("headings",)  # arguments that no other function of the Python API has


class HarnessError(Exception):
    """A run or an analysis failed. The text is a sentence for the user."""

    status = 1


class SceneError(HarnessError):
    """The scene or another input is invalid."""

    status = 2


class RunError(HarnessError):
    """A run ended early; `run` holds it up to the failure."""

    def __init__(self, message: str, run: Any) -> None:
        super().__init__(message)
        self.run = run


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


def unknown_name_message(category: str, name: object, allowed_names: Iterable[str]) -> str:
    """Return the message about a name that is not allowed, with the nearest allowed name.

    Parameters
    ----------
    category : str
        Category of the name, as in "output" or "scene".
    name : object
        The invalid name.
    allowed_names : iterable of str
        The valid names.
    """
    names, quoted_name = sorted(allowed_names), format_value(name)
    close = get_close_matches(quoted_name.strip("'"), names, n=1)
    hint = f" (nearest: '{close[0]}')" if close else ""
    suffix = f" and {len(names) - MAX_LISTED_NAMES} more" if len(names) > MAX_LISTED_NAMES else ""
    return f"unknown {category} {quoted_name}{hint}; allowed: {', '.join(names[:MAX_LISTED_NAMES]) or 'none'}{suffix}"


def unknown_source_message(category: str, source: str, allowed_names: Iterable[str], other: str = "") -> str:
    """Return the message about a source that is not an allowed name, and about a path that does not exist.

    Parameters
    ----------
    category, allowed_names
        As in `unknown_name_message`.
    source : str
        The invalid name or path.
    other : str
        Other allowed sources, as in ", or the path of a .toml file".
    """
    message = unknown_name_message(category, source, allowed_names) + other
    if exists(source):
        return message
    is_path = bool(splitext(source)[1]) or basename(source) != source
    quoted_source = format_value(source)
    return (
        f"{quoted_source} does not exist; {message}"
        if is_path
        else f"{message}; no file or folder {quoted_source} exists"
    )


def check_names(category: str, names: Iterable[object], allowed_names: Collection[str]) -> None:
    """Raise SceneError for the first name that is not allowed, or no text."""
    for name in names:
        if not isinstance(name, str) or name not in allowed_names:
            raise SceneError(unknown_name_message(category, name, allowed_names))


def check_varied(category: str, names: Iterable[str], allowed_names: Collection[str], values: Collection[str]) -> None:
    """Raise SceneError for a varied variable that is not allowed, or is also among the set values."""
    names = [*names]
    check_names(category, names, allowed_names)
    for name in names:
        if name in values:
            raise SceneError(f"{name} is both varied and set; remove one of them")


def option_text(name: str, value: object = None) -> str:
    """Return an option as the user writes it: as in `--rate 100` for a command, or `rate=100` for the Python API.

    Parameters
    ----------
    name : str
        Name of the argument of the Python API.
    value : object
        Its value: a number, a text, True for a flag, names, or a mapping to headings or ranges; by default only the
        option is named.
    """
    if not COMMAND_LINE.get():
        text = f"`{name}`" if value is None else f"{name}={value!r}"
        return f"{text} of read_record" if name in OF_READ_RECORD else text
    text = f"--{OPTIONS.get(name, name).replace('_', '-')}"
    if value is None or value is True:
        return text
    if isinstance(value, Mapping):
        ranges = {key: "{:g}:{:g}".format(*item) if isinstance(item, tuple) else item for key, item in value.items()}
        value = [f"{key}={item}" for key, item in ranges.items()]
    return f"{text} {shlex.quote(','.join(value) if isinstance(value, list) else str(value))}"


def by_interface(command: str, python: str) -> str:
    """Return the first text while a command runs, and the second one otherwise, in the Python API."""
    return command if COMMAND_LINE.get() else python


def command_text(name: str, model: str = "") -> str:
    """Return a command, or the function of the Python API that does the same; `model` is its first argument."""
    function = f"harness.{FUNCTIONS.get(name, name)}"
    return by_interface(f"friction-fmus {name} {model}".rstrip(), f"{function}({model!r}, ...)" if model else function)


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
