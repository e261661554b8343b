"""Removes dead code: members that are never read, functions and classes that are never used, unused imports.

A definition is dead if no reachable code reads its symbol (symbol_table.py).  The FMI layer is kept whole: it works
with objects of any class, so a member that it reads by name is live in all classes.
"""

import ast
import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

from ..syntax_trees import all_nodes, child_nodes, child_statements, parsed_module
from .emit_source import MAX_LINE_LENGTH, SourceLine, wrap_line
from .symbol_table import UNKNOWN, Scope, SymbolTable, assignment_pairs, assignment_targets, imported_module

DOTTED_NAME = re.compile(r"[A-Za-z_]\w*(?:\.[A-Za-z_]\w*)+")
FMI_LAYER = frozenset(
    f"runtime.{name}"
    for name in (
        *("call_sequence", "early_return", "failure_handling", "fmu_instance", "messages", "model_exchange"),
        *("pythonfmu_workarounds", "saved_state", "slave", "variable_access", "variable_declarations"),
    )
)
Files = dict[str, list[SourceLine]]
# parts of an expression that cannot fail and change nothing, unlike calls, division, powers and indexing
WITHOUT_EFFECT = (
    *(ast.Name, ast.Constant, ast.Attribute, ast.List, ast.UnaryOp, ast.unaryop, ast.IfExp, ast.Compare, ast.cmpop),
    *(ast.BinOp, ast.Add, ast.Sub, ast.Mult),
)


def remove_dead_code(files: Files, model: str, variables: Iterable[str]) -> Files:
    """Remove dead code from the files; `model` is the path of the model, and importers read its `variables`."""
    trees = {module_of(path): parsed_module("\n".join(lines)) for path, lines in files.items()}
    dead = DefinitionsAndUses(trees, module_of(model)).dead_definitions(variables)
    return {path: prune_file(lines, trees[module_of(path)], dead) for path, lines in files.items()}


def module_of(path: str) -> str:
    """Return the name of the module in a file."""
    return path.removesuffix(".py").replace("/", ".")


@dataclass
class CodeUnit:
    """A piece of code and the symbols that it reads.

    It is reachable if at least one symbol of each set in `needs` is live.
    """

    needs: list[set[str]]
    reads: set[str]

    def is_reachable(self, live: set[str]) -> bool:
        """Return whether the symbols that it needs are live."""
        return not any(live.isdisjoint(need) for need in self.needs)


class DefinitionsAndUses:
    """The definitions in all files with the symbols that keep them, and all code with the symbols that it reads."""

    def __init__(self, trees: dict[str, ast.Module], model: str) -> None:
        self.table = SymbolTable(trees, model, FMI_LAYER)
        self.definitions: dict[ast.AST, set[str]] = {}  # classes, functions, imports, and attributes in assignments
        self.units: list[CodeUnit] = []
        for module, tree in trees.items():
            self.add_module(tree, Scope(self.table, module), module == model, module in FMI_LAYER)

    def dead_definitions(self, variables: Iterable[str]) -> set[ast.AST]:
        """Return the definitions that nothing reads, where importers read these variables of the model."""
        live = set().union(*(self.table.path_symbols(name, self.table.model_class) for name in variables))
        units, n_reached = self.units, 1
        while n_reached:
            waiting = []
            for unit in units:
                if unit.is_reachable(live):
                    live |= unit.reads
                else:
                    waiting.append(unit)
            units, n_reached = waiting, len(units) - len(waiting)
        return {node for node, readers in self.definitions.items() if live.isdisjoint(readers)}

    def define(self, node: ast.AST, scope: Scope) -> set[str]:
        """Add a definition; return the symbols that keep it."""
        self.definitions[node] = self.table.readers(scope.symbol(node))
        return self.definitions[node]

    def add_module(self, tree: ast.Module, scope: Scope, is_model: bool, is_fmi_layer: bool) -> None:
        """Add a module; all classes and assignments of a model are kept, and all code of the FMI layer."""
        is_fixed = is_fmi_layer or is_model
        for part in tree.body:
            if isinstance(part, ast.ClassDef):
                needs = [] if is_fixed else [self.define(part, scope)]
                members = scope.inside(part)
                for node in (*part.bases, *part.decorator_list, *part.body):
                    is_method = isinstance(node, ast.FunctionDef) and not node.name.startswith("__")
                    symbols = [self.define(node, members)] if is_method and not is_fmi_layer else []
                    self.add_code(node, needs + symbols, members, is_fixed)
            elif isinstance(part, ast.FunctionDef) and not is_fmi_layer:
                self.add_code(part, [self.define(part, scope)], scope, is_fixed)
            elif isinstance(part, ast.ImportFrom):
                source = imported_module(scope.module, part)
                for alias in part.names:
                    needs = [] if is_fmi_layer else [self.define(alias, scope)]
                    self.units.append(CodeUnit(needs, {f"{source}:{alias.name}"}))
            else:
                self.add_code(part, [], scope, is_fixed)

    def add_code(self, part: ast.AST, needs: list[set[str]], scope: Scope, is_fixed: bool) -> None:
        """Add a piece of code; unless `is_fixed`, assignments that only set attributes become units of their own."""
        reads: set[str] = set()
        self.units.append(CodeUnit(needs, reads))
        pending = [part]
        for node in pending:  # the list grows during the loop
            match node:
                case ast.Name():
                    reads.add(scope.symbol(node))
                    continue  # half of all nodes are names, which have no parts
                case ast.Attribute():
                    reads.add(scope.symbol(node))
                case ast.Constant(value=str(text)) if DOTTED_NAME.fullmatch(text):
                    reads |= self.table.path_symbols(text)
                case ast.Assign() if not is_fixed:
                    for targets, value in assignment_pairs(node):
                        if all(is_removable(target, value, scope) for target in targets):
                            symbols = set().union(*(self.define(target, scope) for target in targets))
                            for child in (*(part for target in targets for part in child_nodes(target)), value):
                                self.add_code(child, [*needs, symbols], scope, True)
                        else:
                            pending += [*targets, value]
                    continue
            pending += child_nodes(node)


def is_removable(target: ast.expr, value: ast.expr, scope: Scope) -> bool:
    """Return whether an assignment only sets an attribute of an object of known class."""
    if not isinstance(target, ast.Attribute) or scope.class_of(target.value) == UNKNOWN:
        return False
    is_new = isinstance(value, ast.Call) and isinstance(value.func, ast.Name) and not value.args
    parts = all_nodes(target) + ([] if is_new else all_nodes(value))
    return all(isinstance(part, WITHOUT_EFFECT) for part in parts)


def prune_file(lines: list[SourceLine], tree: ast.Module, dead: set[ast.AST]) -> list[SourceLine]:
    """Remove dead definitions from a file."""
    lines = list(lines)
    for node in sorted(statements_with_dead_code(tree, dead), key=lambda statement: statement.lineno, reverse=True):
        if isinstance(node, ast.Assign):
            prune_assignment(lines, node, dead)
        elif isinstance(node, ast.ImportFrom):
            prune_import(lines, node, dead)
        else:
            delete_definition(lines, node)
    return lines


def statements_with_dead_code(part: ast.AST, dead: set[ast.AST]) -> Iterator[ast.stmt | ast.ExceptHandler]:
    """Yield dead classes and functions, and outside of them the imports and assignments with dead definitions."""
    for node in child_statements(part):
        definitions: Sequence[ast.AST] = [node]
        if isinstance(node, ast.ImportFrom):
            definitions = node.names
        elif isinstance(node, ast.Assign):
            definitions = [target for target, _ in assignment_targets(node)]
        if dead.isdisjoint(definitions):
            yield from statements_with_dead_code(node, dead)
        else:
            yield node


def delete_definition(lines: list[SourceLine], node: ast.stmt | ast.ExceptHandler) -> None:
    """Delete a class or function with the blank lines above it."""
    first = node.lineno - 1
    while first and not lines[first - 1].strip():
        first -= 1
    del lines[first : node.end_lineno]


def prune_assignment(lines: list[SourceLine], node: ast.Assign, dead: set[ast.AST]) -> None:
    """Remove dead targets from an assignment."""
    pairs = assignment_pairs(node)
    live_pairs = [([target for target in targets if target not in dead], value) for targets, value in pairs]
    if len(pairs) > 1:
        sides = [
            ", ".join(map(ast.unparse, side)) for side in zip(*((t[0], v) for t, v in live_pairs if t), strict=True)
        ]
    else:
        sides = [ast.unparse(part) for part in (*live_pairs[0][0], live_pairs[0][1])]
    old, end = lines[node.lineno - 1], node.end_lineno or 0
    comment = re.search(r"  #.*$", lines[end - 1])
    text = " = ".join(sides) + (comment[0] if comment else "") if len(sides) > 1 else ""
    indent = " " * node.col_offset
    if not text and lines[node.lineno - 2].endswith(":") and not "".join(lines[end : end + 1]).startswith(indent):
        text = "pass"  # the body would be empty
    lines[node.lineno - 1 : end] = [SourceLine.of(indent + text, old.source)] if text else []


def prune_import(lines: list[SourceLine], node: ast.ImportFrom, dead: set[ast.AST]) -> None:
    """Remove dead names from an import."""
    aliases = [alias for alias in node.names if alias not in dead]
    names = ", ".join(f"{alias.name} as {alias.asname}" if alias.asname else alias.name for alias in aliases)
    head = f"from {'.' * node.level}{node.module or ''} import "
    text = wrap_line(f"{head}({names})") if len(head + names) > MAX_LINE_LENGTH else head + names
    source = lines[node.lineno - 1].source
    new = [SourceLine.of(line, source) for line in text.split("\n")] if names else []
    lines[node.lineno - 1 : node.end_lineno] = new
