"""What is said about source that cannot become C."""

import ast
import inspect
from types import FunctionType

from .. import BuildError
from ..model_lookup import FMUS


class UnsupportedConstructError(BuildError):
    """A construct outside the subset: file, line, what is wrong and what to write instead."""


def source_location(function: FunctionType, line: int = 0) -> str:
    """File and line of a function, or the given line of its file; the same on every machine."""
    file = inspect.getsourcefile(function) or "?"
    path = file.removeprefix(f"{FMUS.parent}/") if file.startswith(str(FMUS)) else file.rsplit("/", 1)[-1]
    return f"{path}:{line or function.__code__.co_firstlineno}"


def unsupported(function: FunctionType, node: ast.AST, why: str, instead: str) -> UnsupportedConstructError:
    """The refusal of a node of the source of a function."""
    return UnsupportedConstructError(
        f"{source_location(function, getattr(node, 'lineno', 0))}: '{ast.unparse(node)[:60]}' {why}; {instead}."
    )
