"""What rounding does to a number, as a share of it."""

ULP = 2.220446049250313e-16  # the last place of a double
NEAR = 64.0 * ULP  # how far it may carry a closed form from a tie
