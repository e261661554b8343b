"""Checks that the units of expressions agree with the declared units."""

import re
from collections.abc import Iterable
from fractions import Fraction
from typing import Any

from .. import BuildError
from ..units import BASE_UNITS, SYMBOLS, UNITS, parse_unit, unit_of
from .algebra import operands_first
from .expression_printer import COMPARISON_OPERATORS
from .expressions import Expression, ModelError, Operand, Term
from .model_analysis import ModelAnalysis
from .model_conditions import is_absolute_value
from .model_declaration import Choice, Contact, Input, Mode, Output, State, Variable
from .tables import EDGE, KNOT, Coefficient, Piece, Table, find_table_call

Dimensions = tuple[Fraction, ...]  # exponents of DIMENSIONS
DIMENSIONS = tuple(base for base in BASE_UNITS if base != "rad")  # angles are dimensionless
DIMENSIONLESS: Dimensions = (Fraction(0),) * len(DIMENSIONS)
SECOND: Dimensions = tuple(Fraction(base == "s") for base in DIMENSIONS)
AMBIGUOUS_SPELLINGS = ("h", "c")  # hours or henry; a speed, a temperature or coulomb
UNIT_SPELLINGS = {name.lower(): name for name in SYMBOLS if name.lower() not in AMBIGUOUS_SPELLINGS} | {
    **{"sec": "s", "nm": "N.m", "ns": "N.s", "nms": "N.m.s", "ws": "W.s", "vs": "V.s"},
    **{"ohms": "ohm", "volt": "V", "volts": "V", "amp": "A", "amps": "A", "kelvin": "K"},
}
MAX_OPERATIONS = 50  # of an expression in a message
PRECEDENCE = {"+": 1, "-": 1, "*": 2, "/": 2, "neg": 3} | dict.fromkeys(COMPARISON_OPERATORS, 0)


def check_units(analysis: ModelAnalysis) -> None:
    """Check the units of all outputs, rates, start values, slips and forces."""
    memo: dict[int, Dimensions | None] = {}
    for table in analysis.tables:
        for word, unit in axes(table):
            unit_dimensions(table, word, unit)
        for parameter in table.parameters:
            if declared_dimensions(parameter) != unit_dimensions(table, "y", table.unit_y):
                sentence = f"y of {table} is in {table.unit_y}, but {parameter} is in {parameter.unit}"
                raise ModelError(sentence, table.location)
    for e in analysis.variables:
        dimensions, prefix = declared_dimensions(e), f"{e.name} is declared in {e.unit}, but"
        if isinstance(e, Output):
            check_dimensions(e, e.expression, dimensions, prefix, memo)
        if (
            isinstance(e, (State, Output))
            and e.integrates is not None
            and dimensions != quotient(declared_dimensions(e.integrates), SECOND)
        ):
            raise ModelError(
                f"{e.name} in {e.unit} cannot be the rate of {e.integrates.name} in {e.integrates.unit}", e.location
            )
        if isinstance(e, State):
            check_dimensions(e, e.start_expression, dimensions, f"{prefix} its start", memo)
            check_dimensions(e, e.nominal_velocity, dimensions, f"{prefix} its nominal_velocity", memo)
            check_dimensions(e, e.constant_rate, quotient(dimensions, SECOND), f"{prefix} its rate", memo)
        if isinstance(e, Input) and e.declared_rate is not None:
            check_dimensions(e, e.declared_rate, quotient(dimensions, SECOND), f"{prefix} its rate", memo)
        if isinstance(e, Contact):
            slip = dimensions_of(e.slip, memo)
            for word, force in ("slide", e.slide), ("hold", e.hold):
                check_dimensions(e, force, dimensions, f"{prefix} {word}", memo)
            check_dimensions(e, e.eps, slip, f"the slip of {e.name} is in {dimensions_text(slip)}, but eps", memo)
    for rule in analysis.rules:
        dimensions_of(rule.broken, memo)


def check_dimensions(
    owner: Expression, e: Operand, expected: Dimensions | None, prefix: str, memo: dict[Any, Any]
) -> None:
    """Raise ModelError if an expression has another unit than expected; numbers have any unit."""
    dimensions = dimensions_of(e, memo) if isinstance(e, Expression) else None
    if None not in (dimensions, expected) and dimensions != expected:
        raise ModelError(f"{prefix} {expression_text(e)} is in {dimensions_text(dimensions)}", owner.location)


def check_frequencies(analysis: ModelAnalysis) -> None:
    """Check that no frequency in Hz is used as an angular velocity; both have the dimension 1/s."""
    uses: list[tuple[Expression, str, Operand]] = []  # owner, use and value
    for e in analysis.variables:
        values: list[tuple[Variable, Operand]] = [(e, e.expression)] if isinstance(e, Output) else []
        if isinstance(e, (State, Output)) and e.integrates is not None:
            values.append((e.integrates, e))
        if isinstance(e, State) and e.constant_rate is not None:
            values.append((e, e.constant_rate))
        if isinstance(e, Input) and e.declared_rate is not None:
            values.append((e, e.declared_rate))
        uses += [
            (e, f"{variable.name} is in {variable.unit}", value)
            for variable, value in values
            if angle_exponent(variable) > 0
        ]
        for part in analysis.declared_expressions(e):
            uses += [
                (term, f"the argument of {term.op} is an angle in rad", term.args[0])
                for term in operands_first(part, operands_of=term_operands)
                if isinstance(term, Term) and term.op in ("sin", "cos", "tan")
            ]
    in_hertz = expressions_in_hertz([value for _, _, value in uses])
    for owner, use, value in uses:
        if id(value) in in_hertz:
            raise frequency_error(value, use, owner)


def term_operands(e: Operand) -> tuple[Operand, ...]:
    """Return the operands of a term; a variable has none, because it declares its unit."""
    return e.args if isinstance(e, Term) else ()


def frequency_error(e: Operand, use: str, owner: Expression) -> ModelError:
    """Return the error for a frequency that is used as an angular velocity."""
    text = expression_text(e, PRECEDENCE["*"])
    return ModelError(
        f"{use}, but {text} counts revolutions, as it has the unit Hz: write 2.0 * pi * {text}", owner.location
    )


def expressions_in_hertz(roots: Iterable[Operand]) -> set[int]:
    """Return the identities of the expressions that count revolutions.

    They have a factor in Hz and none that may turn revolutions into an angle: numbers, ratios and angles.
    """
    in_hertz: set[int] = set()
    may_convert: set[int] = set()
    for e in operands_first(*roots, operands_of=term_operands):
        parts = term_operands(e)
        counts = [id(part) in in_hertz for part in parts]
        if isinstance(e, Variable):
            is_counted = "Hz" in e.unit
            converts = declared_dimensions(e) == DIMENSIONLESS or angle_exponent(e) != 0
        else:
            converts = not isinstance(e, Expression) or any(id(part) in may_convert for part in parts)
            is_counted = any(counts)
            if is_counted and e.op in "*/":
                others = [part for part, is_in_hertz in zip(parts, counts, strict=True) if not is_in_hertz]
                is_counted = not any(id(part) in may_convert for part in others)
            elif is_counted:
                is_counted = e.op in ("+", "-", "neg", "fabs", "choose")
        in_hertz |= {id(e)} if is_counted else set()
        may_convert |= {id(e)} if converts else set()
    return in_hertz


def angle_exponent(e: Variable) -> int:
    """Return the exponent of rad in the unit of a variable."""
    return unit_of(e.name, e.unit, e.display).rad if e.unit else 0


def declared_dimensions(e: Variable) -> Dimensions:
    """Return the exponents of the declared unit."""
    if isinstance(e, (Choice, Mode)):
        return DIMENSIONLESS
    try:
        unit = unit_of(e.name, e.unit, e.display)
    except BuildError as error:
        has_hint = parse_unit(e.unit) is None and (hint := unit_hint(e.unit, e.text))
        sentence = f"{e.name} has the unit {e.unit!r}: {hint}" if has_hint else str(error).rstrip(".")
        raise ModelError(sentence, e.location) from error
    return tuple(Fraction(getattr(unit, base)) for base in DIMENSIONS)


def unit_hint(unit: str, text: str) -> str:
    """Return what to write instead of an unknown unit, or an empty text."""
    if parse_unit(text):
        return "the unit comes before the description, so exchange them"
    if re.search(r"\bdeg[. ]?C\b|°C|\bcelsius\b", unit, re.IGNORECASE):
        return "use K for temperatures and for their differences"
    display, n_degrees = re.subn(r"\bdeg(ree)?s?\b", "deg", unit)
    if n_degrees:
        symbol = next((name for name, known_unit in UNITS.items() if known_unit.display == display), None)
        remedy = f', and display="{display}" to show degrees' if symbol else ""
        return f"use {symbol or 'rad'} instead of {display if symbol else 'deg'}{remedy}"
    if unit.strip() in ("", "-"):
        return 'a pure number has the unit "1"'
    symbol = unit.strip().replace("**", "").replace("^", "")
    symbol = re.sub(r"[ *\u00b7]+", ".", symbol)
    symbol = re.sub("[A-Za-z]+", lambda match: UNIT_SPELLINGS.get(match[0].lower(), match[0]), symbol)
    return f'write "{symbol}"' if parse_unit(symbol) else ""


def quotient(a: Dimensions, b: Dimensions) -> Dimensions:
    """Return the exponents of a quotient of units."""
    return tuple(p - q for p, q in zip(a, b, strict=True))


def dimensions_text(dimensions: Dimensions | None) -> str:
    """Format exponents, for example as kg m/s^2."""
    powers = list(zip(DIMENSIONS, dimensions or DIMENSIONLESS, strict=True))
    numerator, denominator = (
        [n if abs(p) == 1 else f"{n}^{abs(p)}" for n, p in powers if sign * p > 0] for sign in (1, -1)
    )
    return (
        " ".join(numerator or ["1"]) + "".join(f"/{unit}" for unit in denominator) if numerator or denominator else "1"
    )


def dimensions_of(e: Operand, memo: dict[int, Dimensions | None]) -> Dimensions | None:
    """Return the exponents of an expression; None for zero, which has any unit."""
    if not isinstance(e, Expression):
        return DIMENSIONLESS if e else None
    for part in operands_first(e, operands_of=lambda part: () if id(part) in memo else term_operands(part)):
        if isinstance(part, Expression) and id(part) not in memo:
            memo[id(part)] = declared_dimensions(part) if isinstance(part, Variable) else _term_dimensions(part, memo)
    return memo[id(e)]


def _term_dimensions(e: Expression, memo: dict[int, Dimensions | None]) -> Dimensions | None:
    assert isinstance(e, Term)
    if isinstance(e.op, Piece):
        return _piece_dimensions(e, memo)
    if isinstance(e.op, Coefficient):
        return _coefficient_dimensions(e.op)
    dimensions = [
        memo[id(argument)] if isinstance(argument, Expression) else dimensions_of(argument, memo) for argument in e.args
    ]
    a, b = dimensions[0], dimensions[-1]
    match e.op:
        case "==":
            return DIMENSIONLESS
        case "+" | "-" | "<" | "<=" | ">" | ">=":
            if None not in (a, b) and a != b:
                raise ModelError(
                    f"{expression_text(e)} mixes units: {dimensions_text(a)} and {dimensions_text(b)}", e.location
                )
            return a if a is not None else b
        case "choose":
            if None not in dimensions[1:] and dimensions[1] != b:
                raise ModelError(
                    f"the cases of choose() have different units: {dimensions_text(dimensions[1])} "
                    f"and {dimensions_text(b)}",
                    e.location,
                )
            return dimensions[1] if dimensions[1] is not None else b
        case "*" | "/":
            if a is None or b is None:
                return None
            return quotient(a, b) if e.op == "/" else quotient(a, quotient(DIMENSIONLESS, b))
        case "neg" | "fabs":
            return a
        case "slip_direction":
            return DIMENSIONLESS
        case "sqrt":
            return a and tuple(p / 2 for p in a)
    if a not in (None, DIMENSIONLESS):
        argument = expression_text(e.args[0])
        raise ModelError(
            f"the argument of {e.op}({argument}) must be dimensionless, got {dimensions_text(a)}", e.location
        )
    return DIMENSIONLESS


def _piece_dimensions(e: Term, memo: dict[int, Dimensions | None]) -> Dimensions:
    """Check the unit of the argument of a table; return that of the number of a piece."""
    assert isinstance(e.op, Piece)
    table, u = e.op.table, memo[id(e.args[0])]
    if u is not None and u != unit_dimensions(table, "x", table.unit_x):
        raise ModelError(
            f"{table} takes an argument in {table.unit_x}, but {expression_text(e.args[0])} is in {dimensions_text(u)}",
            e.location,
        )
    return DIMENSIONLESS


def _coefficient_dimensions(op: Coefficient) -> Dimensions:
    """Return the exponents of a coefficient of a table."""
    x, result = (unit_dimensions(op.table, word, unit) for word, unit in axes(op.table))
    if op.kind in (EDGE, KNOT):
        return x
    for _ in range(op.table.kinds.index(op.kind) - 1):
        result = quotient(result, x)
    return result


def axes(table: Table) -> tuple[tuple[str, str], tuple[str, str]]:
    """Return the axes of a table with their units."""
    return ("x", table.unit_x), ("y", table.unit_y)


def unit_dimensions(table: Table, word: str, unit: str) -> Dimensions:
    """Return the exponents of the unit of one axis of a table."""
    if (parsed_unit := parse_unit(unit)) is None:
        hint = unit_hint(unit, "") or "convert its numbers to a product or a quotient of SI units"
        axis = f"{word} of the table {table}"
        if table.file:
            heading = table.headings[("x", "y").index(word)]
            axis = f"{table.file.name}: the column {heading}, {axis},"
        raise ModelError(f"{axis} has the unit {unit!r}: {hint}", table.location)
    return tuple(Fraction(getattr(parsed_unit, base)) for base in DIMENSIONS)


def expression_text(e: Operand, level: int = 0) -> str:
    """Format an expression for messages; named subexpressions appear by name, parts of a long one as an ellipsis."""
    n_left = MAX_OPERATIONS

    def text(e: Operand, level: int) -> str:
        nonlocal n_left
        if not isinstance(e, Expression):
            return f"{e:g}"
        if e.name and (level or not isinstance(e, Term)):
            return e.name
        assert isinstance(e, Term)
        if n_left == 0:
            return "..."
        n_left -= 1
        precedence = PRECEDENCE.get(e.op, 4)
        if call := find_table_call(e):
            return f"{call[0]}({text(call[1], 0)})"
        if e.op == "choose" and is_absolute_value(e):
            result = f"fabs({text(e.args[1], 0)})"
        elif e.op == "neg":
            result = f"-{text(e.args[0], 3)}"
        elif e.op in PRECEDENCE:
            result = f"{text(e.args[0], precedence)} {e.op} {text(e.args[1], precedence + (e.op in '-/'))}"
        else:
            result = f"{e.op}({', '.join(text(argument, 0) for argument in e.args)})"
        return f"({result})" if precedence < level else result

    return text(e, level)
