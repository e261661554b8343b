"""Rounding errors of rates, to which the errors of a step are compared where nothing else has a size."""

from .codes import EPSILON
from .vectors import ContactVector, StateVector, dynamic_part, kinematic_rates, select_kinematic

# Rounding error of a rate, relative to the sum of its absolute terms, below which no step is rejected.  A product and a
# sum round by half EPSILON each, as does each operand.  With 128 EPSILON, dop853 was allowed errors of 4e-10 in pacejka
# at any tolerance below 1e-12.
RATE_ROUNDING = 2.0 * EPSILON
# Rounding errors of a position in one step, in those of its speed times the step: the coefficients of dop853 are up to
# 43, with both signs.
POSITION_ROUNDING = 16.0


def smallest_sizes(model, step, t, y: StateVector, modes: ContactVector, h) -> StateVector:
    """Return the sizes of states of which rounding errors, in a step of size h, are the tolerated part.

    They are errors of velocities, and of positions by these.
    """
    terms = model.rate_magnitudes(t, y, modes)
    rounding = dynamic_part(RATE_ROUNDING * h / step.tolerance * terms)
    return select_kinematic(POSITION_ROUNDING * h * kinematic_rates(rounding), rounding)
