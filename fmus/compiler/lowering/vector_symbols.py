"""Symbols of the runtime sources by name: vector attributes, results, constants, elementwise functions."""

import ast
from collections.abc import Iterable
from typing import Any, TypeGuard

from .. import BuildError
from ..syntax_trees import all_nodes, parsed_module, parsed_nodes
from .layout import CONDITIONS, CONTACTS, STATES

SELECTIONS = ("select_angles", "select_kinematic", "kinematic_rates")
VECTOR_KINDS = {"StateVector": STATES, "Rates": STATES, "ContactVector": CONTACTS, "ConditionVector": CONDITIONS}


class SourceSymbols:
    """Symbols of all files of the runtime, and the results of the operations in vectors.py."""

    def __init__(self, texts: Iterable[str], vector_operations: str) -> None:
        self.vector_attributes: dict[str, str] = {}
        self.constants: dict[str, Any] = {}
        self.elementwise: set[str] = set()
        self.inlined_functions: dict[str, tuple[list[str], ast.expr]] = {}  # parameters and expression
        self.result_kinds: dict[str, list[str | None]] = {}  # of functions that return vectors
        self.rates: set[str] = set()  # functions that return rates, without those that are states
        self.jacobians: set[str] = set()  # functions that return the derivatives of the rates
        scalars: dict[str, str] = {}  # attributes without declaration -> a class that has them
        for function in parsed_module(vector_operations).body:
            if isinstance(function, ast.FunctionDef):
                self.read_node(function, scalars)
        for text in texts:
            self.read_file(parsed_module(text))
            for node in parsed_nodes(text):
                self.read_node(node, scalars)
        if ambiguous := min(scalars.keys() & self.vector_attributes, default=""):
            raise BuildError(f"{scalars[ambiguous]} does not declare {ambiguous}, a vector in another class.")

    def read_node(self, node: ast.AST, scalars: dict[str, str]) -> None:
        """Collect the symbols of one node."""
        match node:
            case ast.ClassDef():
                names = {getattr(part.targets[0], "id", "") for part in node.body if isinstance(part, ast.Assign)}
                names |= {part.attr for part in all_nodes(node) if is_self_assignment(part)}
                vectors = {part.target.id: part for part in node.body if is_vector_declaration(part)}
                for name, part in vectors.items():
                    kind = annotated_kind(part) or ""
                    if self.vector_attributes.setdefault(name, kind) != kind:
                        raise BuildError(f"{node.name} declares {name} as another vector than another class.")
                scalars |= dict.fromkeys(names - vectors.keys(), node.name)
                prefixes = tuple(f"{name}_" for name in vectors)
                if name := min((name for name in names - vectors.keys() if name.startswith(prefixes)), default=""):
                    raise BuildError(f"{node.name}.{name} is named like a component of a vector; take another name.")
            case ast.FunctionDef(name=name):
                self.read_results(node)
                if is_marked(node, "elementwise"):
                    self.elementwise.add(name)
                if is_marked(node, "inlined") and isinstance(node.body[-1], ast.Return) and node.body[-1].value:
                    self.inlined_functions[name] = [argument.arg for argument in node.args.args], node.body[-1].value

    def read_results(self, node: ast.FunctionDef) -> None:
        """Collect the results of a function."""
        if type_name(node.returns) == "Derivatives":
            self.jacobians.add(node.name)
        if type_name(node.returns) == "Rates":
            self.rates.add(node.name)
        if kinds := annotated_results(node):
            self.result_kinds[node.name] = kinds

    def read_file(self, node: ast.Module) -> None:
        """Collect the constants of a file."""
        for statement in node.body:
            if isinstance(statement, ast.Assign):
                target, value = statement.targets[0], statement.value
                pairs = [(target, value)]
                if isinstance(target, ast.Tuple) and isinstance(value, ast.Tuple):
                    pairs = list(zip(target.elts, value.elts, strict=True))
                for name, constant in pairs:
                    if isinstance(name, ast.Name):
                        self.constants[name.id] = item_label(constant) or getattr(constant, "value", None)


def is_marked(node: ast.FunctionDef, word: str) -> bool:
    """Return whether a function has a decorator."""
    return any(isinstance(mark, ast.Name) and mark.id == word for mark in node.decorator_list)


def is_self_assignment(node: ast.AST) -> TypeGuard[ast.Attribute]:
    """Return whether this node sets an attribute of self."""
    return (
        isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Store) and getattr(node.value, "id", "") == "self"
    )


def is_vector_declaration(node: ast.AST) -> TypeGuard[Any]:
    """Return whether this declares an attribute of a class as a vector."""
    return isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name) and annotated_kind(node) is not None


def annotated_kind(node: ast.arg | ast.AnnAssign) -> str | None:
    """Return what a name with this annotation runs over."""
    return VECTOR_KINDS.get(type_name(node.annotation))


def annotated_results(node: ast.FunctionDef) -> list[str | None]:
    """Return the kinds in the result annotation; empty if none is a vector."""
    kinds = [VECTOR_KINDS.get(type_name(annotation)) for annotation in result_types(node)]
    return kinds if any(kinds) else []


def result_types(node: ast.FunctionDef) -> list[ast.expr | None]:
    """Return the types of the results."""
    parts = node.returns
    if isinstance(parts, ast.Subscript):
        parts = parts.slice
    return [*parts.elts] if isinstance(parts, ast.Tuple) else [parts]


def type_name(annotation: ast.expr | None) -> str:
    """Return the name of a simple type, else ""."""
    return annotation.id if isinstance(annotation, ast.Name) else ""


def item_label(node: ast.AST) -> str:
    """Return the label of an enumeration item (label, value, sentence), else ""."""
    match node:
        case ast.Tuple(elts=[ast.Constant(value=str(text)), _, _]):
            return text
    return ""
