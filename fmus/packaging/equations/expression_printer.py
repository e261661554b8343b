"""Prints expressions as Python statements; common subexpressions become local variables with the names of the model."""

import ast
from collections import Counter
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from math import pi
from typing import Any

from ...runtime.variable_declarations import VariableDeclaration
from .algebra import depends_on, operands
from .conditions import is_in_domain
from .expressions import Expression, ModelError, Operand, Term
from .model_declaration import Choice, Output, SettableVariable

INDENT = "    "
MAX_INLINE_LENGTH = 50  # characters; longer named subexpressions get a separate line
BINARY_OPERATORS: dict[str, ast.operator] = {"+": ast.Add(), "-": ast.Sub(), "*": ast.Mult(), "/": ast.Div()}
COMPARISON_OPERATORS: dict[str, ast.cmpop] = {
    "<": ast.Lt(),
    "<=": ast.LtE(),
    ">": ast.Gt(),
    ">=": ast.GtE(),
    "==": ast.Eq(),
}
DOMAINS = {  # functions that raise an error for some arguments -> test of an argument for which they do not
    "sqrt": "{0} >= 0.0",
    "log": "{0} > 0.0",
    **dict.fromkeys(("asin", "acos"), "fabs({0}) <= 1.0"),
    "exp": "{0} < 709.0",
    **dict.fromkeys(("sinh", "cosh"), "fabs({0}) < 709.0"),
}


class ExpressionPrinter:
    """Prints the lines of one block.

    `given` maps variables to their names in the block; `kept` are constants stored as attributes of the model; `names`
    are those of terms that the model does not name.  Functions of the variables `on_trial` are NaN outside their
    domain, where they would raise an error.
    """

    def __init__(
        self,
        given: Mapping[Expression, str],
        kept: Collection[Expression],
        taken: Collection[str],
        depth: int,
        names: Mapping[Expression, str] | None = None,
        on_trial: Collection[Expression] = (),
    ) -> None:
        self.bound_names, self.constants, self.used_names = dict(given), kept, set(taken)
        self.lines: list[str] = []
        self.depth = depth
        self.names = {} if names is None else names
        self.on_trial = on_trial
        self.local_names: dict[int, str] = {}  # value number -> local variable
        self.author_names: dict[int, str] = {}
        self._use_counts: Counter[int] = Counter()
        self._value_numbers: dict[tuple[Any, ...], int] = {}  # equal expressions share a value number
        self._number_by_id: dict[int, int] = {}
        self._kept_alive: list[Operand] = []  # keeps id() unique

    # ---- lines

    def emit(self, line: str) -> None:
        """Append a line at the current indentation."""
        self.lines.append(INDENT * self.depth + line)

    def emit_assignment(self, target: str, e: Operand) -> None:
        """Emit target = expression unless they are equal."""
        if (text := self.text(e)) != target:
            self.emit(f"{target} = {text}")

    def fresh_name(self, name: str) -> str:
        """Return an unused name derived from `name` and reserve it."""
        if name in self.used_names:
            name = next(n for i in range(1, 1000) if (n := f"{name}_{i}") not in self.used_names)
        self.used_names.add(name)
        return name

    @contextmanager
    def block(self, head: str) -> Iterator[None]:
        """Emit a compound statement; local variables assigned in its body are not known after it."""
        self.emit(head)
        outside, self.depth = dict(self.local_names), self.depth + 1
        yield
        self.local_names, self.depth = outside, self.depth - 1

    # ---- expressions

    def value_number(self, e: Operand) -> int:
        """Return the value number of an expression; equal expressions share it."""
        if isinstance(e, Expression) and id(e) in self._number_by_id:
            return self._number_by_id[id(e)]
        key: tuple[Any, ...]
        if isinstance(e, Term) and e not in self.bound_names and not self._is_constant(e):
            key = e.op, *map(self.value_number, e.args)
        elif isinstance(e, Output) and e not in self.bound_names:
            key = "is", self.value_number(e.expression)
        else:
            key = ("leaf", id(e)) if isinstance(e, Expression) else ("number", repr(e))
        number = self._value_numbers.setdefault(key, len(self._value_numbers)) if key[0] != "is" else key[1]
        self._kept_alive.append(e)
        if isinstance(e, Expression):
            self._number_by_id[id(e)] = number
            name = self.name_of(e)
            if name and (isinstance(e, VariableDeclaration) or number not in self.author_names):
                self.author_names[number] = name
        return number

    def name_of(self, e: Expression) -> str:
        """Return the name of an expression, or an empty text."""
        return e.name or self.names.get(e, "")

    def _is_constant(self, e: Operand) -> bool:
        return isinstance(e, Expression) and any(e is constant for constant in self.constants)

    def _is_leaf(self, e: Operand) -> bool:
        return not isinstance(e, (Term, Output)) or e in self.bound_names or self._is_constant(e)

    def count_uses(self, *targets: Operand) -> None:
        """Count uses in advance, so that expressions used twice become local variables."""
        for e in targets:
            if not self._is_leaf(e):
                if isinstance(e, Output):
                    self.value_number(e)
                    self.count_uses(e.expression)
                    continue
                number = self.value_number(e)
                self._use_counts[number] += 1
                if self._use_counts[number] == 1:
                    self.count_uses(*operands(e))

    def is_shared(self, e: Operand) -> bool:
        """Return whether a term is used more than once."""
        return isinstance(e, Term) and self._use_counts[self.value_number(e)] > 1

    def text(self, e: Operand) -> str:
        """Return the source of an expression; emits local variables as needed."""
        return ast.unparse(ast.fix_missing_locations(self._to_ast(e)))

    def local_variable(self, e: Operand) -> str:
        """Return a local variable with the value; emit its assignment if needed."""
        number = self.value_number(e)
        if number not in self.local_names:
            node = self._to_ast(e)
            if number not in self.local_names:
                self._store_in_local(number, node)
        return self.local_names[number]

    def _store_in_local(self, number: int, node: ast.expr) -> ast.expr:
        name = self._choose_local_name(number)
        self.emit(f"{name} = {ast.unparse(ast.fix_missing_locations(node))}")
        self.local_names[number] = name
        return ast.Name(name)

    def _choose_local_name(self, number: int) -> str:
        """Return a local name for an expression: that of the model if it is unused."""
        name = self.author_names.get(number, "")
        if not name or name in self.local_names.values() or name in self.bound_names.values():
            name = next(n for i in range(1, 1000) if (n := f"{name or 'u'}{i}") not in self.used_names)
        self.used_names.add(name)
        return name

    def _to_ast(self, e: Operand) -> ast.expr:
        if not isinstance(e, Expression):
            return ast.Name("pi") if e == pi else ast.parse(repr(e), mode="eval").body
        if e in self.bound_names:
            return ast.parse(self.bound_names[e], mode="eval").body
        if (number := self.value_number(e)) in self.local_names:
            return ast.Name(self.local_names[number])
        if isinstance(e, (SettableVariable, Choice)) or self._is_constant(e):
            return ast.Attribute(ast.Name("self"), self.name_of(e))
        if isinstance(e, Output):
            return self._to_ast(e.expression)
        if not isinstance(e, Term):
            raise ModelError(f"{e.name} is not available in this equation", e.location)
        if e.op == "choose" and not all(map(self._is_leaf, e.args[1:])):
            return self._emit_branch(e, number)
        node = self._build_node(e)
        if self._use_counts[number] > 1 or (number in self.author_names and len(ast.unparse(node)) > MAX_INLINE_LENGTH):
            return self._store_in_local(number, node)
        return node

    def _emit_branch(self, e: Term, number: int) -> ast.expr:
        name, test = self._choose_local_name(number), self.text(e.args[0])
        for head, case in (f"if {test}:", e.args[1]), ("else:", e.args[2]):
            with self.block(head):
                self.emit(f"{name} = {self.text(case)}")
        self.local_names[number] = name
        return ast.Name(name)

    def _build_node(self, e: Term) -> ast.expr:
        args = [self._to_ast(argument) for argument in e.args]
        if e.op in BINARY_OPERATORS:
            return binary_node(e.op, *args)
        if e.op == "neg":
            return negate_node(args[0])
        if e.op in COMPARISON_OPERATORS:
            if e.op == "==":
                args[1] = ast.Constant(int(e.args[1]))
            return ast.Compare(args[0], [COMPARISON_OPERATORS[e.op]], [args[1]])
        if e.op == "choose":
            return ast.IfExp(*args)
        if e.op in DOMAINS and depends_on(e, self.on_trial) and not is_in_domain(e):
            return self._build_guarded_call(e, args[0])
        return ast.Call(ast.Name(e.op), args, [])

    def _build_guarded_call(self, e: Term, argument: ast.expr) -> ast.expr:
        """Return the function value, or NaN outside its domain."""
        if not isinstance(argument, (ast.Name, ast.Attribute)):
            argument = self._store_in_local(self.value_number(e.args[0]), argument)
        test = ast.parse(DOMAINS[e.op].format(ast.unparse(argument)), mode="eval").body
        return ast.IfExp(test, ast.Call(ast.Name(e.op), [argument], []), ast.Name("nan"))


def binary_node(op: str, a: ast.expr, b: ast.expr) -> ast.expr:
    """Return a op b; a leading minus of b is merged into the sum, which keeps the bits."""
    other = {"+": "-", "-": "+"}
    inner = b
    while isinstance(inner, ast.BinOp) and isinstance(inner.op, (ast.Mult, ast.Div)):
        inner = inner.left
    if op in other and isinstance(inner, ast.UnaryOp):
        return ast.BinOp(a, BINARY_OPERATORS[other[op]], drop_minus(b))
    return ast.BinOp(a, BINARY_OPERATORS[op], b)


def negate_node(node: ast.expr) -> ast.expr:
    """Return the negative; products and quotients negate their first factor, which keeps the bits."""
    if isinstance(node, ast.BinOp) and isinstance(node.op, (ast.Mult, ast.Div)):
        return ast.BinOp(negate_node(node.left), node.op, node.right)
    return ast.UnaryOp(ast.USub(), node)


def drop_minus(node: ast.expr) -> ast.expr:
    """Return a product without its leading minus."""
    if isinstance(node, ast.BinOp):
        return ast.BinOp(drop_minus(node.left), node.op, node.right)
    assert isinstance(node, ast.UnaryOp)
    return node.operand
