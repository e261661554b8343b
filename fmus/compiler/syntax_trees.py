"""Cached and immutable Python syntax trees: parsed once, and shared where they do not change."""

import ast
from functools import lru_cache
from operator import is_
from typing import Any, TypeVar

from . import BuildError

Node = TypeVar("Node", bound=ast.AST)
NON_NODE_FIELDS = {"ctx", "id", "attr", "arg", "name", "asname", "module", "level", "kind", "type_comment"}
NODE_TYPES = [
    node_type for node_type in vars(ast).values() if isinstance(node_type, type) and issubclass(node_type, ast.AST)
]
CHILD_FIELDS = {kind: [name for name in kind._fields if name not in NON_NODE_FIELDS] for kind in NODE_TYPES} | {
    ast.Constant: []
}


class TranslationError(BuildError):
    """Source of the numerics that cannot be lowered to scalars or translated to C, with its file and line."""

    def __init__(self, location: str, node: ast.AST) -> None:
        text = ast.unparse(node).partition("\n")[0]
        super().__init__(
            f"{location}: '{text}' cannot be translated; fmus/compiler/lowering/__init__.py and "
            "fmus/compiler/c/__init__.py describe what can."
        )


@lru_cache(200)
def parsed_module(text: str) -> ast.Module:
    """Return the parsed source text; callers must not change it."""
    return ast.parse(text)


@lru_cache(200)
def parsed_nodes(text: str) -> list[ast.AST]:
    """Return all nodes of the source text, the module first; callers must not change them."""
    return all_nodes(parsed_module(text))


def child_nodes(node: ast.AST) -> list[ast.AST]:
    """Return the direct child nodes, without load and store contexts."""
    result: list[ast.AST] = []
    for name in CHILD_FIELDS[type(node)]:
        value = getattr(node, name, None)
        if isinstance(value, list):
            result += [child for child in value if isinstance(child, ast.AST)]
        elif isinstance(value, ast.AST):
            result.append(value)
    return result


def all_nodes(root: ast.AST) -> list[ast.AST]:
    """Return a node and all its descendants, in the order of ast.walk."""
    result = [root]
    for node in result:  # the list grows during the loop
        result += child_nodes(node)
    return result


class TreeTransformer:
    """Like ast.NodeTransformer, but never changes a tree in place: new trees share unchanged parts with the old."""

    def visit(self, node: ast.AST) -> Any:
        return getattr(self, f"visit_{type(node).__name__}", self.generic_visit)(node)

    def generic_visit(self, node: Node) -> Node:
        result = {}
        for name in CHILD_FIELDS[type(node)]:
            value = getattr(node, name, None)
            if isinstance(value, list):
                result[name] = [self.visit(child) if isinstance(child, ast.AST) else child for child in value]
            elif isinstance(value, ast.AST):
                result[name] = self.visit(value)
        return replace_fields(node, **result) if result else node


def replace_fields(node: Node, **parts: Any) -> Node:
    """Return a copy of the node with these fields replaced, or the node itself if nothing changes."""
    fields = vars(node)
    for name, part in parts.items():
        old = fields[name]
        if part is not old and not (isinstance(old, list) and len(part) == len(old) and all(map(is_, part, old))):
            copy = node.__new__(type(node))
            vars(copy).update(fields | parts)
            return copy
    return node


def is_same_tree(a: Any, b: Any) -> bool:
    """Return whether two trees are equal, ignoring positions."""
    if a is b:
        return True
    if type(a) is not type(b):
        return False
    if isinstance(a, ast.AST):
        return all(is_same_tree(getattr(a, name, None), getattr(b, name, None)) for name in a._fields if name != "ctx")
    return a == b if not isinstance(a, list) else len(a) == len(b) and all(map(is_same_tree, a, b))
