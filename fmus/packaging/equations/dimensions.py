"""Units of expressions: what is declared in newtons is calculated in newtons, or the build says where it is not."""

from fractions import Fraction
from typing import Any

from .. import BuildError
from ..units import unit_of
from .expression_printer import COMPARISON_OPERATORS
from .expressions import COMPARISONS, Expression, ModelError, Operand, Term
from .model_analysis import ModelAnalysis
from .model_declaration import Choice, Contact, Mode, Output, State, Variable

Dimensions = tuple[Fraction, Fraction, Fraction]
BASE_UNITS = ("kg", "m", "s")  # an angle is a number
DIMENSIONLESS: Dimensions = (Fraction(0), Fraction(0), Fraction(0))
SECOND: Dimensions = (Fraction(0), Fraction(0), Fraction(1))
PRECEDENCE = {"+": 1, "-": 1, "*": 2, "/": 2, "neg": 3} | dict.fromkeys(COMPARISON_OPERATORS, 0)


def check_units(an: ModelAnalysis) -> None:
    """Every output, rate, start, slip and force has the unit that it says."""
    known: dict[int, Dimensions | None] = {}
    for e in an.declared:
        own, said = declared_dimensions(e), f"{e.name} is declared in {e.unit}, and"
        if isinstance(e, Output):
            check_dimensions(e, e.expression, own, said, known)
        if (
            isinstance(e, (State, Output))
            and e.integrates is not None
            and own != quotient(declared_dimensions(e.integrates), SECOND)
        ):
            raise ModelError(
                f"{e.name} in {e.unit} cannot be the rate of {e.integrates.name} in {e.integrates.unit}", e.location
            )
        if isinstance(e, State):
            check_dimensions(e, e.start_expression, own, f"{said} its start", known)
            check_dimensions(e, e.nominal_velocity, own, f"{said} its nominal_velocity", known)
            check_dimensions(e, e.constant_rate, quotient(own, SECOND), f"{said} its rate", known)
        if isinstance(e, Contact):
            slip = dimensions_of(e.slip, known)
            for word, one in ("slide", e.slide), ("hold", e.hold):
                check_dimensions(e, one, own, f"{said} {word}", known)
            check_dimensions(e, e.eps, slip, f"the slip of {e.name} is in {dimensions_text(slip)}, and eps", known)
    for rule in an.rules:
        dimensions_of(rule.broken, known)


def check_dimensions(
    owner: Expression, e: Operand, expected: Dimensions | None, begin: str, known: dict[Any, Any]
) -> None:
    """Refuse an expression of another unit than expected; a plain number is of that unit."""
    found = dimensions_of(e, known) if isinstance(e, Expression) else None
    if None not in (found, expected) and found != expected:
        raise ModelError(f"{begin} {expression_text(e)} is in {dimensions_text(found)}", owner.location)


def declared_dimensions(e: Variable) -> Dimensions:
    """The exponents of a declared unit."""
    if isinstance(e, (Choice, Mode)):
        return DIMENSIONLESS
    try:
        unit = unit_of(e.name, e.unit, e.display)
    except BuildError as error:
        raise ModelError(str(error).rstrip("."), e.location) from error
    return Fraction(unit.kg), Fraction(unit.m), Fraction(unit.s)


def quotient(a: Dimensions, b: Dimensions) -> Dimensions:
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def dimensions_text(found: Dimensions | None) -> str:
    """Exponents in words: kg m/s^2."""
    named = list(zip(BASE_UNITS, found or DIMENSIONLESS, strict=True))
    above, below = ([n if abs(p) == 1 else f"{n}^{abs(p)}" for n, p in named if sign * p > 0] for sign in (1, -1))
    return " ".join(above or ["1"]) + "".join(f"/{one}" for one in below) if above or below else "a number"


def dimensions_of(e: Operand, known: dict[int, Dimensions | None]) -> Dimensions | None:
    """The unit of an expression; zero is of every unit."""
    if not isinstance(e, Expression):
        return DIMENSIONLESS if e else None
    if id(e) not in known:
        known[id(e)] = declared_dimensions(e) if isinstance(e, Variable) else _term_dimensions(e, known)
    return known[id(e)]


def _term_dimensions(e: Expression, known: dict[int, Dimensions | None]) -> Dimensions | None:
    assert isinstance(e, Term)
    found = [dimensions_of(one, known) for one in e.args]
    a, b = found[0], found[-1]
    match e.op:
        case "==":
            return DIMENSIONLESS
        case "+" | "-" | "<" | "<=" | ">" | ">=":
            if None not in (a, b) and a != b:
                word = "compares" if e.op in COMPARISONS else "adds" if e.op == "+" else "subtracts"
                raise ModelError(
                    f"{expression_text(e)} {word} {dimensions_text(a)} and {dimensions_text(b)}", e.location
                )
            return a if a is not None else b
        case "choose":
            if None not in found[1:] and found[1] != b:
                raise ModelError(
                    f"choose() has {dimensions_text(found[1])} here and {dimensions_text(b)} there", e.location
                )
            return found[1] if found[1] is not None else b
        case "*" | "/":
            if a is None or b is None:
                return None
            return quotient(a, b) if e.op == "/" else quotient(a, quotient(DIMENSIONLESS, b))
        case "neg" | "fabs":
            return a
        case "sqrt":
            return a and (a[0] / 2, a[1] / 2, a[2] / 2)
    if a not in (None, DIMENSIONLESS):
        argument = expression_text(e.args[0])
        raise ModelError(
            f"{e.op}({argument}) is of {dimensions_text(a)}: what is in its brackets must be a number", e.location
        )
    return DIMENSIONLESS


def expression_text(e: Operand, level: int = 0) -> str:
    """An expression as people write it, named parts by their names."""
    if not isinstance(e, Expression):
        return f"{e:g}"
    if e.name and (level or not isinstance(e, Term)):
        return e.name
    assert isinstance(e, Term)
    own = PRECEDENCE.get(e.op, 4)
    if e.op == "neg":
        text = f"-{expression_text(e.args[0], 3)}"
    elif e.op in PRECEDENCE:
        text = f"{expression_text(e.args[0], own)} {e.op} {expression_text(e.args[1], own + (e.op in '-/'))}"
    else:
        text = f"{e.op}({', '.join(map(expression_text, e.args))})"
    return f"({text})" if own < level else text
