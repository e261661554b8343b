"""A power series over a stretch of time, and where it first comes to zero: motions and loads that have no closed form.

With u the share of the stretch that has passed, f = sum c_j u^j.  As long as |f''| <= M, f lies above the parabola
f + f' d - M d^2/2 for d to come: who goes where that comes to zero passes no zero of f.
"""

from math import fabs, sqrt

TERMS = 20  # of a motion, where the largest rate times the stretch is 1
MAX_BISECTIONS, MAX_ITERATIONS = 200, 100


class PowerSeries:
    """The coefficients, and how many seconds the stretch takes."""

    def __init__(self):
        self.duration = 0.0
        self.c = [0.0] * (TERMS + 1)

    def first_zero(self, side):
        """How far it keeps the sign of `side`, as a share of the stretch, and whether it ends there; it may begin with
        zero, and then it has the sign that comes first.  No further is looked than where its first two terms count."""
        first = 0
        while self.c[first] == 0.0:
            first += 1
            if first == TERMS:
                return 1.0, False
        reach = 1.0
        rest, most = self.coefficient_bounds(first, reach)
        for _ in range(MAX_BISECTIONS):
            if rest <= fabs(self.c[first]) + fabs(self.c[first + 1]) * reach:
                break
            reach *= 0.5
            rest, most = self.coefficient_bounds(first, reach)
        u = 0.0
        for _ in range(MAX_ITERATIONS):
            value = slope = 0.0
            for i in range(TERMS + 1 - first):
                slope = value + slope * u
                value = side * self.c[TERMS - i] + value * u
            if value <= 0.0:
                return u, True
            fall = sqrt(slope * slope + 2.0 * most * value) - slope
            if not 2.0 * value < (reach - u) * fall:
                return reach, False
            ahead = u + 2.0 * value / fall
            if ahead == u:
                return u, True
            u = ahead
        return u, False

    def coefficient_bounds(self, first, reach):
        """Of f/u^first up to there: of all terms but the first two, and of the second derivative."""
        rest = most = 0.0
        for i in range(TERMS - 1 - first):
            n = TERMS - first - i
            rest = fabs(self.c[first + n]) + rest * reach
            most = n * (n - 1) * fabs(self.c[first + n]) + most * reach
        return rest * reach * reach, most
