"""Emits a lowered file: unchanged lines are copied with comments; all lines keep their source line numbers."""

import ast
import re

from ..syntax_trees import is_same_tree, parsed_module, replace_fields
from .constant_folding import known_truth
from .layout import ModelLayout
from .scalarize import LOOP_RANGES, METHOD_LOOP, Scalarizer
from .source_symbols import SourceSymbols, annotated_kind, annotated_results, item_label, pair_rates

MAX_LINE_LENGTH = 120


class SourceLine(str):
    """A line of text with the number of its source line."""

    __slots__ = ("source",)
    source: int

    @classmethod
    def of(cls, text: str, source: int) -> "SourceLine":
        """Create a line with its source line number."""
        line = cls(text)
        line.source = source
        return line


class SourceEmitter:
    """Lowers a file line by line; `vectors` is whether it uses vectors."""

    def __init__(self, spec: ModelLayout, declared: SourceSymbols, path: str, text: str, vectors: bool) -> None:
        self.spec, self.declared, self.path, self.has_vectors = spec, declared, path, vectors
        self.old = [SourceLine.of(line, n) for n, line in enumerate(text.split("\n"), 1)]
        self.lines: list[SourceLine] = []
        self.after = 0  # number of source lines already processed
        self.scalarizer = self.new_scalarizer()
        body = parsed_module(text).body
        imports = [node for node in body if isinstance(node, ast.ImportFrom) and is_build_time_import(node)]
        self.ranges = {alias.name for node in imports for alias in node.names} & {*LOOP_RANGES, METHOD_LOOP}
        self.lower_block(body, 0)
        self.lines += self.old[self.after :]

    def new_scalarizer(self, index: dict[str, int] | None = None) -> Scalarizer:
        """Create the scalarizer of a function; `index` binds loop variables."""
        return Scalarizer(self.spec, self.declared, self.path, self.has_vectors, index)

    # ---- lines

    def copy_lines(self, end: int, shift: int) -> None:
        """Copy source lines up to `end`, moved left by `shift` spaces."""
        for line in self.old[self.after : end]:
            moved = line[shift:] if shift > 0 and not line[:shift].strip() else " " * -shift + line if line else line
            self.lines.append(SourceLine.of(moved, line.source))
        self.after = max(self.after, end)

    def write_lines(self, text: str, node: ast.AST) -> None:
        """Emit lines for a node."""
        self.lines += [SourceLine.of(line, getattr(node, "lineno", 0)) for line in text.split("\n")]

    @staticmethod
    def first_line(node: ast.stmt) -> int:
        """Return the zero-based first line of a statement, including decorators."""
        return min([node.lineno, *(decorator.lineno for decorator in getattr(node, "decorator_list", []))]) - 1

    def trailing_comment(self, node: ast.AST) -> str:
        """Return the comment at the end of a line."""
        match = re.search(r"  #.*$", self.old[getattr(node, "end_lineno", 1) - 1])
        return match[0] if match else ""

    # ---- statements

    def lower_block(self, statements: list[ast.stmt], depth: int) -> bool:
        """Lower a block; return whether it always leaves the function, so that later statements are dropped."""
        for node in statements:
            start = len(self.lines)
            self.copy_lines(self.first_line(node), node.col_offset - depth)
            n_lines = len(self.lines)
            leaves = self.lower_any_statement(node, depth)
            if len(self.lines) == n_lines:
                del self.lines[start:]  # with the comment above it
            self.after = node.end_lineno or 0
            if leaves:
                self.after = statements[-1].end_lineno or 0
                return True
        return False

    def lower_any_statement(self, node: ast.stmt, depth: int) -> bool:
        """Lower a statement; return whether it always leaves the function."""
        match node:
            case ast.ClassDef():
                self.copy_lines(self.first_line(node.body[0]), node.col_offset - depth)
                self.lower_block(node.body, depth + 4)
            case ast.FunctionDef(body=[ast.Expr(ast.Constant(str()))]):
                pass  # a declaration
            case ast.FunctionDef():
                counted = [argument.arg for argument in node.args.args if is_contact(argument)]
                for i in range(len(self.spec.contacts)) if counted else [0]:
                    self.lower_function(node, depth, counted, i)
            case ast.For(target=ast.Name(id=name), iter=ast.Name(id=over)) if over in self.ranges:
                self.unroll_indices(node, name, over, depth)
            case ast.For(iter=ast.Name(id=over)) if over == METHOD_LOOP and over in self.ranges:
                return (
                    self.lower_method_search(node, depth)
                    if isinstance(node.body[0], ast.If)
                    else self.unroll_methods(node, depth)
                )
            case ast.If():
                return self.lower_if(node, depth, "if")
            case ast.While() | ast.For():
                self.emit_head(node, depth)
                self.lower_block(node.body, depth + 4)
            case _:
                self.lower_simple(node, depth)
        return isinstance(node, (ast.Return, ast.Raise))

    def unroll_indices(self, node: ast.For, name: str, indices: str, depth: int) -> None:
        """Unroll a loop over states or contacts."""
        index_ranges = {
            "contact_indices": range(len(self.spec.contacts)),
            "state_indices": range(len(self.spec.states)),
        }
        for i in index_ranges.get(indices, self.spec.velocity_states):
            self.scalarizer.loop_indices[name] = i
            self.after = self.first_line(node.body[0])
            self.lower_block(node.body, depth)

    def unroll_methods(self, node: ast.For, depth: int) -> bool:
        """Unroll a loop over the included methods."""
        for name in self.spec.methods:
            self.scalarizer.bind_method(node.target, name)
            self.after = self.first_line(node.body[0])
            self.lower_block(node.body, depth)
        self.scalarizer.method_bindings = {}
        return False

    def lower_method_search(self, node: ast.For, depth: int) -> bool:
        """Turn a loop that finds the selected method into a chain of tests with a final else."""
        (test,) = node.body
        assert isinstance(test, ast.If)
        count, leaves = len(self.spec.methods), True
        for n, name in enumerate(self.spec.methods, 1):
            self.scalarizer.bind_method(node.target, name)
            if count > 1:
                head = f"{'if' if n == 1 else 'elif'} {ast.unparse(self.scalarizer.visit(test.test))}:"
                self.write_lines(" " * depth + (head if n < count else "else:"), test)
            self.after = self.first_line(test.body[0])
            leaves = self.lower_block(test.body, depth + (4 if count > 1 else 0)) and leaves
        self.scalarizer.method_bindings = {}
        return leaves and count > 0

    def lower_simple(self, node: ast.stmt, depth: int) -> None:
        """Lower a simple statement; copied if it does not change."""
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
                new = self.scalarizer.lower_statement(self.drop_excluded_items(node))
        if len(new) == 1 and is_same_tree(new[0], node):
            self.copy_lines(node.end_lineno or 0, node.col_offset - depth)
            return
        for n, line in enumerate(new):
            whole = ast.unparse(ast.copy_location(line, node))
            text = " " * depth + unparse_bare(line, whole)
            text = text if len(text) <= MAX_LINE_LENGTH else wrap_line(" " * depth + whole)
            self.write_lines(text + self.trailing_comment(node) * (n == 0), node)

    def emit_head(self, node: ast.stmt, depth: int, word: str = "", test: ast.expr | None = None) -> None:
        """Emit the first line of a compound statement; copied unless its test has changed."""
        body = self.first_line(node.body[0])  # type: ignore[attr-defined]
        if isinstance(node, ast.While):
            word, test = "while", self.scalarizer.visit(node.test)
        if test is None or self.is_unchanged(node, word, test):
            self.copy_lines(body, node.col_offset - depth)
        else:
            text = wrap_line(f"{' ' * depth}{word} {ast.unparse(test)}:")
            self.write_lines(text + self.trailing_comment(node.test), node)  # type: ignore[attr-defined]
            self.after = body

    def is_unchanged(self, node: ast.stmt, word: str, test: ast.expr) -> bool:
        """Return whether the first line of a compound statement is unchanged."""
        same_test = is_same_tree(test, node.test)  # type: ignore[attr-defined]
        return same_test and self.old[node.lineno - 1].lstrip().startswith(word + " ")

    def lower_function(self, node: ast.FunctionDef, depth: int, counted: list[str], i: int) -> None:
        """Lower a function with the contact index `i`."""
        outer, self.scalarizer = self.scalarizer, self.new_scalarizer(dict.fromkeys(counted, i))
        arguments = []
        pairs = pair_rates([(argument.arg, argument.annotation) for argument in node.args.args])
        self.scalarizer.states_of_rates |= {rates: ast.Name(states) for rates, states in pairs.items()}
        for argument in node.args.args:
            if self.has_vectors and (kind := annotated_kind(argument)):
                self.scalarizer.vector_kinds[argument.arg] = kind
                arguments += [ast.unparse(term) for term in self.scalarizer.own_components(ast.Name(argument.arg))]
            elif argument.arg not in counted:
                arguments.append(argument.arg)
        body = self.first_line(node.body[0])
        if any(isinstance(mark, ast.Name) and mark.id == "elementwise" for mark in node.decorator_list):
            self.after = node.lineno - 1
        if arguments == [argument.arg for argument in node.args.args] and not (
            annotated_results(node) or any(map(annotated_kind, node.args.args))
        ):
            self.copy_lines(body, node.col_offset - depth)
        else:
            if i:
                self.write_lines("", node)
            name = node.name + (self.spec.contact_suffix(i) if counted else "")
            self.write_lines(wrap_line(f"{' ' * depth}def {name}({', '.join(arguments)}):"), node)
            self.after = body
        start = len(self.lines)
        self.lower_block(node.body, depth + 4)
        if all(not line.strip() for line in self.lines[start:]):
            self.write_lines(" " * (depth + 4) + "pass", node)
        if name := self.scalarizer.find_name_clash():
            raise self.scalarizer.error(
                node, f"uses {name} for a scalar, but a component of a vector gets that name; take another"
            )
        self.scalarizer = outer

    def lower_if(self, node: ast.If, depth: int, word: str) -> bool:
        """Lower an if statement; return whether all branches leave the function."""
        test = self.scalarizer.visit(node.test)
        if known_truth(test) is not None:
            branch = node.body if known_truth(test) else node.orelse
            if not branch:
                return False
            self.after = self.first_line(branch[0])
            return self.lower_block(branch, depth)
        self.emit_head(node, depth, word, test)
        start = len(self.lines)
        leaves = self.lower_block(node.body, depth + 4)
        if len(self.lines) == start:
            self.write_lines(" " * (depth + 4) + "pass", node)
        if not node.orelse:
            return False
        other, start = node.orelse[0], len(self.lines)
        if isinstance(other, ast.If) and len(node.orelse) == 1 and other.col_offset == node.col_offset:
            self.after = self.first_line(other)
            if known_truth(self.scalarizer.visit(other.test)) is None:
                return self.lower_if(other, depth, "elif") and leaves
            self.write_lines(" " * depth + "else:", other)
        else:
            self.copy_lines(self.first_line(other), node.col_offset - depth)
        leaves = self.lower_block(node.orelse, depth + 4) and leaves
        if all(line.lstrip().startswith(("else:", "#")) for line in self.lines[start:]):
            del self.lines[start:]
            return False
        return leaves

    def drop_excluded_items(self, node: ast.stmt) -> ast.stmt:
        """Remove excluded items from a choice; the default becomes the first included item if it is excluded."""
        match node:
            case ast.Assign(
                targets=[ast.Name(id=name)],
                value=ast.Call(func=ast.Name(id="Choice"), args=[start, text, items]) as choice,
            ) if possible := self.spec.choices.get(name):
                is_included = ast.unparse(start).removesuffix(".NUMBER") in self.spec.methods
                if not is_included and self.declared.constants.get(getattr(start, "id", "")) not in possible:
                    start = ast.Constant(possible[0])
                if isinstance(items, ast.Tuple):
                    items = replace_fields(items, elts=[item for item in items.elts if not self.is_gone(item)])
                return replace_fields(node, value=replace_fields(choice, args=[start, text, items]))
        return node

    def is_gone(self, node: ast.expr) -> bool:
        """Return whether this is an excluded item, or its name."""
        return (item_label(node) or self.declared.constants.get(getattr(node, "id", ""))) in self.spec.excluded


def is_build_time_import(node: ast.ImportFrom) -> bool:
    """Return whether this imports a build-time module: vectors or the method registry."""
    return (node.module or "").rsplit(".", 1)[-1] in ("vectors", "method_registry")


def is_contact(argument: ast.arg) -> bool:
    """Return whether an argument is a contact index."""
    return isinstance(argument.annotation, ast.Name) and argument.annotation.id == "ContactIndex"


def unparse_bare(node: ast.stmt, text: str) -> str:
    """Unparse a simple statement without parentheses around tuples."""
    value = getattr(node, "value", None)
    if not (isinstance(value, ast.Tuple) and value.elts):
        return text
    row = ast.unparse(value)
    return text.removesuffix(row) + row[1:-1]


def wrap_line(text: str) -> str:
    """Break a long line inside its brackets."""
    lines: list[str] = []
    depth = 0  # number of brackets that are open where the text begins
    while len(text) > MAX_LINE_LENGTH:
        blanks, whole = text[: len(text) - len(text.lstrip())], not lines
        if whole and text.count(" = ") > 1:  # several targets
            *targets, value = text.strip().split(" = ")
            half = len(targets) // 2
            return "\n".join(
                wrap_line(f"{blanks}{' = '.join(part)} = {value}") for part in (targets[:half], targets[half:])
            )
        inner = blanks + "    " if whole else blanks
        places = break_places(text, depth, len(inner))
        if not places:
            word = next((word for word in (" = ", "return ", "if ", "while ") if whole and word in text), "")
            head, _, value = text.partition(word) if word else (text, "", "")
            value, colon = (value[:-1], ":") if value.endswith(":") else (value, "")
            if word and not is_bracketed(value):
                return wrap_line(f"{head}{word}({value}){colon}")
            break
        depth = min(places)
        n = places[depth]
        lines.append(text[:n])
        text = inner + text[n + 1 :].lstrip()
    return "\n".join([*lines, text])


def break_places(text: str, depth: int, indent: int) -> dict[int, int]:
    """Return for each depth of brackets the last place after `indent` where a line may end."""
    quote, places = "", {}
    for n, letter in enumerate(text[:MAX_LINE_LENGTH]):
        if letter in "\"'" and quote in ("", letter):
            quote = "" if quote else letter
        depth += 0 if quote else (letter in "([") - (letter in ")]")
        ends = text[n - 1] == "," or text[n - 2 : n] in (" +", " -") or text[n + 1 : n + 4] in ("if ", "and")
        if letter == " " and depth > 0 and not quote and ends and n > indent:
            places[depth] = n
    return places


def is_bracketed(text: str) -> bool:
    """Return whether one pair of brackets encloses the whole expression."""
    depth = 0
    for n, letter in enumerate(text):
        depth += (letter in "([") - (letter in ")]")
        if not depth:
            return n == len(text) - 1
    return True
