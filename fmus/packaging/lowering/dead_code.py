"""What nobody needs is left out: attributes that are set and never read, functions that nobody calls, classes of which
nobody makes one, dead imports.

Who reads is known by name: any file that travels, and whoever finds its way by dotted names, as those of variables.
"""

import ast
import re
from collections.abc import Iterable
from dataclasses import dataclass

from ..syntax_trees import all_nodes, child_nodes, parsed_module, parsed_nodes
from .emit_source import SourceLine
from .source_symbols import is_self_assignment

DOTTED_NAME = re.compile(r"[A-Za-z_]\w*(?:\.[A-Za-z_]\w*)+")
FMI_LAYER_MODULES = (
    *("call_sequence", "early_return", "failure_handling", "fmu_instance", "messages", "model_exchange"),
    *("pythonfmu_workarounds", "saved_state", "slave", "variable_access", "variable_declarations"),
)
KEPT_WHOLE = {f"runtime/{name}.py" for name in FMI_LAYER_MODULES}  # by a layer of FMI
Files = dict[str, list[SourceLine]]
Removable = ast.ClassDef | ast.FunctionDef | ast.Assign


def remove_dead_code(files: Files, model: str, names: Iterable[str]) -> Files:
    """The files without what nobody needs; `model` is that of the model, and `names` are read by others."""
    wanted = reachable_names(
        [one for path, lines in files.items() for one in code_units(path, lines, path == model)], set(names)
    )
    return {path: prune_file(path, lines, wanted, path == model) for path, lines in files.items()}


def parse_lines(lines: list[SourceLine]) -> ast.Module:
    """The tree of a file."""
    return parsed_module("\n".join(lines))


@dataclass
class CodeUnit:
    """What a piece of code reads: .attribute, name; it runs if of each of its `needs` one is wanted."""

    needs: list[set[str]]
    reads: set[str]


def code_units(path: str, lines: list[SourceLine], is_model: bool) -> list[CodeUnit]:
    """The functions of a file, and in them what only sets attributes, each with what it reads; of a model each class is
    needed."""
    if path in KEPT_WHOLE:
        return units_of_node(parse_lines(lines), [], True)
    found: list[CodeUnit] = []
    for part in parse_lines(lines).body:
        needs: list[set[str]] = []
        pieces: list[ast.AST] = [part]
        if isinstance(part, ast.ClassDef):
            needs = [] if is_model else [{part.name, "." + part.name}]
            pieces = [*part.bases, *part.decorator_list, *part.body]
        for node in pieces:
            names = [call_names(node)] if isinstance(node, ast.FunctionDef) and not node.name.startswith("__") else []
            found += units_of_node(node, needs + names, is_model)
    return found


def reachable_names(found: list[CodeUnit], names: set[str]) -> set[str]:
    """All that is read by what can be reached."""
    while True:
        reached = [one for one in found if all(names & need for need in one.needs)]
        more = names.union(*(one.reads for one in reached))
        if more == names:
            return names
        names = more


def units_of_node(part: ast.AST, needs: list[set[str]], whole: bool) -> list[CodeUnit]:
    """What a piece of code reads, of a dotted name in a text every word as an attribute; on its own, where it is not
    kept `whole`, what an assignment reads that only sets attributes."""
    mine = CodeUnit(needs, set())
    found, waiting = [mine], [part]
    for node in waiting:  # which grows on the way
        match node:
            case ast.Name(id=name, ctx=ast.Load()):
                mine.reads.add(name)
            case ast.Attribute(attr=name, ctx=ast.Load()):
                mine.reads.add("." + name)
            case ast.Constant(value=str(text)) if DOTTED_NAME.fullmatch(text):
                mine.reads |= {"." + word for word in text.split(".")}
            case ast.Assign():
                mine.reads |= {"." + name for name in attributes_with_effects(node)}
                for targets, value in [] if whole else assignment_pairs(node):
                    if all(is_dead_store(one, value, set()) for one in targets):
                        found += units_of_node(
                            value, [*needs, {"." + one.attr for one in targets if is_self_assignment(one)}], True
                        )
                    else:
                        waiting += [*targets, value]
                if not whole:
                    continue
            case ast.AugAssign(target=ast.Attribute(attr=name)):
                mine.reads.add("." + name)
        waiting += child_nodes(node)
    return found


def prune_file(path: str, lines: list[SourceLine], wanted: set[str], is_model: bool) -> list[SourceLine]:
    """One file without what is not wanted."""
    if path in KEPT_WHOLE:
        return lines
    whole, lines = parse_lines(lines), list(lines)
    for node in sorted(removable_nodes(whole, wanted, is_model), key=lambda one: one.lineno, reverse=True):
        if isinstance(node, ast.Assign):
            prune_assignment(lines, node, wanted)
        else:
            delete_definition(lines, node)
    return prune_imports(lines)


def removable_nodes(whole: ast.Module, wanted: set[str], is_model: bool) -> list[Removable]:
    """The classes and functions that nobody needs, and all assignments outside of these; of a model its functions."""
    found: list[Removable] = []
    waiting: list[ast.AST] = [*whole.body]
    for node in waiting:  # which grows on the way
        match node:
            case ast.ClassDef(name=name) if not is_model and not {name, "." + name} & wanted:
                found.append(node)
            case ast.FunctionDef(name=name) if not name.startswith("__") and not call_names(node) & wanted:
                found.append(node)
            case ast.Assign() if not is_model:
                found.append(node)
            case _:
                waiting += ast.iter_child_nodes(node)
    return found


def call_names(node: ast.FunctionDef) -> set[str]:
    """By what a function is called: a method by .name alone."""
    return {"." + node.name} if node.col_offset else {"." + node.name, node.name}


def delete_definition(lines: list[SourceLine], node: ast.ClassDef | ast.FunctionDef) -> None:
    """Take out a class or a function, with the blank lines above it."""
    first = node.lineno - 1
    while first and not lines[first - 1].strip():
        first -= 1
    del lines[first : node.end_lineno]


def prune_assignment(lines: list[SourceLine], node: ast.Assign, wanted: set[str]) -> None:
    """Take attributes of self that nobody reads out of an assignment that does nothing else."""
    pairs = assignment_pairs(node)
    kept = [([one for one in targets if not is_dead_store(one, value, wanted)], value) for targets, value in pairs]
    if kept == pairs:
        return
    if len(pairs) > 1:
        sides = [", ".join(map(ast.unparse, side)) for side in zip(*((t[0], v) for t, v in kept if t), strict=True)]
    else:
        sides = [ast.unparse(one) for one in (*kept[0][0], kept[0][1])]
    old, end = lines[node.lineno - 1], node.end_lineno or 0
    comment = re.search(r"  #.*$", lines[end - 1])
    text = " = ".join(sides) + (comment[0] if comment else "") if len(sides) > 1 else ""
    if not text and lines[node.lineno - 2].endswith(":") and not "".join(lines[end : end + 1]).strip():
        text = "pass"  # nothing else is left of the function
    lines[node.lineno - 1 : end] = [SourceLine.of(" " * node.col_offset + text, old.source)] if text else []


def assignment_pairs(node: ast.Assign) -> list[tuple[list[ast.expr], ast.expr]]:
    """What is assigned, each with all that it is assigned to."""
    target, value = node.targets[0], node.value
    if isinstance(target, ast.Tuple) and isinstance(value, ast.Tuple) and len(target.elts) == len(value.elts):
        return [([one], what) for one, what in zip(target.elts, value.elts, strict=True)]
    return [(node.targets, value)]


def assignment_targets(node: ast.Assign) -> list[tuple[ast.expr, ast.expr]]:
    """What is assigned, target by target."""
    return [(target, value) for targets, value in assignment_pairs(node) for target in targets]


def attributes_with_effects(node: ast.Assign) -> set[str]:
    """The attributes that an assignment sets in a way that does more, or may."""
    kept = [target for target, value in assignment_targets(node) if not is_dead_store(target, value, set())]
    return {part.attr for one in kept for part in all_nodes(one) if isinstance(part, ast.Attribute)}


def is_dead_store(target: ast.expr, value: ast.expr, wanted: set[str]) -> bool:
    """Whether this only sets an attribute of self, or of what self is made of, that nobody reads."""
    makes = isinstance(value, ast.Call) and isinstance(value.func, ast.Name) and not value.args
    mine = is_self_assignment(target) and "." + target.attr not in wanted
    return mine and (makes or isinstance(value, (ast.Name, ast.Constant, ast.Attribute)))


def prune_imports(lines: list[SourceLine]) -> list[SourceLine]:
    used = {node.id for node in parsed_nodes("\n".join(lines)) if isinstance(node, ast.Name)}
    for node in reversed([node for node in parse_lines(lines).body if isinstance(node, ast.ImportFrom)]):
        kept = [alias.name for alias in node.names if alias.name in used]
        if len(kept) < len(node.names) and not any(alias.asname for alias in node.names):
            text = f"from {'.' * node.level}{node.module or ''} import {', '.join(kept)}"
            new = [SourceLine.of(text, lines[node.lineno - 1].source)] if kept else []
            lines[node.lineno - 1 : node.end_lineno] = new
    return lines
