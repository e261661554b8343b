"""Removes dead code: attributes that are never read, functions and classes that are never used, unused imports.

Functions and classes of modules are symbols with an origin: each use is resolved to the file that defines it
("conditions:initialize").  Members of objects are matched by name in all embedded files (".initialize"), and in dotted
names such as those of variables, since the files do not declare the class of every object.
"""

import ast
import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import partial

from ..syntax_trees import all_nodes, child_nodes, parsed_module, parsed_nodes
from .emit_source import MAX_LINE_LENGTH, SourceLine, wrap_line

DOTTED_NAME = re.compile(r"[A-Za-z_]\w*(?:\.[A-Za-z_]\w*)+")
FMI_LAYER_MODULES = (
    *("call_sequence", "early_return", "failure_handling", "fmu_instance", "messages", "model_exchange"),
    *("pythonfmu_workarounds", "saved_state", "slave", "variable_access", "variable_declarations"),
)
KEPT_WHOLE = {f"runtime/{name}.py" for name in FMI_LAYER_MODULES}  # called by the FMI layer
Files = dict[str, list[SourceLine]]
Removable = ast.ClassDef | ast.FunctionDef | ast.Assign
# parts of an expression that cannot fail and change nothing, unlike calls, division, powers and indexing
WITHOUT_EFFECT = (
    *(ast.Name, ast.Constant, ast.Attribute, ast.List, ast.UnaryOp, ast.unaryop, ast.IfExp, ast.Compare, ast.cmpop),
    *(ast.BinOp, ast.Add, ast.Sub, ast.Mult),
)


def remove_dead_code(files: Files, model: str, names: Iterable[str]) -> Files:
    """Remove dead code from the files; `model` is the path of the model, `names` are read from outside."""
    symbols = ModuleSymbols(files)
    used = reachable_names(
        [one for path, lines in files.items() for one in code_units(path, lines, symbols, path == model)], set(names)
    )
    return {path: prune_file(path, lines, used, path == model) for path, lines in files.items()}


def parse_lines(lines: list[SourceLine]) -> ast.Module:
    """Parse a file."""
    return parsed_module("\n".join(lines))


class ModuleSymbols:
    """Module-level names of all files, resolved to the file that defines them."""

    def __init__(self, files: Files) -> None:
        self.modules = {module_of(path) for path in files}
        self.imported: dict[str, str] = {}  # "module:name" -> the same where it is imported from
        self.defined: set[str] = set()
        for path, lines in files.items():
            for node in parse_lines(lines).body:
                if isinstance(node, ast.ImportFrom) and node.level:
                    source = (node.module or "").rpartition(".")[2]
                    for alias in node.names:
                        self.imported[f"{module_of(path)}:{alias.asname or alias.name}"] = f"{source}:{alias.name}"
                elif isinstance(node, (ast.FunctionDef, ast.ClassDef)):
                    self.defined.add(f"{module_of(path)}:{node.name}")

    def read_symbol(self, module: str, node: ast.AST) -> str:
        """Return what a name or attribute in a module refers to: "module:name" or ".attribute"; else ""."""
        match node:
            case ast.Name(id=name):
                return self.origin(f"{module}:{name}")
            case ast.Attribute(value=ast.Name(id=owner), attr=name) if self.is_module(module, owner):
                return self.origin(f"{owner}:{name}")
            case ast.Attribute(attr=name):
                return "." + name
        return ""

    def origin(self, symbol: str) -> str:
        """Follow imports to the definition of a function or class; "" for anything else."""
        while symbol in self.imported:
            symbol = self.imported[symbol]
        return symbol if symbol in self.defined else ""

    def is_module(self, module: str, name: str) -> bool:
        """Return whether a name in a module is an imported module."""
        return name in self.modules and f"{module}:{name}" in self.imported


def module_of(path: str) -> str:
    """Return the name of the module in a file."""
    return path.rpartition("/")[2].removesuffix(".py")


@dataclass
class CodeUnit:
    """A piece of code and what it reads (".attribute" or "module:name").

    It is reachable if at least one name of each set in `needs` is reachable.
    """

    needs: list[set[str]]
    reads: set[str]


def code_units(path: str, lines: list[SourceLine], symbols: ModuleSymbols, is_model: bool) -> list[CodeUnit]:
    """Return functions and attribute assignments of a file with what they read; all classes of a model are kept."""
    module = module_of(path)
    read_symbol = partial(symbols.read_symbol, module)
    if path in KEPT_WHOLE:
        return units_of_node(parse_lines(lines), [], True, read_symbol)
    result: list[CodeUnit] = []
    for part in parse_lines(lines).body:
        needs: list[set[str]] = []
        pieces: list[ast.AST] = [part]
        if isinstance(part, ast.ClassDef):
            needs = [] if is_model else [{f"{module}:{part.name}"}]
            pieces = [*part.bases, *part.decorator_list, *part.body]
        for node in pieces:
            names = []
            if isinstance(node, ast.FunctionDef) and not node.name.startswith("__"):
                names = [{symbol_of(module, node)}]
            result += units_of_node(node, needs + names, is_model, read_symbol)
    return result


def reachable_names(units: list[CodeUnit], names: set[str]) -> set[str]:
    """Return all names read by reachable code."""
    while True:
        reached = [one for one in units if all(names & need for need in one.needs)]
        more = names.union(*(one.reads for one in reached))
        if more == names:
            return names
        names = more


def units_of_node(
    part: ast.AST, needs: list[set[str]], whole: bool, read_symbol: Callable[[ast.AST], str]
) -> list[CodeUnit]:
    """Return what a piece of code reads; the parts of dotted names in strings count as attributes.

    Unless `whole`, assignments that only set attributes become units of their own.
    """
    mine = CodeUnit(needs, set())
    result, pending = [mine], [part]
    for node in pending:  # the list grows during the loop
        match node:
            case ast.Name(ctx=ast.Load()) | ast.Attribute(ctx=ast.Load()):
                mine.reads.add(read_symbol(node))
            case ast.Constant(value=str(text)) if DOTTED_NAME.fullmatch(text):
                mine.reads |= {"." + word for word in text.split(".")}
            case ast.Assign():
                mine.reads |= {"." + name for name in attributes_kept(node, whole)}
                for targets, value in [] if whole else assignment_pairs(node):
                    if all(is_dead_store(one, value, set()) for one in targets):
                        stored = {"." + one.attr for one in targets if isinstance(one, ast.Attribute)}
                        for piece in (*targets, value):
                            result += units_of_node(piece, [*needs, stored], True, read_symbol)
                    else:
                        pending += [*targets, value]
                if not whole:
                    continue
            case ast.AugAssign(target=ast.Attribute(attr=name)):
                mine.reads.add("." + name)
        pending += child_nodes(node)
    return result


def prune_file(path: str, lines: list[SourceLine], used: set[str], is_model: bool) -> list[SourceLine]:
    """Remove from a file what is not in `used`."""
    if path in KEPT_WHOLE:
        return lines
    whole, lines = parse_lines(lines), list(lines)
    for node in sorted(
        removable_nodes(whole, used, module_of(path), is_model), key=lambda one: one.lineno, reverse=True
    ):
        if isinstance(node, ast.Assign):
            prune_assignment(lines, node, used)
        else:
            delete_definition(lines, node)
    return prune_imports(lines)


def removable_nodes(whole: ast.Module, used: set[str], module: str, is_model: bool) -> list[Removable]:
    """Return unused classes and functions, and all assignments outside of them; only functions for a model."""
    result: list[Removable] = []
    pending: list[ast.AST] = [*whole.body]
    for node in pending:  # the list grows during the loop
        match node:
            case ast.ClassDef(name=name) if not is_model and f"{module}:{name}" not in used:
                result.append(node)
            case ast.FunctionDef(name=name) if not name.startswith("__") and symbol_of(module, node) not in used:
                result.append(node)
            case ast.Assign() if not is_model:
                result.append(node)
            case _:
                pending += ast.iter_child_nodes(node)
    return result


def symbol_of(module: str, node: ast.FunctionDef) -> str:
    """Return "module:name" of a function, or ".name" of a method."""
    return f".{node.name}" if node.col_offset else f"{module}:{node.name}"


def delete_definition(lines: list[SourceLine], node: ast.ClassDef | ast.FunctionDef) -> None:
    """Delete a class or function with the blank lines above it."""
    first = node.lineno - 1
    while first and not lines[first - 1].strip():
        first -= 1
    del lines[first : node.end_lineno]


def prune_assignment(lines: list[SourceLine], node: ast.Assign, used: set[str]) -> None:
    """Remove unread attributes from an assignment without other effects."""
    pairs = assignment_pairs(node)
    kept = [([one for one in targets if not is_dead_store(one, value, used)], value) for targets, value in pairs]
    if kept == pairs:
        return
    if len(pairs) > 1:
        sides = [", ".join(map(ast.unparse, side)) for side in zip(*((t[0], v) for t, v in kept if t), strict=True)]
    else:
        sides = [ast.unparse(one) for one in (*kept[0][0], kept[0][1])]
    old, end = lines[node.lineno - 1], node.end_lineno or 0
    comment = re.search(r"  #.*$", lines[end - 1])
    text = " = ".join(sides) + (comment[0] if comment else "") if len(sides) > 1 else ""
    indent = " " * node.col_offset
    if not text and lines[node.lineno - 2].endswith(":") and not "".join(lines[end : end + 1]).startswith(indent):
        text = "pass"  # the body would be empty
    lines[node.lineno - 1 : end] = [SourceLine.of(indent + text, old.source)] if text else []


def assignment_pairs(node: ast.Assign) -> list[tuple[list[ast.expr], ast.expr]]:
    """Return pairs of targets and value."""
    target, value = node.targets[0], node.value
    if isinstance(target, ast.Tuple) and isinstance(value, ast.Tuple) and len(target.elts) == len(value.elts):
        return [([one], what) for one, what in zip(target.elts, value.elts, strict=True)]
    return [(node.targets, value)]


def assignment_targets(node: ast.Assign) -> list[tuple[ast.expr, ast.expr]]:
    """Return pairs of target and value, one per target."""
    return [(target, value) for targets, value in assignment_pairs(node) for target in targets]


def attributes_kept(node: ast.Assign, whole: bool) -> set[str]:
    """Return the attributes in targets that stay without a reader: all if `whole`, else those with other effects."""
    kept = [target for target, value in assignment_targets(node) if whole or not is_dead_store(target, value, set())]
    return {part.attr for one in kept for part in all_nodes(one) if isinstance(part, ast.Attribute)}


def is_dead_store(target: ast.expr, value: ast.expr, used: set[str]) -> bool:
    """Return whether this only sets an attribute that is never read."""
    if not isinstance(target, ast.Attribute) or "." + target.attr in used:
        return False
    makes = isinstance(value, ast.Call) and isinstance(value.func, ast.Name) and not value.args
    parts = all_nodes(target) + ([] if makes else all_nodes(value))
    return all(isinstance(one, WITHOUT_EFFECT) for one in parts)


def prune_imports(lines: list[SourceLine]) -> list[SourceLine]:
    """Remove unused names from the imports of a file."""
    names = {node.id for node in parsed_nodes("\n".join(lines)) if isinstance(node, ast.Name)}
    for node in reversed([node for node in parse_lines(lines).body if isinstance(node, ast.ImportFrom)]):
        kept = [alias.name for alias in node.names if alias.name in names]
        if len(kept) < len(node.names) and not any(alias.asname for alias in node.names):
            head, names_text = f"from {'.' * node.level}{node.module or ''} import ", ", ".join(kept)
            is_long = len(head + names_text) > MAX_LINE_LENGTH
            text = wrap_line(f"{head}({names_text})") if is_long else head + names_text
            source = lines[node.lineno - 1].source
            new = [SourceLine.of(line, source) for line in text.split("\n")] if kept else []
            lines[node.lineno - 1 : node.end_lineno] = new
    return lines
