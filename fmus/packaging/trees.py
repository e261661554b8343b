"""Trees of Python, of which most are looked at again and again: read once, and copied quickly."""

import ast
from functools import lru_cache
from typing import Any, TypeVar

Node = TypeVar("Node", bound=ast.AST)


@lru_cache(200)
def nodes(text: str) -> list[ast.AST]:
    """Every node of a text, its tree first; nobody changes them."""
    return walked(ast.parse(text))


def tree(text: str) -> ast.Module:
    """The tree itself."""
    found = nodes(text)[0]
    assert isinstance(found, ast.Module)
    return found


def walked(root: ast.AST) -> list[ast.AST]:
    """A tree and all that is in it, in the order of ast.walk."""
    found = [root]
    for node in found:  # which grows on the way
        for name in node._fields:
            value = getattr(node, name, None)
            if isinstance(value, ast.AST):
                found.append(value)
            elif isinstance(value, list):
                found += [one for one in value if isinstance(one, ast.AST)]
    return found


def copied(node: Node, down: int = 0) -> Node:
    """A tree of its own, its lines moved down by some: what copy.deepcopy makes in ten times the time."""
    if not node._fields:  # a plus, a minus: one for all in Python's parser, too
        return node
    made = node.__new__(type(node))
    vars(made).update({name: _part(name, value, down) for name, value in vars(node).items()})
    return made


def _part(name: str, value: Any, down: int) -> Any:
    """A child, a row of such, the number of a line, or anything else."""
    if isinstance(value, ast.AST):
        return copied(value, down)
    if isinstance(value, list):
        return [copied(one, down) if isinstance(one, ast.AST) else one for one in value]
    return value + down if down and value is not None and name in ("lineno", "end_lineno") else value


def same(a: Any, b: Any) -> bool:
    """Whether two trees say the same, wherever they stand."""
    if type(a) is not type(b):
        return False
    if isinstance(a, ast.AST):
        return all(same(getattr(a, name, None), getattr(b, name, None)) for name in a._fields if name != "ctx")
    return a == b if not isinstance(a, list) else len(a) == len(b) and all(map(same, a, b))
