"""The body of one function of the numerics as C statements.

Names are declared at the top, as in Python they live as long as the function.  A statement in which something may
fault is followed by a check that leaves the function, just where Python's exception would.
"""

import ast
from collections.abc import Callable
from types import FunctionType
from typing import TYPE_CHECKING

from ..lowering import function_tree
from ..reserved_names import C_NAMES
from .expressions import LEAVE, SIGN, Expressions, Value, group
from .kinds import FLOAT, INT, Group, Kind, Known, Object, Scalar, declare, spell
from .refusal import place

if TYPE_CHECKING:
    from .program import Program


class Body(Expressions):
    """One function, specialised to the kinds of its arguments."""

    def __init__(self, program: "Program", function: FunctionType, kinds: list[Kind]) -> None:
        super().__init__(program, function)
        self.result: Kind | None = None
        self.returns = False  # a return was seen, so the result is known
        self.breaks: list[list[set[str]]] = []  # for every loop around: what has a value at its breaks
        tree = function_tree(function)
        self.sentence = (ast.get_docstring(tree) or "").replace("*/", "* /").splitlines()[:1]
        self.parameters = [argument.arg for argument in tree.args.args]
        for name, kind in zip(self.parameters, kinds, strict=True):
            self.name(tree, name, kind)
            self.assigned.add(name)
        if self.block(tree.body) and self.result:
            raise self.refused(tree, "may end without a return", "return a value on every way")

    def text(self, name: str) -> str:
        """The C function."""
        parameters = [declare(self.locals[p], p) for p in self.parameters if not isinstance(self.locals[p], Known)]
        parameters += ["bool *fault"] * self.faults
        about = " - ".join([place(self.function), *self.sentence])
        head = declare(self.result, name) if self.result else f"void {name}"
        leave = f"return {self.nothing()};" if self.result else "return;"
        body = [line.format(leave=leave) if line.lstrip() == LEAVE else line for line in self.lines]
        given = ", ".join(parameters) or "void"
        lines = [f"/* {about} */", f"static {head}({given})", "{", *self.declarations(), *body, "}"]
        return "".join(f"{line}\n" for line in lines)

    def declarations(self) -> list[str]:
        """The local names, a line for each kind."""
        kinds: dict[str, list[str]] = {}
        for name, kind in self.locals.items():
            if name not in self.parameters:
                kinds.setdefault(spell(kind), []).append(name)
        return [f"    {declare_all(c, names)}" for c, names in kinds.items()]

    def nothing(self) -> str:
        """What is returned with the fault flag up."""
        return f"({self.result.c}){{0}}" if isinstance(self.result, Group) else "0"

    # ---- lines

    def braces(self, head: str, body: Callable[[], bool]) -> bool:
        if head.startswith("else") and self.lines[-1].endswith("}"):
            head = f"{self.lines.pop().strip()} {head}"
        self.emit(head + " {")
        self.depth += 1
        falls = body()
        self.depth -= 1
        self.emit("}")
        return falls

    def begin(self) -> None:
        """Nothing of the statement at hand has been seen yet."""
        self.faulty, self.clean, self.alone = False, True, None

    def block(self, statements: list[ast.stmt]) -> bool:
        """Statements in a row; whether their end is reached.  What comes after a return is left out."""
        for statement in statements:
            self.begin()
            if not self.visit(statement):
                return False
        return True

    # ---- statements: each tells whether the next one is reached

    def visit_Pass(self, node: ast.Pass) -> bool:
        return True

    def visit_Expr(self, node: ast.Expr) -> bool:
        if isinstance(node.value, ast.Constant) and isinstance(node.value.value, str):
            return True  # a docstring
        self.alone = node.value
        value = self.visit(node.value)
        if not isinstance(node.value, ast.Call) or (isinstance(value.kind, Known) and value.kind.value is not None):
            raise self.refused(node, "has no effect", "leave it out")
        self.emit(f"{value.text};" if value.kind == Known(None) else f"(void){value.within(SIGN)};")
        self.check()
        return True

    def visit_Return(self, node: ast.Return) -> bool:
        value = self.value(node.value) if node.value else None
        kind = value.kind if value else None
        if self.returns and kind != self.result:
            raise self.refused(node, "returns something else than the return before", "return the same kind of numbers")
        self.result, self.returns = kind, True
        self.emit(f"return {value.text};" if value else "return;")
        return False

    def value(self, node: ast.expr) -> Value:
        """The right-hand side of an assignment or what is returned."""
        if isinstance(node, ast.Tuple):
            return group([self.number(part) for part in node.elts])
        self.alone = node
        value = self.visit(node)
        return value if isinstance(value.kind, (Group, Object)) else self.at_run_time(node, value)

    def visit_Assign(self, node: ast.Assign) -> bool:
        match node:
            case ast.Assign(targets=[ast.Tuple(elts=targets)], value=ast.Tuple(elts=values)):
                if len(targets) != len(values):
                    raise self.refused(node, "has more or fewer values than names", "write one for each")
                self.side_by_side(targets, values)
                return True
        value = self.value(node.value)
        if len(node.targets) > 1 or isinstance(node.targets[0], ast.Tuple):
            value = self.kept(value)
            self.check()
        for target in node.targets:
            if isinstance(target, ast.Tuple):
                self.unpack(target, value)
            else:
                self.assign(target, value)
        return True

    def side_by_side(self, targets: list[ast.expr], values: list[ast.expr]) -> None:
        """a, b = x, y: all values come first where the order can be told."""
        found = [self.number(value) for value in values]
        later = [spelled(value) for value in values]
        apart = all(not spelled(target) & set().union(*later[i + 1 :]) for i, target in enumerate(targets))
        calls = any(isinstance(part, ast.Call) for value in values for part in ast.walk(value))
        fields = not all(isinstance(target, ast.Name) for target in targets)  # which a call may read
        if self.faulty or not apart or (calls and fields):
            found = [self.kept(value) for value in found]
            self.check()
        for target, value in zip(targets, found, strict=True):
            self.assign(target, value)

    def unpack(self, target: ast.Tuple, value: Value) -> None:
        if not isinstance(value.kind, Group) or len(value.kind.parts) != len(target.elts):
            raise self.refused(target, "does not fit what is returned", "write one name for each number")
        for i, (part, kind) in enumerate(zip(target.elts, value.kind.parts, strict=True)):
            self.assign(part, Value(kind, f"{value.text}._{i}"))

    def visit_AugAssign(self, node: ast.AugAssign) -> bool:
        loaded = ast.copy_location(ast.parse(ast.unparse(node.target), mode="eval").body, node)
        value = ast.copy_location(ast.BinOp(loaded, node.op, node.value), node)
        self.assign(node.target, self.number(value))
        return True

    def assign(self, target: ast.expr, value: Value) -> None:
        if isinstance(target, ast.Name):
            if target.id == "_":  # not wanted
                return
            self.name(target, target.id, value.kind)
            self.assigned.add(target.id)
            place = target.id
        else:
            self.pure = False
            if self.faulty:  # then nothing is assigned
                value = self.kept(value)
                self.check()
            clean = self.clean
            found = self.visit(target)
            self.clean = clean
            self.same(target, found.kind, value.kind)
            place = found.text
        self.emit(f"{place} = {value.text};")
        self.check()

    def name(self, node: ast.AST, name: str, kind: Kind) -> None:
        """Take a name into use; it keeps its kind for life."""
        if name in C_NAMES:
            raise self.refused(node, f"uses {name}, a word of C", "take another name")
        self.same(node, self.locals.setdefault(name, kind), kind)

    def same(self, node: ast.AST, old: Kind, new: Kind) -> None:
        if old == new and isinstance(new, (Scalar, Object, Known)):
            return
        words = [getattr(kind, "name", "no number") for kind in (old, new)]
        instead = "write 0.0, not 0" if (old, new) == (FLOAT, INT) else "use another name"
        raise self.refused(node, f"is assigned a {words[1]} where there was a {words[0]}", instead)

    # ---- branches and loops

    def visit_If(self, node: ast.If) -> bool:
        return self.branch(node, "if")

    def branch(self, node: ast.If, word: str) -> bool:
        test = self.truth(node.test)
        condition = self.tested(test)
        before = set(self.assigned)
        falls = self.braces(f"{word} ({condition})", lambda: self.block(node.body))
        after, self.assigned = self.assigned, before
        if node.orelse:
            falls_else = self.otherwise(node.orelse)
            if not (falls and falls_else):
                after = self.assigned if falls_else else after
                self.assigned = after
                return falls or falls_else
        self.assigned = self.assigned & after if falls else self.assigned
        return True

    def otherwise(self, statements: list[ast.stmt]) -> bool:
        """else; or else if, where the test needs no line of its own."""
        match statements:
            case [ast.If(test=test) as inner]:
                lines, self.lines = self.lines, []
                self.truth(test)
                plain, self.lines = not self.lines and not self.faulty, lines
                self.begin()
                if plain:
                    return self.branch(inner, "else if")
        return self.braces("else", lambda: self.block(statements))

    def tested(self, test: Value) -> str:
        """The text of a test, kept in a name of its own if it may fault."""
        if not self.faulty:
            return test.text
        name = self.temporary(test.kind, test.text)
        self.check()
        return name

    def visit_While(self, node: ast.While) -> bool:
        if node.orelse:
            raise self.refused(node, "has an else", "use a flag")
        before = set(self.assigned)
        self.breaks.append([])
        lines, self.lines = self.lines, []
        self.depth += 1
        test = self.truth(node.test)
        endless, condition = test.text == "true", self.tested(test)
        prelude, self.lines = self.lines, lines
        self.depth -= 1
        head = f"while ({'true' if prelude else condition})"

        def body() -> bool:
            if prelude:
                self.lines += prelude
                self.emit(f"if (!{condition if condition.isidentifier() else f'({condition})'}) break;")
            return self.block(node.body)

        self.braces(head, body)
        ways = self.breaks.pop()
        if endless:
            self.assigned = set.intersection(*ways) if ways else before
            return bool(ways)
        self.assigned = before
        return True

    def visit_For(self, node: ast.For) -> bool:
        match node:
            case ast.For(target=ast.Name(), iter=ast.Call(func=ast.Name(id="range"), args=args), orelse=[]):
                bounds = [self.number(argument) for argument in args]
            case _:
                raise self.refused(node, "is no loop over a range", "write for i in range(n)")
        if len(bounds) not in (1, 2) or any(bound.kind is not INT for bound in bounds):
            raise self.refused(node, "has another range than of one or two ints", "write range(n) or range(m, n)")
        low, high = (self.kept(bound).text for bound in [Value(INT, "0"), *bounds][-2:])
        self.check()
        counter, before = f"_{next(self.temporaries)}", set(self.assigned)
        self.breaks.append([])

        def body() -> bool:
            self.assign(node.target, Value(INT, counter))
            return self.block(node.body)

        self.braces(f"for (int64_t {counter} = {low}; {counter} < {high}; {counter}++)", body)
        self.breaks.pop()
        self.assigned = before
        return True

    def visit_Break(self, node: ast.Break) -> bool:
        self.breaks[-1].append(set(self.assigned))
        self.emit("break;")
        return False

    def visit_Continue(self, node: ast.Continue) -> bool:
        self.emit("continue;")
        return False


def spelled(node: ast.expr) -> set[str]:
    """The names and attributes in an expression."""
    names = {part.id for part in ast.walk(node) if isinstance(part, ast.Name)}
    return names - {"self"} | {part.attr for part in ast.walk(node) if isinstance(part, ast.Attribute)}


def declare_all(c: str, names: list[str]) -> str:
    """double a, b;  or  struct Methods *a, *b;"""
    star = "*" if c.endswith("*") else ""
    return f"{c.rstrip('*').rstrip()} " + ", ".join(star + name for name in names) + ";"
