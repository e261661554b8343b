"""What rounding does to a number, as a share of it."""

EPSILON = 2.220446049250313e-16  # the last place of a double
ROUNDOFF_MARGIN = 64.0 * EPSILON  # how far it may carry a closed form from a tie
