"""Expressions: what a number is calculated from.  Nothing is evaluated here."""

import math
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, Never

EQUATIONS_FOLDER = str(Path(__file__).parent)
PACKAGING_FOLDER = str(Path(__file__).parents[2] / "packaging")
Operand = Any  # an expression or a number

# The derivative of each function, by its argument and its value.
FUNCTIONS: dict[str, Callable[[Operand, Operand], Operand]] = {
    "sin": lambda u, value: Term("cos", u),
    "cos": lambda u, value: -Term("sin", u),
    "tan": lambda u, value: 1.0 + value * value,
    "asin": lambda u, value: Term("/", 1.0, Term("sqrt", 1.0 - u * u)),
    "acos": lambda u, value: Term("/", -1.0, Term("sqrt", 1.0 - u * u)),
    "atan": lambda u, value: 1.0 / (1.0 + u * u),
    "sinh": lambda u, value: Term("cosh", u),
    "cosh": lambda u, value: Term("sinh", u),
    "tanh": lambda u, value: 1.0 - value * value,
    "exp": lambda u, value: value,
    "log": lambda u, value: 1.0 / u,
    "sqrt": lambda u, value: choose(value > 0.0, 0.5 / value, 0.0),
    "fabs": lambda u, value: Term("copysign", 1.0, u),
}
COMPARISONS = ("<", "<=", ">", ">=", "==")


class ModelError(ValueError):
    """Something that an author wrote and that cannot be: what is wrong, and in which line of which file."""

    def __init__(self, sentence: str, location: "tuple[str, int] | None" = None) -> None:
        super().__init__(sentence)
        self.location = location or author_location()


def author_location() -> tuple[str, int]:
    """File and line, in the file of the author, of what is made just now."""
    frame = sys._getframe(1)
    while frame.f_back is not None and frame.f_code.co_filename.startswith(EQUATIONS_FOLDER):
        frame = frame.f_back
    return frame.f_code.co_filename, frame.f_lineno


def _binary_operators(op: str) -> tuple[Any, Any]:
    """The methods that make a term of an operation, self op other and other op self."""
    return (lambda self, other: Term(op, self, other)), (lambda self, other: Term(op, other, self))


def _refusal(sentence: str) -> Callable[..., Never]:
    """A method that cannot be, with what it says."""

    def refuse(e: "Expression", *_: object) -> Never:
        raise ModelError(sentence.format(name=e.name or "an expression"))

    return refuse


class Expression:
    """What a number is calculated from: a declared variable, or a term of such."""

    name = ""
    location: tuple[str, int]

    def __new__(cls, *_: object, **__: object) -> "Expression":
        made = super().__new__(cls)
        made.location = author_location()
        return made

    __add__, __radd__ = _binary_operators("+")
    __sub__, __rsub__ = _binary_operators("-")
    __mul__, __rmul__ = _binary_operators("*")
    __truediv__, __rtruediv__ = _binary_operators("/")
    # Python turns a < b round to b > a by itself
    __lt__, __le__, __gt__, __ge__ = (_binary_operators(op)[0] for op in ("<", "<=", ">", ">="))

    def __neg__(self) -> "Term":
        return Term("neg", self)

    def __pos__(self) -> "Expression":
        return self

    def __abs__(self) -> "Term":
        return Term("fabs", self)

    def __eq__(self, other: object) -> bool:
        """Whether this is the very same: for those who calculate with expressions; an author would get no answer."""
        if self is not other and not sys._getframe(1).f_code.co_filename.startswith(PACKAGING_FOLDER):
            raise ModelError("== and != say nothing of values that are not there yet: write choose(a < b, this, that)")
        return self is other

    __hash__ = object.__hash__

    __pow__ = __rpow__ = _refusal("** rounds in ways of its own: write a product, x * x, or exp and log")
    __bool__ = _refusal("{name} has no value yet: write choose(condition, this, that) for an if")
    __float__ = _refusal(
        f"{{name}} has no value yet: functions of expressions are imported from fmus, which has {', '.join(FUNCTIONS)}"
    )
    __iter__ = _refusal("{name} is one number: there is nothing to loop over")
    __index__ = _refusal(
        "{name} has no value yet, and no table can be read by it: write its law as a formula, or as pieces with "
        "choose(condition, this, that)"
    )
    __array_ufunc__ = None  # numpy leaves it alone


def as_operand(e: Operand) -> Operand:
    """An expression as it is, a number as a float; anything else is refused."""
    if isinstance(e, Expression):
        return e
    if isinstance(e, bool) or not isinstance(e, (int, float)):
        raise ModelError(f"{e!r} is neither a number nor an expression: nothing can be calculated with it")
    if not math.isfinite(e):
        raise ModelError(f"{e!r} is not a finite number: nothing can be calculated with it")
    return float(e)


class Term(Expression):
    """An operation or a function, and what it is done to."""

    def __init__(self, op: str, *args: Operand) -> None:
        self.op, self.args = op, tuple(map(as_operand, args))


def _function(name: str) -> Callable[[Operand], Operand]:
    def made(u: Operand) -> Operand:
        return Term(name, u) if isinstance(u, Expression) else getattr(math, name)(u)

    made.__name__ = made.__qualname__ = name
    made.__doc__ = f"The function {name} of an expression, or of a number."
    return made


sin, cos, tan, asin, acos, atan = map(_function, ("sin", "cos", "tan", "asin", "acos", "atan"))
sinh, cosh, tanh, exp, log = map(_function, ("sinh", "cosh", "tanh", "exp", "log"))
sqrt, fabs = map(_function, ("sqrt", "fabs"))


def choose(condition: Operand, this: Operand, that: Operand) -> Term:
    """The expression `this` where the condition, a comparison of expressions, holds, and `that` elsewhere."""
    if not (isinstance(condition, Term) and condition.op in COMPARISONS):
        raise ModelError("choose() begins with a comparison of expressions by <, <=, > or >=")
    return Term("choose", condition, this, that)
