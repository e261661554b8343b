"""The vectors of the numerics, and what they mean on numpy arrays, for whoever runs the sources as they stand.

A vector runs over the states of a model or over its contacts.  Sources that speak of vectors are written out in scalars
before they travel (packaging/written), so this file stays at home.  One model at a time runs on arrays: `on_arrays`.
"""

import re
from functools import wraps

import numpy as np
import numpy.typing as npt

# What an annotation says that a name runs over, or counts.
States = npt.NDArray[np.float64]
Rates = npt.NDArray[np.float64]
Contacts = npt.NDArray[np.int64]
Contact = int

# Of the model at hand: every state, every state that is the rate of another, every contact; for each contact the place
# of its slip among the states, and that of the state whose rate the slip is.
places: list[int] = []
speeds: list[int] = []
contacts: list[int] = []
slip: list[int] = []
place: list[int] = []
own: list[bool] = []  # for each state whether its rate is calculated, and is no state
rate: list[int] = []  # the place of that rate, where it is a state

SMALL = 1e-6  # a pivot over what it shall eliminate
VECTOR = re.compile(r"(y|f|modes)(\d*|_\w+)")


def per_state():
    """A vector to be filled."""
    return np.zeros(len(places))


def per_contact():
    """Another, over the contacts."""
    return np.zeros(len(contacts))


def magnitude(a):
    return np.where(a > 0.0, a, -a)


def greater(a, b):
    return np.where(a > b, a, b)


def largest(a):
    found = a[0]
    for one in a[1:]:
        found = found if found > one else one
    return found


def first(a):
    found = a[0]
    for one in a[1:]:
        found = found if found < one else one
    return found


def total(*vectors):
    """The sum, term by term."""
    terms = [one for vector in vectors for one in vector]
    found = terms[0]
    for one in terms[1:]:
        found = found + one
    return found


def every(a):
    return bool(np.all(a))


def some(a):
    return bool(np.any(a))


def kinematic(a, b):
    """`a` for the states whose rate is a state, `b` for the others."""
    return np.where(own, b, a)


def speeds_of(y):
    """The rates that are states, each at the place of the state whose rate it is."""
    return np.array([y[i] for i in rate])


def each(function):
    """A function of numbers, taken number by number."""

    @wraps(function)
    def over(*vectors):
        return np.array([function(*row) for row in zip(*vectors)])

    return over


def factored(g, h, J):
    """1 - g h J, ready to be solved with: see packaging/written/elimination.py, which does the same in scalars."""
    w, inverse = np.zeros(J.shape), np.full(len(J), np.nan)
    calculated = [i for i in places if own[i]]
    for i in calculated:
        for p in places:
            if not own[p]:
                w[i, p] = g * h * J[i, p]
        for j in calculated:
            entry = J[i, j]
            for p in places:
                if not own[p] and rate[p] == j:
                    entry = entry + w[i, p]
            w[i, j] = 1.0 - g * h * entry if i == j else -g * h * entry
    for n, k in enumerate(calculated):
        if w[k, k] != 0.0 and all(abs(w[k, k]) > SMALL * abs(w[i, k]) for i in calculated[n + 1 :]):
            inverse[k] = g / w[k, k]
        for i in calculated[n + 1 :]:
            w[i, k] = w[i, k] * inverse[k] / g
            for j in calculated[n + 1 :]:
                w[i, j] = w[i, j] - w[i, k] * w[k, j]
        for j in calculated[n + 1 :]:
            w[k, j] = w[k, j] / g
    return g, h, w, inverse


def solved(system, r):
    """The k of (1 - g h J) k = g r."""
    g, h, w, inverse = system
    calculated, k = [i for i in places if own[i]], np.zeros(len(r))
    for n, i in enumerate(calculated):
        k[i] = r[i]
        for p in places:
            if not own[p]:
                k[i] = k[i] + w[i, p] * r[p]
        for j in calculated[:n]:
            k[i] = k[i] - w[i, j] * k[j]
    for n, i in reversed(list(enumerate(calculated))):
        for j in calculated[n + 1 :]:
            k[i] = k[i] - w[i, j] * k[j]
        k[i] = k[i] * inverse[i]
    for p in places:
        if not own[p]:
            k[p] = g * (r[p] + h * k[rate[p]])
    return k


def on_arrays(model):
    """A model of the sources as they stand, with its vectors on arrays: what the numerics take for a model.

    The classes of all that it owns learn that a number fills a vector, and that what is assigned is copied.
    """
    states, modes = list(model.states), list(model.contacts)
    rates, slips = list(model.states.values()), list(model.contacts.values())
    places[:], contacts[:] = range(len(states)), range(len(modes))
    speeds[:] = [states.index(name) for name in states if name in rates]
    slip[:] = [states.index(name) if name in states else -1 for name in slips]
    place[:] = [rates.index(name) if name in rates else -1 for name in slips]
    own[:] = [name not in states for name in rates]
    rate[:] = [states.index(name) if name in states else -1 for name in rates]
    fill(model.solver)
    if model.linear:
        methods = model.solver.step.methods
        methods.exact = exact_on_arrays(methods.exact)
    cls = type(model)
    alone, all_of_them = ("hold", "terms", "departure"), ("slips", "slip_terms", "forces", "changes", "struck")
    about = {}
    for name in ("rates", "jacobian", "push", "observe", *(all_of_them if cls.coupled else ())):
        about[name] = called_with_numbers(cls, name)
    for name in alone if modes and not cls.coupled else ():
        if not getattr(cls, name).__module__.startswith(__package__):
            about[name] = called_of_a_contact(cls, name)
    model.__class__ = type(cls.__name__, (cls,), about)
    return model


def fill(thing):
    """Make vectors of the attributes of an object, and of the objects that it owns, that are vectors."""
    said = {name for one in type(thing).__mro__ for name in vars(one).get("__annotations__", {})}
    over_contacts = {name for name in said if "modes" in name}

    def assign(self, name, value):
        if name in said or VECTOR.fullmatch(name):
            long = len(contacts) if name in over_contacts or name.startswith("modes") else len(places)
            value = np.full(long, value) if np.ndim(value) == 0 else np.array(value)
        object.__setattr__(self, name, value)

    type(thing).__setattr__ = assign
    for name, value in list(vars(thing).items()):
        setattr(thing, name, 0.0 if isinstance(value, np.ndarray) else value)  # that of another model
        if hasattr(value, "__dict__"):
            fill(value)


def called_with_numbers(cls, name):
    """A method of a model, called with vectors; what it returns becomes one."""

    def call(self, t, *vectors):
        found = getattr(cls, name)(self, t, *numbers(vectors))
        if name == "rates":
            y, found = vectors[0], iter(found if isinstance(found, tuple) else (found,))
            return np.array([next(found) if own[i] else y[rate[i]] for i in places])
        if name == "jacobian":
            found, f_t, J = iter(found), per_state(), np.zeros((len(places), len(places)))
            for i in places:
                if own[i]:
                    f_t[i], J[i] = next(found), [next(found) for _ in places]
            return f_t, J
        if name in ("slips", "slip_terms", "forces", "changes", "struck"):
            found = np.array(found if isinstance(found, tuple) else (found,))
            parts = len(found) // (len(places) if name == "struck" else len(contacts))
            return found if parts == 1 else np.split(found, parts)
        return found

    return call


def called_of_a_contact(cls, name):
    """What a model says of its only contact, called with vectors and the number of the contact."""

    def call(self, t, *vectors):
        *vectors, _ = vectors
        return getattr(cls, name)(self, t, *numbers(vectors))

    return call


def numbers(vectors):
    """All the numbers of some vectors, as Python has them."""
    return [one for vector in vectors for one in (vector.tolist() if isinstance(vector, np.ndarray) else [vector])]


def exact_on_arrays(exact):
    """The closed form, called with vectors."""
    cls = type(exact)

    class Exact(cls):
        def begin(self, y, f, p, lost):
            cls.begin(self, *y.tolist(), float(f[1]), p, lost)

        def standstill(self, modes):
            return cls.standstill(self, int(modes[0]))

        def end(self, t):
            x, v, lost = cls.end(self, t)
            return (x, v), lost

    return Exact()
