"""What all sources say of attributes and results, by name; their constants; functions that take vectors by number."""

import ast
from collections.abc import Iterable
from typing import Any, TypeGuard

from ..trees import nodes, tree, walked
from .spec import CONTACTS, STATES, STEM, Spec

KINDS = {"StateVector": STATES, "RateVector": STATES, "ContactVector": CONTACTS}


class Declarations:
    """Of the files of the numerics."""

    def __init__(self, texts: Iterable[str]) -> None:
        self.attributes: dict[str, str] = {}
        self.stored: set[str] = set()
        self.constants: dict[str, Any] = {}
        self.each: set[str] = set()
        self.words: set[str] = set()  # what files call their own: constants, functions, classes
        self.classes: list[set[str]] = []  # the attributes of each class
        self.results: dict[str, list[str | None]] = {
            "initial_state": [STATES],
            "rates": [STATES],
            "kinematic_rates": [STATES],
            "apply_impulses": [STATES],
            "slip_velocities": [CONTACTS],
            "slip_magnitudes": [CONTACTS],
            "contact_forces": [CONTACTS] * 3,
            "contact_rates": [CONTACTS] * 4,
            "solve_factored": [STATES],
            "state_vector": [STATES],
            "contact_vector": [CONTACTS],
        }
        for text in texts:
            self.read_file(tree(text))
            for node in nodes(text):
                self.read(node)

    def read(self, node: ast.AST) -> None:
        """What one node says."""
        match node:
            case ast.AnnAssign(target=ast.Name(id=name)) if kind := annotated(node):
                self.attributes[name] = kind
            case ast.Attribute(attr=name, ctx=ast.Store()):
                self.stored.add(name)
            case ast.ClassDef():
                names = {getattr(one.targets[0], "id", "") for one in node.body if isinstance(one, ast.Assign)}
                self.classes.append(names | {one.attr for one in walked(node) if is_own(one)})
            case ast.FunctionDef(name=name):
                if kinds := returned(node):
                    self.results[name] = kinds
                if any(isinstance(one, ast.Name) and one.id == "elementwise" for one in node.decorator_list):
                    self.each.add(name)

    def clash(self, spec: Spec) -> str:
        """A name of the model that means something else in the numerics, if there is one."""
        found = self.words & {*spec.states, *spec.states.values(), *spec.contacts}
        for names in self.classes:
            vectors = filter(STEM.fullmatch, names)
            kinds = [(vector, self.attribute(vector) or STATES) for vector in vectors]
            found |= names & {spec.number(v, kind, i) for v, kind in kinds for i in range(len(spec.parts(kind)))}
        return min(found, default="")

    def read_file(self, node: ast.Module) -> None:
        """What a file calls its own."""
        for statement in node.body:
            if isinstance(statement, (ast.FunctionDef, ast.ClassDef)):
                self.words.add(statement.name)
            if isinstance(statement, ast.ImportFrom):
                self.words.update(alias.name for alias in statement.names)
            if isinstance(statement, ast.Assign):
                target, value = statement.targets[0], statement.value
                pairs = [(target, value)]
                if isinstance(target, ast.Tuple) and isinstance(value, ast.Tuple):
                    pairs = list(zip(target.elts, value.elts, strict=True))
                for one, what in pairs:
                    if isinstance(one, ast.Name):
                        self.words.add(one.id)
                        self.constants[one.id] = label(what) or getattr(what, "value", None)

    def attribute(self, name: str) -> str | None:
        """What an attribute runs over; None for a number."""
        stem = STEM.fullmatch(name)
        return self.attributes.get(name) or ((CONTACTS if stem[1] == "modes" else STATES) if stem else None)


def is_own(node: ast.AST) -> TypeGuard[ast.Attribute]:
    """Whether this sets an attribute of self."""
    return (
        isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Store) and getattr(node.value, "id", "") == "self"
    )


def annotated(node: ast.arg | ast.AnnAssign) -> str | None:
    """What an annotation makes a name run over."""
    return KINDS.get(node.annotation.id) if isinstance(node.annotation, ast.Name) else None


def returned(node: ast.FunctionDef) -> list[str | None]:
    """What the annotation of a result says, part by part; nothing where no vector is among them."""
    parts = node.returns
    if isinstance(parts, ast.Subscript):
        parts = parts.slice
    names = parts.elts if isinstance(parts, ast.Tuple) else [parts]
    kinds = [KINDS.get(getattr(name, "id", "")) for name in names]
    return kinds if any(kinds) else []


def label(node: ast.AST) -> str:
    """The label of an item of an enumeration, (label, value, sentence); of anything else none."""
    match node:
        case ast.Tuple(elts=[ast.Constant(value=str(found)), _, _]):
            return found
    return ""
