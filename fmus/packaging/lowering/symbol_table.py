"""Symbols of the lowered files: what each name refers to.

    "module:name"   a name of a module, such as runtime.codes: function, class, constant or import
    "Class.name"    a member of the objects of a class
    ".name"         a member of an object of unknown class

A name such as `step` stands for objects of one class in all files, be it an attribute, a parameter or a local name: the
class that is called in an assignment to this name, or to another name that is assigned to it.  The class is unknown if
there is no such assignment, or if there are several with different classes.
"""

import ast
from collections import defaultdict
from collections.abc import Collection, Mapping
from dataclasses import dataclass

from ..syntax_trees import nested_statements

UNKNOWN = ""  # class
MODEL = "model"  # name of a model in the runtime


class SymbolTable:
    """Modules that files import, classes and their relatives, and the classes of objects.

    Parameters
    ----------
    trees
        Syntax trees of the files, by module.
    model
        Module of the model; `model` refers to objects of its last class.
    untyped_modules
        Modules that work with objects of any class, and whose classes may be mixed with others.
    """

    def __init__(self, trees: Mapping[str, ast.Module], model: str, untyped_modules: frozenset[str]) -> None:
        self.untyped_modules = untyped_modules
        self.model_class = UNKNOWN
        self.imported_modules: dict[str, str] = {}  # symbol of a module in a file -> name of the module
        bases: dict[str, list[str]] = {}
        assignments: list[tuple[str, ast.expr]] = []
        for module, tree in trees.items():
            for node in nested_statements(tree):
                match node:
                    case ast.ImportFrom(module=None, names=names):
                        for alias in names:
                            name = f"{imported_module(module, node)}.{alias.name}"
                            self.imported_modules[f"{module}:{alias.asname or alias.name}"] = name.removeprefix(".")
                    case ast.ClassDef(name=name) if module not in untyped_modules:
                        bases[name] = [base.id for base in node.bases if isinstance(base, ast.Name)]
                        self.model_class = name if module == model else self.model_class
                    case ast.Assign() if module not in untyped_modules:
                        assignments += [(last_name(target), value) for target, value in assignment_targets(node)]
        self.classes = related_classes(bases)
        self.object_classes = object_classes(assignments, bases) | {MODEL: self.model_class}
        self.object_classes |= {name: name for name in bases}  # with the members of the class itself

    def readers(self, symbol: str) -> set[str]:
        """Return the symbols that read a definition: a member is also read through related classes."""
        if ":" in symbol:
            return {symbol}
        owner, _, name = symbol.partition(".")
        return {f"{relative}.{name}" for relative in self.classes[owner]}

    def path_symbols(self, path: str, owner: str = UNKNOWN) -> set[str]:
        """Return the symbols of the members in a dotted name such as solver.steps."""
        symbols = set()
        for name in path.split("."):
            symbols.add(f"{owner}.{name}")
            owner = self.object_classes.get(name, UNKNOWN)
        return symbols


@dataclass(frozen=True)
class Scope:
    """A module, or a class of it, that gives names their meaning."""

    table: SymbolTable
    module: str
    owner: str = UNKNOWN  # class of self

    def inside(self, node: ast.ClassDef) -> "Scope":
        """Return the scope of a class of the module."""
        return Scope(self.table, self.module, UNKNOWN if self.module in self.table.untyped_modules else node.name)

    def symbol(self, node: ast.AST) -> str:
        """Return the symbol of a name, an attribute, a definition or an import."""
        match node:
            case ast.Attribute(value=ast.Name(id=name), attr=attribute) if module := self.table.imported_modules.get(
                f"{self.module}:{name}"
            ):
                return f"{module}:{attribute}"
            case ast.Attribute(value=value, attr=attribute):
                return f"{self.class_of(value)}.{attribute}"
            case ast.FunctionDef(name=name) if node.col_offset:
                return f"{self.owner}.{name}"
            case ast.Name(id=name) | ast.ClassDef(name=name) | ast.FunctionDef(name=name):
                return f"{self.module}:{name}"
            case ast.alias(name=name, asname=other_name):
                return f"{self.module}:{other_name or name}"
        raise AssertionError(node)

    def class_of(self, node: ast.expr) -> str:
        """Return the class of an object."""
        match node:
            case ast.Name(id="self") | ast.Call(func=ast.Name(id="super")):
                return self.owner
        return self.table.object_classes.get(last_name(node), UNKNOWN)


def object_classes(assignments: list[tuple[str, ast.expr]], classes: Collection[str]) -> dict[str, str]:
    """Return the class of the objects that each name refers to."""
    result: defaultdict[str, set[str]] = defaultdict(set)
    others = []  # pairs of a name and another one that is assigned to it
    names_of_classes = {name: last_name(value) for name, value in assignments if last_name(value) in classes}
    for name, value in assignments:
        called = last_name(value.func) if isinstance(value, ast.Call) else ""
        if (called := names_of_classes.get(called, called)) in classes:
            result[name].add(called)
        elif isinstance(value, (ast.Name, ast.Attribute)):
            others.append((name, last_name(value)))
    is_complete = False
    while not is_complete:
        is_complete = True
        for name, other in others:
            if not result[other] <= result[name]:
                result[name] |= result[other]
                is_complete = False
    return {name: min(candidates) for name, candidates in result.items() if name and len(candidates) == 1}


def related_classes(bases: Mapping[str, list[str]]) -> dict[str, set[str]]:
    """Return for each class the classes through which its members are read: all related ones, and the unknown class."""

    def ancestors(name: str) -> set[str]:
        return {name}.union(*map(ancestors, bases.get(name, [])))

    result = {name: {UNKNOWN, *ancestors(name)} for name in bases}
    for name in bases:
        for base in ancestors(name) & bases.keys():
            result[base].add(name)
    return result


def imported_module(module: str, node: ast.ImportFrom) -> str:
    """Return the module from which a module imports names."""
    parents = module.split(".")[: -node.level] if node.level else []
    return ".".join([*parents, *([node.module] if node.module else [])])


def last_name(node: ast.AST) -> str:
    """Return a name, or the last part of a dotted name, else ""."""
    return getattr(node, "attr", "") or getattr(node, "id", "")


def assignment_pairs(node: ast.Assign) -> list[tuple[list[ast.expr], ast.expr]]:
    """Return pairs of targets and value."""
    target, value = node.targets[0], node.value
    if isinstance(target, ast.Tuple) and isinstance(value, ast.Tuple) and len(target.elts) == len(value.elts):
        return [([element], element_value) for element, element_value in zip(target.elts, value.elts, strict=True)]
    return [(node.targets, value)]


def assignment_targets(node: ast.Assign) -> list[tuple[ast.expr, ast.expr]]:
    """Return pairs of target and value, one per target."""
    return [(target, value) for targets, value in assignment_pairs(node) for target in targets]
