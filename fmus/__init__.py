"""Authoring interface for models: variable declarations and functions of expressions.

A model file defines one class derived from Model, which declares variables and writes each equation once.
`python build_fmus.py path/to/file.py` builds its FMU.
"""

from math import pi

from .packaging.equations.expressions import (
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
from .packaging.equations.model_declaration import (
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
    Rule,
    State,
)

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
    "Rule",
    "State",
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
