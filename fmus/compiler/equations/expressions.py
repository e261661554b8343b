"""Symbolic expressions; nothing is evaluated here."""

import math
import sys
from collections.abc import Callable, Hashable, Iterable, Sequence
from numbers import Real
from pathlib import Path
from typing import Any, Never

EQUATIONS_FOLDER = str(Path(__file__).parent)
Operand = Any  # an expression or a number

# The derivative of each function, as a function of argument and value.
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
MAX_VALUE_LENGTH = 60  # characters of a value in a message
POWERS: dict[object, str] = {
    **{n: " * ".join(["{0}"] * n) for n in range(1, 11)},
    **{-n: f"1.0 / ({' * '.join(['{0}'] * n)})" for n in range(2, 11)},
    **{n + 0.5: " * ".join(["{0}"] * n + ["sqrt({0})"]) for n in range(4)},
    **{0: "1.0", -1: "1.0 / {0}", -0.5: "1.0 / sqrt({0})"},
}
GENERAL_POWER = "exp({1} * log({0})), for {0} > 0"
NO_VALUE = (
    "{name} has no value at build time, so functions of math and numpy do not take it: import functions from fmus, "
    f"which has {', '.join(FUNCTIONS)}"
)


NO_TRUTH = (
    "{name} has no value at build time, as if, and, or, not, max, min and a < x < b would need: write "
    "choose(condition, this, that), for example choose(x > 0.0, x, 0.0) instead of max(x, 0.0)"
)
NO_EQUALITY = (
    "== and != cannot compare expressions, which have no value yet: write choose(a < b, this, that), or "
    "name.choose(label=this, ...) for a Choice"
)


class ModelError(Exception):
    """Raised for a mistake in a model file: message, file and line.

    It is no ValueError, because a model file may catch that of math.sqrt, and would hide the mistake.
    """

    def __init__(self, sentence: str, location: "tuple[str, int] | None" = None) -> None:
        super().__init__(sentence)
        self.location = location or author_location()


def author_location() -> tuple[str, int]:
    """Return file and line of the model file from which the current call comes."""
    frame = sys._getframe(1)
    while frame.f_back is not None and frame.f_code.co_filename.startswith(EQUATIONS_FOLDER):
        frame = frame.f_back
    return frame.f_code.co_filename, frame.f_lineno


def _binary_operators(op: str) -> tuple[Any, Any]:
    """Return the methods for self op other and other op self."""
    return (lambda self, other: Term(op, self, other)), (lambda self, other: Term(op, other, self))


def _refusal(sentence: str) -> Callable[..., Never]:
    """Return a method that raises ModelError with this message."""

    def refuse(e: "Expression", *_: object) -> Never:
        raise ModelError(sentence.format(name=e.name or "an expression"))

    return refuse


class Expression:
    """Base class of expressions: a declared variable or a term."""

    name = ""
    # declared variables of an expression: suffix of the attribute and of the name in the FMU, as in mu_y1 and mu.y[1]
    own_variables: Sequence[tuple[str, str, Any]] = ()
    location: tuple[str, int]

    __add__, __radd__ = _binary_operators("+")
    __sub__, __rsub__ = _binary_operators("-")
    __mul__, __rmul__ = _binary_operators("*")
    __truediv__, __rtruediv__ = _binary_operators("/")
    # Python falls back from a < b to b > a
    __lt__, __le__, __gt__, __ge__ = (_binary_operators(op)[0] for op in ("<", "<=", ">", ">="))

    def __neg__(self) -> "Term":
        return Term("neg", self)

    def __pos__(self) -> "Expression":
        return self

    def __abs__(self) -> "Term":
        return Term("fabs", self)

    def __eq__(self, other: object) -> "Term":  # type: ignore[override]
        """Return a comparison; `is` and the keys of sets and dictionaries compare by identity."""
        return Term("==", self, other)

    @property
    def label(self) -> str:
        """Name in messages."""
        return self.name

    def __repr__(self) -> str:
        return self.name or "an expression"

    def __format__(self, format_spec: str) -> str:
        if format_spec:
            raise ModelError(f"{self} has no value at build time, so a text can show its name only: write {{{self}}}")
        return str(self)

    __ne__ = _refusal(NO_EQUALITY)
    __hash__ = object.__hash__

    def __pow__(self, exponent: Hashable) -> Never:
        x = self.name or "x"
        power = POWERS.get(exponent, GENERAL_POWER).format(x, exponent if isinstance(exponent, int | float) else "n")
        raise ModelError(f"** is not supported, because its rounding differs between platforms: write {power}")

    __rpow__ = _refusal(
        "** is not supported, because its rounding differs between platforms: write exp(x * log(a)), for a > 0"
    )
    __bool__ = _refusal(NO_TRUTH)
    __float__ = _refusal(NO_VALUE)
    __mod__ = __rmod__ = __floordiv__ = __rfloordiv__ = __divmod__ = __rdivmod__ = __matmul__ = __rmatmul__ = _refusal(
        "%, // and @ are not supported: use +, -, *, / and choose(condition, this, that)"
    )
    __and__ = __rand__ = __or__ = __ror__ = __xor__ = __rxor__ = __invert__ = _refusal(
        "&, |, ^ and ~ are not supported: nest choose(condition, this, that), one comparison in each"
    )
    __round__ = __trunc__ = __floor__ = __ceil__ = _refusal(NO_VALUE)
    __int__ = _refusal(NO_VALUE)
    __iter__ = _refusal("{name} is a scalar: it cannot be iterated over")
    __index__ = _refusal(
        "{name} has no value at build time and cannot index a list: declare name = Table(x, y, unit_x, unit_y) and "
        "write name({name}); a count, as in range(n), must be a number such as n = 3"
    )
    __array_ufunc__ = None  # disables numpy arithmetic


def as_operand(e: Operand) -> Operand:
    """Return an expression unchanged and a number as float; raise ModelError for anything else."""
    if isinstance(e, Expression):
        if callable(e):
            raise ModelError(f"{e} is a table: call it with its argument, as in {e.name or 'table'}(x)")
        if is_comparison(e):
            if isinstance(e, Term) and e.op == "==":
                raise ModelError(NO_EQUALITY)
            raise ModelError("a comparison is no number: it can only be the first argument of choose() or of a Rule")
        return e
    if not is_number(e):
        raise ModelError(f"{describe(e)} is neither a number nor an expression")
    if not math.isfinite(e):
        raise ModelError(f"{e!r} is not a finite number")
    return float(e)


def is_number(value: object) -> bool:
    """Return whether a value is a real number, also of numpy; Booleans are not."""
    return isinstance(value, Real) and not isinstance(value, bool)


def is_comparison(e: Operand) -> bool:
    """Return whether an operand is a comparison, which has no numerical value."""
    return isinstance(e, Term) and e.op in COMPARISONS


def is_among(e: object, expressions: Iterable[Expression]) -> bool:
    """Return whether an object is one of some expressions."""
    return any(e is expression for expression in expressions)


def describe(value: object) -> str:
    """Return a short text for a value in a message."""
    if isinstance(value, (str, int, float, complex, type(None))):
        return text if len(text := repr(value)) <= MAX_VALUE_LENGTH else f"{text[:MAX_VALUE_LENGTH]}..."
    return "an expression" if isinstance(value, Term) else f"an object of type {type(value).__name__}"


class Term(Expression):
    """An operation or function applied to operands."""

    structure_hash: int  # equal for terms of the same structure

    def __init__(self, op: str, *args: Operand) -> None:
        self.location = author_location()
        condition = args[:1] if op == "choose" else ()
        self.op, self.args = op, (*condition, *map(as_operand, args[len(condition) :]))
        self.structure_hash = hash((op, *(e.structure_hash if isinstance(e, Term) else e for e in self.args)))

    def __bool__(self) -> Never:
        raise (
            ModelError(NO_EQUALITY)
            if self.op == "=="
            else ModelError(NO_TRUTH.format(name=self.name or "an expression"))
        )


def _function(name: str) -> Callable[[Operand], Operand]:
    def function(u: Operand) -> Operand:
        if isinstance(u, Expression):
            return Term(name, u)
        if not is_number(u):
            raise ModelError(f"{name}() needs an expression or a number, got {describe(u)}")
        try:
            return getattr(math, name)(u)
        except (ArithmeticError, ValueError) as error:
            raise ModelError(f"{name}({describe(u)}) has no value") from error

    function.__name__ = function.__qualname__ = name
    function.__doc__ = f"Return {name} of an expression or a number."
    return function


sin, cos, tan, asin, acos, atan = map(_function, ("sin", "cos", "tan", "asin", "acos", "atan"))
sinh, cosh, tanh, exp, log = map(_function, ("sinh", "cosh", "tanh", "exp", "log"))
sqrt, fabs = map(_function, ("sqrt", "fabs"))


def choose(condition: Operand, this: Operand, that: Operand) -> Term:
    """Return `this` where the condition, a comparison of expressions, is true, else `that`."""
    if isinstance(condition, Term) and condition.op == "==":
        raise ModelError(NO_EQUALITY)
    if not is_comparison(condition):
        raise ModelError("the first argument of choose() must be a comparison of expressions by <, <=, > or >=")
    return Term("choose", condition, this, that)
