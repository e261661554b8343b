"""Run the vector form of the numerics on numpy arrays."""

from typing import get_args, get_origin

import numpy as np

from fmus.runtime.vectors import (
    ContactIndex,
    ContactVector,
    RateVector,
    StateVector,
    contact_indices,
    is_angle,
    is_dynamic,
    position_index,
    rate_index,
    slip_index,
    state_indices,
    state_vector,
    velocity_indices,
)

VECTOR_TYPES = (StateVector, RateVector, ContactVector)


def to_array_model(model, run):
    """Return the model with all vectors of its run stored as numpy arrays, as the vector form of the numerics expects.

    The classes of the model and of the objects that the run owns are replaced by subclasses: assigning a scalar to a
    vector attribute fills the vector, and assigning an array copies it.
    """
    states, modes = list(model.states), list(model.contacts)
    rates, slips = list(model.states.values()), list(model.contacts.values())
    state_indices[:], contact_indices[:] = range(len(states)), range(len(modes))
    velocity_indices[:] = [states.index(name) for name in states if name in rates]
    slip_index[:] = [states.index(name) if name in states else -1 for name in slips]
    position_index[:] = [rates.index(name) if name in rates else -1 for name in slips]
    is_angle[:] = [name in model.angles for name in states]
    is_dynamic[:] = [name not in states for name in rates]
    rate_index[:] = [states.index(name) if name in states else -1 for name in rates]
    store_vectors_as_arrays(run.solver)
    if model.is_linear:
        methods = run.solver.step.active_method
        methods.exact = array_exact_method(methods.exact)
    cls = type(model)
    methods = {name: declaration(cls, name) for name in vars(cls)}
    wrapped = {name: call_with_scalars(cls, name, types) for name, types in methods.items() if takes_vectors(types)}
    model.__class__ = type(cls.__name__, (cls,), wrapped)
    return model


def declaration(cls, name):
    """Return the types of parameters and result with which the runtime declares a method of a generated class."""
    function = next((vars(base)[name] for base in cls.__mro__[1:] if name in vars(base)), None)
    return getattr(function, "__annotations__", {})


def takes_vectors(types):
    """Return whether a parameter of a method is a vector."""
    return any(kind in VECTOR_TYPES for name, kind in types.items() if name != "return")


def store_vectors_as_arrays(owner):
    """Store the vector attributes of an object, and of all objects that it owns, as arrays."""
    types = {name: kind for one in type(owner).__mro__ for name, kind in vars(one).get("__annotations__", {}).items()}

    def assign(self, name, value):
        if types.get(name) in VECTOR_TYPES:
            long = len(contact_indices) if types[name] == ContactVector else len(state_indices)
            value = np.full(long, value) if np.ndim(value) == 0 else np.array(value)
        object.__setattr__(self, name, value)

    type(owner).__setattr__ = assign
    for name, value in list(vars(owner).items()):
        setattr(owner, name, 0.0 if isinstance(value, np.ndarray) else value)  # left over from another model
        if hasattr(value, "__dict__"):
            store_vectors_as_arrays(value)


def call_with_scalars(cls, name, types):
    """Wrap a method of the model so that it takes and returns vectors; a single contact needs no index."""
    returned = types.get("return")
    results = get_args(returned) if get_origin(returned) is tuple else (returned,)

    def call(self, t, *arguments):
        arguments = arguments[:-1] if ContactIndex in types.values() else arguments
        result = getattr(cls, name)(self, t, *numbers(arguments))
        if name in ("rates", "rate_magnitudes"):
            y, result = arguments[0], iter(result if isinstance(result, tuple) else (result,))
            return np.array([next(result) if is_dynamic[i] else y[rate_index[i]] for i in state_indices])
        if name == "jacobian":
            result, f_t, J = iter(result), state_vector(), np.zeros((len(state_indices), len(state_indices)))
            for i in state_indices:
                if is_dynamic[i]:
                    f_t[i], J[i] = next(result), [next(result) for _ in state_indices]
            return f_t, J
        if results[0] in VECTOR_TYPES:
            result = np.array(result if isinstance(result, tuple) else (result,))
            return result if len(results) == 1 else np.split(result, len(results))
        return result

    return call


def numbers(vectors):
    """Flatten vectors to a list of Python floats."""
    return [one for vector in vectors for one in (vector.tolist() if isinstance(vector, np.ndarray) else [vector])]


def array_exact_method(exact):
    """Wrap the closed-form method so that it takes and returns vectors."""
    cls = type(exact)

    class Exact(cls):
        def start_segment(self, y, f, p, lost):
            cls.start_segment(self, *y.tolist(), float(f[1]), p, lost)

        def next_standstill(self, modes):
            return cls.next_standstill(self, int(modes[0]))

        def state_at_standstill(self, t):
            x, v, lost = cls.state_at_standstill(self, t)
            return (x, v), lost

    return Exact(exact.has_input_derivatives)
