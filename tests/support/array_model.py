"""Run the vector form of the numerics on numpy arrays."""

import numpy as np

from fmus.packaging.lowering.layout import NAMED_VECTOR
from fmus.runtime.vectors import (
    contact_indices,
    is_dynamic,
    position_index,
    rate_index,
    slip_index,
    state_indices,
    state_vector,
    velocity_indices,
)

CONTACT_RESULTS = (
    *("slip_velocities", "slip_magnitudes", "contact_forces", "contact_rates", "apply_impulses", "law_modes"),
)


def to_array_model(model):
    """Return the model with all vectors stored as numpy arrays, as the vector form of the numerics expects.

    The classes of the model and of the objects that it owns are replaced by subclasses: assigning a scalar to a vector
    attribute fills the vector, and assigning an array copies it.
    """
    states, modes = list(model.states), list(model.contacts)
    rates, slips = list(model.states.values()), list(model.contacts.values())
    state_indices[:], contact_indices[:] = range(len(states)), range(len(modes))
    velocity_indices[:] = [states.index(name) for name in states if name in rates]
    slip_index[:] = [states.index(name) if name in states else -1 for name in slips]
    position_index[:] = [rates.index(name) if name in rates else -1 for name in slips]
    is_dynamic[:] = [name not in states for name in rates]
    rate_index[:] = [states.index(name) if name in states else -1 for name in rates]
    store_vectors_as_arrays(model.solver)
    if model.is_linear:
        methods = model.solver.step.active_method
        methods.exact = array_exact_method(methods.exact)
    cls = type(model)
    alone, all_of_them = (
        ("stick_load", "load_magnitude", "breakaway_acceleration"),
        ("slip_velocities", "slip_magnitudes", "contact_forces", "contact_rates", "apply_impulses"),
    )
    about = {}
    for name in (
        "rates",
        "jacobian",
        "applied_acceleration",
        "compute_outputs",
        *(all_of_them if cls.is_coupled else ()),
        *(["update_conditions"] if cls.has_conditions else ()),
        *(["law_modes"] if cls.has_other_laws else ()),
    ):
        about[name] = call_with_scalars(cls, name)
    for name in alone if modes and not cls.is_coupled else ():
        if not getattr(cls, name).__module__.startswith("fmus.runtime"):
            about[name] = call_for_single_contact(cls, name)
    model.__class__ = type(cls.__name__, (cls,), about)
    return model


def store_vectors_as_arrays(thing):
    """Store the vector attributes of an object, and of all objects that it owns, as arrays."""
    annotated = {name for one in type(thing).__mro__ for name in vars(one).get("__annotations__", {})}
    over_contacts = {name for name in annotated if "modes" in name}

    def assign(self, name, value):
        if name in annotated or NAMED_VECTOR.fullmatch(name):
            long = len(contact_indices) if name in over_contacts or name.startswith("modes") else len(state_indices)
            value = np.full(long, value) if np.ndim(value) == 0 else np.array(value)
        object.__setattr__(self, name, value)

    type(thing).__setattr__ = assign
    for name, value in list(vars(thing).items()):
        setattr(thing, name, 0.0 if isinstance(value, np.ndarray) else value)  # left over from another model
        if hasattr(value, "__dict__"):
            store_vectors_as_arrays(value)


def call_with_scalars(cls, name):
    """Wrap a method of the model so that it takes and returns vectors."""

    def call(self, t, *vectors):
        result = getattr(cls, name)(self, t, *numbers(vectors))
        if name == "rates":
            y, result = vectors[0], iter(result if isinstance(result, tuple) else (result,))
            return np.array([next(result) if is_dynamic[i] else y[rate_index[i]] for i in state_indices])
        if name == "jacobian":
            result, f_t, J = iter(result), state_vector(), np.zeros((len(state_indices), len(state_indices)))
            for i in state_indices:
                if is_dynamic[i]:
                    f_t[i], J[i] = next(result), [next(result) for _ in state_indices]
            return f_t, J
        if name in CONTACT_RESULTS:
            result = np.array(result if isinstance(result, tuple) else (result,))
            parts = len(result) // (len(state_indices) if name == "apply_impulses" else len(contact_indices))
            return result if parts == 1 else np.split(result, parts)
        return result

    return call


def call_for_single_contact(cls, name):
    """Wrap a method of a model with a single contact so that it takes vectors and a contact index."""

    def call(self, t, *vectors):
        *vectors, _ = vectors
        return getattr(cls, name)(self, t, *numbers(vectors))

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

    return Exact()
