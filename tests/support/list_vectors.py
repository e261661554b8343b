"""Vectors as plain lists: run the sources of the numerics as they are, without lowering, for one model at a time.

`load_vector_model` imports a copy of the runtime, in which this module takes the place of vectors.py.
"""

import sys
from functools import wraps
from importlib import import_module
from operator import add, eq, ge, gt, le, lt, mul, ne, sub, truediv
from pathlib import Path
from types import ModuleType
from typing import get_args, get_origin

from fmus.runtime import linear_solver
from fmus.runtime.vectors import ConditionVector, ContactIndex, ContactVector, Derivatives, Rates, StateVector

__all__ = ["ConditionVector", "Derivatives", "load_vector_model"]
RUNTIME = Path(linear_solver.__file__).parent
PACKAGE = "vector_sources"
VECTOR_TYPES = (StateVector, Rates, ContactVector, ConditionVector)

state_indices, velocity_indices, contact_indices, slip_index, position_index = [], [], [], [], []
planar_indices, is_planar = [], []
is_dynamic, is_angle, rate_index = [], [], []  # of each state; the rate where it is a state


class Vector(list):
    """A list with arithmetic and comparisons element by element; the other operand may be a number."""

    def combine(self, operation, other):
        others = other if isinstance(other, list) else [other] * len(self)
        return Vector(map(operation, self, others))

    def __neg__(self):
        return Vector(-element for element in self)


for name, operation in {"add": add, "sub": sub, "mul": mul, "truediv": truediv}.items():
    setattr(Vector, f"__{name}__", lambda a, b, operation=operation: a.combine(operation, b))
    setattr(Vector, f"__r{name}__", lambda a, b, operation=operation: a.combine(lambda x, y: operation(y, x), b))
for operation in (eq, ge, gt, le, lt, ne):
    setattr(Vector, f"__{operation.__name__}__", lambda a, b, operation=operation: a.combine(operation, b))


# ---- the operations of vectors.py


def state_vector():
    return Vector([0.0] * len(state_indices))


def contact_vector():
    return Vector([0.0] * len(contact_indices))


def magnitude(a):
    return Vector(x if x > 0.0 else -x for x in a)


def error_size(a):
    return Vector(1.0 if angle and size > 1.0 else size for size, angle in zip(magnitude(a), is_angle, strict=True))


def elementwise_max(a, b):
    return Vector(x if x > y else y for x, y in zip(a, b, strict=True))


def max_of(a):
    result = a[0]
    for element in a[1:]:
        result = result if result > element else element
    return result


def min_of(a):
    result = a[0]
    for element in a[1:]:
        result = result if result < element else element
    return result


def sum_of(*vectors):
    first, *others = [element for vector in vectors for element in vector]
    for element in others:
        first = first + element
    return first


all_of, any_of = all, any


def select_kinematic(a, b):
    return Vector(y if dynamic else x for x, y, dynamic in zip(a, b, is_dynamic, strict=True))


def dynamic_part(a):
    return Vector(x if dynamic else 0.0 for x, dynamic in zip(a, is_dynamic, strict=True))


def kinematic_rates(y):
    return Vector(y[i] for i in rate_index)


def complete_rates(y, others):
    return select_kinematic(kinematic_rates(y), others)


def elementwise(function):
    @wraps(function)
    def apply(*vectors):
        return Vector(map(function, *vectors))

    return apply


def inlined(function):
    return function


def multiply(J, a):
    result = kinematic_rates(a)
    for i in computed_states():
        result[i] = sum(J[i, j] * a[j] for j in state_indices)
    return result


def factorize(g, h, J):
    w = linear_solver.Entries()
    linear_solver.factorize(w, g, h, J, computed_states(), kinematic_states())
    return g, h, w


def solve_factored(system, r):
    (g, h, w), k = system, linear_solver.Entries()
    linear_solver.solve(k, w, g, h, dict(enumerate(r)), computed_states(), kinematic_states())
    return Vector(k[i] for i in state_indices)


def factorize_complex(re, im, J):
    w = linear_solver.Entries()
    linear_solver.factorize_complex(w, re, im, J, computed_states(), kinematic_states())
    return w


def solve_complex(w, r, q):
    u, re, im = linear_solver.Entries(), state_vector(), state_vector()
    right = {i: linear_solver.Complex(r[i], q[i]) for i in computed_states()}
    linear_solver.solve_complex(u, w, right, computed_states())
    for i, value in u.items():
        re[i], im[i] = value.re, value.im
    return re, im


def computed_states():
    """Return the indices of states whose rate is computed."""
    return [i for i in state_indices if is_dynamic[i]]


def kinematic_states():
    """Return the index of the rate of each state whose rate is a state."""
    return {i: rate_index[i] for i in state_indices if not is_dynamic[i]}


# ---- a model on these vectors


def load_vector_model(source):
    """Return an instance of the generated class of a model file, whose runtime is not lowered."""
    for name in [name for name in sys.modules if name.split(".")[0] == PACKAGE]:
        del sys.modules[name]
    for name in PACKAGE, f"{PACKAGE}.runtime":
        sys.modules[name] = ModuleType(name)
    sys.modules[f"{PACKAGE}.runtime"].__path__ = [str(RUNTIME)]
    sys.modules[f"{PACKAGE}.runtime.vectors"] = sys.modules[__name__]
    module = ModuleType(f"{PACKAGE}.{source.name}")
    module.__package__ = PACKAGE
    exec(compile(source.generated_source, f"{source.name}.py", "exec"), vars(module))
    model = vars(module)[source.class_name]
    fill_indices(model)
    import_module(f"{PACKAGE}.runtime.run_state")
    for name, part in [*sys.modules.items()]:
        for cls in vars(part).values() if name.startswith(f"{PACKAGE}.runtime.") else ():
            if isinstance(cls, type) and cls.__module__ == name:
                store_vectors_as_lists(cls)
    if model.is_linear:
        pass_vectors_to(sys.modules[f"{PACKAGE}.runtime.linear_closed_form"].LinearClosedForm)
    methods = {name: declaration(model, name) for name in vars(model)}
    wrapped_methods = {
        name: call_with_scalars(model, name, types) for name, types in methods.items() if takes_vectors(types)
    }
    return type(model.__name__, (model,), {"__module__": module.__name__, **wrapped_methods})()


def fill_indices(model):
    """Set the indices of the operations to those of a model."""
    states, rates, slips = list(model.states), list(model.states.values()), list(model.contacts.values())
    state_indices[:], contact_indices[:] = range(len(states)), range(len(slips))
    velocity_indices[:] = [states.index(name) for name in states if name in rates]
    slip_index[:] = [states.index(name) if name in states else -1 for name in slips]
    position_index[:] = [rates.index(name) if name in rates else -1 for name in slips]
    is_planar[:] = [mode in getattr(model, "planar_modes", ()) for mode in model.contacts]
    planar_indices[:] = [i for i, planar in enumerate(is_planar) if planar]
    is_angle[:] = [name in model.angles for name in states]
    is_dynamic[:] = [name not in states for name in rates]
    rate_index[:] = [states.index(name) if name in states else -1 for name in rates]


def declaration(cls, name):
    """Return the types of parameters and result with which the runtime declares a method of a generated class."""
    function = next((vars(base)[name] for base in cls.__mro__[1:] if name in vars(base)), None)
    return getattr(function, "__annotations__", {})


def takes_vectors(types):
    """Return whether a parameter of a method is a vector."""
    return any(kind in VECTOR_TYPES for name, kind in types.items() if name != "return")


def store_vectors_as_lists(cls):
    """Let each vector attribute of a class copy what is assigned to it; a number fills the vector."""
    types = {name: kind for base in cls.__mro__ for name, kind in vars(base).get("__annotations__", {}).items()}
    if not any(kind in VECTOR_TYPES for kind in types.values()):
        return

    def assign(self, name, value):
        if types.get(name) in VECTOR_TYPES:
            size = len(contact_indices) if types[name] is ContactVector else len(state_indices)
            value = Vector(value) if isinstance(value, (list, tuple)) else Vector([value] * size)
        object.__setattr__(self, name, value)

    cls.__setattr__ = assign


def call_with_scalars(cls, name, types):
    """Wrap a method of the model so that it takes and returns vectors; a single contact needs no index."""
    return_type = types.get("return")
    results = get_args(return_type) if get_origin(return_type) is tuple else (return_type,)

    def call(self, t, *arguments):
        arguments = arguments[:-1] if ContactIndex in types.values() else arguments
        scalars = [x for argument in arguments for x in (argument if isinstance(argument, list) else [argument])]
        result = getattr(cls, name)(self, t, *scalars)
        if return_type is Rates:
            y, rates = arguments[0], iter(result if isinstance(result, tuple) else (result,))
            return Vector(next(rates) if is_dynamic[i] else y[rate_index[i]] for i in state_indices)
        if name == "jacobian":
            entries, f_t, J = iter(result), state_vector(), {}
            for i in computed_states():
                f_t[i] = next(entries)
                J |= {(i, j): next(entries) for j in state_indices}
            return f_t, J
        if results[0] in VECTOR_TYPES:
            numbers = Vector(result if isinstance(result, tuple) else (result,))
            size = len(numbers) // len(results)
            parts = [Vector(numbers[n * size : (n + 1) * size]) for n in range(len(results))]
            return parts[0] if len(parts) == 1 else parts
        return result

    return call


def pass_vectors_to(closed_form):
    """Let the methods of the closed form take and return vectors."""
    start, standstill, state = (
        vars(closed_form)[name] for name in ("start_segment", "next_standstill", "state_at_standstill")
    )

    def state_at_standstill(self, t):
        x, v, x_roundoff = state(self, t)
        return (x, v), x_roundoff

    closed_form.start_segment = lambda self, y, a, p, x_roundoff: start(self, *y, a, p, x_roundoff)
    closed_form.next_standstill = lambda self, modes: standstill(self, modes[0])
    closed_form.state_at_standstill = state_at_standstill
