"""What can go wrong, each with one sentence and an exit status."""

from collections.abc import Collection, Iterable
from difflib import get_close_matches
from importlib import import_module
from typing import Any

MAX_VALUE_LENGTH = 100  # letters of a value in a sentence
MAX_LISTED_NAMES = 100  # names in one


class HarnessError(Exception):
    """A run or an analysis that failed; its text is one sentence for the user."""

    status = 1


class SceneError(HarnessError):
    """A scene that cannot be run as it is written."""

    status = 2


def first_line(error: Exception) -> str:
    """The first line of somebody else's exception, or its kind where it says nothing."""
    return str(error).splitlines()[0] if str(error) else type(error).__name__


def format_value(value: object) -> str:
    """A value as a sentence can hold it."""
    try:
        text = repr(value)
    except (RecursionError, ValueError):  # an integer of thousands of digits, too, is more than Python writes out
        return "what stands there"
    return text if len(text) <= MAX_VALUE_LENGTH else f"{text[:MAX_VALUE_LENGTH]}... ({len(text)} letters)"


def unknown_name_message(kind: str, word: object, allowed: Iterable[str]) -> str:
    """The sentence about a word that is not among the allowed ones, with the nearest of them."""
    names, text = sorted(allowed), format_value(word)
    close = get_close_matches(text.strip("'"), names, n=1)
    hint = f" (nearest: '{close[0]}')" if close else ""
    more = f" and {len(names) - MAX_LISTED_NAMES} more" if len(names) > MAX_LISTED_NAMES else ""
    return f"unknown {kind} {text}{hint}; allowed: {', '.join(names[:MAX_LISTED_NAMES]) or 'none'}{more}"


def check_names(kind: str, names: Iterable[str], allowed: Collection[str]) -> None:
    """SceneError about the first of some names that is not among the allowed ones."""
    for name in names:
        if name not in allowed:
            raise SceneError(unknown_name_message(kind, name, allowed))


def optional(package: str, purpose: str, extra: str) -> Any:
    """Import an optional package.

    Raises
    ------
    HarnessError
        If the package is not installed; the message names the extra that installs it.
    """
    try:
        return import_module(package)
    except ModuleNotFoundError:
        install = f"python -m pip install 'friction-fmus[{extra}]'"
        raise HarnessError(f"{purpose} needs {package}, which is not installed: {install}") from None
