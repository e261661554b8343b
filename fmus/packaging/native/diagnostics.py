"""Error messages for source that cannot be translated to C."""

import ast
import inspect
from types import FunctionType

from .. import BuildError
from ..model_lookup import FMUS


class UnsupportedConstructError(BuildError):
    """Source that cannot be translated to C. The message has file, line, reason and an alternative."""


def source_location(function: FunctionType, line: int = 0) -> str:
    """Return file and line of a function, or the given line of its file, independent of the machine."""
    file = inspect.getsourcefile(function) or "?"
    path = file.removeprefix(f"{FMUS.parent}/") if file.startswith(str(FMUS)) else file.rsplit("/", 1)[-1]
    return f"{path}:{line or function.__code__.co_firstlineno}"


def unsupported(function: FunctionType, node: ast.AST, why: str, instead: str) -> UnsupportedConstructError:
    """Return the error for a node in the source of a function."""
    return UnsupportedConstructError(
        f"{source_location(function, getattr(node, 'lineno', 0))}: '{ast.unparse(node)[:60]}' {why}; {instead}."
    )
