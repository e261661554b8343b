"""Vector operations of the numerics, which are declared here.

A vector runs over the states or over the contacts of a model.  At build time the sources are unrolled to scalars
(compiler/lowering), so FMUs do not carry this module.  tests/support/list_vectors.py implements the operations on
lists, by which tests run the sources as they are.
"""

from typing import Any


class StateVector(Any):
    """Numbers for all states."""


class Rates(StateVector):
    """Rates of all states, from a generated method that computes those that are not states themselves."""


class ContactVector(Any):
    """Numbers for all contacts."""


class ConditionVector(Any):
    """Numbers for all conditions."""


ContactIndex = int
Derivatives = tuple[StateVector, Any]  # of rates by time, and by the states

# Indices of the model: all states; states that are the rate of another; all contacts; contacts in a plane; for each
# contact the index of its slip velocity and of the state whose rate that is, and whether it acts in a plane.
state_indices: list[int] = []
velocity_indices: list[int] = []
contact_indices: list[int] = []
planar_indices: list[int] = []
slip_index: list[int] = []
position_index: list[int] = []
is_planar: list[bool] = []


def elementwise(function):
    """Apply a function of scalars element by element."""
    return function


def inlined(function):
    """Mark a function that returns one expression, which replaces its calls at build time, for each element."""
    return function


def state_vector() -> StateVector:
    """Return a vector over the states, to be filled."""


def contact_vector() -> ContactVector:
    """Return a vector over the contacts, to be filled."""


def max_of(a):
    """Return the largest element."""


def min_of(a):
    """Return the smallest element."""


def sum_of(*vectors):
    """Sum all elements of some vectors, in order."""


def all_of(a):
    """Return whether all elements are true."""


def any_of(a):
    """Return whether any element is true."""


def select_angles(a, b):
    """Take `a` for angles that enter the equations by periodic functions only, and `b` for the other states."""


@inlined
def magnitude(a):
    """Return the magnitudes."""
    return a if a > 0.0 else -a


@inlined
def elementwise_max(a, b):
    """Return the larger elements of two vectors."""
    return a if a > b else b


@inlined
def error_size(a):
    """Return the magnitudes to which the errors of states are relative: of angles at most 1 rad.

    Whole revolutions of an angle do not change the motion.
    """
    return select_angles(1.0 if a > 1.0 or a < -1.0 else magnitude(a), magnitude(a))


def select_kinematic(a, b):
    """Take `a` for states whose rate is a state and `b` for the others."""


@inlined
def dynamic_part(a):
    """Return a, with zeros for states whose rate is a state."""
    return select_kinematic(0.0, a)


def kinematic_rates(y):
    """Return, for states whose rate is a state, that rate."""


@inlined
def complete_rates(y, others):
    """Return the rates at y: those that are states from y, the others from a vector."""
    return select_kinematic(kinematic_rates(y), others)


def multiply(J, a: StateVector) -> StateVector:
    """Multiply a vector by the derivatives of all rates; each row sums its terms in order."""


def factorize(g, h, J):
    """Factorize 1 - g h J."""


def solve_factored(system, r) -> StateVector:
    """Solve (1 - g h J) k = g r for k."""


def factorize_complex(re, im, J):
    """Factorize re + i im - J, after the elimination of states whose rate is a state."""


def solve_complex(w, r, q) -> tuple[StateVector, StateVector]:
    """Solve for a right-hand side r + i q that is zero for states whose rate is a state; return both parts of the
    solution, for the other states only."""
