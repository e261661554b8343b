"""Calculating with expressions: values put in, derivatives, operations undone, bounds.

A term is made shorter only where that leaves its bits alone: by zeros, ones and signs.
"""

import math
from collections.abc import Callable, Collection, Mapping
from contextlib import suppress

from .expressions import COMPARISONS, FUNCTIONS, Expression, ModelError, Operand, Term
from .model_declaration import Output, Parameter

Memo = dict[int, Operand]
ARITHMETIC: dict[str, Callable[[float, float], float]] = {
    "+": lambda a, b: a + b,
    "-": lambda a, b: a - b,
    "*": lambda a, b: a * b,
    "/": lambda a, b: a / b,
}


def operands(e: Operand) -> tuple[Operand, ...]:
    """What an expression is calculated from, one level down."""
    return e.args if isinstance(e, Term) else (e.expression,) if isinstance(e, Output) else ()


def depends_on(e: Operand, variables: Collection[Expression]) -> bool:
    """Whether an expression has one of the leaves in it."""
    return not subexpressions(e).keys().isdisjoint(map(id, variables))


def has_condition_on(e: Operand, variables: Collection[Expression]) -> bool:
    """Whether a condition in an expression has one of the leaves in it: derivatives do not tell."""
    conditions = (one for one in subexpressions(e).values() if isinstance(one, Term) and one.op in COMPARISONS)
    return any(depends_on(one, variables) for one in conditions)


def subexpressions(e: Operand, found: Memo | None = None) -> Memo:
    """All that an expression is made of, each once, by identity: what comes first in the text stands first."""
    found = {} if found is None else found
    if id(e) not in found:
        found[id(e)] = e
        for one in operands(e):
            subexpressions(one, found)
    return found


def variables_in(e: Operand) -> list[Expression]:
    """The declared variables in an expression, each once."""
    return [
        one for one in subexpressions(e).values() if isinstance(one, Expression) and not isinstance(one, (Term, Output))
    ]


def count_occurrences(e: Operand, leaf: Expression) -> int:
    return 1 if e is leaf else sum(count_occurrences(one, leaf) for one in operands(e))


def is_same_expression(a: Operand, b: Operand) -> bool:
    """Whether two expressions are one, written twice."""
    if isinstance(a, Term) and isinstance(b, Term):
        return a is b or (a.op == b.op and len(a.args) == len(b.args) and all(map(is_same_expression, a.args, b.args)))
    return a is b or (not isinstance(a, Expression) and not isinstance(b, Expression) and a == b)


def substitute(e: Operand, values: Mapping[Expression, Operand], memo: Memo | None = None) -> Operand:
    """The expression with leaves, or parts, replaced; what does not change is shared."""
    memo = {} if memo is None else memo
    if id(e) in memo:
        return memo[id(e)]
    new = e
    if isinstance(e, Expression) and e in values:
        new = values[e]
    elif isinstance(e, Output):
        new = substitute(e.expression, values, memo)
        new = e if new is e.expression else new
    elif isinstance(e, Term):
        args = [substitute(one, values, memo) for one in e.args]
        new = e if all(a is b for a, b in zip(args, e.args, strict=True)) else build_term(e.op, *args)
    memo[id(e)] = new
    return new


def is_constant(e: Operand, value: float) -> bool:
    return not isinstance(e, Expression) and e == value


def build_term(op: str, *args: Operand) -> Operand:
    """A term, shorter where a number is known."""
    if op == "neg":
        return negate(args[0])
    if op == "choose":
        condition, this, that = args
        if isinstance(condition, bool):  # which has been settled
            return this if condition else that
        return this if is_same_expression(this, that) else Term(op, *args)
    if op in FUNCTIONS and not isinstance(args[0], Expression):
        with suppress(ArithmeticError, ValueError):  # as of a logarithm behind a condition that does not hold
            return getattr(math, op)(args[0])
    if op not in ARITHMETIC:
        return Term(op, *args)
    a, b = args
    if not isinstance(a, Expression) and not isinstance(b, Expression) and not (op == "/" and b == 0.0):
        return ARITHMETIC[op](a, b)
    match op:
        case "+" if is_constant(a, 0.0):
            return b
        case "+" | "-" if is_constant(b, 0.0):
            return a
        case "+" if isinstance(b, Term) and b.op == "neg":
            return build_term("-", a, b.args[0])
        case "-" if is_same_expression(a, b):
            return 0.0
        case "-" if is_constant(a, 0.0):
            return negate(b)
        case "-" if isinstance(b, Term) and b.op == "neg":
            return build_term("+", a, b.args[0])
        case "*" if is_constant(a, 0.0) or is_constant(b, 0.0):
            return 0.0
        case "*" if is_constant(a, 1.0):
            return b
        case "*" if is_constant(a, -1.0):
            return negate(b)
        case "*" | "/" if is_constant(b, 1.0):
            return a
        case "*" | "/" if is_constant(b, -1.0):
            return negate(a)
        case "/" if is_constant(a, 0.0):
            return 0.0
    return Term(op, *args)


def negate(e: Operand) -> Operand:
    """-e; a minus goes inside where that is as exact."""
    if not isinstance(e, Term):
        return Term("neg", e) if isinstance(e, Expression) else 0.0 - e
    if e.op == "neg":
        return e.args[0]
    if e.op == "-":
        return build_term("-", e.args[1], e.args[0])
    if e.op in "*/" and not isinstance(e.args[0], Expression):
        return build_term(e.op, -e.args[0], e.args[1])
    if e.op in "*/" and isinstance(e.args[0], Term) and e.args[0].op in ("neg", "-"):
        return build_term(e.op, negate(e.args[0]), e.args[1])
    return Term("neg", e)


def differentiate(e: Operand, by: Mapping[Expression, Operand], memo: Memo | None = None) -> Operand:
    """The derivative along `by`: leaves and their rates."""
    memo = {} if memo is None else memo
    if id(e) in memo:
        return memo[id(e)]
    if not isinstance(e, Expression) or e in by or not depends_on(e, by):
        return by.get(e, 0.0)

    def slope(one: Operand) -> Operand:
        return differentiate(one, by, memo)

    if isinstance(e, Output):
        new = slope(e.expression)
    else:
        assert isinstance(e, Term)
        new = _differentiate_term(e, slope)
    if e.name and isinstance(new, Term) and not new.name and id(new) not in subexpressions(e):
        new.name = f"d{e.name}_d{next(iter(by)).name}"
    memo[id(e)] = new
    return new


def _differentiate_term(e: Term, slope: Callable[[Operand], Operand]) -> Operand:
    a, b = e.args[0], e.args[-1]
    match e.op:
        case "+" | "-":
            return build_term(e.op, slope(a), slope(b))
        case "neg":
            return build_term("neg", slope(a))
        case "*" if a is b:
            return build_term("*", build_term("*", 2.0, a), slope(a))
        case "*":
            return build_term("+", build_term("*", slope(a), b), build_term("*", a, slope(b)))
        case "/":
            return build_term("-", build_term("/", slope(a), b), build_term("/", build_term("*", e, slope(b)), b))
        case "choose":
            return build_term("choose", a, slope(e.args[1]), slope(b))
        case "copysign":
            return 0.0
    if e.op in COMPARISONS:
        raise ModelError("a comparison has no derivative", e.location)
    return _apply_chain_rule(FUNCTIONS[e.op](a, e), slope(a))


def _apply_chain_rule(outer: Operand, inner: Operand) -> Operand:
    """A product, over whose denominator there is the whole of it where the outer part is one over something."""
    if isinstance(outer, Term) and outer.op == "choose":
        return build_term("choose", outer.args[0], *(_apply_chain_rule(one, inner) for one in outer.args[1:]))
    if isinstance(outer, Term) and outer.op == "/":
        return build_term("/", _apply_chain_rule(outer.args[0], inner), outer.args[1])
    return build_term("*", outer, inner)


def solve_for(e: Operand, leaf: Expression) -> Operand:
    """The value of the leaf, which occurs once, that makes e zero: each operation is undone, the outermost first."""
    right: Operand = 0.0
    while e is not leaf:
        if isinstance(e, Output):
            e = e.expression
            continue
        a, b = e.args[0], e.args[-1]
        left = count_occurrences(a, leaf) > 0
        match e.op:
            case "+":
                e, right = (a, build_term("-", right, b)) if left else (b, build_term("-", right, a))
            case "-":
                e, right = (a, build_term("+", right, b)) if left else (b, build_term("-", a, right))
            case "neg":
                e, right = a, build_term("neg", right)
            case "*":
                e, right = (a, build_term("/", right, b)) if left else (b, build_term("/", right, a))
            case "/" if left:
                e, right = a, build_term("*", right, b)
            case _:
                raise ModelError(f"{leaf.name} must enter the rates linearly, and not through {e.op}", e.location)
    return right


def is_summand(e: Operand, leaf: Expression) -> bool:
    """Whether the leaf is one of the terms that an expression adds up."""
    if not isinstance(e, Term):
        return e is leaf or any(is_summand(one, leaf) for one in operands(e))
    return (
        count_occurrences(e, leaf) == 1 and e.op in ("+", "-", "neg") and any(is_summand(one, leaf) for one in e.args)
    )


def rounding_scale(e: Operand) -> Operand:
    """The sum of the sizes of what an expression is made of, of which rounding takes its share."""
    if not isinstance(e, Expression):
        return abs(e)
    if isinstance(e, Output):
        return rounding_scale(e.expression)
    if isinstance(e, Parameter) and (e.low >= 0.0 or e.above >= 0.0):
        return e
    if not isinstance(e, Term):
        return Term("fabs", e)
    found = _term_rounding_scale(e)
    return e if is_same_expression(found, e) else found


def _term_rounding_scale(e: Term) -> Operand:
    a, b = e.args[0], e.args[-1]
    match e.op:
        case "+" | "-":
            return build_term("+", rounding_scale(a), rounding_scale(b))
        case "*":
            return build_term("*", rounding_scale(a), rounding_scale(b))
        case "/":
            return build_term("/", rounding_scale(a), rounding_scale(b) if not isinstance(b, Term) else Term("fabs", b))
        case "neg" | "fabs" | "sin" | "atan" | "tanh":  # whose slope is at most 1, and which vanish with the argument
            return rounding_scale(a)
        case "choose":
            return build_term("choose", a, rounding_scale(e.args[1]), rounding_scale(b))
    slope = build_term("*", Term("fabs", FUNCTIONS[e.op](a, e)), rounding_scale(a)) if e.op in FUNCTIONS else 0.0
    return build_term("+", Term("fabs", e), slope)


def growth_exponent(e: Operand, moving: Collection[Expression]) -> float:
    """How an expression grows with what moves, as a power."""
    if not depends_on(e, moving):
        return 0.0
    if not isinstance(e, (Term, Output)):
        return 1.0
    grown = [growth_exponent(one, moving) for one in operands(e)]
    match getattr(e, "op", "neg"):
        case "+" | "-" | "neg" | "fabs" | "choose":
            return max(grown)
        case "*":
            return sum(grown)
        case "/" if grown[1] == 0.0:
            return grown[0]
        case "sqrt":
            return 0.5 * grown[0]
        case "sin" | "cos" | "atan" | "tanh" | "copysign":
            return 0.0
    return float("inf")
