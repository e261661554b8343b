"""Symbols of the runtime sources by name: vector attributes, results, constants, elementwise functions."""

import ast
import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import count
from typing import Any, TypeGuard, TypeVar

from .. import BuildError
from ..syntax_trees import all_nodes, parsed_module, parsed_nodes
from .layout import CONDITIONS, CONTACTS, NAMED_VECTOR, STATES, stage_name

# functions of vectors, component by component: to scalars; by the kind of rates
ELEMENTWISE = {
    "magnitude": "{0} if {0} > 0.0 else -{0}",
    "elementwise_max": "{0} if {0} > {1} else {1}",
}
SELECTIONS = ("select_kinematic", "dynamic_part", "kinematic_rates", "complete_rates")
named_vector = cache(NAMED_VECTOR.fullmatch)  # thousands of names, most of them several times
PREFIX = "own_"  # of names of a model that look like those of vectors
Key = TypeVar("Key", str, int)
VECTOR_KINDS = {"StateVector": STATES, "RateVector": STATES, "ContactVector": CONTACTS, "ConditionVector": CONDITIONS}


@dataclass(frozen=True)
class Scope:
    """Names of a function, or of the attributes of a class: scalars, vectors such as y2, and other vectors."""

    scalars: set[str]
    named_vectors: list[re.Match[str]]
    other_vectors: set[str]
    has_jacobian: bool

    @classmethod
    def of(cls, names: set[str], vectors: set[str], kept: Collection[str] = (), has_jacobian: bool = False) -> "Scope":
        """Sort names by kind; `kept` are vectors that may be lowered to a scalar of the same name."""
        named = [match for match in map(named_vector, names) if match]
        others = vectors - {match[0] for match in named}
        return cls((names - others).union(kept) - {match[0] for match in named}, named, others, has_jacobian)


class SourceSymbols:
    """Symbols of all files of the runtime, and the results of the operations in vectors.py."""

    def __init__(self, texts: Iterable[str], vector_operations: str) -> None:
        self.vector_attributes: dict[str, str] = {}
        self.states_of_rates: dict[str, str] = {}  # attribute with rates -> attribute with their states
        self.constants: dict[str, Any] = {}
        self.elementwise: set[str] = set()
        self.module_names: set[str] = set()  # module-level names: constants, functions, classes
        self.scopes: list[Scope] = []  # functions, and attributes of classes
        functions: list[ast.FunctionDef] = []
        self.result_kinds: dict[str, list[str | None]] = {}  # of functions that return vectors
        # of functions that return rates: place of the rates -> place of their states; negative places are arguments
        self.states_of_results: dict[str, dict[int, int]] = {}
        self.jacobians: set[str] = set()  # functions that return the derivatives of the rates
        scalars: dict[str, str] = {}  # attributes without declaration -> a class that has them
        for function in parsed_module(vector_operations).body:
            if isinstance(function, ast.FunctionDef):
                self.read_results(function)
        for text in texts:
            self.read_file(parsed_module(text))
            for node in parsed_nodes(text):
                self.read_node(node, scalars)
            functions += [node for node in parsed_nodes(text) if isinstance(node, ast.FunctionDef)]
        if ambiguous := min(scalars.keys() & self.vector_attributes, default=""):
            raise BuildError(f"{scalars[ambiguous]} does not declare {ambiguous}, a vector in another class.")
        self.scopes += map(self.function_scope, functions)
        self.suffixes: dict[str, set[str]] = {"y": set(), "f": set(), "modes": set()}  # of vectors named y2, f2, modes0
        for match in (match for scope in self.scopes for match in scope.named_vectors):
            self.suffixes[match[1]].add(match[2])

    def read_node(self, node: ast.AST, scalars: dict[str, str]) -> None:
        """Collect the symbols of one node."""
        match node:
            case ast.ClassDef():
                names = {getattr(part.targets[0], "id", "") for part in node.body if isinstance(part, ast.Assign)}
                names |= {part.attr for part in all_nodes(node) if is_self_assignment(part)}
                declared = {part.target.id: part for part in node.body if is_vector_declaration(part)}
                for name, part in declared.items():
                    kind = annotated_kind(part) or ""
                    if self.vector_attributes.setdefault(name, kind) != kind:
                        raise BuildError(f"{node.name} declares {name} as another vector than another class.")
                pairs = pair_rates([(name, part.annotation) for name, part in declared.items()])
                self.states_of_rates |= pairs
                scalars |= dict.fromkeys(names - declared.keys(), node.name)
                self.scopes.append(Scope.of(names, {*declared}))
            case ast.FunctionDef(name=name):
                self.read_results(node)
                if any(isinstance(mark, ast.Name) and mark.id == "elementwise" for mark in node.decorator_list):
                    self.elementwise.add(name)

    def read_results(self, node: ast.FunctionDef) -> None:
        """Collect the results of a function."""
        if isinstance(node.returns, ast.Name) and node.returns.id == "Derivatives":
            self.jacobians.add(node.name)
        if kinds := annotated_results(node):
            self.result_kinds[node.name] = kinds
            arguments = [argument for argument in node.args.args if argument.arg != "self"]
            types = [(n - len(arguments), argument.annotation) for n, argument in enumerate(arguments)]
            pairs = pair_rates([*types, *enumerate(result_types(node))])
            self.states_of_results[node.name] = {rates: states for rates, states in pairs.items() if rates >= 0}

    def function_scope(self, function: ast.FunctionDef) -> "Scope":
        """Return the names in a function; a name is a vector if it is annotated or a vector is assigned to it."""
        names, assignments = {argument.arg for argument in function.args.args}, []
        has_jacobian = False
        for node in all_nodes(function):
            if isinstance(node, ast.Name):
                names.add(node.id)
            elif isinstance(node, ast.Attribute):
                has_jacobian = has_jacobian or node.attr in self.jacobians
            elif isinstance(node, ast.Assign):
                assignments.append(node)
        kinds = {argument.arg: annotated_kind(argument) for argument in function.args.args}
        elementwise = {*ELEMENTWISE, *SELECTIONS, *self.elementwise}

        def kind_of(e: ast.expr, place: int = 0) -> str | None:
            match e:
                case ast.Name(id=name):
                    return kinds.get(name)
                case ast.Attribute(attr=name):
                    return self.vector_attributes.get(name)
                case ast.BinOp(left=left, right=right):
                    return kind_of(left) or kind_of(right)
                case ast.UnaryOp(operand=operand):
                    return kind_of(operand)
                case ast.Call(func=ast.Name(id=name), args=args) if name in elementwise:
                    return next(filter(None, map(kind_of, args)), None)
                case ast.Call(func=ast.Name(id=name) | ast.Attribute(attr=name)):
                    results = [STATES] if name in self.jacobians else self.result_kinds.get(name, [])
                    return results[place] if place < len(results) else None
            return None

        for node in sorted(assignments, key=lambda node: node.lineno):
            for target in node.targets:
                targets = target.elts if isinstance(target, ast.Tuple) else [target]
                values = node.value.elts if isinstance(node.value, ast.Tuple) else [node.value] * len(targets)
                for place, (target, value) in enumerate(zip(targets, values, strict=False)):
                    if isinstance(target, ast.Name) and (kind := kind_of(value, place)):
                        kinds[target.id] = kind
        vectors = {name for name, kind in kinds.items() if kind}
        # a vector over a single contact keeps its name
        return Scope.of(names, vectors, {name for name in vectors if kinds[name] == CONTACTS}, has_jacobian)

    def stage_separator(self, states: Mapping[str, str], modes: Iterable[str]) -> str:
        """Return the separator of names and numbers of stages for which no stage is named like a variable of the model.

        It is empty for most models, and an underscore for one with the states x and x2, whose stages are x_2 and x2_2.
        """
        stems = stems_of_names(states, modes)
        for separator in ("_" * n for n in count()):
            stages = [self._components(name, stem_names, separator) - {name} for name, stem_names in stems.items()]
            if len(stems.keys() | set().union(*stages)) == len(stems) + sum(map(len, stages)):
                return separator
        raise AssertionError

    def resolve_names(self, states: Mapping[str, str], modes: Iterable[str], separator: str) -> dict[str, str]:
        """Return the names of states, rates and modes in the runtime.

        They are those of the model, with underscores where a component of a vector would get a name that has another
        meaning in the same function or class of the runtime, or is a component of another vector.  A name like y_1,
        which is that of a vector whatever follows it, gets a prefix.
        """
        stems, result = stems_of_names(states, modes), {}
        vectors = {vector for scope in self.scopes if scope.named_vectors for vector in scope.other_vectors}
        used_names = {f"{vector}_{name}" for vector in vectors for name in stems}
        used_names |= {f"{rate}_{state}" for rate in states.values() for state in states}  # entries of the Jacobian
        for name, stem_names in stems.items():
            first = f"{PREFIX}{name}" if NAMED_VECTOR.fullmatch(f"{name}_") else name
            candidates = (first + "_" * n for n in count())
            result[name] = next(
                candidate
                for candidate in candidates
                if (candidate == name or candidate not in stems)
                and used_names.isdisjoint(self._components(candidate, stem_names, separator))
                and self._is_free(candidate, stem_names, separator)
            )
            used_names |= self._components(result[name], stem_names, separator)
        return result

    def _components(self, name: str, stems: set[str], separator: str) -> set[str]:
        """Return the names that the components of all vectors get from a name."""
        return {stage_name(name, suffix, separator) for stem in stems for suffix in self.suffixes[stem]}

    def _is_free(self, name: str, stems: set[str], separator: str) -> bool:
        """Return whether no component named after `name` has another meaning in the runtime."""
        for scope in self.scopes:
            components = {stage_name(name, match[2], separator) for match in scope.named_vectors if match[1] in stems}
            components |= {f"{vector}_{name}" for vector in scope.other_vectors}
            if not components.isdisjoint(scope.scalars):
                return False
            if scope.has_jacobian and "f" in stems and name in scope.other_vectors:
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
                for name, constant in pairs:
                    if isinstance(name, ast.Name):
                        self.module_names.add(name.id)
                        self.constants[name.id] = item_label(constant) or getattr(constant, "value", None)


def stems_of_names(states: Mapping[str, str], modes: Iterable[str]) -> dict[str, set[str]]:
    """Return the names of a model with the stems of the vectors whose components are named after them."""
    result: dict[str, set[str]] = {name: set() for name in (*states, *states.values(), *modes)}
    for stem, names in ("y", states), ("f", states.values()), ("modes", modes):
        for name in names:
            result[name].add(stem)
    return result


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


def pair_rates(types: Sequence[tuple[Key, ast.expr | None]]) -> dict[Key, Key]:
    """Return for each RateVector the StateVector declared last before it."""
    result, states = {}, None
    for key, annotation in types:
        if type_name(annotation) == "StateVector":
            states = key
        elif type_name(annotation) == "RateVector":
            if states is None:
                raise BuildError(
                    f"The RateVector {key} follows no StateVector; write StateVector to store it as a whole."
                )
            result[key] = states
    return result


def item_label(node: ast.AST) -> str:
    """Return the label of an enumeration item (label, value, sentence), else ""."""
    match node:
        case ast.Tuple(elts=[ast.Constant(value=str(text)), _, _]):
            return text
    return ""
