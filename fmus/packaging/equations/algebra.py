"""Algebra on expressions: substitution, differentiation, solving for a variable, rounding scales.

Terms are simplified only where the result keeps its bits: zeros, ones and signs.
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
    """Return the direct operands of an expression."""
    return e.args if isinstance(e, Term) else (e.expression,) if isinstance(e, Output) else ()


def depends_on(e: Operand, variables: Collection[Expression]) -> bool:
    """Return whether an expression contains one of the variables."""
    return not subexpressions(e).keys().isdisjoint(map(id, variables))


def has_condition_on(e: Operand, variables: Collection[Expression]) -> bool:
    """Return whether a condition in an expression depends on the variables; derivatives do not show this."""
    conditions = (term for term in subexpressions(e).values() if isinstance(term, Term) and term.op in COMPARISONS)
    return any(depends_on(term, variables) for term in conditions)


def subexpressions(e: Operand, result: Memo | None = None) -> Memo:
    """Return all distinct subexpressions by identity, in the order of the source text."""
    result = {} if result is None else result
    if id(e) not in result:
        result[id(e)] = e
        for operand in operands(e):
            subexpressions(operand, result)
    return result


def variables_in(e: Operand) -> list[Expression]:
    """Return the distinct declared variables in an expression."""
    return [
        leaf
        for leaf in subexpressions(e).values()
        if isinstance(leaf, Expression) and not isinstance(leaf, (Term, Output))
    ]


def factors(e: Operand) -> list[Operand]:
    """Return the factors of a product; e is 0 if one of them is 0."""
    if isinstance(e, Term) and e.op == "*":
        return [factor for part in e.args for factor in factors(part)]
    return factors(e.args[0]) if isinstance(e, Term) and e.op in ("neg", "/", "fabs", "sqrt") else [e]


def unconditional_quotients(targets: Collection[Operand]) -> list[Term]:
    """Return the quotients that every evaluation of the targets calculates: those outside the cases of choose()."""
    result: list[Term] = []
    visited: Memo = {}
    stack = list(targets)
    while stack:
        e = stack.pop()
        if id(e) not in visited:
            visited[id(e)] = e
            is_choose = isinstance(e, Term) and e.op == "choose"
            stack += operands(e)[:1] if is_choose else operands(e)
            if isinstance(e, Term) and e.op == "/":
                result.append(e)
    return result


def count_occurrences(e: Operand, leaf: Expression) -> int:
    """Return how often a variable occurs in an expression."""
    return 1 if e is leaf else sum(count_occurrences(operand, leaf) for operand in operands(e))


def is_same_expression(a: Operand, b: Operand) -> bool:
    """Return whether two expressions have the same structure."""
    if isinstance(a, Term) and isinstance(b, Term):
        return a is b or (a.op == b.op and len(a.args) == len(b.args) and all(map(is_same_expression, a.args, b.args)))
    return a is b or (not isinstance(a, Expression) and not isinstance(b, Expression) and a == b)


def substitute(e: Operand, values: Mapping[Expression, Operand], memo: Memo | None = None) -> Operand:
    """Replace variables or subexpressions by values; unchanged parts are shared."""
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
        args = [substitute(argument, values, memo) for argument in e.args]
        new = e if all(a is b for a, b in zip(args, e.args, strict=True)) else build_term(e.op, *args)
    memo[id(e)] = new
    return new


def is_constant(e: Operand, value: float) -> bool:
    """Return whether an operand is this number."""
    return not isinstance(e, Expression) and e == value


def build_term(op: str, *args: Operand) -> Operand:
    """Build a term, simplified where operands are numbers."""
    if op == "neg":
        return negate(args[0])
    if op == "choose":
        condition, this, that = args
        if isinstance(condition, bool):  # decided at build time
            return this if condition else that
        return this if is_same_expression(this, that) else Term(op, *args)
    if op in FUNCTIONS and not isinstance(args[0], Expression):
        with suppress(ArithmeticError, ValueError):  # for example a logarithm in a branch that is not taken
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
    """Return -e, with the minus sign moved inside where this is exact."""
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


def differentiate(
    e: Operand,
    by: Mapping[Expression, Operand],
    names: dict[Expression, str] | None = None,
    memo: Memo | None = None,
) -> Operand:
    """Return the derivative of e, where `by` gives the derivatives of the variables.

    New terms that are derivatives of named terms are added to `names`.
    """
    names = {} if names is None else names
    memo = {} if memo is None else memo
    if id(e) in memo:
        return memo[id(e)]
    if not isinstance(e, Expression) or e in by or not depends_on(e, by):
        return by.get(e, 0.0)

    def slope(operand: Operand) -> Operand:
        return differentiate(operand, by, names, memo)

    if isinstance(e, Output):
        new = slope(e.expression)
    else:
        assert isinstance(e, Term)
        new = _differentiate_term(e, slope)
    name = e.name or names.get(e, "")
    if name and isinstance(new, Term) and not (new.name or new in names) and id(new) not in subexpressions(e):
        names[new] = f"d{name}_d{next(iter(by)).name}"
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
    """Return outer * inner, with inner in the numerator where outer is a quotient."""
    if isinstance(outer, Term) and outer.op == "choose":
        return build_term("choose", outer.args[0], *(_apply_chain_rule(case, inner) for case in outer.args[1:]))
    if isinstance(outer, Term) and outer.op == "/":
        return build_term("/", _apply_chain_rule(outer.args[0], inner), outer.args[1])
    return build_term("*", outer, inner)


def solve_for(e: Operand, leaf: Expression) -> Operand:
    """Solve e = 0 for a variable that occurs once in e, by inverting the operations from the outside."""
    right: Operand = 0.0
    while e is not leaf:
        if isinstance(e, Output):
            e = e.expression
            continue
        a, b = e.args[0], e.args[-1]
        is_in_first = count_occurrences(a, leaf) > 0
        match e.op:
            case "+":
                e, right = (a, build_term("-", right, b)) if is_in_first else (b, build_term("-", right, a))
            case "-":
                e, right = (a, build_term("+", right, b)) if is_in_first else (b, build_term("-", a, right))
            case "neg":
                e, right = a, build_term("neg", right)
            case "*":
                e, right = (a, build_term("/", right, b)) if is_in_first else (b, build_term("/", right, a))
            case "/" if is_in_first:
                e, right = a, build_term("*", right, b)
            case _:
                raise ModelError(f"{leaf.name} must enter the rates linearly, not through {e.op}", e.location)
    return right


def is_summand(e: Operand, leaf: Expression) -> bool:
    """Return whether the variable is a summand of the expression."""
    if not isinstance(e, Term):
        return e is leaf or any(is_summand(operand, leaf) for operand in operands(e))
    return (
        count_occurrences(e, leaf) == 1
        and e.op in ("+", "-", "neg")
        and any(is_summand(operand, leaf) for operand in e.args)
    )


def is_factor(e: Operand, leaf: Expression) -> bool:
    """Return whether the expression is a product of the variable and other factors that do not contain it."""
    if not isinstance(e, Term):
        return e is leaf or any(is_factor(operand, leaf) for operand in operands(e))
    if count_occurrences(e, leaf) != 1 or e.op not in ("*", "/", "neg"):
        return False
    return any(is_factor(operand, leaf) for operand in (e.args[:1] if e.op == "/" else e.args))


def rounding_scale(e: Operand) -> Operand:
    """Return a bound on the magnitude of the terms of e; rounding errors of e are relative to it."""
    if not isinstance(e, Expression):
        return abs(e)
    if isinstance(e, Output):
        return rounding_scale(e.expression)
    if isinstance(e, Parameter) and (e.low >= 0.0 or e.above >= 0.0):
        return e
    if not isinstance(e, Term):
        return Term("fabs", e)
    result = _term_rounding_scale(e)
    return e if is_same_expression(result, e) else result


def _term_rounding_scale(e: Term) -> Operand:
    a, b = e.args[0], e.args[-1]
    match e.op:
        case "+" | "-":
            return build_term("+", rounding_scale(a), rounding_scale(b))
        case "*":
            return build_term("*", rounding_scale(a), rounding_scale(b))
        case "/":
            return build_term("/", rounding_scale(a), rounding_scale(b) if not isinstance(b, Term) else Term("fabs", b))
        case "neg" | "fabs" | "sin" | "atan" | "tanh":  # slope at most 1, zero at zero
            return rounding_scale(a)
        case "choose":
            return build_term("choose", a, rounding_scale(e.args[1]), rounding_scale(b))
    slope = build_term("*", Term("fabs", FUNCTIONS[e.op](a, e)), rounding_scale(a)) if e.op in FUNCTIONS else 0.0
    return build_term("+", Term("fabs", e), slope)


def growth_exponent(e: Operand, moving: Collection[Expression]) -> float:
    """Return the exponent with which an expression grows with the moving variables."""
    if not depends_on(e, moving):
        return 0.0
    if not isinstance(e, (Term, Output)):
        return 1.0
    exponents = [growth_exponent(operand, moving) for operand in operands(e)]
    match getattr(e, "op", "neg"):
        case "+" | "-" | "neg" | "fabs" | "choose":
            return max(exponents)
        case "*":
            return sum(exponents)
        case "/" if exponents[1] == 0.0:
            return exponents[0]
        case "sqrt":
            return 0.5 * exponents[0]
        case "sin" | "cos" | "atan" | "tanh" | "copysign":
            return 0.0
    return float("inf")
