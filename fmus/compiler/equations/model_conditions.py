"""Conditions of the equations that may change during a step: choose(), pieces of tables and limits of friction forces.

A condition of choose() that depends on states or time keeps its value during a step; its change is an event.  So does
the piece of a table, which has two conditions: its argument lies above the lower and below the upper edge of the piece.
So the equations are smooth in every step.  Limits must hold during the whole run.
"""

from collections import defaultdict
from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import dataclass

from .algebra import (
    Memo,
    dependents,
    depends_on,
    is_constant,
    is_same_expression,
    operands,
    operands_first,
    subexpressions,
    substitute,
    variables_in,
    with_operands,
)
from .expressions import COMPARISONS, Expression, ModelError, Operand, Term, is_among
from .model_declaration import HYBRID, Contact, Model, Output, SettableVariable, State, Variable
from .tables import EDGE, REFUSE, Coefficient, Piece, find_table_call, is_piece, table_of

LIMITED_DOMAIN = ("sqrt", "log", "asin", "acos", "/")  # operations that fail for some operands
HOLD_TOLERANCE = 1e-9  # the sliding force may exceed the holding force by rounding errors


@dataclass(frozen=True)
class Condition:
    """A condition: its margin, positive while it holds; both sides; comparisons it replaces; message of a limit.

    Two conditions that belong to the piece of a table have this piece, in all its copies, in place of comparisons.
    """

    margin: Operand
    sides: tuple[Operand, ...]
    comparisons: tuple[Term, ...] = ()
    is_frozen: bool = False  # whether the equations use its value at the start of the step
    sentence: str = ""

    @property
    def piece(self) -> Term | None:
        """The piece of a table to which the condition belongs, if any."""
        return self.comparisons[0] if self.comparisons and is_piece(self.comparisons[0]) else None


def find_conditions(
    targets: Iterable[Operand], varying: Iterable[Expression], contacts: Collection[Contact] = ()
) -> list[Condition]:
    """Find the conditions of choose() and the pieces of tables in some equations that depend on `varying`.

    Equal ones are one condition.  The slips of `contacts` have the signs of their modes.
    """
    varying, targets = tuple(varying), tuple(targets)
    dependent_ids = dependents(targets, varying)
    terms = [e for target in targets for e in subexpressions(target).values() if isinstance(e, Term)]
    terms = list({id(e): e for e in terms}.values())
    groups: list[list[Term]] = []
    group_by_hash: defaultdict[int, list[list[Term]]] = defaultdict(list)

    def find_group(e: Term) -> list[Term] | None:
        return next((group for group in group_by_hash[e.structure_hash] if is_same_expression(group[0], e)), None)

    def find_side(kink: Term) -> Term | None:
        group = find_group(Term(">", kink.args[0], 0.0))
        return group[0] if group else None

    def add_group(e: Term) -> None:
        groups.append([e])
        group_by_hash[e.structure_hash].append(groups[-1])

    for e in terms:
        if (e.op in COMPARISONS or is_piece(e)) and id(e) in dependent_ids:
            if (group := find_group(e)) is None:
                add_group(e)
            else:
                group.append(e)
    visited_ids: set[int] = set()
    margins = []
    for group in groups:  # grows: a kink may lie within another one
        margins.append(sign_slips(group[0].args[0], contacts) if is_piece(group[0]) else comparison_margin(group[0]))
        for e in kinks(margins[-1], visited_ids):
            side = Term(">", e.args[0], 0.0)
            side.location = e.location
            if id(e) in dependent_ids and find_group(side) is None:
                add_group(side)
    protected_ids = protected_comparisons(targets, varying)
    # A search on a polynomial would pass the narrow dip of fabs(u) - b without a zero; u itself has none.
    margins = replace_absolute_values(margins, lambda kink, _: find_side(kink))
    return [
        Condition(condition_margin, group[0].args, tuple(group), protected_ids.isdisjoint(map(id, group)))
        for group, margin in zip(groups, margins, strict=True)
        for condition_margin in (piece_margins(group[0], margin) if is_piece(group[0]) else (margin,))
    ]


def sign_slips(u: Operand, contacts: Collection[Contact]) -> Operand:
    """Return an expression with mode * slip in place of |slip|: smooth, and no event apart from that of the contact."""
    sizes: dict[Expression, Operand] = {
        e: Term("*", c.mode, c.slip)
        for e in subexpressions(u).values()
        if isinstance(e, Term) and e.op == "fabs"
        for c in contacts
        if c.laws == (HYBRID,) and is_same_expression(e.args[0], c.slip)
    }
    return substitute(u, sizes)


def piece_margins(piece: Term, u: Operand) -> tuple[Term, Term]:
    """Return the distances of the argument u of a table from the lower and the upper edge of its piece."""
    table = table_of(piece)
    lower, upper = (Term(Coefficient(table, EDGE, offset), piece) for offset in (0, 1))
    return Term("+", Term("-", u, lower), table.overlap), Term("+", Term("-", upper, u), table.overlap)


def table_limits(targets: Iterable[Operand], forces: Collection[Expression]) -> list[Condition]:
    """Return the limits of arguments of tables that refuse values beyond their first and their last point."""
    pieces: dict[int, list[Term]] = {}  # by hash, each once
    for e in operands_first(*targets):
        if isinstance(e, Term) and isinstance(e.op, Piece) and e.op.table.ends == REFUSE:
            if depends_on(e, forces):
                raise ModelError(
                    f"{e.op.table} refuses values beyond its ends, but its argument depends on the force of a contact: "
                    'declare ends="hold" or ends="continue"',
                    e.location,
                )
            equal_pieces = pieces.setdefault(e.structure_hash, [])
            if not any(is_same_expression(e, piece) for piece in equal_pieces):
                equal_pieces.append(e)
    result = []
    for piece in (piece for equal_pieces in pieces.values() for piece in equal_pieces):
        table, (u,) = table_of(piece), piece.args
        for margin, event, x in (
            (Term("-", u, table.x[0]), "falls below the first", table.x[0]),
            (Term("-", table.x[-1], u), "exceeds the last", table.x[-1]),
        ):
            point = f"the argument of {table} {event} point of the table, {x!r} {table.unit_x}"
            remedy = 'extend the table, or declare ends="hold" or ends="continue"'
            sentence = f"{point}, at t = {{violation_time!r}} s: {remedy}"
            result.append(Condition(margin, (u,), sentence=sentence))
    return result


def kinks(e: Operand, visited_ids: set[int]) -> list[Term]:
    """Return the absolute values in an expression that were not visited yet; those inside of others come first."""
    parts = operands_first(e, operands_of=lambda part: () if id(part) in visited_ids else operands(part))
    result = [term for term in parts if isinstance(term, Term) and term.op == "fabs" and id(term) not in visited_ids]
    visited_ids.update(map(id, parts))
    return result


def replace_absolute_values(
    expressions: Sequence[Operand],
    comparison: Callable[[Term, Operand], Term | None],
    unchanged_outputs: Collection[Expression] = (),
) -> list[Operand]:
    """Return expressions with choose() in place of absolute values.

    Parameters
    ----------
    expressions
        Expressions, which are not changed.
    comparison
        Gets an absolute value and its new operand u; returns the condition u > 0, or None to keep the absolute value.
    unchanged_outputs
        Outputs that expressions continue to contain.
    """
    result: Memo = {}
    for part in operands_first(*expressions):
        new = with_operands(part, result)
        if isinstance(part, Term) and part.op == "fabs":
            u = result[id(part.args[0])]
            if (condition := comparison(part, u)) is not None:
                new = Term("choose", condition, u, Term("neg", u))
                new.location = part.location
        result[id(part)] = part if isinstance(part, Output) and part in unchanged_outputs else new
    return [result[id(e)] for e in expressions]


def add_liftoff(model: type[Model]) -> None:
    """Write the friction of contacts that may lift off by choose(), so that it is zero where it would be negative.

    A sliding force that depends on the direction has a condition for each direction, because a condition keeps its
    value during a step, and the solver tries several modes at its end.
    """
    for c in vars(model).values():
        if not (isinstance(c, Contact) and c.lifts_off):
            continue
        if c.hold is not None and depends_on(c.slide, (c.mode,)):
            forward, backward = (while_positive(substitute(c.slide, {c.mode: mode}), c) for mode in (1.0, -1.0))
            c.hold = while_positive(c.hold, c)
            c.slide = set_location(Term("choose", set_location(Term(">", c.mode, 0.0), c), forward, backward), c)
        else:
            touches = set_location(Term(">", c.slide, 0.0), c)
            c.slide = set_location(Term("choose", touches, c.slide, 0.0), c)
            c.hold = None if c.hold is None else set_location(Term("choose", touches, c.hold, 0.0), c)


def while_positive(e: Operand, owner: Expression) -> Operand:
    """Return an expression where it is positive, else 0."""
    if not isinstance(e, Expression):
        return e
    return set_location(Term("choose", set_location(Term(">", e, 0.0), owner), e, 0.0), owner)


def set_location(e: Term, owner: Expression) -> Term:
    """Give a term the location of a declaration in the model file."""
    e.location = owner.location
    return e


def locate_kinks(model: type[Model]) -> None:
    """Write the absolute values in the friction and the loads of contacts by choose(), so that their kinks are events.

    A limit mu |N| falls to zero and rises again where N changes its sign, and a load may have a cusp; a search would
    not find the dip.  The kinks of |slip| and of drag |v| v need no events of their own.
    """
    attributes = list(vars(model).values())
    contacts = [e for e in attributes if isinstance(e, Contact)]
    positions = [e.integrates for e in attributes if isinstance(e, State) and e.integrates is not None]
    speeds = [
        s
        for c in contacts
        for s in variables_in(c.slip)
        if isinstance(s, State) and s.constant_rate is None and not is_among(s, positions)
    ]
    if not contacts:
        return
    outputs = {e for e in attributes if isinstance(e, Output)}
    slots: list[tuple[Variable, str]] = [(e, "expression") for e in attributes if isinstance(e, Output)]
    slots += [(c, name) for c in contacts for name in ("slide", "hold")]
    expressions = [getattr(e, name) for e, name in slots]
    leaves = [e for e in operands_first(*expressions) if isinstance(e, Variable) and not isinstance(e, Output)]
    changing_ids, fast_ids = dependents(expressions, leaves), dependents(expressions, speeds)

    def comparison(kink: Term, u: Operand) -> Term | None:
        if id(kink) not in changing_ids or id(kink) in fast_ids:
            return None
        condition = Term(">", u, 0.0)
        condition.location = kink.location
        return condition

    for (e, name), new in zip(slots, replace_absolute_values(expressions, comparison, outputs), strict=True):
        setattr(e, name, new)


def is_absolute_value(e: Term) -> bool:
    """Return whether a term is choose(u > 0, u, -u)."""
    condition, true_case, false_case = e.args
    return (
        is_lower_bound(condition, true_case)
        and is_constant(condition.args[1], 0.0)
        and is_same_expression(false_case, Term("neg", true_case))
    )


def comparison_margin(e: Term) -> Operand:
    """Return the difference of both sides, positive where the comparison holds."""
    a, b = e.args
    larger, smaller = (b, a) if e.op in ("<", "<=") else (a, b)
    margin = larger if is_constant(smaller, 0.0) else Term("-", larger, smaller)
    # equal sides count as a positive margin where the comparison includes them
    return Term("+", margin, 1e-300) if e.op in ("<=", ">=") else margin


def protected_comparisons(targets: Collection[Operand], varying: Collection[Expression]) -> set[int]:
    """Return the identities of the comparisons that keep an operation inside its domain.

    They must be evaluated where the operation is.  These are the conditions around the operation and those inside its
    operand, if they depend on what the operand depends on.
    """
    dependent_ids = dependents(targets, varying)
    order = operands_first(*targets)
    bits = {id(e): 1 << n for n, e in enumerate(varying)}
    dependencies: dict[int, int] = {}  # bits of the variables on which an expression depends
    domain_dependencies: dict[int, int] = {}  # bits of the variables that decide whether its operations have a value
    for e in order:
        dependencies[id(e)], domain_dependencies[id(e)] = bits.get(id(e), 0), 0
        for operand in operands(e):
            dependencies[id(e)] |= dependencies[id(operand)]
            domain_dependencies[id(e)] |= domain_dependencies[id(operand)]
        if isinstance(e, Term) and e.op in LIMITED_DOMAIN:
            domain_dependencies[id(e)] |= dependencies[id(e.args[-1])]
    chooses = [e for e in order if isinstance(e, Term) and e.op == "choose"]
    outer_comparisons = [
        e.args[0]
        for e in chooses
        if any(dependencies[id(e.args[0])] & domain_dependencies[id(case)] for case in e.args[1:])
        and isinstance(e.args[0], Term)
    ]
    operations = [
        e for e in order if isinstance(e, Term) and e.op in LIMITED_DOMAIN and id(e.args[-1]) in dependent_ids
    ]
    inner_comparisons = [e for e in operands_first(*operations) if isinstance(e, Term) and e.op in COMPARISONS]
    return {id(e) for e in (*outer_comparisons, *inner_comparisons)}


class Signs:
    """Finds expressions whose form shows that they are never negative, or never positive; visits each one once."""

    def __init__(self) -> None:
        self._nonnegative: dict[int, bool] = {}
        self._nonpositive: dict[int, bool] = {}
        self._visited_operands: list[Operand] = []  # keeps id() unique

    def is_nonnegative(self, e: Operand) -> bool:
        """Return whether the form of an expression shows that it is never negative."""
        self._visit(e)
        return self._nonnegative[id(e)]

    def is_in_domain(self, e: Term) -> bool:
        """Return whether the form of the operand of a function shows that the function has a finite value there."""
        (u,) = e.args
        self._visit(u)
        return (e.op == "sqrt" and self._nonnegative[id(u)]) or (
            e.op == "exp" and (self._nonpositive[id(u)] or self._is_decay(e))
        )

    def _visit(self, e: Operand) -> None:
        for part in operands_first(e, operands_of=lambda part: () if id(part) in self._nonnegative else operands(part)):
            if id(part) not in self._nonnegative:
                self._visited_operands.append(part)
                self._nonpositive[id(part)] = self._has_nonpositive_form(part)
                self._nonnegative[id(part)] = self._has_nonnegative_form(part)

    def _has_nonnegative_form(self, e: Operand) -> bool:
        if not isinstance(e, Expression):
            return e >= 0.0
        if isinstance(e, SettableVariable):
            return e.low >= 0.0 or e.above >= 0.0
        signs = [self._nonnegative[id(operand)] for operand in operands(e)]
        if not isinstance(e, Term):
            return bool(signs) and all(signs)
        match e.op:
            case "fabs" | "sqrt" | "exp" | "cosh":
                return True
            case "*" if is_same_expression(e.args[0], e.args[1]):
                return True
            case "+" if self._is_weighted_mean(*e.args):
                return True
            case "+" if call := find_table_call(e):
                table, u = call
                return table.is_nonnegative(self._nonnegative[id(u)])
            case "+" | "*" | "/":
                return all(signs)
            case "-":
                return signs[0] and self._nonpositive[id(e.args[1])]
            case "choose":
                return is_absolute_value(e) or all(
                    self._nonnegative[id(case)] or self._is_positive_part(e.args[0], case) for case in e.args[1:]
                )
        return False

    def _has_nonpositive_form(self, e: Operand) -> bool:
        if not isinstance(e, Term):
            return not isinstance(e, Expression) and e <= 0.0
        a, b = id(e.args[0]), id(e.args[-1])
        nonnegative, nonpositive = self._nonnegative, self._nonpositive
        match e.op:
            case "neg":
                return nonnegative[a]
            case "*" | "/":
                return (nonpositive[a] and nonnegative[b]) or (nonnegative[a] and nonpositive[b])
        return False

    def _is_weighted_mean(self, a: Operand, difference: Operand) -> bool:
        """Return whether a + difference is a + (b - a) * w with nonnegative a and b and a weight w between 0 and 1."""
        if not (isinstance(difference, Term) and difference.op == "*" and isinstance(difference.args[0], Term)):
            return False
        b_minus_a, weight = difference.args
        return (
            b_minus_a.op == "-"
            and is_same_expression(b_minus_a.args[1], a)
            and self._nonnegative[id(a)]
            and self._nonnegative[id(b_minus_a.args[0])]
            and self._is_decay(weight)
        )

    def _is_decay(self, e: Operand) -> bool:
        """Return whether an expression is exp(-x) with a nonnegative x."""
        if not (isinstance(e, Term) and e.op == "exp" and isinstance(e.args[0], Term)):
            return False
        exponent = e.args[0]
        first = exponent.args[0]
        if exponent.op in ("*", "/") and isinstance(first, Term) and first.op == "neg":  # -x * x is (-x) * x
            x, other = first.args[0], exponent.args[1]
            is_square = exponent.op == "*" and is_same_expression(x, other)
            return is_square or (self._nonnegative[id(x)] and self._nonnegative[id(other)])
        return exponent.op == "neg" and self._nonnegative[id(first)]

    def _is_positive_part(self, condition: Operand, case: Operand) -> bool:
        """Return whether a case is chosen only where it is positive, as in choose(x > 0, x, 0)."""
        return is_lower_bound(condition, case) and self._nonnegative[id(condition.args[1])]


def is_nonnegative(e: Operand) -> bool:
    """Return whether the form of an expression shows that it is never negative."""
    return Signs().is_nonnegative(e)


def is_lower_bound(condition: Operand, e: Operand) -> bool:
    """Return whether a condition is e > bound or e >= bound."""
    return isinstance(condition, Term) and condition.op in (">", ">=") and is_same_expression(condition.args[0], e)
