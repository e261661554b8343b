"""Authoring interface for models: variable declarations and functions of expressions.

A model file defines one class derived from Model, which declares variables and writes each equation once.
`python build_fmus.py path/to/file.py` builds its FMU.
"""

from importlib import import_module
from math import pi
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .compiler.equations.expressions import (
        acos,
        asin,
        atan,
        choose,
        cos,
        cosh,
        exp,
        fabs,
        log,
        sin,
        sinh,
        sqrt,
        tan,
        tanh,
    )
    from .compiler.equations.model_declaration import (
        HYBRID,
        SIGN,
        THRESHOLD,
        Choice,
        Contact,
        Fixed,
        Input,
        Mode,
        Model,
        Output,
        Parameter,
        PlanarContact,
        Rule,
        State,
    )
    from .compiler.equations.tables import Table

__all__ = [
    "HYBRID",
    "SIGN",
    "THRESHOLD",
    "Choice",
    "Contact",
    "Fixed",
    "Input",
    "Mode",
    "Model",
    "Output",
    "Parameter",
    "PlanarContact",
    "Rule",
    "State",
    "Table",
    "acos",
    "asin",
    "atan",
    "choose",
    "cos",
    "cosh",
    "exp",
    "fabs",
    "log",
    "pi",
    "sin",
    "sinh",
    "sqrt",
    "tan",
    "tanh",
]


def __getattr__(name: str) -> Any:
    """Import a name at its first use, so that `import fmus.runtime` loads nothing else."""
    for module in ("expressions", "model_declaration", "tables") if name in __all__ else ():
        names = vars(import_module(f".compiler.equations.{module}", __name__))
        if name in names:
            return names[name]
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
