"""Removes functions that nothing calls and imports that nothing reads, so that an FMU omits modules it does not need.

A function is kept if code that is kept contains its name, whatever object has that name there.
"""

import ast
from collections import defaultdict
from collections.abc import Mapping
from typing import TypeGuard

from ..syntax_trees import all_nodes, replace_fields

FMI_LAYER = frozenset(  # kept whole: importers and the C sources call its functions
    f"runtime/{name}.py"
    for name in (
        *("call_sequence", "early_return", "failure_handling", "model_instance", "messages", "model_exchange"),
        *("pythonfmu_workarounds", "saved_state", "slave", "variable_access", "variable_declarations"),
    )
)


def remove_unused_code(files: Mapping[str, ast.Module]) -> dict[str, ast.Module]:
    """Remove unused functions and imports from the files of an FMU."""
    called_by: defaultdict[str, set[str]] = defaultdict(set)  # name of functions -> names in them
    pending: list[str] = []  # names in all other code
    for path, tree in files.items():
        for node in tree.body:
            for part in [*node.bases, *node.body] if isinstance(node, ast.ClassDef) else [node]:
                if is_removable(part) and path not in FMI_LAYER:
                    called_by[part.name] |= names_in(part)
                else:
                    pending += names_in(part)
    used: set[str] = set()
    while pending:
        name = pending.pop()
        if name not in used:
            used.add(name)
            pending += called_by[name]
    return {path: tree if path in FMI_LAYER else prune(tree, used) for path, tree in files.items()}


def is_removable(node: ast.AST) -> TypeGuard[ast.FunctionDef]:
    """Return whether this is a function that runs only if its name is used."""
    return isinstance(node, ast.FunctionDef) and not node.name.startswith("__")


def names_in(root: ast.AST) -> set[str]:
    """Return all names and attributes in some code, and names that it has as text."""
    result = set()
    for node in all_nodes(root):
        match node:
            case ast.Name(id=name) | ast.Attribute(attr=name) | ast.Constant(value=str(name)):
                result.add(name)
    return result


def prune(tree: ast.Module, used: set[str]) -> ast.Module:
    """Remove functions whose names are not used, then imports that the file does not read."""

    def keep(statements: list[ast.stmt]) -> list[ast.stmt]:
        return [node for node in statements if not (is_removable(node) and node.name not in used)]

    body = [
        replace_fields(node, body=keep(node.body) or [ast.copy_location(ast.Pass(), node)])
        if isinstance(node, ast.ClassDef)
        else node
        for node in keep(tree.body)
    ]
    read = {name for node in body for name in names_in(node)}
    result: list[ast.stmt] = []
    for node in body:
        if isinstance(node, ast.ImportFrom) and node.module != "__future__":
            aliases = [alias for alias in node.names if (alias.asname or alias.name) in read]
            result += [replace_fields(node, names=aliases)] if aliases else []
        else:
            result.append(node)
    return ast.Module(result, [])
