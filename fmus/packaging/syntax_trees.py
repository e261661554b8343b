"""Trees of Python, of which most are looked at again and again: read once, and shared where they do not change."""

import ast
from functools import lru_cache
from operator import is_
from typing import Any, TypeVar

Node = TypeVar("Node", bound=ast.AST)
NON_NODE_FIELDS = {"ctx", "id", "attr", "arg", "name", "asname", "module", "level", "kind", "type_comment"}
NODE_TYPES = [one for one in vars(ast).values() if isinstance(one, type) and issubclass(one, ast.AST)]
CHILD_FIELDS = {kind: [name for name in kind._fields if name not in NON_NODE_FIELDS] for kind in NODE_TYPES} | {
    ast.Constant: []
}


@lru_cache(200)
def parsed_nodes(text: str) -> list[ast.AST]:
    """Every node of a text, its tree first; nobody changes them."""
    return all_nodes(ast.parse(text))


def parsed_module(text: str) -> ast.Module:
    """The tree itself."""
    found = parsed_nodes(text)[0]
    assert isinstance(found, ast.Module)
    return found


def child_nodes(node: ast.AST) -> list[ast.AST]:
    """The nodes one level down; not whether something is read or written."""
    found: list[ast.AST] = []
    for name in CHILD_FIELDS[type(node)]:
        value = getattr(node, name, None)
        if isinstance(value, list):
            found += [one for one in value if isinstance(one, ast.AST)]
        elif isinstance(value, ast.AST):
            found.append(value)
    return found


def all_nodes(root: ast.AST) -> list[ast.AST]:
    """A tree and all that is in it, in the order of ast.walk."""
    found = [root]
    for node in found:  # which grows on the way
        found += child_nodes(node)
    return found


class TreeTransformer:
    """What becomes of a tree: visit_Name(node) and its like say it of a kind of nodes, and tell it of the node itself
    where nothing does.  No tree is changed: what is new holds those parts of the old that stay."""

    def visit(self, node: ast.AST) -> Any:
        return getattr(self, f"visit_{type(node).__name__}", self.generic_visit)(node)

    def generic_visit(self, node: Node) -> Node:
        found = {}
        for name in CHILD_FIELDS[type(node)]:
            value = getattr(node, name, None)
            if isinstance(value, list):
                found[name] = [self.visit(one) if isinstance(one, ast.AST) else one for one in value]
            elif isinstance(value, ast.AST):
                found[name] = self.visit(value)
        return replace_fields(node, **found) if found else node


def replace_fields(node: Node, **parts: Any) -> Node:
    """A node with these parts in place of its own; the node itself, if they are its own."""
    its = vars(node)
    for name, part in parts.items():
        old = its[name]
        if part is not old and not (isinstance(old, list) and len(part) == len(old) and all(map(is_, part, old))):
            made = node.__new__(type(node))
            vars(made).update(its | parts)
            return made
    return node


def is_same_tree(a: Any, b: Any) -> bool:
    """Whether two trees say the same, wherever they stand."""
    if a is b:
        return True
    if type(a) is not type(b):
        return False
    if isinstance(a, ast.AST):
        return all(is_same_tree(getattr(a, name, None), getattr(b, name, None)) for name in a._fields if name != "ctx")
    return a == b if not isinstance(a, list) else len(a) == len(b) and all(map(is_same_tree, a, b))
