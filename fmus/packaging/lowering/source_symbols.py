"""Symbols of the runtime sources by name: vector attributes, results, constants, elementwise functions."""

import ast
from collections.abc import Iterable
from typing import Any, TypeGuard

from ..syntax_trees import all_nodes, parsed_module, parsed_nodes
from .layout import CONTACTS, NAMED_VECTOR, STATES, ModelLayout

VECTOR_KINDS = {"StateVector": STATES, "RateVector": STATES, "ContactVector": CONTACTS}


class SourceSymbols:
    """Symbols of all files of the runtime, and the results of the operations in vectors.py."""

    def __init__(self, texts: Iterable[str], vector_operations: str) -> None:
        self.vector_attributes: dict[str, str] = {}
        self.assigned_attributes: set[str] = set()
        self.constants: dict[str, Any] = {}
        self.elementwise: set[str] = set()
        self.module_names: set[str] = set()  # module-level names: constants, functions, classes
        self.class_attributes: list[set[str]] = []  # attribute names of each class
        self.result_kinds: dict[str, list[str | None]] = {}
        for function in parsed_module(vector_operations).body:
            if isinstance(function, ast.FunctionDef):
                self.read_results(function)
        for text in texts:
            self.read_file(parsed_module(text))
            for node in parsed_nodes(text):
                self.read_node(node)

    def read_node(self, node: ast.AST) -> None:
        """Collect the symbols of one node."""
        match node:
            case ast.AnnAssign(target=ast.Name(id=name)) if kind := annotated_kind(node):
                self.vector_attributes[name] = kind
            case ast.Attribute(attr=name, ctx=ast.Store()):
                self.assigned_attributes.add(name)
            case ast.ClassDef():
                names = {getattr(one.targets[0], "id", "") for one in node.body if isinstance(one, ast.Assign)}
                self.class_attributes.append(names | {one.attr for one in all_nodes(node) if is_self_assignment(one)})
            case ast.FunctionDef(name=name):
                self.read_results(node)
                if any(isinstance(one, ast.Name) and one.id == "elementwise" for one in node.decorator_list):
                    self.elementwise.add(name)

    def read_results(self, node: ast.FunctionDef) -> None:
        """Collect the kinds of the results of a function."""
        if kinds := annotated_results(node):
            self.result_kinds[node.name] = kinds

    def find_name_clash(self, spec: ModelLayout) -> str:
        """Return a name of the model that already has another meaning in the runtime, or ""."""
        clashes = self.module_names & {*spec.states, *spec.states.values(), *spec.contacts}
        for names in self.class_attributes:
            vectors = filter(NAMED_VECTOR.fullmatch, names)
            kinds = [(vector, self.attribute_kind(vector) or STATES) for vector in vectors]
            clashes |= names & {
                spec.component_name(v, kind, i) for v, kind in kinds for i in range(len(spec.component_names(kind)))
            }
        return min(clashes, default="")

    def read_file(self, node: ast.Module) -> None:
        """Collect the module-level names and constants of a file."""
        for statement in node.body:
            if isinstance(statement, (ast.FunctionDef, ast.ClassDef)):
                self.module_names.add(statement.name)
            if isinstance(statement, ast.ImportFrom):
                self.module_names.update(alias.name for alias in statement.names)
            if isinstance(statement, ast.Assign):
                target, value = statement.targets[0], statement.value
                pairs = [(target, value)]
                if isinstance(target, ast.Tuple) and isinstance(value, ast.Tuple):
                    pairs = list(zip(target.elts, value.elts, strict=True))
                for one, what in pairs:
                    if isinstance(one, ast.Name):
                        self.module_names.add(one.id)
                        self.constants[one.id] = item_label(what) or getattr(what, "value", None)

    def attribute_kind(self, name: str) -> str | None:
        """Return what an attribute runs over (states or contacts); None for a scalar."""
        stem = NAMED_VECTOR.fullmatch(name)
        return self.vector_attributes.get(name) or ((CONTACTS if stem[1] == "modes" else STATES) if stem else None)


def is_self_assignment(node: ast.AST) -> TypeGuard[ast.Attribute]:
    """Return whether this node sets an attribute of self."""
    return (
        isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Store) and getattr(node.value, "id", "") == "self"
    )


def annotated_kind(node: ast.arg | ast.AnnAssign) -> str | None:
    """Return what a name with this annotation runs over."""
    return VECTOR_KINDS.get(node.annotation.id) if isinstance(node.annotation, ast.Name) else None


def annotated_results(node: ast.FunctionDef) -> list[str | None]:
    """Return the kinds in the result annotation; empty if none is a vector."""
    parts = node.returns
    if isinstance(parts, ast.Subscript):
        parts = parts.slice
    names = parts.elts if isinstance(parts, ast.Tuple) else [parts]
    kinds = [VECTOR_KINDS.get(getattr(name, "id", "")) for name in names]
    return kinds if any(kinds) else []


def item_label(node: ast.AST) -> str:
    """Return the label of an enumeration item (label, value, sentence), else ""."""
    match node:
        case ast.Tuple(elts=[ast.Constant(value=str(text)), _, _]):
            return text
    return ""
