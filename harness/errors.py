"""What can go wrong, each with one sentence and an exit status."""

from collections.abc import Iterable
from difflib import get_close_matches


class HarnessError(Exception):
    """A run or an analysis that failed; its text is one sentence for the user."""

    status = 1


class SceneError(HarnessError):
    """A scene that cannot be run as it is written."""

    status = 2


def reason(error: Exception) -> str:
    """The first line of somebody else's exception, or its kind where it says nothing."""
    return str(error).splitlines()[0] if str(error) else type(error).__name__


def unknown(kind: str, word: object, allowed: Iterable[str]) -> str:
    """The sentence about a word that is not among the allowed ones, with the nearest of them."""
    names = sorted(allowed)
    close = get_close_matches(str(word), names, n=1)
    hint = f" (nearest: '{close[0]}')" if close else ""
    return f"unknown {kind} '{word}'{hint}; allowed: {', '.join(names) or 'none'}"
