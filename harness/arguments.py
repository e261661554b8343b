"""Rules of arguments: what a value must be, stated once for the Python API and for the command line.

A function of the API names the rule of each argument in `check_arguments`; an option of a command has the type
`RuleType`, which reads a text and applies the same rule. This module does not import numpy, which `--help` does not
need.
"""

import os
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from datetime import date
from functools import wraps
from inspect import signature
from math import inf, isfinite
from numbers import Number
from operator import index
from pathlib import Path
from typing import TYPE_CHECKING, Any, ParamSpec, TypeVar

from .errors import SceneError, format_value, unknown_name_message

if TYPE_CHECKING:
    import numpy as np

MAX_NAME_BYTES = 255  # of a part of a path, on common file systems
MAX_WORKERS = 1024  # processes of a sweep
MAX_RUNS = 10_000_000  # of a sweep
INTERFACES = CO_SIMULATION, MODEL_EXCHANGE = ("CoSimulation", "ModelExchange")
QUANTITIES = ("position", "velocity", "acceleration")  # by the order of the derivative
SUBTRACT_FIRST = "time stamps are no numbers: subtract the first one, as in t - t[0]"
INVALID = (AttributeError, OverflowError, RecursionError, TypeError, ValueError)  # raised for a value that is not valid

Progress = Callable[[float], None]  # takes the finished share, from 0 to 1
P = ParamSpec("P")
R = TypeVar("R")


class UnknownNameError(SceneError):
    """A value is none of the allowed names. The text says of what."""


@dataclass(frozen=True)
class Rule:
    """What a value must be.

    Attributes
    ----------
    text : str
        Description, as in "a finite number above 0".
    convert : callable
        Returns a value in its own type; raises TypeError, ValueError, OverflowError or SceneError if it is not valid.
    parse : callable
        Reads the value from a text on the command line.
    span : str
        Range of numbers x for the help, as in "x>0"; empty without limits.
    """

    text: str
    convert: Callable[[Any], Any]
    parse: Callable[[str], Any] = str
    span: str = ""

    def check(self, name: str, value: Any) -> Any:
        """Return a value in its own type; raise SceneError, which names the argument, if it is not valid."""
        try:
            return self.convert(value)
        except INVALID:
            raise SceneError(f"{name} = {format_value(value)} must be {self.text}") from None
        except UnknownNameError:
            raise
        except SceneError as error:  # of a part of the value
            raise SceneError(f"{name}: {error}") from None

    def accepts(self, value: Any) -> bool:
        """Return whether a value is valid."""
        try:
            self.convert(value)
        except (*INVALID, SceneError):
            return False
        return True


def check_arguments(**rules: Rule) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Decorate a function so that it checks and converts its arguments by these rules.

    An argument whose default is None may be None.
    """

    def decorate(function: Callable[P, R]) -> Callable[P, R]:
        function_signature = signature(function)
        assert set(rules) <= set(function_signature.parameters), f"{function.__name__} has no argument of a rule"
        optional = {name for name, parameter in function_signature.parameters.items() if parameter.default is None}

        @wraps(function)
        def wrapper(*arguments: P.args, **options: P.kwargs) -> R:
            call = function_signature.bind(*arguments, **options)
            for name, value in call.arguments.items():
                if name in rules and not (value is None and name in optional):
                    call.arguments[name] = rules[name].check(name, value)
            return function(*call.args, **call.kwargs)

        return wrapper

    return decorate


def is_array(value: Any) -> bool:
    """Return whether a value is an array with at least one dimension; those of numpy without any are numbers."""
    return bool(getattr(value, "ndim", False))


def is_boolean(value: Any) -> bool:
    """Return whether a value is True or False, of Python or of numpy, which names its type bool since version 2."""
    return type(value).__name__ in ("bool", "bool_")


def real(value: Any) -> float:
    """Return a finite number as a float; a Boolean, a text or an array is none."""
    if isinstance(value, str | bytes | bytearray) or is_boolean(value) or is_array(value):
        raise TypeError
    number = float(value)
    if not isfinite(number):
        raise ValueError
    return number


def above_zero(value: Any) -> float:
    """Return a finite number above 0."""
    if not (number := real(value)) > 0:
        raise ValueError
    return number


def at_least_zero(value: Any) -> float:
    """Return a finite number of at least 0."""
    if not (number := real(value)) >= 0:
        raise ValueError
    return number


def whole_number(low: int, high: float = inf) -> Rule:
    """Return the rule of a whole number from `low` to `high`."""

    def convert(value: Any) -> int:
        if is_boolean(value) or not low <= (number := index(value)) <= high:
            raise ValueError
        return number

    if high == inf:
        return Rule(f"a whole number of at least {low}", convert, int, f"x>={low}")
    return Rule(f"a whole number from {low} to {high}", convert, int, f"{low}<=x<={high}")


def choice(category: str, names: Iterable[str]) -> Rule:
    """Return the rule of one of several names."""
    allowed_names = tuple(names)

    def convert(value: Any) -> str:
        if not isinstance(value, str) or value not in allowed_names:
            raise UnknownNameError(unknown_name_message(category, value, allowed_names))
        return value

    return Rule(f"one of {', '.join(allowed_names)}", convert)


def flag(value: Any) -> bool:
    """Return True or False, also of numpy."""
    if not is_boolean(value):
        raise TypeError
    return bool(value)


def text(value: Any) -> str:
    """Return a text that is not empty and can be encoded."""
    if not isinstance(value, str) or not value or "\0" in value:
        raise TypeError
    value.encode()  # raises ValueError for a lone surrogate
    return value


def path(value: Any) -> str | Path:
    """Return a name, or a path, whose bytes may be no text."""
    name = text(os.fsencode(value).decode(errors="replace") if isinstance(value, Path) else value)
    if any(len(part.encode()) > MAX_NAME_BYTES for part in Path(name).parts):
        raise ValueError
    return value


def check_interval(begin: float, end: float) -> None:
    """Raise SceneError unless a part of a record, in s, begins before it ends."""
    if not begin < end:
        raise SceneError(f"begin = {begin!r} s must be before end = {end!r} s")


def items(value: Any) -> list[Any]:
    """Return the items of a sequence or another iterable, or a single text or path as the only one."""
    if isinstance(value, str | Path):
        return [value]
    if isinstance(value, bytes | bytearray | Mapping) or hasattr(value, "columns"):
        raise TypeError
    return list(value)


def names(value: Any) -> tuple[str, ...]:
    """Return one name, or several, each once."""
    return tuple(dict.fromkeys(map(text, items(value))))


def some_names(value: Any) -> tuple[str, ...]:
    """Return at least one name."""
    if not (result := names(value)):
        raise ValueError
    return result


def paths(value: Any) -> list[str | Path]:
    """Return one path, or several."""
    return [path(item) for item in items(value)]


def mapping(item: Rule, values: str) -> Rule:
    """Return the rule of a mapping from names to values that follow a rule; `values` describes them."""

    def convert(value: Any) -> dict[str, Any]:
        if not isinstance(value, Mapping):
            raise TypeError
        return {text(name): item.check(name, entry) for name, entry in value.items()}

    return Rule(f"a mapping from names to {values}", convert)


def names_with(entry: Rule, values: str, default: Callable[[str], Any]) -> Rule:
    """Return the rule of names, or of a mapping from names to values; without a value, a name has the default."""
    of_mapping = mapping(entry, values)

    def convert(value: Any) -> dict[str, Any]:
        if isinstance(value, Mapping):
            return dict(of_mapping.convert(value))
        return {name: default(name) for name in names(value)}

    return Rule(f"a name, a list of names, or {of_mapping.text}", convert)


def to_array(value: Any) -> "np.ndarray":
    """Return a value as an array; masked numbers are NaN, time deltas seconds, and numbers as objects floats."""
    import numpy as np

    if np.ma.is_masked(value):
        return np.ma.filled(value.astype(float), np.nan)  # numpy.asarray would return what the mask hides
    has_texts = isinstance(value, list | tuple) and any(isinstance(item, str) for item in value)
    array = np.asarray(value, object if has_texts else None)  # an array of texts would take n times the longest one
    if array.dtype.kind == "m":
        return array / np.timedelta64(1, "s")
    if array.dtype.kind == "O" and all(isinstance(item, Number) and not is_boolean(item) for item in array.flat):
        return array.astype(float)
    return array


def has_time_stamps(array: "np.ndarray") -> bool:
    """Return whether an array holds time stamps: those of numpy, or objects of datetime or pandas."""
    return array.dtype.kind == "M" or (array.dtype.kind == "O" and any(isinstance(item, date) for item in array.flat))


def row(value: Any) -> "np.ndarray":
    """Return a row (n,) of at least one number as floats; NaN is a missing number."""
    numbers = to_array(value)
    if has_time_stamps(numbers):
        raise SceneError(SUBTRACT_FIRST)
    if numbers.ndim != 1 or numbers.dtype.kind not in "fiu" or not len(numbers):
        raise TypeError
    return numbers.astype(float)


def finite_row(value: Any) -> "np.ndarray":
    """Return a row (n,) of at least one finite number as floats."""
    import numpy as np

    numbers = row(value)
    if not np.isfinite(numbers).all():
        i = int(np.argmin(np.isfinite(numbers)))
        raise SceneError(f"{numbers[i]} at index {i} is not a finite number")
    return numbers


def increasing_row(value: Any) -> "np.ndarray":
    """Return a row (n,) of at least one finite number as floats, which increase."""
    import numpy as np

    numbers = finite_row(value)
    falls = np.diff(numbers) <= 0
    if falls.any():
        i = int(np.argmax(falls))
        raise SceneError(f"{numbers[i + 1]} at index {i + 1} is not after {numbers[i]}: give increasing numbers")
    return numbers


def setting(value: Any) -> Any:
    """Return a value of a variable: a finite number, a Boolean, a text, or a list of these for an array."""
    if isinstance(value, str):
        return text(value)
    if isinstance(value, list | tuple) or is_array(value):
        return [setting(item) for item in value]
    if is_boolean(value):
        return bool(value)
    try:
        return index(value)  # an integer keeps its digits
    except TypeError:
        number = real(value)
        return value if isinstance(value, float) else number  # of the command line, it keeps its text


def limits(value: Any) -> tuple[float, float] | None:
    """Return a range, or None for that of the function."""
    if value is None:
        return None
    low, high = map(real, items(value))
    return low, high


def method(value: Any) -> str | int:
    """Return the name or the number of an integration method."""
    if is_boolean(value):
        raise TypeError
    return text(value) if isinstance(value, str) else index(value)


def progress(value: Any) -> Any:
    """Return a function, or False for no progress bar."""
    if value is not False and not callable(value):
        raise TypeError
    return value


def axes(value: Any) -> Any:
    """Return axes of matplotlib."""
    if not hasattr(value, "transAxes"):
        raise TypeError
    return value


FINITE = Rule("a finite number", real, float)
POSITIVE = Rule("a finite number above 0", above_zero, float, "x>0")
NONNEGATIVE = Rule("a finite number of at least 0", at_least_zero, float, "x>=0")
COUNT, NATURAL = whole_number(1), whole_number(0)
WORKERS, RUNS = whole_number(1, MAX_WORKERS), whole_number(1, MAX_RUNS)
FLAG = Rule("true or false", flag)
TEXT = Rule("a text that is not empty", text)
NAMES = Rule("a name, or a list of names", names)
SOME_NAMES = Rule("a name, or a list of names that is not empty", some_names)
INCREASING_ROW = Rule("a row of finite numbers, at least one, which increase", increasing_row)
PATH = Rule("a name or a path", path)
PATHS = Rule("a name, a path, or a list of these", paths)
SETTINGS = mapping(Rule("a finite number or a text", setting), "numbers or texts")
NUMBERS = mapping(FINITE, "finite numbers")
POSITIVES = mapping(POSITIVE, "finite numbers above 0")
RANGES = names_with(
    Rule("a pair of finite numbers or None", limits), "pairs of finite numbers or None", lambda name: None
)
HEADINGS = names_with(TEXT, "headings", lambda name: name)
INTERFACE = choice("interface", INTERFACES)
QUANTITY = choice("quantity", QUANTITIES)
METHOD = Rule("a name or a number", method)
AXES = Rule("axes of matplotlib", axes)
PROGRESS = Rule("a function of one number, or False", progress)
