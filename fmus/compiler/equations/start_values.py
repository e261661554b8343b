"""Checks the start values: equations and rules are evaluated there, and an expression without a value is named."""

import math
import operator
from collections.abc import Callable
from typing import Any

from ...runtime.planar_contact import slip_direction
from .algebra import (
    ARITHMETIC,
    has_condition_on,
    is_same_expression,
    operands,
    operands_first,
    subexpressions,
    variables_in,
)
from .contact_analysis import DIRECTION_ADVICE
from .dimensions import expression_text
from .expressions import Expression, ModelError, Operand, Term
from .model_analysis import ModelAnalysis
from .model_declaration import Contact, Fixed, Input, Output, Parameter, PlanarContact, State
from .tables import Coefficient, Piece

SMALL_SLIP = 1e-9  # m/s or rad/s, for the two sides of zero slip
FORCE_TOLERANCE = 1e-6  # relative difference of forces that are equal
MAX_TEXT_LENGTH = 80  # characters of an expression in a message
OPERATIONS: dict[str, Callable[..., Any]] = {
    **ARITHMETIC,
    **{"<": operator.lt, "<=": operator.le, ">": operator.gt, ">=": operator.ge, "==": operator.eq},
    "neg": operator.neg,
    "slip_direction": slip_direction,
}


def check_start_values(analysis: ModelAnalysis) -> None:
    """Raise ModelError for an expression without a value at the start values, or for values that the model refuses.

    Contacts that share bodies have a force of 0 here, others their load.
    """
    values = start_values(analysis)
    memo: dict[int, Value] = {}
    at_rest = dict(values)
    for symbol, rate in analysis.declared_derivatives().items():
        at_rest[symbol] = evaluate(rate, values, memo)
    at_rest |= {c: evaluate(analysis.load[c], at_rest, memo) for c in analysis.independent_contacts}
    memo = {}
    output_values = {e: evaluate(e, at_rest, memo) for e in analysis.outputs}
    for rule in analysis.rules:
        if evaluate(rule.broken, values, {}):
            numbers = {e.name: e.start if e.is_integer else float(e.start) for e in analysis.parameters}
            numbers |= {e.name: e.start for e in analysis.choices}
            sentence = f"the start values are invalid: {rule.sentence.format_map(numbers)}"
            raise ModelError(sentence, rule.broken.location)
    check_friction_forces(analysis, values, output_values)
    check_state_ranges(analysis, values)


def check_friction_forces(
    analysis: ModelAnalysis, values: dict[Expression, float], output_values: dict[Expression, float]
) -> None:
    """Raise ModelError for a sliding or holding force without a value at the start values, or with a direction."""
    for c in analysis.contacts:
        for e in (c.slide, analysis.holding_limit[c]):
            try:
                evaluate(e, values, {})
            except ModelError as error:
                raise ModelError(f"{c.name}: {error}", c.location) from error
        if isinstance(c, PlanarContact):  # its slip has a size only
            continue
        check_symmetry(c, values, values | output_values)
        if c.hold is None:
            for point in (values, shifted_values(analysis, values)):
                check_holding_force(c, point)


def check_symmetry(c: Contact, values: dict[Expression, float], load_values: dict[Expression, float]) -> None:
    """Raise ModelError if the sliding force depends on the direction of the slip without saying so.

    `load_values` also holds the values of outputs, in which the direction may be that of a load.
    """
    try:
        forward, backward = (sliding_force(c, slip, values) for slip in (1.0, -1.0))
        direct_forward, direct_backward = (sliding_force(c, slip, load_values) for slip in (1.0, -1.0))
    except ModelError:
        return  # no value at these slips
    if forward == -backward != 0.0:
        raise ModelError(
            f"slide of {c.name} changes its sign with the slip: write the size of the force, which the solver "
            "directs against the slip",
            c.location,
        )
    if not has_condition_on(c.slide_while_closed, variables_in(c.slip)) and differ(direct_forward, direct_backward):
        raise ModelError(
            f"slide of {c.name} is {direct_forward:g} {c.unit} at a slip of 1, but {direct_backward:g} {c.unit} at "
            "-1: write the size of the slip by fabs(), and declare a load that depends on the direction as an "
            f"Output; if the friction itself depends on the direction, {DIRECTION_ADVICE}",
            c.location,
        )


def check_holding_force(c: Contact, values: dict[Expression, float]) -> None:
    """Raise ModelError if the sliding force has another limit on each side of zero slip, and none is to be held."""
    try:
        ahead, behind = (sliding_force(c, slip, values) for slip in (SMALL_SLIP, -SMALL_SLIP))
    except ModelError:
        return  # no value at these slips
    if has_condition_on(c.slide_while_closed, variables_in(c.slip)) and differ(ahead, behind):
        raise ModelError(
            f"slide of {c.name} is {ahead:g} {c.unit} for small positive slips, but {behind:g} {c.unit} for negative "
            f"ones: {DIRECTION_ADVICE}; pass hold= only if the contact holds the same in both directions",
            c.location,
        )


def shifted_values(analysis: ModelAnalysis, values: dict[Expression, float]) -> dict[Expression, float]:
    """Return the start values, moved by different amounts, so that forces equal by chance differ."""
    result = dict(values)
    for n, (e, start) in enumerate(values.items(), start=1):
        value = start + 0.01 * n * (abs(start) + 1.0)
        if isinstance(e, (Parameter, Fixed, Input, State)) and e.accepts(value):
            result[e] = value
    return result


def sliding_force(c: Contact, slip: float, values: dict[Expression, float]) -> float:
    """Return the sliding force at a slip, as if the contact were closed."""
    slide = c.slide_while_closed
    slips = [e for e in subexpressions(slide).values() if is_same_expression(e, c.slip)]
    return evaluate(slide, values | dict.fromkeys(slips, slip), {})


def differ(a: float, b: float) -> bool:
    """Return whether two forces differ by more than rounding errors."""
    return abs(a - b) > FORCE_TOLERANCE * max(abs(a), abs(b))


def check_state_ranges(analysis: ModelAnalysis, values: dict[Expression, float]) -> None:
    """Raise ModelError for a state that starts outside its declared range."""
    for s in analysis.states:
        if not s.accepts(values[s]):
            raise ModelError(
                f"{s.name} starts at {values[s]!r}{s.unit_suffix}, but its declaration says that it is "
                f"{s.allowed_range}",
                s.location,
            )


def start_values(analysis: ModelAnalysis) -> dict[Expression, float]:
    """Return the values of parameters, inputs and states at the start; what follows from them counts as 0."""
    values: dict[Expression, float] = dict.fromkeys((*analysis.time_varying, *analysis.input_symbols), 0.0)
    values |= {e: float(e.start) for e in (*analysis.parameters, *analysis.choices, *analysis.inputs)}
    memo: dict[int, Value] = {}
    for s in analysis.states:
        values[s] = evaluate(s.start_expression, values, memo)
    return values


Value = float | ModelError  # an expression without a value has the error of the operation that fails


def evaluate(e: Operand, values: dict[Expression, float], memo: dict[int, Value]) -> float:
    """Return the value of an expression; raise ModelError where it has none."""

    def unknown_operands(part: Operand) -> tuple[Operand, ...]:
        return () if id(part) in memo or (isinstance(part, Expression) and part in values) else operands(part)

    for part in operands_first(e, operands_of=unknown_operands):
        if id(part) not in memo:
            memo[id(part)] = _value_of(part, values, memo)
    result = memo[id(e)]
    if isinstance(result, ModelError):
        raise result
    return result


def _value_of(e: Operand, values: dict[Expression, float], memo: dict[int, Value]) -> Value:
    """Return the value of an expression whose operands are in the memo; of choose() only one case needs a value."""
    if not isinstance(e, Expression):
        return float(e)
    if e in values:
        return values[e]
    args: list[Any] = [memo[id(operand)] for operand in operands(e)]
    if isinstance(e, Term) and e.op == "choose" and not isinstance(args[0], ModelError):
        return args[1] if args[0] else args[2]
    for argument in args:
        if isinstance(argument, ModelError):
            return argument
    if isinstance(e, Output):
        return args[0]
    assert isinstance(e, Term)
    if isinstance(e.op, (Piece, Coefficient)):
        return e.op.evaluate(*args)
    function = OPERATIONS[e.op] if e.op in OPERATIONS else getattr(math, e.op)
    try:
        return float(function(*args))
    except (ArithmeticError, ValueError):
        return ModelError(
            f"{_short_text(e)} cannot be calculated at the start values, "
            f"where {_short_text(e.args[-1])} is {args[-1] + 0.0!r}",  # 0.0 instead of -0.0
            e.location,
        )


def _short_text(e: Operand) -> str:
    text = expression_text(e)
    return text if len(text) <= MAX_TEXT_LENGTH else f"{text[:MAX_TEXT_LENGTH]}..."
