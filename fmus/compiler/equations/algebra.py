"""Algebra on expressions: substitution, differentiation, solving for a variable, rounding scales.

Terms are simplified only where the result keeps its bits: zeros, ones and signs.

Equations share subexpressions and may be thousands of terms deep.  So every function visits a subexpression once, and
none recurses: it follows `operands_first`.
"""

import math
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from contextlib import suppress

from .expressions import COMPARISONS, FUNCTIONS, Expression, ModelError, Operand, Term
from .model_declaration import Mode, Output, Parameter
from .tables import EDGE, Coefficient, Piece

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


def operands_first(*roots: Operand, operands_of: Callable[[Operand], Iterable[Operand]] = operands) -> list[Operand]:
    """Return all distinct subexpressions by identity, each after its operands.

    Parameters
    ----------
    *roots
        Expressions.
    operands_of
        Returns the operands of a subexpression that are visited.
    """
    result: list[Operand] = []
    visited_ids: set[int] = set()
    stack = [(e, False) for e in reversed(roots)]
    while stack:
        e, is_complete = stack.pop()
        if is_complete:
            result.append(e)
        elif id(e) not in visited_ids:
            visited_ids.add(id(e))
            stack.append((e, True))
            stack.extend((operand, False) for operand in reversed((*operands_of(e),)))
    return result


def dependents(roots: Iterable[Operand], variables: Iterable[Expression]) -> set[int]:
    """Return the identities of the variables and of all subexpressions that contain one of them."""
    result = {id(e) for e in variables}
    for e in operands_first(*roots):
        if any(id(operand) in result for operand in operands(e)):
            result.add(id(e))
    return result


def depends_on(e: Operand, variables: Collection[Expression]) -> bool:
    """Return whether an expression contains one of the variables."""
    return not subexpressions(e).keys().isdisjoint(map(id, variables))


def has_condition_on(e: Operand, variables: Collection[Expression]) -> bool:
    """Return whether a condition in an expression depends on the variables; derivatives do not show this."""
    conditions = [term for term in subexpressions(e).values() if isinstance(term, Term) and term.op in COMPARISONS]
    return not dependents(conditions, variables).isdisjoint(map(id, conditions))


def subexpressions(e: Operand, result: Memo | None = None) -> Memo:
    """Return all distinct subexpressions by identity, in the order of the source text."""
    result = {} if result is None else result
    stack = [e]
    while stack:
        part = stack.pop()
        if id(part) not in result:
            result[id(part)] = part
            stack.extend(reversed(operands(part)))
    return result


def variables_in(e: Operand) -> list[Expression]:
    """Return the distinct declared variables in an expression."""
    return [
        leaf
        for leaf in subexpressions(e).values()
        if isinstance(leaf, Expression) and not isinstance(leaf, (Term, Output))
    ]


def factors(e: Operand) -> list[Operand]:
    """Return the distinct factors of a product; e is 0 if one of them is 0."""

    def parts(part: Operand) -> tuple[Operand, ...]:
        if not isinstance(part, Term):
            return ()
        return part.args if part.op == "*" else part.args[:1] if part.op in ("neg", "/", "fabs", "sqrt") else ()

    return [part for part in operands_first(e, operands_of=parts) if not parts(part)]


def unconditional_operands(e: Operand) -> tuple[Operand, ...]:
    """Return the operands that every evaluation of an expression calculates: of choose() the condition only."""
    return operands(e)[:1] if isinstance(e, Term) and e.op == "choose" else operands(e)


def value_operands(e: Operand) -> tuple[Operand, ...]:
    """Return the operands that are numbers: of choose() the cases only."""
    return operands(e)[1:] if isinstance(e, Term) and e.op == "choose" else operands(e)


def unconditional_quotients(targets: Collection[Operand]) -> list[Term]:
    """Return the quotients that every evaluation of the targets calculates: those outside the cases of choose()."""
    result: list[Term] = []
    visited_operands: Memo = {}
    stack = list(targets)
    while stack:
        e = stack.pop()
        if id(e) not in visited_operands:
            visited_operands[id(e)] = e
            stack += unconditional_operands(e)
            if isinstance(e, Term) and e.op == "/":
                result.append(e)
    return result


def is_same_expression(a: Operand, b: Operand) -> bool:
    """Return whether two expressions have the same structure."""
    stack, compared_pairs = [(a, b)], set()
    while stack:
        a, b = stack.pop()
        if a is b or (id(a), id(b)) in compared_pairs:
            continue
        compared_pairs.add((id(a), id(b)))
        if isinstance(a, Term) and isinstance(b, Term):
            if a.structure_hash != b.structure_hash or a.op != b.op or len(a.args) != len(b.args):
                return False
            stack.extend(zip(a.args, b.args, strict=True))
        elif isinstance(a, Expression) or isinstance(b, Expression) or a != b:
            return False
    return True


def substitute(e: Operand, values: Mapping[Expression, Operand]) -> Operand:
    """Replace variables or subexpressions by values; unchanged parts are shared."""

    def is_replaced(part: Operand) -> bool:
        return isinstance(part, Expression) and part in values

    result: Memo = {}
    for part in operands_first(e, operands_of=lambda part: () if is_replaced(part) else operands(part)):
        result[id(part)] = values[part] if is_replaced(part) else with_operands(part, result)
    return result[id(e)]


def with_operands(e: Operand, new_operands: Memo) -> Operand:
    """Return an expression with other operands, given by the identities of its own; itself if none changes."""
    if isinstance(e, Output):
        new = new_operands[id(e.expression)]
        return e if new is e.expression else new
    if not isinstance(e, Term):
        return e
    args = [new_operands[id(argument)] for argument in e.args]
    return e if all(a is b for a, b in zip(args, e.args, strict=True)) else build_term(e.op, *args)


def is_constant(e: Operand, value: float) -> bool:
    """Return whether an operand is this number."""
    return not isinstance(e, Expression) and e == value


def build_term(op: str, *args: Operand) -> Operand:
    """Build a term, simplified where operands are numbers."""
    if op == "neg":
        return negate(args[0])
    if op == "choose":
        condition, true_case, false_case = args
        if isinstance(condition, bool):  # decided at build time
            return true_case if condition else false_case
        return true_case if is_same_expression(true_case, false_case) else Term(op, *args)
    if isinstance(op, (Piece, Coefficient)) and not any(isinstance(e, Expression) for e in args):
        return op.evaluate(*args)
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


def differentiate_term(e: Term, slope: Callable[[Operand], Operand]) -> Operand:
    """Return the derivative of a term, where `slope` returns those of its operands."""
    a, b = e.args[0], e.args[-1]
    if isinstance(e.op, (Piece, Coefficient)):  # constant between two points of a table
        return 0.0
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
        case "slip_direction":
            changes = slope(a), slope(e.args[1])
            is_constant_direction = all(is_constant(change, 0.0) for change in changes)
            return 0.0 if is_constant_direction else Term("slip_turn", *e.args, *changes)
    if e.op in COMPARISONS:
        raise ModelError("a comparison has no derivative", e.location)
    return _apply_chain_rule(FUNCTIONS[e.op](a, e), slope(a))


def differentiate(
    e: Operand,
    by: Mapping[Expression, Operand],
    names: dict[Expression, str] | None = None,
    of_term: Callable[[Term, Callable[[Operand], Operand]], Operand] = differentiate_term,
) -> Operand:
    """Return the derivative of an expression.

    Parameters
    ----------
    e
        Expression.
    by
        Derivatives of the variables; those of others are zero.
    names
        Receives new terms that are derivatives of named terms.
    of_term
        Rules: returns the derivative of a term, given a function that returns those of its operands.
    """
    names = {} if names is None else names
    existing_terms, dependent_ids, result = subexpressions(e), dependents([e], by), Memo()

    def moving_operands(part: Operand) -> tuple[Operand, ...]:
        if id(part) not in dependent_ids or part in by or getattr(part, "op", "") == "copysign":
            return ()
        return value_operands(part)

    for part in operands_first(e, operands_of=moving_operands):
        if id(part) not in dependent_ids or part in by:
            new = by.get(part, 0.0)
        elif isinstance(part, Output):
            new = result[id(part.expression)]
        else:
            assert isinstance(part, Term)
            new = of_term(part, lambda operand: result[id(operand)])
        result[id(part)] = new
        name = (part.name or names.get(part, "")) if isinstance(part, (Term, Output)) and part not in by else ""
        if name and isinstance(new, Term) and not (new.name or new in names) and id(new) not in existing_terms:
            names[new] = f"d{name}_d{next(iter(by)).name}"
    return result[id(e)]


def _apply_chain_rule(outer: Operand, inner: Operand) -> Operand:
    """Return outer * inner, with inner in the numerator where outer is a quotient."""
    if isinstance(outer, Term) and outer.op == "choose":
        return build_term("choose", outer.args[0], *(_apply_chain_rule(case, inner) for case in outer.args[1:]))
    if isinstance(outer, Term) and outer.op == "/":
        return build_term("/", _apply_chain_rule(outer.args[0], inner), outer.args[1])
    return build_term("*", outer, inner)


def path_to(e: Operand, leaf: Expression) -> list[tuple[Expression, int]] | None:
    """Return the terms around the only occurrence of a variable, each with the index of the operand that contains it.

    The outermost term comes first.  None if the variable does not occur, or occurs several times.
    """
    counts: dict[int, int] = {id(leaf): 1}
    for part in operands_first(e, operands_of=lambda part: () if part is leaf else operands(part)):
        if part is not leaf:  # 2 stands for several: the exact number may double with each shared term
            counts[id(part)] = min(2, sum(counts[id(operand)] for operand in operands(part)))
    if counts[id(e)] != 1:
        return None
    result = []
    while e is not leaf:
        index = next(i for i, operand in enumerate(operands(e)) if counts[id(operand)])
        result.append((e, index))
        e = operands(e)[index]
    return result


def solve_for(e: Operand, leaf: Expression) -> Operand:
    """Solve e = 0 for a variable that occurs once in e, by inverting the operations from the outside."""
    right: Operand = 0.0
    path = path_to(e, leaf)
    assert path is not None
    for term, index in path:
        if not isinstance(term, Term):  # an Output
            continue
        a, b = term.args[0], term.args[-1]
        is_in_first = index == 0
        match term.op:
            case "+":
                right = build_term("-", right, b if is_in_first else a)
            case "-":
                right = build_term("+", right, b) if is_in_first else build_term("-", a, right)
            case "neg":
                right = build_term("neg", right)
            case "*":
                right = build_term("/", right, b if is_in_first else a)
            case "/" if is_in_first:
                right = build_term("*", right, b)
            case _:
                raise ModelError(f"{leaf.name} must enter the rates linearly, not through {term.op}", term.location)
    return right


def is_summand(e: Operand, leaf: Expression) -> bool:
    """Return whether the variable is a summand of the expression."""
    path = path_to(e, leaf)
    return path is not None and all(term.op in ("+", "-", "neg") for term, _ in path if isinstance(term, Term))


def is_factor(e: Operand, leaf: Expression) -> bool:
    """Return whether the expression is a product of the variable and other factors that do not contain it."""
    path = path_to(e, leaf)
    return path is not None and all(
        term.op in ("*", "neg") or (term.op == "/" and index == 0) for term, index in path if isinstance(term, Term)
    )


def magnitudes(expressions: Sequence[Operand]) -> list[Operand]:
    """Return the sizes of expressions: the sums of their absolute terms, also where these cancel.

    Whole revolutions of an angle do not change them.
    """
    return _fold_scales(expressions, _term_magnitude)


def rounding_scale(e: Operand) -> Operand:
    """Return a bound on the magnitude of e to which its rounding errors are relative."""
    return rounding_scales([e])[0]


def rounding_scales(expressions: Sequence[Operand]) -> list[Operand]:
    """Return the rounding scales of expressions: to first order, the errors are a few EPSILON times these.

    Every variable has a rounding error, relative to itself, and so has every operation (N. J. Higham, Accuracy and
    Stability of Numerical Algorithms, 3.3).  The sine of an angle of many revolutions has the large error of the angle,
    but a product of such sines is no product of large errors.
    """
    return _fold_scales(expressions, _term_rounding_scale)


def _fold_scales(expressions: Sequence[Operand], term_scale: Callable[[Term, Memo], Operand]) -> list[Operand]:
    """Return the scales of expressions, given that of a term with the scales of its operands, by identity."""
    result: Memo = {}
    for part in operands_first(*expressions, operands_of=value_operands):
        if not isinstance(part, Expression):
            scale = abs(part)
        elif isinstance(part, Mode):
            scale = 1.0
        elif isinstance(part, Output):
            scale = result[id(part.expression)]
        elif isinstance(part, Parameter) and (part.low >= 0.0 or part.above >= 0.0):
            scale = part
        elif isinstance(part, Term):
            scale = term_scale(part, result)
            scale = part if is_same_expression(scale, part) else scale
        else:
            scale = Term("fabs", part)
        result[id(part)] = scale
    return [result[id(e)] for e in expressions]


def _term_magnitude(e: Term, scales: Memo) -> Operand:
    a, b = e.args[0], e.args[-1]
    if isinstance(e.op, Coefficient) and e.op.kind == EDGE:
        return e.op.table.scale
    match e.op:
        case "+" | "-" | "*":
            return build_term("*" if e.op == "*" else "+", scales[id(a)], scales[id(b)])
        case "/":
            return build_term("/", scales[id(a)], scales[id(b)] if not isinstance(b, Term) else Term("fabs", b))
        case "neg" | "fabs" | "atan" | "tanh":  # slope at most 1, zero at zero
            return scales[id(a)]
        case "choose":
            return build_term("choose", a, scales[id(e.args[1])], scales[id(b)])
        case "slip_direction":  # at its zeros, it is not small
            return 1.0
        case "sin" | "tan":
            return Term("fabs", e)
        case "cos":  # at its zeros, it is not small
            return build_term("+", Term("fabs", e), Term("fabs", Term("sin", a)))
    return _error_through_function(e, scales)


def _term_rounding_scale(e: Term, scales: Memo) -> Operand:
    a, b = e.args[0], e.args[-1]
    scale_a, scale_b = scales.get(id(a), 0.0), scales.get(id(b), 0.0)
    match e.op:
        case "*" if not (_is_size(scale_a, a) or _is_size(scale_b, b)):
            return build_term("+", build_term("*", scale_a, Term("fabs", b)), build_term("*", Term("fabs", a), scale_b))
        case "/" if not _is_size(scale_b, b):
            error = build_term("*", Term("fabs", e), scale_b)
            return build_term("/", build_term("+", scale_a, error), Term("fabs", b))
        case "sin":  # slope at most 1, zero at zero; this evaluates no cosine
            return scale_a
        case "cos" | "tan" | "atan" | "tanh":
            return _error_through_function(e, scales)
    return _term_magnitude(e, scales)


def _error_through_function(e: Term, scales: Memo) -> Operand:
    """Return the magnitude of a function, and that of its change by the scale of its argument."""
    a = e.args[0]
    slope = build_term("*", Term("fabs", FUNCTIONS[e.op](a, e)), scales[id(a)]) if e.op in FUNCTIONS else 0.0
    return build_term("+", Term("fabs", e), slope)


def _is_size(scale: Operand, e: Operand) -> bool:
    """Return whether a scale is the magnitude of the expression itself, as that of a variable."""
    return not isinstance(e, Term) or scale is e or is_same_expression(scale, Term("fabs", e))
