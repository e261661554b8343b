"""Vector operations of the numerics, implemented on numpy arrays.

A vector runs over the states or over the contacts of a model.  At build time the sources are unrolled to scalars
(compiler/lowering), so FMUs do not carry this module.  It allows tests to run the sources as they are, for one model
at a time: tests/support/array_model.py fills the index lists below.
"""

from functools import wraps

import numpy as np
import numpy.typing as npt

from . import linear_solver

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
is_angle: list[bool] = []  # for each state: whether it is an angle that enters by periodic functions only
rate_index: list[int] = []  # index of the rate, where it is a state


def state_vector() -> StateVector:
    """Return a vector over the states, to be filled."""
    return np.zeros(len(state_indices))


def contact_vector() -> ContactVector:
    """Return a vector over the contacts, to be filled."""
    return np.zeros(len(contact_indices))  # type: ignore[return-value]


def magnitude(a):
    return np.where(a > 0.0, a, -a)


def error_size(a):
    """Return the magnitudes to which the errors of states are relative: of angles at most 1 rad.

    Whole revolutions of an angle that enters the equations by periodic functions only do not change the motion.
    """
    size = magnitude(a)
    return np.where(is_angle & (size > 1.0), 1.0, size)


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


def inlined(function):
    """Mark a function of vectors that returns one expression; its calls are replaced by it at build time."""
    return function


def multiply(J, a: StateVector) -> StateVector:
    """Multiply a vector by the derivatives of all rates; each row sums its terms in order."""
    entries, result = matrix_entries(J), kinematic_rates(a)
    for i in computed_states():
        result[i] = sum(entries[i, j] * a[j] for j in state_indices)
    return result


def factorize(g, h, J):
    """Factorize 1 - g h J."""
    w = linear_solver.Entries()
    with np.errstate(all="ignore"):
        linear_solver.factorize(w, g, h, matrix_entries(J), computed_states(), kinematic_states())
    return g, h, w


def solve_factored(system, r) -> StateVector:
    """Solve (1 - g h J) k = g r for k."""
    g, h, w = system
    k = linear_solver.Entries()
    with np.errstate(all="ignore"):
        linear_solver.solve(k, w, g, h, dict(enumerate(r)), computed_states(), kinematic_states())
    return np.array([k[i] for i in state_indices])


def factorize_complex(re, im, J):
    """Factorize re + i im - J, after the elimination of states whose rate is a state."""
    w = linear_solver.Entries()
    with np.errstate(all="ignore"):
        linear_solver.factorize_complex(w, re, im, matrix_entries(J), computed_states(), kinematic_states())
    return w


def solve_complex(w, r, q) -> tuple[StateVector, StateVector]:
    """Solve for a right-hand side r + i q that is zero for states whose rate is a state; return both parts of the
    solution, for the other states only."""
    u, (re, im) = linear_solver.Entries(), np.zeros((2, len(r)))
    right = {i: linear_solver.Complex(r[i], q[i]) for i in computed_states()}
    with np.errstate(all="ignore"):
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


def matrix_entries(J):
    """Return the entries of the computed rates by row and column."""
    return {(i, j): J[i, j] for i in computed_states() for j in state_indices}
