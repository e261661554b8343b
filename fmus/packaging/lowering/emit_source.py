"""The text of one file: lines that do not change are copied, with their comments, and each knows its source."""

import ast
import re

from ..syntax_trees import is_same_tree, parsed_module, replace_fields
from .constant_folding import known_truth
from .layout import ModelLayout
from .scalarize import LOOP_RANGES, METHOD_LOOP, Scalarizer
from .source_symbols import SourceSymbols, annotated_kind, annotated_results, item_label

MAX_LINE_LENGTH = 120


class SourceLine(str):
    """A line of text, and the number of the line of the source that it follows from."""

    __slots__ = ("source",)
    source: int

    @classmethod
    def of(cls, text: str, source: int) -> "SourceLine":
        line = cls(text)
        line.source = source
        return line


class SourceEmitter:
    """A file written out, line by line; `vectors`: whether it speaks of any."""

    def __init__(self, spec: ModelLayout, declared: SourceSymbols, path: str, text: str, vectors: bool) -> None:
        self.spec, self.declared, self.path, self.has_vectors = spec, declared, path, vectors
        self.old = [SourceLine.of(line, n) for n, line in enumerate(text.split("\n"), 1)]
        self.lines: list[SourceLine] = []
        self.after = 0  # the lines of the source that have been dealt with
        self.scalarizer = self.fresh()
        body = parsed_module(text).body
        imports = [node for node in body if isinstance(node, ast.ImportFrom) and is_build_time_import(node)]
        self.ranges = {alias.name for node in imports for alias in node.names} & {*LOOP_RANGES, METHOD_LOOP}
        self.block(body, 0)
        self.lines += self.old[self.after :]

    def fresh(self, index: dict[str, int] | None = None) -> Scalarizer:
        return Scalarizer(self.spec, self.declared, self.path, self.has_vectors, index)

    # ---- lines

    def copy(self, end: int, shift: int) -> None:
        """The lines of the source up to one, moved to the left by some blanks."""
        for line in self.old[self.after : end]:
            moved = line[shift:] if shift > 0 and not line[:shift].strip() else " " * -shift + line if line else line
            self.lines.append(SourceLine.of(moved, line.source))
        self.after = max(self.after, end)

    def write(self, text: str, node: ast.AST) -> None:
        self.lines += [SourceLine.of(line, getattr(node, "lineno", 0)) for line in text.split("\n")]

    @staticmethod
    def first(node: ast.stmt) -> int:
        return min([node.lineno, *(one.lineno for one in getattr(node, "decorator_list", []))]) - 1

    def comment(self, node: ast.AST) -> str:
        """The comment behind a line."""
        found = re.search(r"  #.*$", self.old[getattr(node, "end_lineno", 1) - 1])
        return found[0] if found else ""

    # ---- statements

    def block(self, statements: list[ast.stmt], depth: int) -> bool:
        """Statements in a row; whether they certainly leave the function, after which nothing follows."""
        for node in statements:
            mark = len(self.lines)
            self.copy(self.first(node), node.col_offset - depth)
            kept = len(self.lines)
            leaves = self.statement(node, depth)
            if len(self.lines) == kept:
                del self.lines[mark:]  # with the comment that stood above it
            self.after = node.end_lineno or 0
            if leaves:
                self.after = statements[-1].end_lineno or 0
                return True
        return False

    def statement(self, node: ast.stmt, depth: int) -> bool:
        match node:
            case ast.ClassDef():
                self.copy(self.first(node.body[0]), node.col_offset - depth)
                self.block(node.body, depth + 4)
            case ast.FunctionDef():
                counted = [one.arg for one in node.args.args if is_contact(one)]
                for i in range(len(self.spec.contacts)) if counted else [0]:
                    self.function(node, depth, counted, i)
            case ast.For(target=ast.Name(id=name), iter=ast.Name(id=over)) if over in self.ranges:
                self.unrolled(node, name, over, depth)
            case ast.For(iter=ast.Name(id=over)) if over == METHOD_LOOP and over in self.ranges:
                return self.chosen(node, depth) if isinstance(node.body[0], ast.If) else self.of_methods(node, depth)
            case ast.If():
                return self.branch(node, depth, "if")
            case ast.While() | ast.For():
                self.head(node, depth)
                self.block(node.body, depth + 4)
            case _:
                self.simple(node, depth)
        return isinstance(node, (ast.Return, ast.Raise))

    def unrolled(self, node: ast.For, name: str, over: str, depth: int) -> None:
        """A loop over states or contacts, once for each."""
        many = {"contact_indices": range(len(self.spec.contacts)), "state_indices": range(len(self.spec.states))}
        for i in many.get(over, self.spec.velocity_states):
            self.scalarizer.loop_indices[name] = i
            self.after = self.first(node.body[0])
            self.block(node.body, depth)

    def of_methods(self, node: ast.For, depth: int) -> bool:
        """A loop over the methods that are offered, once for each."""
        for name in self.spec.methods:
            self.scalarizer.bind_method(node.target, name)
            self.after = self.first(node.body[0])
            self.block(node.body, depth)
        self.scalarizer.method_bindings = {}
        return False

    def chosen(self, node: ast.For, depth: int) -> bool:
        """A loop that looks for the method in force: a chain of tests, the last of which is not asked for."""
        (test,) = node.body
        assert isinstance(test, ast.If)
        many, leaves = len(self.spec.methods), True
        for n, name in enumerate(self.spec.methods, 1):
            self.scalarizer.bind_method(node.target, name)
            if many > 1:
                asked = f"{'if' if n == 1 else 'elif'} {ast.unparse(self.scalarizer.visit(test.test))}:"
                self.write(" " * depth + (asked if n < many else "else:"), test)
            self.after = self.first(test.body[0])
            leaves = self.block(test.body, depth + (4 if many > 1 else 0)) and leaves
        self.scalarizer.method_bindings = {}
        return leaves and many > 0

    def simple(self, node: ast.stmt, depth: int) -> None:
        new: list[ast.stmt]
        match node:
            case ast.ImportFrom(module="method_registry"):
                names = [ast.alias(name) for name in sorted(self.spec.methods)]
                new = [ast.ImportFrom(None, names, 1)] if names else []
            case ast.ImportFrom() if is_build_time_import(node):
                return
            case ast.Import() | ast.ImportFrom():
                new = [node]
            case _:
                new = self.scalarizer.lower_statement(self.offered(node))
        if len(new) == 1 and is_same_tree(new[0], node):
            self.copy(node.end_lineno or 0, node.col_offset - depth)
            return
        for n, one in enumerate(new):
            whole = ast.unparse(ast.copy_location(one, node))
            text = " " * depth + unparse_bare(one, whole)
            text = text if len(text) <= MAX_LINE_LENGTH else wrap_line(" " * depth + whole)
            self.write(text + self.comment(node) * (n == 0), node)

    def head(self, node: ast.stmt, depth: int, word: str = "", test: ast.expr | None = None) -> None:
        """The first line of a compound statement; copied unless its test has changed."""
        body = self.first(node.body[0])  # type: ignore[attr-defined]
        if isinstance(node, ast.While):
            word, test = "while", self.scalarizer.visit(node.test)
        if test is None or self.stands(node, word, test):
            self.copy(body, node.col_offset - depth)
        else:
            text = wrap_line(f"{' ' * depth}{word} {ast.unparse(test)}:")
            self.write(text + self.comment(node.test), node)  # type: ignore[attr-defined]
            self.after = body

    def stands(self, node: ast.stmt, word: str, test: ast.expr) -> bool:
        """Whether the head of a compound statement can stay as it is."""
        kept = is_same_tree(test, node.test)  # type: ignore[attr-defined]
        return kept and self.old[node.lineno - 1].lstrip().startswith(word + " ")

    def function(self, node: ast.FunctionDef, depth: int, counted: list[str], i: int) -> None:
        outer, self.scalarizer = self.scalarizer, self.fresh(dict.fromkeys(counted, i))
        arguments = []
        for one in node.args.args:
            if self.has_vectors and (kind := annotated_kind(one)):
                self.scalarizer.vector_kinds[one.arg] = kind
                arguments += [ast.unparse(term) for term in self.scalarizer.own_components(ast.Name(one.arg))]
            elif one.arg not in counted:
                arguments.append(one.arg)
        body = self.first(node.body[0])
        if any(isinstance(one, ast.Name) and one.id == "elementwise" for one in node.decorator_list):
            self.after = node.lineno - 1
        if arguments == [one.arg for one in node.args.args] and not (
            annotated_results(node) or any(map(annotated_kind, node.args.args))
        ):
            self.copy(body, node.col_offset - depth)
        else:
            if i:
                self.write("", node)
            name = node.name + (self.spec.contact_suffix(i) if counted else "")
            self.write(wrap_line(f"{' ' * depth}def {name}({', '.join(arguments)}):"), node)
            self.after = body
        mark = len(self.lines)
        self.block(node.body, depth + 4)
        if all(not line.strip() for line in self.lines[mark:]):
            self.write(" " * (depth + 4) + "pass", node)
        if name := self.scalarizer.find_name_clash():
            raise self.scalarizer.error(
                node, f"uses {name} for a number, and a number of a vector gets that name; take another"
            )
        self.scalarizer = outer

    def branch(self, node: ast.If, depth: int, word: str) -> bool:
        test = self.scalarizer.visit(node.test)
        if known_truth(test) is not None:
            chosen = node.body if known_truth(test) else node.orelse
            if not chosen:
                return False
            self.after = self.first(chosen[0])
            return self.block(chosen, depth)
        self.head(node, depth, word, test)
        mark = len(self.lines)
        leaves = self.block(node.body, depth + 4)
        if len(self.lines) == mark:
            self.write(" " * (depth + 4) + "pass", node)
        if not node.orelse:
            return False
        other, mark = node.orelse[0], len(self.lines)
        if isinstance(other, ast.If) and len(node.orelse) == 1 and other.col_offset == node.col_offset:
            self.after = self.first(other)
            if known_truth(self.scalarizer.visit(other.test)) is None:
                return self.branch(other, depth, "elif") and leaves
            self.write(" " * depth + "else:", other)
        else:
            self.copy(self.first(other), node.col_offset - depth)
        leaves = self.block(node.orelse, depth + 4) and leaves
        if all(line.lstrip().startswith(("else:", "#")) for line in self.lines[mark:]):
            del self.lines[mark:]
            return False
        return leaves

    def offered(self, node: ast.stmt) -> ast.stmt:
        """A choice of methods or laws without the items that are not offered; one that starts with such an item starts
        with the first that is offered."""
        match node:
            case ast.Assign(
                targets=[ast.Name(id=name)],
                value=ast.Call(func=ast.Name(id="Choice"), args=[start, text, items]) as choice,
            ) if possible := self.spec.choices.get(name):
                kept = ast.unparse(start).removesuffix(".NUMBER") in self.spec.methods
                if not kept and self.declared.constants.get(getattr(start, "id", "")) not in possible:
                    start = ast.Constant(possible[0])
                if isinstance(items, ast.Tuple):
                    items = replace_fields(items, elts=[one for one in items.elts if not self.is_gone(one)])
                return replace_fields(node, value=replace_fields(choice, args=[start, text, items]))
        return node

    def is_gone(self, node: ast.expr) -> bool:
        """Whether this is an item that is not offered, or its name."""
        return (item_label(node) or self.declared.constants.get(getattr(node, "id", ""))) in self.spec.excluded


def is_build_time_import(node: ast.ImportFrom) -> bool:
    """Whether this imports what does not travel: the vectors, and the methods that are found."""
    return (node.module or "").rsplit(".", 1)[-1] in ("vectors", "method_registry")


def is_contact(argument: ast.arg) -> bool:
    return isinstance(argument.annotation, ast.Name) and argument.annotation.id == "ContactIndex"


def unparse_bare(node: ast.stmt, text: str) -> str:
    """The text of a simple statement, without brackets around a row."""
    value = getattr(node, "value", None)
    if not (isinstance(value, ast.Tuple) and value.elts):
        return text
    row = ast.unparse(value)
    return text.removesuffix(row) + row[1:-1]


def wrap_line(text: str, depth: int = 0) -> str:
    """A line that is too long on several, broken inside its brackets, of which `depth` are open before it."""
    if len(text) <= MAX_LINE_LENGTH:
        return text
    blanks, whole = text[: len(text) - len(text.lstrip())], not depth
    if not depth and text.count(" = ") > 1:  # a row of targets
        *targets, value = text.strip().split(" = ")
        half = len(targets) // 2
        return "\n".join(
            wrap_line(f"{blanks}{' = '.join(part)} = {value}") for part in (targets[:half], targets[half:])
        )
    quote, places = "", {}
    inner = blanks if depth else blanks + "    "
    for n, letter in enumerate(text[:MAX_LINE_LENGTH]):
        if letter in "\"'" and quote in ("", letter):
            quote = "" if quote else letter
        depth += 0 if quote else (letter in "([") - (letter in ")]")
        ends = text[n - 1] == "," or text[n - 2 : n] in (" +", " -") or text[n + 1 : n + 4] in ("if ", "and")
        if letter == " " and depth > 0 and not quote and ends and n > len(inner):
            places[depth] = n
    if not places:
        word = next((word for word in (" = ", "return ", "if ", "while ") if whole and word in text), "")
        head, _, value = text.partition(word) if word else (text, "", "")
        value, colon = (value[:-1], ":") if value.endswith(":") else (value, "")
        return wrap_line(f"{head}{word}({value}){colon}") if word and not is_bracketed(value) else text
    shallow = min(places)
    n = places[shallow]
    return text[:n] + "\n" + wrap_line(inner + text[n + 1 :].lstrip(), shallow)


def is_bracketed(text: str) -> bool:
    """Whether one pair of brackets holds all of an expression."""
    depth = 0
    for n, letter in enumerate(text):
        depth += (letter in "([") - (letter in ")]")
        if not depth:
            return n == len(text) - 1
    return True
