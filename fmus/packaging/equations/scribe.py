"""Expressions as text, line by line: what is needed twice is calculated once, under the name that the author gave."""

import ast
from collections import Counter
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from math import pi
from typing import Any

from ...runtime.variable_declarations import VariableDeclaration
from .algebra import inside
from .declared import Choice, Fixed, Input, Output, Parameter
from .expressions import Expression, Mistake, Operand, Term

INDENT = "    "
LONG = 50  # letters: what has a name and is longer stands on a line of its own
BINARY: dict[str, ast.operator] = {"+": ast.Add(), "-": ast.Sub(), "*": ast.Mult(), "/": ast.Div()}
COMPARED: dict[str, ast.cmpop] = {"<": ast.Lt(), "<=": ast.LtE(), ">": ast.Gt(), ">=": ast.GtE(), "==": ast.Eq()}


class Scribe:
    """The lines of one block.

    `given`: what variables are called here.  `kept`: constants, which are attributes of the model.
    """

    def __init__(
        self, given: Mapping[Expression, str], kept: Collection[Expression], taken: Collection[str], depth: int
    ) -> None:
        self.given, self.kept, self.taken = dict(given), kept, set(taken)
        self.lines: list[str] = []
        self.depth = depth
        self.known: dict[int, str] = {}  # number of an expression -> its local name
        self.names: dict[int, str] = {}
        self._uses: Counter[int] = Counter()
        self._numbers: dict[tuple[Any, ...], int] = {}  # equal expressions have one number
        self._of: dict[int, int] = {}
        self._alive: list[Operand] = []  # whose identity must not pass on to another

    # ---- lines

    def say(self, line: str) -> None:
        self.lines.append(INDENT * self.depth + line)

    def let(self, target: str, e: Operand) -> None:
        if (text := self.text(e)) != target:
            self.say(f"{target} = {text}")

    def fresh(self, name: str) -> str:
        """The name, or another where it is taken: from here on it is."""
        if name in self.taken:
            name = next(n for i in range(1, 1000) if (n := f"{name}_{i}") not in self.taken)
        self.taken.add(name)
        return name

    @contextmanager
    def block(self, head: str) -> Iterator[None]:
        """The lines below a head; what is calculated there is not known behind it."""
        self.say(head)
        outside, self.depth = dict(self.known), self.depth + 1
        yield
        self.known, self.depth = outside, self.depth - 1

    # ---- expressions

    def number(self, e: Operand) -> int:
        if isinstance(e, Expression) and id(e) in self._of:
            return self._of[id(e)]
        key: tuple[Any, ...]
        if isinstance(e, Term) and e not in self.given and not self._is_kept(e):
            key = e.op, *map(self.number, e.args)
        elif isinstance(e, Output) and e not in self.given:
            key = "is", self.number(e.means)
        else:
            key = ("leaf", id(e)) if isinstance(e, Expression) else ("number", repr(e))
        found = self._numbers.setdefault(key, len(self._numbers)) if key[0] != "is" else key[1]
        self._alive.append(e)
        if isinstance(e, Expression):
            self._of[id(e)] = found
            if e.name and (isinstance(e, VariableDeclaration) or found not in self.names):
                self.names[found] = e.name
        return found

    def _is_kept(self, e: Operand) -> bool:
        return isinstance(e, Expression) and any(e is one for one in self.kept)

    def _is_leaf(self, e: Operand) -> bool:
        return not isinstance(e, (Term, Output)) or e in self.given or self._is_kept(e)

    def count(self, *targets: Operand) -> None:
        """Note what is coming, so that what is needed twice gets a name."""
        for e in targets:
            if not self._is_leaf(e):
                if isinstance(e, Output):
                    self.number(e)
                    self.count(e.means)
                    continue
                number = self.number(e)
                self._uses[number] += 1
                if self._uses[number] == 1:
                    self.count(*inside(e))

    def is_shared(self, e: Operand) -> bool:
        """Whether a term has been counted more than once."""
        return isinstance(e, Term) and self._uses[self.number(e)] > 1

    def text(self, e: Operand) -> str:
        return ast.unparse(ast.fix_missing_locations(self._node(e)))

    def hold(self, e: Operand) -> str:
        """The name of a local variable that has the value, whether or not it is needed twice."""
        number = self.number(e)
        if number not in self.known:
            node = self._node(e)
            if number not in self.known:
                self._keep(number, node)
        return self.known[number]

    def _keep(self, number: int, node: ast.expr) -> ast.expr:
        name = self._local(number)
        self.say(f"{name} = {ast.unparse(ast.fix_missing_locations(node))}")
        self.known[number] = name
        return ast.Name(name)

    def _local(self, number: int) -> str:
        """A name for an expression: the author's, if it is free."""
        name = self.names.get(number, "")
        if not name or name in self.known.values() or name in self.given.values():
            name = next(n for i in range(1, 1000) if (n := f"{name or 'u'}{i}") not in self.taken)
        self.taken.add(name)
        return name

    def _node(self, e: Operand) -> ast.expr:
        if not isinstance(e, Expression):
            return ast.Name("pi") if e == pi else ast.parse(repr(e), mode="eval").body
        if e in self.given:
            return ast.parse(self.given[e], mode="eval").body
        if (number := self.number(e)) in self.known:
            return ast.Name(self.known[number])
        if isinstance(e, (Parameter, Fixed, Input, Choice)) or self._is_kept(e):
            return ast.Attribute(ast.Name("self"), e.name)
        if isinstance(e, Output):
            return self._node(e.means)
        if not isinstance(e, Term):
            raise Mistake(f"{e.name} is not known where it is needed", e.place)
        if e.op == "choose" and not all(map(self._is_leaf, e.args[1:])):
            return self._branch(e, number)
        node = self._built(e)
        if self._uses[number] > 1 or (number in self.names and len(ast.unparse(node)) > LONG):
            return self._keep(number, node)
        return node

    def _branch(self, e: Term, number: int) -> ast.expr:
        name, test = self._local(number), self.text(e.args[0])
        for head, case in (f"if {test}:", e.args[1]), ("else:", e.args[2]):
            with self.block(head):
                self.say(f"{name} = {self.text(case)}")
        self.known[number] = name
        return ast.Name(name)

    def _built(self, e: Term) -> ast.expr:
        args = [self._node(one) for one in e.args]
        if e.op in BINARY:
            return signed(e.op, *args)
        if e.op == "neg":
            return minus(args[0])
        if e.op in COMPARED:
            if e.op == "==":
                args[1] = ast.Constant(int(e.args[1]))
            return ast.Compare(args[0], [COMPARED[e.op]], [args[1]])
        if e.op == "choose":
            return ast.IfExp(*args)
        return ast.Call(ast.Name(e.op), args, [])


def signed(op: str, a: ast.expr, b: ast.expr) -> ast.expr:
    """a op b; a minus in front of a product or quotient is drawn into the sum around it, which has the same bits."""
    other = {"+": "-", "-": "+"}
    inner = b
    while isinstance(inner, ast.BinOp) and isinstance(inner.op, (ast.Mult, ast.Div)):
        inner = inner.left
    if op in other and isinstance(inner, ast.UnaryOp):
        return ast.BinOp(a, BINARY[other[op]], unsigned(b))
    return ast.BinOp(a, BINARY[op], b)


def minus(node: ast.expr) -> ast.expr:
    """The negative; of a product or a quotient that of its first factor, which has the same bits."""
    if isinstance(node, ast.BinOp) and isinstance(node.op, (ast.Mult, ast.Div)):
        return ast.BinOp(minus(node.left), node.op, node.right)
    return ast.UnaryOp(ast.USub(), node)


def unsigned(node: ast.expr) -> ast.expr:
    """A product without the minus in front."""
    if isinstance(node, ast.BinOp):
        return ast.BinOp(unsigned(node.left), node.op, node.right)
    assert isinstance(node, ast.UnaryOp)
    return node.operand
