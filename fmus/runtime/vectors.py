"""The vectors of the numerics, and what they mean on numpy arrays, for whoever runs the sources as they stand.

A vector runs over the states of a model or over its contacts.  Sources that speak of vectors are written out in scalars
before they travel (packaging/written), so this file stays at home.  One model at a time runs on arrays, that of the
places below: tests/support/array_model.py sets them.
"""

from functools import wraps

import numpy as np
import numpy.typing as npt

# What an annotation says that a name runs over, or counts.
StateVector = npt.NDArray[np.float64]
RateVector = npt.NDArray[np.float64]
ContactVector = npt.NDArray[np.int64]
ContactIndex = int

# Of the model at hand: every state, every state that is the rate of another, every contact; for each contact the place
# of its slip among the states, and that of the state whose rate the slip is.
state_indices: list[int] = []
velocity_indices: list[int] = []
contact_indices: list[int] = []
slip_index: list[int] = []
position_index: list[int] = []
is_dynamic: list[bool] = []  # for each state whether its rate is calculated, and is no state
rate_index: list[int] = []  # the place of that rate, where it is a state

SMALL = 1e-6  # a pivot over what it shall eliminate


def state_vector():
    """A vector to be filled."""
    return np.zeros(len(state_indices))


def contact_vector():
    """Another, over the contacts."""
    return np.zeros(len(contact_indices))


def magnitude(a):
    return np.where(a > 0.0, a, -a)


def elementwise_max(a, b):
    return np.where(a > b, a, b)


def max_of(a):
    found = a[0]
    for one in a[1:]:
        found = found if found > one else one
    return found


def min_of(a):
    found = a[0]
    for one in a[1:]:
        found = found if found < one else one
    return found


def sum_of(*vectors):
    """The sum, term by term."""
    terms = [one for vector in vectors for one in vector]
    found = terms[0]
    for one in terms[1:]:
        found = found + one
    return found


def all_of(a):
    return bool(np.all(a))


def any_of(a):
    return bool(np.any(a))


def select_kinematic(a, b):
    """`a` for the states whose rate is a state, `b` for the others."""
    return np.where(is_dynamic, b, a)


def kinematic_rates(y):
    """The rates that are states, each at the place of the state whose rate it is."""
    return np.array([y[i] for i in rate_index])


def elementwise(function):
    """A function of numbers, taken number by number."""

    @wraps(function)
    def over(*vectors):
        return np.array([function(*row) for row in zip(*vectors)])

    return over


def factorize(g, h, J):
    """1 - g h J, ready to be solved with: see packaging/written/elimination.py, which does the same in scalars."""
    w, inverse = np.zeros(J.shape), np.full(len(J), np.nan)
    calculated = [i for i in state_indices if is_dynamic[i]]
    for i in calculated:
        for p in state_indices:
            if not is_dynamic[p]:
                w[i, p] = g * h * J[i, p]
        for j in calculated:
            entry = J[i, j]
            for p in state_indices:
                if not is_dynamic[p] and rate_index[p] == j:
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


def solve_factored(system, r):
    """The k of (1 - g h J) k = g r."""
    g, h, w, inverse = system
    calculated, k = [i for i in state_indices if is_dynamic[i]], np.zeros(len(r))
    for n, i in enumerate(calculated):
        k[i] = r[i]
        for p in state_indices:
            if not is_dynamic[p]:
                k[i] = k[i] + w[i, p] * r[p]
        for j in calculated[:n]:
            k[i] = k[i] - w[i, j] * k[j]
    for n, i in reversed(list(enumerate(calculated))):
        for j in calculated[n + 1 :]:
            k[i] = k[i] - w[i, j] * k[j]
        k[i] = k[i] * inverse[i]
    for p in state_indices:
        if not is_dynamic[p]:
            k[p] = g * (r[p] + h * k[rate_index[p]])
    return k
