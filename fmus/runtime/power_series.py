"""Power series over a time interval and its first zero, for motions and loads without a closed form.

f(u) = sum c_j u^j, where u in [0, 1] is the elapsed fraction of the interval.  While |f''| <= M, f(u + d) stays above
the parabola f + f' d - M d^2/2.  Stepping to the zero of that parabola therefore cannot jump over a zero of f.
"""

from math import fabs, sqrt

TERMS = 20  # enough for a motion whose largest eigenvalue times the interval is 1
MAX_BISECTIONS, MAX_ITERATIONS = 200, 100


class PowerSeries:
    """Coefficients, and the duration of the interval in s."""

    def __init__(self):
        self.duration = 0.0
        self.c = [0.0] * (TERMS + 1)

    def first_zero(self, side):
        """Find the first zero of a series that has the sign of `side` (1 or -1) at first.

        A series that starts at zero has the sign of its first non-zero term.  The search covers only the part of the
        interval where the first two terms dominate.

        Returns
        -------
        tuple
            The fraction of the interval up to which the sign is known, and whether there is a zero.
        """
        first = 0
        while self.c[first] == 0.0:
            first += 1
            if first == TERMS:
                return 1.0, False
        reach = 1.0
        higher_terms, curvature = self.coefficient_bounds(first, reach)
        for _ in range(MAX_BISECTIONS):
            if higher_terms <= fabs(self.c[first]) + fabs(self.c[first + 1]) * reach:
                break
            reach *= 0.5
            higher_terms, curvature = self.coefficient_bounds(first, reach)
        u = 0.0
        for _ in range(MAX_ITERATIONS):
            value = slope = 0.0
            for i in range(TERMS + 1 - first):
                slope = value + slope * u
                value = side * self.c[TERMS - i] + value * u
            if value <= 0.0:
                return u, True
            descent = sqrt(slope * slope + 2.0 * curvature * value) - slope
            if not 2.0 * value < (reach - u) * descent:
                return reach, False
            u_next = u + 2.0 * value / descent
            if u_next == u:
                return u, True
            u = u_next
        return u, False

    def coefficient_bounds(self, first, reach):
        """Bound, for f/u^first on [0, reach], the terms beyond the first two and the second derivative."""
        higher_terms = curvature = 0.0
        for i in range(TERMS - 1 - first):
            n = TERMS - first - i
            higher_terms = fabs(self.c[first + n]) + higher_terms * reach
            curvature = n * (n - 1) * fabs(self.c[first + n]) + curvature * reach
        return higher_terms * reach * reach, curvature
