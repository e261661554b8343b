"""What an author of a model imports: declared variables, and what can be calculated with them.

A model is a class that derives from Model, alone in its file: it declares variables and writes each equation once, in
their names.  `python build_fmus.py path/to/file.py` makes an FMU of it.
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
