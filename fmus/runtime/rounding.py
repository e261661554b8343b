"""Relative sizes of rounding errors."""

EPSILON = 2.220446049250313e-16  # machine epsilon of a double
ROUNDOFF_MARGIN = 64.0 * EPSILON  # relative tolerance for ties between stick and slip in closed forms
