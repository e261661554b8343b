"""The vectors of the numerics, and what they mean on numpy arrays, for whoever runs the sources as they stand.

A vector runs over the states of a model or over its contacts.  Sources that speak of vectors are written out in scalars
before they travel (packaging/written), so this file stays at home.  One model at a time runs on arrays, that of the
places below: tests/support/on_arrays.py sets them.
"""

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
