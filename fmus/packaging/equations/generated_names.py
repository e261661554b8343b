"""Names reserved by generated models; variables of a model must not use them."""

from ...runtime.contact_lcp import CoupledFriction
from ...runtime.method_registry import methods
from ...runtime.stick_slip import DryFriction
from .expressions import FUNCTIONS

MATH = ("copysign", "inf", "pi", *FUNCTIONS)
IMPORTS = {  # module -> names that generated code may import
    "": tuple(label for label, _, _ in methods),
    "stick_slip": ("HYBRID_LAW", "SIGN_LAW", "THRESHOLD_LAW", "DryFriction", "sign", "threshold"),
    "codes": ("EXACT", "HYBRID", "MODEL_RULE", "OK"),
    "input_polynomial": ("InputPolynomial",),
    "event_location": ("EventLocation",),
    "contact_lcp": ("CoupledFriction",),
    "variable_declarations": ("Choice", "Contact", "Fixed", "Input", "Mode", "Output", "Parameter", "State"),
    "integrator": ("Integrator",),
    "active_method": ("EXACT_ITEM", "METHOD_ITEMS"),
    "oscillator": ("Oscillator",),
}
ATTRIBUTES = (
    "friction",
    "solver",
    "events",
    "exact",
    "model_exchange",
    "x_base",
    "t_base",
    "time",
    "method",
    "event_location",
    "violation_time",
    "violation_value",
)
CLASSES = ("Solver", "Model", "Fmi3Slave")
RESERVED = {
    *("self", "t", *MATH, *ATTRIBUTES, *CLASSES),
    *(name for names in IMPORTS.values() for name in names),
    *(name for name in dir(DryFriction) if not name.startswith("__")),
}
RESERVED_WHERE_COUPLED = {*dir(CoupledFriction)}
