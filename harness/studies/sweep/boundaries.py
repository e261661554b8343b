"""Known boundaries in the space of a model's parameters, to be drawn into the map of a sweep.

An FMU brings them along in documentation/boundaries.toml; they lie beside the file of the model, as `stickslip.toml`:

    [[boundaries]]
    text = "first break-away at the stop, v_driver = mu_s m g/(k t)"     one line for people
    quantity = "k*abs(v_driver)*t/(mu_s*m*g)"     1 on the boundary; of parameters and t, the stop time in s
    below = "never breaks away"                   what holds where the quantity is less than 1
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

INSIDE = "documentation/boundaries.toml"
STOP = "t"
FUNCTIONS = {"abs": np.abs, "sqrt": np.sqrt, "sin": np.sin, "cos": np.cos}
ARITHMETIC = (ast.Expression, ast.Name, ast.Constant, ast.BinOp, ast.UnaryOp, ast.Call, ast.Load)
OPERATORS = (ast.Add, ast.Sub, ast.Mult, ast.Div, ast.USub)
LONGEST = 1000  # letters of a quantity


@dataclass(frozen=True)
class Boundary:
    """`quantity`, an expression of parameters and the stop time, is 1 on the boundary, and less where `below` holds."""

    text: str
    quantity: str
    below: str

    @cached_property
    def tree(self) -> ast.Expression:
        """The expression; ValueError if it is more than arithmetic."""
        tree = ast.parse(self.quantity[:LONGEST], mode="eval")
        for node in ast.walk(tree):
            if not isinstance(node, ARITHMETIC + OPERATORS) or isinstance(getattr(node, "value", 0), str):
                raise ValueError(f"{self.quantity} holds more than arithmetic")
        return tree

    @property
    def parameters(self) -> set[str]:
        """The parameters on which it depends."""
        names = {node.id for node in ast.walk(self.tree) if isinstance(node, ast.Name)}
        return names - {*FUNCTIONS, STOP}

    def evaluate(self, space: Mapping[str, Any], stop: float) -> Any:
        """The quantity where the parameters are these, numbers or arrays."""
        scope = {"__builtins__": {}} | FUNCTIONS | {STOP: stop} | dict(space)
        with np.errstate(all="ignore"):
            return eval(compile(self.tree, "boundary", "eval"), scope)


def read_boundaries(fmu: Path, varied: tuple[str, ...], there: Mapping[str, Any]) -> tuple[Boundary, ...]:
    """The boundaries that run through the space of the varied parameters, of those there are; HarnessError if the FMU
    tells them in another form."""
    try:
        with ZipFile(fmu) as archive:
            if INSIDE not in archive.namelist():
                return ()
            tables = tomllib.loads(archive.read(INSIDE).decode())["boundaries"]
        found = [Boundary(**{key: str(table[key]) for key in ("text", "quantity", "below")}) for table in tables]
        known = {*varied, *there}
        return tuple(each for each in found if each.parameters & {*varied} and each.parameters <= known)
    except (KeyError, TypeError, ValueError, SyntaxError, RecursionError) as error:
        raise HarnessError(f"{fmu.name}: {INSIDE} is not understood: {format_value(first_line(error))}") from None
