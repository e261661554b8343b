"""A power series over a stretch of time, and where it first comes to zero: motions and loads that have no closed form.

With u the share of the stretch that has passed, f = sum c_j u^j.  As long as |f''| <= M, f lies above the parabola
f + f' d - M d^2/2 for d to come: who goes where that comes to zero passes no zero of f.
"""

from math import fabs, sqrt

TERMS = 20  # of a motion, where the largest rate times the stretch is 1
MOST_LOOKS = 100


class Series:
    """The coefficients, and how many seconds the stretch takes."""

    def __init__(self):
        self.span = 0.0
        self.c = [0.0] * (TERMS + 1)

    def first_zero(self, side):
        """How far it keeps the sign of `side`, as a share of the stretch, and whether it ends there; it may begin with
        zero, and then it has the sign that comes first."""
        first = 0
        while first < TERMS and self.c[first] == 0.0:
            first += 1
        if self.c[first] == 0.0:
            return 1.0, False
        u = most = 0.0
        for k in range(first + 2, TERMS + 1):
            most += (k - first) * (k - first - 1) * fabs(self.c[k])
        for _ in range(MOST_LOOKS):
            value = slope = 0.0
            for i in range(TERMS + 1 - first):
                slope = value + slope * u
                value = side * self.c[TERMS - i] + value * u
            if value <= 0.0:
                return u, True
            fall = sqrt(slope * slope + 2.0 * most * value) - slope
            if not 2.0 * value < (1.0 - u) * fall:
                return 1.0, False
            ahead = u + 2.0 * value / fall
            if ahead == u:
                return u, True
            u = ahead
        return u, False
