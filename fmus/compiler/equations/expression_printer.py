"""Prints expressions as Python statements; common subexpressions become local variables with the names of the model."""

import ast
from collections import Counter
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from itertools import count
from math import pi
from typing import Any

from ...runtime.variable_declarations import VariableDeclaration
from .algebra import operands, operands_first, unconditional_operands
from .expressions import Expression, ModelError, Operand, Term
from .model_conditions import Signs
from .model_declaration import Choice, Output, SettableVariable
from .tables import Coefficient, Piece

INDENT = "    "
MAX_INLINE_LENGTH = 50  # characters; longer named subexpressions get a separate line
# Operations in one expression.  Larger ones are split into local variables: Python and C compilers limit the depth, and
# subexpressions that are not counted as shared would be printed again and again.
MAX_INLINE_OPERATIONS = 60
BRANCH_DEPTH = 10  # operations as which a branch counts
MAX_CASES = 40  # around each other; Python allows 100 levels of indentation
MAX_LINES = 200_000  # of a method
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
        bound_names: Mapping[Expression, str],
        constants: Collection[Expression],
        used_names: Collection[str],
        depth: int,
        names: Mapping[Expression, str] | None = None,
        on_trial: Collection[Expression] = (),
    ) -> None:
        self.bound_names, self.used_names = dict(bound_names), set(used_names)
        self.constants = {id(e) for e in constants}
        self.lines: list[str] = []
        self.depth = depth
        self.names = {} if names is None else names
        self._numbers: dict[str, Iterator[int]] = {}  # stem of a name -> its next numbers
        self._names_in_block: dict[str, None] = {}  # of local variables
        self.on_trial = on_trial
        self.local_names: dict[int, str] = {}  # value number -> local variable
        self.author_names: dict[int, str] = {}
        self._use_counts: Counter[int] = Counter()
        self._value_numbers: dict[tuple[Any, ...], int] = {}  # equal expressions share a value number
        self._number_by_id: dict[int, int] = {}
        self._live_operands: list[Operand] = []  # keeps id() unique
        self._branches_in_both_cases: dict[int, list[Operand]] = {}  # by value number
        self._is_on_trial: dict[int, bool] = {id(e): True for e in on_trial}
        self._signs = Signs()
        self._n_cases = 0  # cases of choose() around the current line

    # ---- lines

    def emit(self, line: str) -> None:
        """Append a line at the current indentation."""
        if len(self.lines) == MAX_LINES:
            raise ModelError(
                f"a method of this model would have more than {MAX_LINES} lines: use fewer variables, or fewer "
                "choose() in the cases of others"
            )
        self.lines.append(INDENT * self.depth + line)

    def emit_assignment(self, target: str, e: Operand) -> None:
        """Emit target = expression unless they are equal."""
        if (text := self.text(e)) != target:
            self.emit(f"{target} = {text}")

    def fresh_name(self, name: str) -> str:
        """Return an unused name derived from `name` and reserve it."""
        return self._numbered_name(f"{name}_") if name in self.used_names else self._use_name(name)

    def _numbered_name(self, stem: str) -> str:
        """Return the stem with the first number that gives an unused name, and reserve it."""
        numbers = self._numbers.setdefault(stem, count(1))
        return self._use_name(next(name for i in numbers if (name := f"{stem}{i}") not in self.used_names))

    def _use_name(self, name: str) -> str:
        self.used_names.add(name)
        return name

    @contextmanager
    def block(self, head: str) -> Iterator[None]:
        """Emit a compound statement; local variables assigned in its body are not known after it."""
        self.emit(head)
        n_variables, n_names = len(self.local_names), len(self._names_in_block)
        self.depth += 1
        yield
        self.depth -= 1
        for _ in range(len(self.local_names) - n_variables):
            self.local_names.popitem()  # removes the last one that was added
        for _ in range(len(self._names_in_block) - n_names):
            self._names_in_block.popitem()

    # ---- expressions

    def value_number(self, e: Operand) -> int:
        """Return the value number of an expression; equal expressions share it."""
        if not isinstance(e, Expression):
            return self._value_numbers.setdefault(("number", repr(e)), len(self._value_numbers))
        if id(e) not in self._number_by_id:
            for part in operands_first(e, operands_of=self._unnumbered_operands):
                if isinstance(part, Expression) and id(part) not in self._number_by_id:
                    self._add_number(part)
        return self._number_by_id[id(e)]

    def _unnumbered_operands(self, e: Operand) -> tuple[Operand, ...]:
        return () if self._is_leaf(e) or id(e) in self._number_by_id else operands(e)

    def _add_number(self, e: Expression) -> None:
        """Number an expression whose operands have numbers."""
        key: tuple[Any, ...] = ("leaf", id(e))
        if isinstance(e, Term) and not self._is_leaf(e):
            key = e.op, *map(self.value_number, e.args)
        if isinstance(e, Output) and not self._is_leaf(e):
            number = self.value_number(e.expression)
        else:
            number = self._value_numbers.setdefault(key, len(self._value_numbers))
        self._live_operands.append(e)
        self._number_by_id[id(e)] = number
        name = self.name_of(e)
        if name and (isinstance(e, VariableDeclaration) or number not in self.author_names):
            self.author_names[number] = name

    def name_of(self, e: Expression) -> str:
        """Return the name of an expression, or an empty text."""
        return e.name or self.names.get(e, "") or (e.op if isinstance(e, Term) and isinstance(e.op, Piece) else "")

    def _is_constant(self, e: Operand) -> bool:
        return id(e) in self.constants

    def _is_leaf(self, e: Operand) -> bool:
        return not isinstance(e, (Term, Output)) or e in self.bound_names or self._is_constant(e)

    def count_uses(self, *targets: Operand) -> None:
        """Count uses in advance, so that expressions used twice become local variables."""
        stack = [*reversed(targets)]
        while stack:
            e = stack.pop()
            if self._is_leaf(e):
                continue
            number = self.value_number(e)
            if isinstance(e, Output):
                stack.append(e.expression)
                continue
            self._use_counts[number] += 1
            if self._use_counts[number] == 1:
                stack.extend(reversed(operands(e)))

    def is_shared(self, e: Operand) -> bool:
        """Return whether a term is used more than once."""
        return isinstance(e, Term) and self._use_counts[self.value_number(e)] > 1

    def text(self, e: Operand) -> str:
        """Return the source of an expression; emits local variables as needed."""
        self._store_large_parts(e)
        return ast.unparse(self._to_ast(e))

    def local_variable(self, e: Operand) -> str:
        """Return a local variable with the value; emit its assignment if needed."""
        number = self.value_number(e)
        if number not in self.local_names:
            self._store_large_parts(e)
            node = self._to_ast(e)
            if number not in self.local_names:
                self._store_in_local(number, node)
        return self.local_names[number]

    def _store_large_parts(self, e: Operand) -> None:
        """Emit local variables for parts of a large expression that are evaluated with it, innermost first."""
        sizes: dict[int, int] = {}  # operations in the text of a part
        depths: dict[int, int] = {}  # nested calls of _to_ast
        for part in operands_first(e, operands_of=self._operands_before):
            before = self._operands_before(part)
            size = sum(sizes[id(operand)] for operand in before) + 1
            depth = max((depths[id(operand)] for operand in before), default=0)
            depth += BRANCH_DEPTH if self._is_branch(part) else 1
            if before and isinstance(part, Term) and (size > MAX_INLINE_OPERATIONS or depth > MAX_INLINE_OPERATIONS):
                number, node = self.value_number(part), self._to_ast(part)
                if number not in self.local_names:
                    self._store_in_local(number, node)
                size = depth = 0
            sizes[id(part)] = 0 if not before or self.is_shared(part) or self._is_branch(part) else size
            depths[id(part)] = depth

    def _operands_before(self, e: Operand) -> tuple[Operand, ...]:
        """Return the operands whose statements come before the statement of an expression."""
        if self._is_leaf(e) or self.value_number(e) in self.local_names:
            return ()
        return (*unconditional_operands(e), *self._common_branches(e)) if self._is_branch(e) else operands(e)

    def _is_branch(self, e: Operand) -> bool:
        """Return whether an expression needs an if statement."""
        return isinstance(e, Term) and e.op == "choose" and not all(map(self._is_leaf, e.args[1:]))

    def _common_branches(self, e: Operand) -> list[Operand]:
        """Return the branches in both cases of a branch; printed once in each case, nested ones would double."""
        number = self.value_number(e)
        if number not in self._branches_in_both_cases:
            cases = [
                {
                    self.value_number(part): part
                    for part in operands_first(case, operands_of=self._operands_outside_branches)
                    if self._is_branch(part)
                }
                for case in operands(e)[1:]
            ]
            self._branches_in_both_cases[number] = [part for n, part in cases[0].items() if n in cases[1]]
        return self._branches_in_both_cases[number]

    def _operands_outside_branches(self, e: Operand) -> tuple[Operand, ...]:
        is_printed = self._is_leaf(e) or self._is_branch(e) or self.value_number(e) in self.local_names
        return () if is_printed else operands(e)

    def _store_in_local(self, number: int, node: ast.expr) -> ast.expr:
        name = self._choose_local_name(number)
        self.emit(f"{name} = {ast.unparse(node)}")
        self.local_names[number] = name
        return ast.Name(name)

    def _choose_local_name(self, number: int) -> str:
        """Return a local name for an expression: that of the model if it is unused."""
        name = self.author_names.get(number, "")
        if not name or name in self._names_in_block or name in self.bound_names.values():
            name = self._numbered_name(name or "u")
        self._names_in_block[name] = None
        return self._use_name(name)

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
        if self._is_branch(e):
            return self._emit_branch(e, number)
        node = self._build_node(e)
        if self._use_counts[number] > 1 or (number in self.author_names and len(ast.unparse(node)) > MAX_INLINE_LENGTH):
            return self._store_in_local(number, node)
        return node

    def _emit_branch(self, e: Term, number: int) -> ast.expr:
        name, test = self._choose_local_name(number), self.text(e.args[0])
        for part in self._common_branches(e):
            self.local_variable(part)
        if self._n_cases == MAX_CASES:
            raise ModelError(
                f"more than {MAX_CASES} choose(), or derivatives of sqrt(), are in the cases of each other: nest them "
                "by halves, as in choose(x < b, choose(x < a, ...), choose(x < c, ...)), or add terms with one each",
                e.location,
            )
        self._n_cases += 1
        for head, case in (f"if {test}:", e.args[1]), ("else:", e.args[2]):
            with self.block(head):
                self.emit(f"{name} = {self.text(case)}")
        self._n_cases -= 1
        self.local_names[number] = name
        return ast.Name(name)

    def _build_node(self, e: Term) -> ast.expr:
        if isinstance(e.op, Coefficient):
            piece = e.args[0]
            is_fixed = not isinstance(piece, Expression)
            index: ast.expr = ast.Constant(int(piece)) if is_fixed else ast.Name(self.local_variable(piece))
            index = ast.BinOp(index, ast.Add(), ast.Constant(e.op.offset)) if e.op.offset else index
            return ast.Subscript(ast.parse(e.op.array, mode="eval").body, index)
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
        if isinstance(e.op, Piece):
            return ast.Call(ast.Attribute(ast.Name("self"), e.op.method), args, [])
        if e.op in DOMAINS and self._depends_on_trial(e) and not self._signs.is_in_domain(e):
            return self._build_guarded_call(e, args[0])
        return ast.Call(ast.Name(e.op), args, [])

    def _depends_on_trial(self, e: Operand) -> bool:
        is_on_trial = self._is_on_trial
        for part in operands_first(e, operands_of=lambda part: () if id(part) in is_on_trial else operands(part)):
            is_on_trial[id(part)] = is_on_trial.get(id(part), False) or any(
                is_on_trial[id(operand)] for operand in operands(part)
            )
            self._live_operands.append(part)
        return is_on_trial[id(e)]

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
