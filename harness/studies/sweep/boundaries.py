"""Known boundaries in the parameter space of a model, drawn into the map of a sweep.

An FMU contains them as documentation/boundaries.toml; the source is a file beside the model, such as `stickslip.toml`:

    [[boundaries]]
    text = "first break-away at the stop, v_driver = mu_s m g/(k t)"     label
    quantity = "k*abs(v_driver)*t/(mu_s*m*g)"     1 on the boundary; t is the stop time in s
    below = "never breaks away"                   label of the region where the quantity is less than 1
"""

import ast
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any
from zipfile import ZipFile

import numpy as np

from ...errors import HarnessError, first_line, format_value

BOUNDARIES_FILE = "documentation/boundaries.toml"
STOP = "t"
FUNCTIONS = {"abs": np.abs, "sqrt": np.sqrt, "sin": np.sin, "cos": np.cos}
ARITHMETIC = (ast.Expression, ast.Name, ast.Constant, ast.BinOp, ast.UnaryOp, ast.Call, ast.Load)
OPERATORS = (ast.Add, ast.Sub, ast.Mult, ast.Div, ast.USub)
MAX_LENGTH = 1000  # maximum length of a quantity in characters


@dataclass(frozen=True)
class Boundary:
    """A boundary: the expression `quantity` is 1 on it, and less than 1 in the region `below`."""

    text: str
    quantity: str
    below: str

    @cached_property
    def tree(self) -> ast.Expression:
        """Parse the expression; ValueError if it is not plain arithmetic."""
        tree = ast.parse(self.quantity[:MAX_LENGTH], mode="eval")
        for node in ast.walk(tree):
            if not isinstance(node, ARITHMETIC + OPERATORS) or isinstance(getattr(node, "value", 0), str):
                raise ValueError(f"{self.quantity} is not plain arithmetic")
        return tree

    @property
    def parameters(self) -> set[str]:
        """Return the parameters on which the boundary depends."""
        names = {node.id for node in ast.walk(self.tree) if isinstance(node, ast.Name)}
        return names - {*FUNCTIONS, STOP}

    def evaluate(self, space: Mapping[str, Any], stop: float) -> Any:
        """Evaluate the quantity for parameter values `space` (numbers or arrays) and a stop time in s."""
        scope = {"__builtins__": {}} | FUNCTIONS | {STOP: stop} | dict(space)
        with np.errstate(all="ignore"):
            return eval(compile(self.tree, "boundary", "eval"), scope)


def read_boundaries(fmu: Path, varied: tuple[str, ...], others: Mapping[str, Any]) -> tuple[Boundary, ...]:
    """Read the boundaries that depend on a varied parameter and otherwise only on `there`, the other parameters.

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
    except (KeyError, TypeError, ValueError, SyntaxError, RecursionError) as error:
        raise HarnessError(f"{fmu.name}: {BOUNDARIES_FILE} is invalid: {format_value(first_line(error))}") from None
