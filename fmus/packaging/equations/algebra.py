"""Calculating with expressions: values put in, derivatives, operations undone, bounds.

A term is made shorter only where that leaves its bits alone: by zeros, ones and signs.
"""

import math
from collections.abc import Callable, Collection, Mapping
from contextlib import suppress

from .declared import Output, Parameter
from .expressions import COMPARISONS, FUNCTIONS, Expression, Mistake, Operand, Term

Memo = dict[int, Operand]
ARITHMETIC: dict[str, Callable[[float, float], float]] = {
    "+": lambda a, b: a + b,
    "-": lambda a, b: a - b,
    "*": lambda a, b: a * b,
    "/": lambda a, b: a / b,
}


def inside(e: Operand) -> tuple[Operand, ...]:
    """What an expression is calculated from, one level down."""
    return e.args if isinstance(e, Term) else (e.means,) if isinstance(e, Output) else ()


def depends(e: Operand, leaves: Collection[Expression]) -> bool:
    """Whether an expression has one of the leaves in it."""
    return not parts(e).keys().isdisjoint(map(id, leaves))


def jumps(e: Operand, leaves: Collection[Expression]) -> bool:
    """Whether a condition in an expression has one of the leaves in it: derivatives do not tell."""
    conditions = (one for one in parts(e).values() if isinstance(one, Term) and one.op in COMPARISONS)
    return any(depends(one, leaves) for one in conditions)


def parts(e: Operand, found: Memo | None = None) -> Memo:
    """All that an expression is made of, each once, by identity: what comes first in the text stands first."""
    found = {} if found is None else found
    if id(e) not in found:
        found[id(e)] = e
        for one in inside(e):
            parts(one, found)
    return found


def leaves(e: Operand) -> list[Expression]:
    """The declared variables in an expression, each once."""
    return [one for one in parts(e).values() if isinstance(one, Expression) and not isinstance(one, (Term, Output))]


def occurrences(e: Operand, leaf: Expression) -> int:
    return 1 if e is leaf else sum(occurrences(one, leaf) for one in inside(e))


def same(a: Operand, b: Operand) -> bool:
    """Whether two expressions are one, written twice."""
    if isinstance(a, Term) and isinstance(b, Term):
        return a is b or (a.op == b.op and len(a.args) == len(b.args) and all(map(same, a.args, b.args)))
    return a is b or (not isinstance(a, Expression) and not isinstance(b, Expression) and a == b)


def put(e: Operand, values: Mapping[Expression, Operand], memo: Memo | None = None) -> Operand:
    """The expression with leaves, or parts, replaced; what does not change is shared."""
    memo = {} if memo is None else memo
    if id(e) in memo:
        return memo[id(e)]
    new = e
    if isinstance(e, Expression) and e in values:
        new = values[e]
    elif isinstance(e, Output):
        new = put(e.means, values, memo)
        new = e if new is e.means else new
    elif isinstance(e, Term):
        args = [put(one, values, memo) for one in e.args]
        new = e if all(a is b for a, b in zip(args, e.args, strict=True)) else made(e.op, *args)
    memo[id(e)] = new
    return new


def is_number(e: Operand, value: float) -> bool:
    return not isinstance(e, Expression) and e == value


def made(op: str, *args: Operand) -> Operand:
    """A term, shorter where a number is known."""
    if op == "neg":
        return negative(args[0])
    if op == "choose":
        condition, this, that = args
        if isinstance(condition, bool):  # which has been settled
            return this if condition else that
        return this if same(this, that) else Term(op, *args)
    if op in FUNCTIONS and not isinstance(args[0], Expression):
        with suppress(ArithmeticError, ValueError):  # as of a logarithm behind a condition that does not hold
            return getattr(math, op)(args[0])
    if op not in ARITHMETIC:
        return Term(op, *args)
    a, b = args
    if not isinstance(a, Expression) and not isinstance(b, Expression) and not (op == "/" and b == 0.0):
        return ARITHMETIC[op](a, b)
    match op:
        case "+" if is_number(a, 0.0):
            return b
        case "+" | "-" if is_number(b, 0.0):
            return a
        case "+" if isinstance(b, Term) and b.op == "neg":
            return made("-", a, b.args[0])
        case "-" if same(a, b):
            return 0.0
        case "-" if is_number(a, 0.0):
            return negative(b)
        case "-" if isinstance(b, Term) and b.op == "neg":
            return made("+", a, b.args[0])
        case "*" if is_number(a, 0.0) or is_number(b, 0.0):
            return 0.0
        case "*" if is_number(a, 1.0):
            return b
        case "*" if is_number(a, -1.0):
            return negative(b)
        case "*" | "/" if is_number(b, 1.0):
            return a
        case "*" | "/" if is_number(b, -1.0):
            return negative(a)
        case "/" if is_number(a, 0.0):
            return 0.0
    return Term(op, *args)


def negative(e: Operand) -> Operand:
    """-e; a minus goes inside where that is as exact."""
    if not isinstance(e, Term):
        return Term("neg", e) if isinstance(e, Expression) else 0.0 - e
    if e.op == "neg":
        return e.args[0]
    if e.op == "-":
        return made("-", e.args[1], e.args[0])
    if e.op in "*/" and not isinstance(e.args[0], Expression):
        return made(e.op, -e.args[0], e.args[1])
    if e.op in "*/" and isinstance(e.args[0], Term) and e.args[0].op in ("neg", "-"):
        return made(e.op, negative(e.args[0]), e.args[1])
    return Term("neg", e)


def derivative(e: Operand, by: Mapping[Expression, Operand], memo: Memo | None = None) -> Operand:
    """The derivative along `by`: leaves and their rates."""
    memo = {} if memo is None else memo
    if id(e) in memo:
        return memo[id(e)]
    if not isinstance(e, Expression) or e in by or not depends(e, by):
        return by.get(e, 0.0)

    def slope(one: Operand) -> Operand:
        return derivative(one, by, memo)

    if isinstance(e, Output):
        new = slope(e.means)
    else:
        assert isinstance(e, Term)
        new = _of_term(e, slope)
    if e.name and isinstance(new, Term) and not new.name and id(new) not in parts(e):
        new.name = f"d{e.name}_d{next(iter(by)).name}"
    memo[id(e)] = new
    return new


def _of_term(e: Term, slope: Callable[[Operand], Operand]) -> Operand:
    a, b = e.args[0], e.args[-1]
    match e.op:
        case "+" | "-":
            return made(e.op, slope(a), slope(b))
        case "neg":
            return made("neg", slope(a))
        case "*" if a is b:
            return made("*", made("*", 2.0, a), slope(a))
        case "*":
            return made("+", made("*", slope(a), b), made("*", a, slope(b)))
        case "/":
            return made("-", made("/", slope(a), b), made("/", made("*", e, slope(b)), b))
        case "choose":
            return made("choose", a, slope(e.args[1]), slope(b))
        case "copysign":
            return 0.0
    if e.op in COMPARISONS:
        raise Mistake("a comparison has no derivative", e.place)
    return _chain(FUNCTIONS[e.op](a, e), slope(a))


def _chain(outer: Operand, inner: Operand) -> Operand:
    """A product, over whose denominator there is the whole of it where the outer part is one over something."""
    if isinstance(outer, Term) and outer.op == "choose":
        return made("choose", outer.args[0], *(_chain(one, inner) for one in outer.args[1:]))
    if isinstance(outer, Term) and outer.op == "/":
        return made("/", _chain(outer.args[0], inner), outer.args[1])
    return made("*", outer, inner)


def undone(e: Operand, leaf: Expression) -> Operand:
    """The value of the leaf, which occurs once, that makes e zero: each operation is undone, the outermost first."""
    right: Operand = 0.0
    while e is not leaf:
        if isinstance(e, Output):
            e = e.means
            continue
        a, b = e.args[0], e.args[-1]
        left = occurrences(a, leaf) > 0
        match e.op:
            case "+":
                e, right = (a, made("-", right, b)) if left else (b, made("-", right, a))
            case "-":
                e, right = (a, made("+", right, b)) if left else (b, made("-", a, right))
            case "neg":
                e, right = a, made("neg", right)
            case "*":
                e, right = (a, made("/", right, b)) if left else (b, made("/", right, a))
            case "/" if left:
                e, right = a, made("*", right, b)
            case _:
                raise Mistake(f"{leaf.name} must enter the rates linearly, and not through {e.op}", e.place)
    return right


def is_sum(e: Operand, leaf: Expression) -> bool:
    """Whether the leaf is one of the terms that an expression adds up."""
    if not isinstance(e, Term):
        return e is leaf or any(is_sum(one, leaf) for one in inside(e))
    return occurrences(e, leaf) == 1 and e.op in ("+", "-", "neg") and any(is_sum(one, leaf) for one in e.args)


def size(e: Operand) -> Operand:
    """The sum of the sizes of what an expression is made of, of which rounding takes its share."""
    if not isinstance(e, Expression):
        return abs(e)
    if isinstance(e, Output):
        return size(e.means)
    if isinstance(e, Parameter) and (e.low >= 0.0 or e.above >= 0.0):
        return e
    if not isinstance(e, Term):
        return Term("fabs", e)
    found = _size(e)
    return e if same(found, e) else found


def _size(e: Term) -> Operand:
    a, b = e.args[0], e.args[-1]
    match e.op:
        case "+" | "-":
            return made("+", size(a), size(b))
        case "*":
            return made("*", size(a), size(b))
        case "/":
            return made("/", size(a), size(b) if not isinstance(b, Term) else Term("fabs", b))
        case "neg" | "fabs" | "sin" | "atan" | "tanh":  # whose slope is at most 1, and which vanish with the argument
            return size(a)
        case "choose":
            return made("choose", a, size(e.args[1]), size(b))
    slope = made("*", Term("fabs", FUNCTIONS[e.op](a, e)), size(a)) if e.op in FUNCTIONS else 0.0
    return made("+", Term("fabs", e), slope)


def degree(e: Operand, moving: Collection[Expression]) -> float:
    """How an expression grows with what moves, as a power."""
    if not depends(e, moving):
        return 0.0
    if not isinstance(e, (Term, Output)):
        return 1.0
    grown = [degree(one, moving) for one in inside(e)]
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
