"""Conditions of the equations that may change during a step: choose() and limits of friction forces.

A condition of choose() that depends on states or time keeps its value during a step; its change is an event.  So the
equations are smooth in every step.  Limits must hold during the whole run.
"""

from collections.abc import Collection, Iterable
from dataclasses import dataclass

from .algebra import depends_on, is_constant, is_same_expression, operands, subexpressions, substitute, variables_in
from .expressions import COMPARISONS, Expression, Operand, Term, is_among
from .model_declaration import Contact, Model, Output, SettableVariable, State

LIMITED_DOMAIN = ("sqrt", "log", "asin", "acos", "/")  # operations that fail for some operands
HOLD_TOLERANCE = 1e-9  # the sliding force may exceed the holding force by rounding errors


@dataclass(frozen=True)
class Condition:
    """A condition: its margin, positive while it holds; both sides; comparisons it replaces; message of a limit."""

    margin: Operand
    sides: tuple[Operand, ...]
    comparisons: tuple[Term, ...] = ()
    is_frozen: bool = False  # whether the equations use its value at the start of the step
    sentence: str = ""


def find_conditions(targets: Iterable[Operand], varying: Iterable[Expression]) -> list[Condition]:
    """Find the conditions of choose() in some equations that depend on `varying`; equal ones are one condition."""
    varying = tuple(varying)
    terms = [e for target in targets for e in subexpressions(target).values() if isinstance(e, Term)]
    terms = list({id(e): e for e in terms}.values())
    groups: list[list[Term]] = []
    for e in terms:
        if e.op in COMPARISONS and depends_on(e, varying):
            group = next((candidate for candidate in groups if is_same_expression(candidate[0], e)), None)
            if group is None:
                groups.append([e])
            else:
                group.append(e)
    for group in groups:  # grows: a kink may lie within another one
        for e in kinks(comparison_margin(group[0])):
            side = Term(">", e.args[0], 0.0)
            side.location = e.location
            if depends_on(e, varying) and not any(is_same_expression(other[0], side) for other in groups):
                groups.append([side])
    protecting = {id(comparison) for e in terms for comparison in protected_comparisons(e, varying)}
    return [
        Condition(
            without_kinks(comparison_margin(group[0]), groups),
            group[0].args,
            tuple(group),
            not any(id(e) in protecting for e in group),
        )
        for group in groups
    ]


def kinks(e: Operand) -> list[Term]:
    """Return the absolute values in an expression, those of terms that contain others last."""
    return [term for term in reversed(subexpressions(e).values()) if isinstance(term, Term) and term.op == "fabs"]


def without_kinks(e: Operand, groups: list[list[Term]]) -> Operand:
    """Return an expression with its absolute values as cases of the comparisons u > 0 among the groups.

    A search on a polynomial would pass the narrow dip of fabs(u) - b without a zero; u itself has none.
    """
    values: dict[Expression, Operand] = {}
    for kink in kinks(e):
        (u,) = kink.args
        for comparison, *_ in groups:
            if comparison.op == ">" and is_same_expression(comparison, Term(">", u, 0.0)):
                smooth = substitute(u, values)
                values[kink] = Term("choose", comparison, smooth, Term("neg", smooth))
    return substitute(e, values)


def locate_kinks(model: type[Model]) -> None:
    """Write the absolute values in the friction and the loads of contacts by choose(), so that their kinks are events.

    A limit mu |N| falls to zero and rises again where N changes its sign, and a load may have a cusp; a search would
    not find the dip.  The kinks of |slip| and of drag |v| v need no events of their own.
    """
    declared = list(vars(model).values())
    contacts = [e for e in declared if isinstance(e, Contact)]
    positions = [e.integrates for e in declared if isinstance(e, State) and e.integrates is not None]
    speeds = [
        s
        for c in contacts
        for s in variables_in(c.slip)
        if isinstance(s, State) and s.constant_rate is None and not is_among(s, positions)
    ]
    for e in declared if contacts else ():  # an output before the outputs that use it
        if isinstance(e, Output):
            e.expression = without_absolute_values(e.expression, speeds)
        elif isinstance(e, Contact):
            e.slide = without_absolute_values(e.slide, speeds)
            e.hold = None if e.hold is None else without_absolute_values(e.hold, speeds)


def without_absolute_values(e: Operand, speeds: Collection[Expression]) -> Operand:
    """Return an expression with choose() in place of the absolute values that do not depend on the speeds."""
    values: dict[Expression, Operand] = {}
    for kink in kinks(e):
        if variables_in(kink) and not depends_on(kink, speeds):
            u = substitute(kink.args[0], values)
            comparison = Term(">", u, 0.0)
            values[kink] = Term("choose", comparison, u, Term("neg", u))
            comparison.location = values[kink].location = kink.location
    return substitute(e, values)


def is_absolute_value(e: Term) -> bool:
    """Return whether a term is choose(u > 0, u, -u)."""
    condition, this, that = e.args
    return is_positive_part(condition, this) and is_same_expression(that, Term("neg", this))


def comparison_margin(e: Term) -> Operand:
    """Return the difference of both sides, positive where the comparison holds."""
    a, b = e.args
    larger, smaller = (b, a) if e.op in ("<", "<=") else (a, b)
    margin = larger if is_constant(smaller, 0.0) else Term("-", larger, smaller)
    # equal sides count as a positive margin where the comparison includes them
    return Term("+", margin, 1e-300) if e.op in ("<=", ">=") else margin


def protected_comparisons(e: Term, varying: tuple[Expression, ...]) -> list[Term]:
    """Return the comparisons that keep an operation inside its domain; they must be evaluated where it is.

    These are the conditions around the operation and those inside its operand, if they depend on what the operand
    depends on.
    """
    if e.op == "choose":
        condition, *cases = e.args
        inside = [term for case in cases for term in subexpressions(case).values()]
        related = [one for one in variables_in(condition) if is_among(one, varying)]
        return [condition] if any(has_limited_domain(term, related) for term in inside) else []
    if has_limited_domain(e, varying):
        return [term for term in subexpressions(e).values() if isinstance(term, Term) and term.op in COMPARISONS]
    return []


def has_limited_domain(e: Operand, varying: Collection[Expression]) -> bool:
    """Return whether an operation fails for some values of the variables."""
    return isinstance(e, Term) and e.op in LIMITED_DOMAIN and depends_on(e.args[-1], varying)


def is_in_domain(e: Term) -> bool:
    """Return whether the form of the operand of a function shows that the function has a finite value there."""
    (u,) = e.args
    return (e.op == "sqrt" and is_nonnegative(u)) or (e.op == "exp" and (is_nonpositive(u) or is_decay(e)))


def is_nonnegative(e: Operand) -> bool:
    """Return whether the form of an expression shows that it is never negative."""
    if not isinstance(e, Expression):
        return e >= 0.0
    if isinstance(e, SettableVariable):
        return e.low >= 0.0 or e.above >= 0.0
    if not isinstance(e, Term):
        return bool(operands(e)) and all(map(is_nonnegative, operands(e)))
    match e.op:
        case "fabs" | "sqrt" | "exp" | "cosh":
            return True
        case "*" if is_same_expression(e.args[0], e.args[1]):
            return True
        case "+" if is_weighted_mean(*e.args):
            return True
        case "+" | "*" | "/":
            return all(map(is_nonnegative, e.args))
        case "-":
            return is_nonnegative(e.args[0]) and is_nonpositive(e.args[1])
        case "choose":
            return is_absolute_value(e) or all(
                is_nonnegative(case) or is_positive_part(e.args[0], case) for case in e.args[1:]
            )
    return False


def is_nonpositive(e: Operand) -> bool:
    """Return whether the form of an expression shows that it is never positive."""
    if not isinstance(e, Term):
        return not isinstance(e, Expression) and e <= 0.0
    a, b = e.args[0], e.args[-1]
    match e.op:
        case "neg":
            return is_nonnegative(a)
        case "*" | "/":
            return (is_nonpositive(a) and is_nonnegative(b)) or (is_nonnegative(a) and is_nonpositive(b))
    return False


def is_weighted_mean(a: Operand, difference: Operand) -> bool:
    """Return whether a + difference is a + (b - a) * w with nonnegative a and b and a weight w between 0 and 1."""
    if not (isinstance(difference, Term) and difference.op == "*" and isinstance(difference.args[0], Term)):
        return False
    b_minus_a, weight = difference.args
    return (
        b_minus_a.op == "-"
        and is_same_expression(b_minus_a.args[1], a)
        and is_nonnegative(a)
        and is_nonnegative(b_minus_a.args[0])
        and is_decay(weight)
    )


def is_decay(e: Operand) -> bool:
    """Return whether an expression is exp(-x) with a nonnegative x."""
    if not (isinstance(e, Term) and e.op == "exp" and isinstance(e.args[0], Term)):
        return False
    exponent = e.args[0]
    first = exponent.args[0]
    if exponent.op in ("*", "/") and isinstance(first, Term) and first.op == "neg":  # -x * x is (-x) * x
        return is_nonnegative(Term(exponent.op, first.args[0], exponent.args[1]))
    return exponent.op == "neg" and is_nonnegative(first)


def is_positive_part(condition: Operand, case: Operand) -> bool:
    """Return whether a case is chosen only where it is positive, as in choose(x > 0, x, 0)."""
    return (
        isinstance(condition, Term)
        and condition.op in (">", ">=")
        and is_nonnegative(condition.args[1])
        and is_same_expression(condition.args[0], case)
    )
