"""Known boundaries in the parameter space of a model, drawn into the map of a sweep.

An FMU contains them as documentation/boundaries.toml; the source is a file in the folder of the model, such as
`stickslip.toml`:

    [[boundaries]]
    text = "first break-away at the stop, v_driver = mu_s m g/(k t)"     label
    quantity = "k*abs(v_driver)*t/(mu_s*m*g)"     1 on the boundary; t is the stop time in s
    below = "never breaks away"                   label of the region where the quantity is less than 1
"""

import ast
import tomllib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any
from zipfile import ZipFile

import numpy as np

from ...errors import HarnessError, first_line, format_value

BOUNDARIES_FILE = "documentation/boundaries.toml"
STOP = "t"
FUNCTIONS: dict[str, Callable[..., Any]] = {"abs": np.abs, "sqrt": np.sqrt, "sin": np.sin, "cos": np.cos}
OPERATORS: dict[type[ast.AST], Callable[..., Any]] = {
    ast.Add: np.add,
    ast.Sub: np.subtract,
    ast.Mult: np.multiply,
    ast.Div: np.divide,
}
MAX_LENGTH, MAX_DEPTH = 1000, 50  # of a quantity, in characters and in nested operations

Evaluation = Callable[[Mapping[str, Any]], Any]  # of parameter values by name


@dataclass(frozen=True)
class Boundary:
    """A boundary: the expression `quantity` is 1 on it, and less than 1 in the region `below`."""

    text: str
    quantity: str
    below: str

    @cached_property
    def arithmetic(self) -> "Arithmetic":
        """Parse the expression; ValueError if it is not plain arithmetic."""
        return parse_arithmetic(self.quantity)

    @property
    def parameters(self) -> frozenset[str]:
        """Return the parameters on which the boundary depends."""
        return self.arithmetic.names - {STOP}

    def evaluate(self, space: Mapping[str, Any], stop: float) -> Any:
        """Evaluate the quantity for parameter values `space` (numbers or arrays) and a stop time in s."""
        with np.errstate(all="ignore"):
            return self.arithmetic.evaluate({STOP: stop} | dict(space))


@dataclass(frozen=True)
class Arithmetic:
    """An expression: the names in it, and its evaluation."""

    names: frozenset[str]
    evaluate: Evaluation


def parse_arithmetic(text: str) -> Arithmetic:
    """Parse numbers, names, + - * /, parentheses and `FUNCTIONS`. The text is never executed as Python.

    Raises
    ------
    ValueError, SyntaxError
        If the text contains anything else, or is too long or too deeply nested.
    """
    if len(text) > MAX_LENGTH:
        raise ValueError(f"it has {len(text)} characters, more than {MAX_LENGTH}")
    names: set[str] = set()

    def convert(node: ast.expr, depth: int) -> Evaluation:
        match node:
            case ast.Constant(int() | float() as number) if not isinstance(number, bool) and depth:
                value = float(number)
                return lambda values: value
            case ast.Name(name) if name not in FUNCTIONS and depth:
                names.add(name)
                return lambda values: values[name]
            case ast.BinOp(left, operator, right) if type(operator) in OPERATORS and depth:
                apply, one, two = OPERATORS[type(operator)], convert(left, depth - 1), convert(right, depth - 1)
                return lambda values: apply(one(values), two(values))
            case ast.UnaryOp(ast.USub(), operand) if depth:
                negated = convert(operand, depth - 1)
                return lambda values: np.negative(negated(values))
            case ast.Call(ast.Name(name), [argument], []) if name in FUNCTIONS and depth:
                function, inner = FUNCTIONS[name], convert(argument, depth - 1)
                return lambda values: function(inner(values))
        raise ValueError(f"{text} is not plain arithmetic of at most {MAX_DEPTH} nested operations")

    evaluate = convert(ast.parse(text.strip(), mode="eval").body, MAX_DEPTH)
    return Arithmetic(frozenset(names), evaluate)


def read_boundaries(fmu: Path, varied: tuple[str, ...], others: Mapping[str, Any]) -> tuple[Boundary, ...]:
    """Read the boundaries that depend on a varied parameter and otherwise only on `others`, the other parameters.

    Raises
    ------
    HarnessError
        If the boundaries in the FMU are invalid.
    """
    try:
        with ZipFile(fmu) as archive:
            if BOUNDARIES_FILE not in archive.namelist():
                return ()
            tables = tomllib.loads(archive.read(BOUNDARIES_FILE).decode())["boundaries"]
        boundaries = [Boundary(**{key: str(table[key]) for key in ("text", "quantity", "below")}) for table in tables]
        names = {*varied, *others}
        return tuple(
            boundary for boundary in boundaries if boundary.parameters & {*varied} and boundary.parameters <= names
        )
    except (KeyError, TypeError, ValueError, SyntaxError, RecursionError, MemoryError, OverflowError) as error:
        raise HarnessError(f"{fmu.name}: {BOUNDARIES_FILE} is invalid: {format_value(first_line(error))}") from None
