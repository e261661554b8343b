"""Units of expressions: what is declared in newtons is calculated in newtons, or the build says where it is not."""

from fractions import Fraction
from typing import Any

from .. import BuildError
from ..units import unit_of
from .anatomy import Anatomy
from .declared import Choice, Contact, Mode, Output, State, Variable
from .expressions import COMPARISONS, Expression, Mistake, Operand, Term
from .scribe import COMPARED

Powers = tuple[Fraction, Fraction, Fraction]
NAMES = ("kg", "m", "s")  # an angle is a number
NUMBER: Powers = (Fraction(0), Fraction(0), Fraction(0))
SECOND: Powers = (Fraction(0), Fraction(0), Fraction(1))
LEVEL = {"+": 1, "-": 1, "*": 2, "/": 2, "neg": 3} | dict.fromkeys(COMPARED, 0)


def judge_units(an: Anatomy) -> None:
    """Every output, rate, start, slip and force has the unit that it says."""
    known: dict[int, Powers | None] = {}
    for e in an.declared:
        own, said = powers(e), f"{e.name} is declared in {e.unit}, and"
        if isinstance(e, Output):
            agree(e, e.means, own, said, known)
        if isinstance(e, (State, Output)) and e.whose is not None and own != over(powers(e.whose), SECOND):
            raise Mistake(f"{e.name} in {e.unit} cannot be the rate of {e.whose.name} in {e.whose.unit}", e.place)
        if isinstance(e, State):
            agree(e, e.begins, own, f"{said} its start", known)
            agree(e, e.finest, own, f"{said} its finest", known)
            agree(e, e.steady, over(own, SECOND), f"{said} its rate", known)
        if isinstance(e, Contact):
            slip = of(e.slip, known)
            for word, one in ("slide", e.slide), ("hold", e.hold):
                agree(e, one, own, f"{said} {word}", known)
            agree(e, e.eps, slip, f"the slip of {e.name} is in {told(slip)}, and eps", known)
    for rule in an.rules:
        of(rule.broken, known)


def agree(owner: Expression, e: Operand, expected: Powers | None, begin: str, known: dict[Any, Any]) -> None:
    """Refuse an expression of another unit than expected; a plain number is of that unit."""
    found = of(e, known) if isinstance(e, Expression) else None
    if None not in (found, expected) and found != expected:
        raise Mistake(f"{begin} {shown(e)} is in {told(found)}", owner.place)


def powers(e: Variable) -> Powers:
    """The exponents of a declared unit."""
    if isinstance(e, (Choice, Mode)):
        return NUMBER
    try:
        unit = unit_of(e.name, e.unit, e.display)
    except BuildError as error:
        raise Mistake(str(error).rstrip("."), e.place) from error
    return Fraction(unit.kg), Fraction(unit.m), Fraction(unit.s)


def over(a: Powers, b: Powers) -> Powers:
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def told(found: Powers | None) -> str:
    """Exponents in words: kg m/s^2."""
    named = list(zip(NAMES, found or NUMBER, strict=True))
    above, below = ([n if abs(p) == 1 else f"{n}^{abs(p)}" for n, p in named if sign * p > 0] for sign in (1, -1))
    return " ".join(above or ["1"]) + "".join(f"/{one}" for one in below) if above or below else "a number"


def of(e: Operand, known: dict[int, Powers | None]) -> Powers | None:
    """The unit of an expression; zero is of every unit."""
    if not isinstance(e, Expression):
        return NUMBER if e else None
    if id(e) not in known:
        known[id(e)] = powers(e) if isinstance(e, Variable) else _of_term(e, known)
    return known[id(e)]


def _of_term(e: Expression, known: dict[int, Powers | None]) -> Powers | None:
    assert isinstance(e, Term)
    found = [of(one, known) for one in e.args]
    a, b = found[0], found[-1]
    match e.op:
        case "==":
            return NUMBER
        case "+" | "-" | "<" | "<=" | ">" | ">=":
            if None not in (a, b) and a != b:
                word = "compares" if e.op in COMPARISONS else "adds" if e.op == "+" else "subtracts"
                raise Mistake(f"{shown(e)} {word} {told(a)} and {told(b)}", e.place)
            return a if a is not None else b
        case "choose":
            if None not in found[1:] and found[1] != b:
                raise Mistake(f"choose() has {told(found[1])} here and {told(b)} there", e.place)
            return found[1] if found[1] is not None else b
        case "*" | "/":
            if a is None or b is None:
                return None
            return over(a, b) if e.op == "/" else over(a, over(NUMBER, b))
        case "neg" | "fabs":
            return a
        case "sqrt":
            return a and (a[0] / 2, a[1] / 2, a[2] / 2)
    if a not in (None, NUMBER):
        raise Mistake(f"{e.op}({shown(e.args[0])}) is of {told(a)}: what is in its brackets must be a number", e.place)
    return NUMBER


def shown(e: Operand, level: int = 0) -> str:
    """An expression as people write it, named parts by their names."""
    if not isinstance(e, Expression):
        return f"{e:g}"
    if e.name and (level or not isinstance(e, Term)):
        return e.name
    assert isinstance(e, Term)
    own = LEVEL.get(e.op, 4)
    if e.op == "neg":
        text = f"-{shown(e.args[0], 3)}"
    elif e.op in LEVEL:
        text = f"{shown(e.args[0], own)} {e.op} {shown(e.args[1], own + (e.op in '-/'))}"
    else:
        text = f"{e.op}({', '.join(map(shown, e.args))})"
    return f"({text})" if own < level else text
