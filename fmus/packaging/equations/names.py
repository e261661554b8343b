"""The names that a written-out model takes for itself; an author's are others."""

from ...runtime.automaton import DryFriction
from ...runtime.coupled import CoupledFriction
from ...runtime.found import methods
from .expressions import FUNCTIONS

MATH = ("copysign", "inf", "pi", *FUNCTIONS)
IMPORTS = {  # module -> what may be needed of it
    "": tuple(label for label, _, _ in methods),
    "automaton": ("HYBRID_LAW", "SIGN_LAW", "THRESHOLD_LAW", "DryFriction", "sign", "threshold"),
    "codes": ("EXACT", "HYBRID"),
    "course": ("Course",),
    "coupled": ("CoupledFriction",),
    "declare": ("Choice", "Contact", "Fixed", "Input", "Mode", "Output", "Parameter", "State"),
    "march": ("March",),
    "methods": ("EXACT_ITEM", "ITEMS"),
    "oscillator": ("Oscillator",),
}
ATTRIBUTES = ("friction", "solver", "events", "exact", "exchange", "x_base", "t_base", "time", "method")
METHODS = (  # beside those inherited
    *("initial", "rates", "jacobian", "push", "piece", "hold", "terms", "observe"),
    *("push_rate", "load_rate", "input_rates", "bends"),
)
COUPLED_METHODS = ("slips", "slip_terms", "forces", "changes", "struck")
CLASSES = ("Solver", "Model", "Fmi3Slave")
RESERVED = {
    *("self", "t", *MATH, *ATTRIBUTES, *METHODS, *CLASSES),
    *(name for names in IMPORTS.values() for name in names),
    *(name for name in dir(DryFriction) if not name.startswith("__")),
}
RESERVED_WHERE_COUPLED = {*dir(CoupledFriction), *COUPLED_METHODS}
