"""Vector operations of the numerics, implemented on numpy arrays.

A vector runs over the states or over the contacts of a model.  At build time the sources are unrolled to scalars
(packaging/lowering), so FMUs do not carry this module.  It allows tests to run the sources as they are, for one model
at a time: tests/support/array_model.py fills the index lists below.
"""

from functools import wraps

import numpy as np
import numpy.typing as npt

# Annotations that declare vectors over states, contacts or conditions, and the index of a contact.  A RateVector holds
# the rates at the StateVector that is declared last before it, among the attributes of a class, the parameters of a
# function and its results.  Scalars are not stored twice: those of its rates that are states are read from there.
StateVector = npt.NDArray[np.float64]
RateVector = npt.NDArray[np.float64]
ContactVector = npt.NDArray[np.int64]
ConditionVector = npt.NDArray[np.float64]
ContactIndex = int
Derivatives = tuple[RateVector, npt.NDArray[np.float64]]  # of rates by time, and by the states

# Indices of the current model: all states; states that are the rate of another; all contacts; for each contact the
# index of its slip velocity and of the state whose rate that is.
state_indices: list[int] = []
velocity_indices: list[int] = []
contact_indices: list[int] = []
slip_index: list[int] = []
position_index: list[int] = []
is_dynamic: list[bool] = []  # for each state: whether its rate is computed, not a state
rate_index: list[int] = []  # index of the rate, where it is a state

SMALL = 1e-6  # smallest ratio of a later pivot to its change by the elimination of another


def state_vector() -> StateVector:
    """Return a vector over the states, to be filled."""
    return np.zeros(len(state_indices))


def contact_vector() -> ContactVector:
    """Return a vector over the contacts, to be filled."""
    return np.zeros(len(contact_indices))  # type: ignore[return-value]


def magnitude(a):
    return np.where(a > 0.0, a, -a)


def elementwise_max(a, b):
    return np.where(a > b, a, b)


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
    """Sum all elements of some vectors, in order."""
    terms = [element for vector in vectors for element in vector]
    result = terms[0]
    for term in terms[1:]:
        result = result + term
    return result


def all_of(a):
    return bool(np.all(a))


def any_of(a):
    return bool(np.any(a))


def select_kinematic(a, b):
    """Take `a` for states whose rate is a state and `b` for the others."""
    return np.where(is_dynamic, b, a)


def dynamic_part(a):
    """Return a, with zeros for states whose rate is a state."""
    return np.where(is_dynamic, a, 0.0)


def kinematic_rates(y):
    """Return, for states whose rate is a state, that rate."""
    return np.array([y[i] for i in rate_index])


def complete_rates(y: StateVector, others) -> RateVector:
    """Return the rates at y: those that are states from y, the others from a vector."""
    return select_kinematic(kinematic_rates(y), others)


def elementwise(function):
    """Apply a function of scalars element by element."""

    @wraps(function)
    def apply(*vectors):
        return np.array([function(*row) for row in zip(*vectors)])

    return apply


def factorize(g, h, J):
    """Factorize 1 - g h J; packaging/lowering/elimination.py generates the same operations in scalars, without those on
    entries that are always zero."""
    w, inverse = np.zeros(J.shape), np.full(len(J), np.nan)
    computed = [i for i in state_indices if is_dynamic[i]]
    for i in computed:
        for p in state_indices:
            if not is_dynamic[p]:
                w[i, p] = g * h * J[i, p]
        for j in computed:
            entry = J[i, j]
            for p in state_indices:
                if not is_dynamic[p] and rate_index[p] == j:
                    entry = entry + w[i, p]
            w[i, j] = 1.0 - g * h * entry if i == j else -g * h * entry
    for n, k in enumerate(computed):
        others = computed[n + 1 :]
        if w[k, k] != 0.0 and all(abs(w[k, k] * w[i, i]) >= SMALL * abs(w[i, k] * w[k, i]) for i in others):
            inverse[k] = g / w[k, k]
        for i in computed[n + 1 :]:
            w[i, k] = w[i, k] * inverse[k] / g
            for j in computed[n + 1 :]:
                w[i, j] = w[i, j] - w[i, k] * w[k, j]
        for j in computed[n + 1 :]:
            w[k, j] = w[k, j] / g
    return g, h, w, inverse


def solve_factored(system, r) -> StateVector:
    """Solve (1 - g h J) k = g r for k."""
    g, h, w, inverse = system
    computed, k = [i for i in state_indices if is_dynamic[i]], np.zeros(len(r))
    for n, i in enumerate(computed):
        k[i] = r[i]
        for p in state_indices:
            if not is_dynamic[p]:
                k[i] = k[i] + w[i, p] * r[p]
        for j in computed[:n]:
            k[i] = k[i] - w[i, j] * k[j]
    for n, i in reversed(list(enumerate(computed))):
        for j in computed[n + 1 :]:
            k[i] = k[i] - w[i, j] * k[j]
        k[i] = k[i] * inverse[i]
    for p in state_indices:
        if not is_dynamic[p]:
            k[p] = g * (r[p] + h * k[rate_index[p]])
    return k


def factorize_complex(re, im, J):
    """Factorize re + i im - J, after the elimination of states whose rate is a state; see elimination.py."""
    n = len(J)
    w, inverse = np.zeros((n, n, 2)), np.full((n, 2), np.nan)
    computed = [i for i in state_indices if is_dynamic[i]]
    g_re = 1.0 / (re + im * (im / re))  # reciprocal of the shift
    g_im = -(im / re) * g_re
    for i in computed:
        for j in computed:
            a, b = J[i, j], 0.0
            for p in state_indices:
                if not is_dynamic[p] and rate_index[p] == j:
                    a, b = a + g_re * J[i, p], b + g_im * J[i, p]
            w[i, j] = (re - a, im - b) if i == j else (-a, -b)
    for n, k in enumerate(computed):
        a, b = w[k, k]
        size, others = a * a + b * b, computed[n + 1 :]
        if size != 0.0 and all(
            size * squared(w[i, i]) >= SMALL * SMALL * (squared(w[i, k]) * squared(w[k, i])) for i in others
        ):
            inverse[k] = a / size, -b / size
        for i in computed[n + 1 :]:
            w[i, k] = complex_product(w[i, k], inverse[k])
            for j in computed[n + 1 :]:
                w[i, j] = w[i, j] - complex_product(w[i, k], w[k, j])
    return w, inverse


def solve_complex(system, r, q) -> tuple[StateVector, StateVector]:
    """Solve for a right-hand side r + i q that is zero for states whose rate is a state; return both parts of the
    solution, for the other states only."""
    w, inverse = system
    computed, u = [i for i in state_indices if is_dynamic[i]], np.zeros((len(r), 2))
    for n, i in enumerate(computed):
        u[i] = r[i], q[i]
        for j in computed[:n]:
            u[i] = u[i] - complex_product(w[i, j], u[j])
    for n, i in reversed(list(enumerate(computed))):
        for j in computed[n + 1 :]:
            u[i] = u[i] - complex_product(w[i, j], u[j])
        u[i] = complex_product(u[i], inverse[i])
    return u[:, 0], u[:, 1]


def squared(a):
    """Return the squared magnitude of a complex number."""
    return a[0] * a[0] + a[1] * a[1]


def complex_product(a, b):
    """Multiply two complex numbers, each a pair of numbers."""
    return np.array([a[0] * b[0] - a[1] * b[1], a[0] * b[1] + a[1] * b[0]])
