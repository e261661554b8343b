"""Symbols of the runtime sources by name: vector attributes, results, constants, elementwise functions."""

import ast
import re
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from itertools import count
from typing import Any, TypeGuard

from ..syntax_trees import all_nodes, parsed_module, parsed_nodes
from .layout import CONTACTS, NAMED_VECTOR, STATES, stage_name

# functions of vectors, component by component: to scalars; by the kind of rates
ELEMENTWISE = {
    "magnitude": "{0} if {0} > 0.0 else -{0}",
    "elementwise_max": "{0} if {0} > {1} else {1}",
}
SELECTIONS = ("select_kinematic", "dynamic_part", "kinematic_rates")
named_vector = cache(NAMED_VECTOR.fullmatch)  # thousands of names, most of them several times
PREFIX = "own_"  # of names of a model that look like those of vectors
VECTOR_KINDS = {"StateVector": STATES, "RateVector": STATES, "ContactVector": CONTACTS}


@dataclass(frozen=True)
class Scope:
    """Names of a function, or of the attributes of a class: scalars, vectors such as y2, and other vectors."""

    scalars: set[str]
    named_vectors: list[re.Match[str]]
    other_vectors: set[str]

    @classmethod
    def of(cls, names: set[str], vectors: set[str], kept: Collection[str] = ()) -> "Scope":
        """Sort names by kind; `kept` are vectors that may be lowered to a scalar of the same name."""
        named = [match for match in map(named_vector, names) if match]
        others = vectors - {match[0] for match in named}
        return cls((names - others).union(kept) - {match[0] for match in named}, named, others)


class SourceSymbols:
    """Symbols of all files of the runtime, and the results of the operations in vectors.py."""

    def __init__(self, texts: Iterable[str], vector_operations: str) -> None:
        self.vector_attributes: dict[str, str] = {}
        self.assigned_attributes: set[str] = set()
        self.constants: dict[str, Any] = {}
        self.elementwise: set[str] = set()
        self.module_names: set[str] = set()  # module-level names: constants, functions, classes
        self.scopes: list[Scope] = []  # functions, and attributes of classes
        functions: list[ast.FunctionDef] = []
        self.result_kinds: dict[str, list[str | None]] = {}
        for function in parsed_module(vector_operations).body:
            if isinstance(function, ast.FunctionDef):
                self.read_results(function)
        for text in texts:
            self.read_file(parsed_module(text))
            for node in parsed_nodes(text):
                self.read_node(node)
            functions += [node for node in parsed_nodes(text) if isinstance(node, ast.FunctionDef)]
        self.scopes += map(self.function_scope, functions)
        self.suffixes: dict[str, set[str]] = {"y": set(), "f": set(), "modes": set()}  # of vectors named y2, f2, modes0
        for match in (match for scope in self.scopes for match in scope.named_vectors):
            self.suffixes[match[1]].add(match[2])

    def read_node(self, node: ast.AST) -> None:
        """Collect the symbols of one node."""
        match node:
            case ast.AnnAssign(target=ast.Name(id=name)) if kind := annotated_kind(node):
                self.vector_attributes[name] = kind
            case ast.Attribute(attr=name, ctx=ast.Store()):
                self.assigned_attributes.add(name)
            case ast.ClassDef():
                names = {getattr(one.targets[0], "id", "") for one in node.body if isinstance(one, ast.Assign)}
                names |= {one.attr for one in all_nodes(node) if is_self_assignment(one)}
                annotated = {getattr(one.target, "id", "") for one in node.body if isinstance(one, ast.AnnAssign)}
                self.scopes.append(Scope.of(names, annotated & {*self.vector_attributes}))
            case ast.FunctionDef(name=name):
                self.read_results(node)
                if any(isinstance(one, ast.Name) and one.id == "elementwise" for one in node.decorator_list):
                    self.elementwise.add(name)

    def read_results(self, node: ast.FunctionDef) -> None:
        """Collect the kinds of the results of a function."""
        if kinds := annotated_results(node):
            self.result_kinds[node.name] = kinds

    def function_scope(self, function: ast.FunctionDef) -> "Scope":
        """Return the names in a function; a name is a vector if it is annotated or a vector is assigned to it."""
        names, assignments = {one.arg for one in function.args.args}, []
        for node in all_nodes(function):
            if isinstance(node, ast.Name):
                names.add(node.id)
            elif isinstance(node, ast.Assign):
                assignments.append(node)
        kinds = {one.arg: annotated_kind(one) for one in function.args.args}
        kinds |= {one: self.attribute_kind(one) for one in names if named_vector(one)}
        elementwise = {*ELEMENTWISE, *SELECTIONS, *self.elementwise}

        def kind_of(e: ast.expr, place: int = 0) -> str | None:
            match e:
                case ast.Name(id=name):
                    return kinds.get(name)
                case ast.Attribute(attr=name):
                    return self.attribute_kind(name)
                case ast.BinOp(left=left, right=right):
                    return kind_of(left) or kind_of(right)
                case ast.UnaryOp(operand=operand):
                    return kind_of(operand)
                case ast.Call(func=ast.Name(id=name), args=args) if name in elementwise:
                    return next(filter(None, map(kind_of, args)), None)
                case ast.Call(func=ast.Name(id=name) | ast.Attribute(attr=name)):
                    results = self.result_kinds.get(name, [])
                    return results[place] if place < len(results) else None
            return None

        for node in sorted(assignments, key=lambda one: one.lineno):
            for target in node.targets:
                targets = target.elts if isinstance(target, ast.Tuple) else [target]
                values = node.value.elts if isinstance(node.value, ast.Tuple) else [node.value] * len(targets)
                for place, (one, value) in enumerate(zip(targets, values, strict=False)):
                    if isinstance(one, ast.Name) and (kind := kind_of(value, place)):
                        kinds[one.id] = kind
        vectors = {name for name, kind in kinds.items() if kind}
        # a vector over a single contact keeps its name
        return Scope.of(names, vectors, {name for name in vectors if kinds[name] == CONTACTS})

    def resolve_names(self, states: Mapping[str, str], modes: Iterable[str]) -> dict[str, str]:
        """Return the names of states, rates and modes in the runtime.

        They are those of the model, with underscores where a component of a vector would get a name that has another
        meaning in the same function or class, or is a component of another vector.  A name like y_1, which is that of a
        vector whatever follows it, gets a prefix.
        """
        stems: dict[str, set[str]] = {name: set() for name in (*states, *states.values(), *modes)}
        for stem, names in ("y", states), ("f", states.values()), ("modes", modes):
            for name in names:
                stems[name].add(stem)
        result: dict[str, str] = {}
        vectors = {vector for scope in self.scopes if scope.named_vectors for vector in scope.other_vectors}
        used = {f"{vector}_{name}" for vector in vectors for name in stems}
        used |= {f"{rate}_{state}" for rate in states.values() for state in states}  # entries of the Jacobian
        for name, own in stems.items():
            first = f"{PREFIX}{name}" if NAMED_VECTOR.fullmatch(f"{name}_") else name
            candidates = (first + "_" * n for n in count())
            result[name] = next(
                one
                for one in candidates
                if (one == name or one not in stems)
                and used.isdisjoint(self._components(one, own))
                and self._is_free(one, own)
            )
            used |= self._components(result[name], own)
        return result

    def _components(self, name: str, stems: set[str]) -> set[str]:
        """Return the names that the components of all vectors get from a name."""
        return {stage_name(name, suffix) for stem in stems for suffix in self.suffixes[stem]}

    def _is_free(self, name: str, stems: set[str]) -> bool:
        """Return whether no component named after `name` has another meaning in the runtime."""
        for scope in self.scopes:
            components = {stage_name(name, match[2]) for match in scope.named_vectors if match[1] in stems}
            components |= {f"{one}_{name}" for one in scope.other_vectors}
            if not components.isdisjoint(scope.scalars):
                return False
            if "J" in scope.scalars and "f" in stems and name in scope.other_vectors:
                return False  # components of this vector would be named like entries of the Jacobian
        return name not in self.module_names and not NAMED_VECTOR.fullmatch(name)

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
        stem = named_vector(name)
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
