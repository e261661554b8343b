"""Interpolant inside a step: one polynomial form for all methods, degree 3 to 7.

At the fraction s of the step, with r = 1 - s,

    y = c0 + s (c1 + r (c2 + s (c3 + r (c4 + s (c5 + r (c6 + s c7))))))

which matches both ends for any c2 ... c7.  c0 ... c3 give the cubic Hermite interpolant; c4 ... c7 add the information
of a method's stages (E. Hairer, S. P. Norsett, G. Wanner, Solving Ordinary Differential Equations I, II.6).
"""

from .vectors import StateVector


class Interpolant:
    """Coefficients for a step of size `h`; valid once `is_ready` is set."""

    c0: StateVector
    c1: StateVector
    c2: StateVector
    c3: StateVector
    c4: StateVector
    c5: StateVector
    c6: StateVector
    c7: StateVector

    def __init__(self):
        self.is_ready = False
        self.h = 0.0
        self.degree = 3
        self.n_event_evals = 0  # evaluations of event functions inside the step
        self.c0 = self.c1 = self.c2 = self.c3 = self.c4 = self.c5 = self.c6 = self.c7 = 0.0

    def set_hermite_cubic(self, step):
        """Set the cubic Hermite interpolant through the values and slopes at both ends of a step."""
        h = step.h_full
        self.is_ready, self.h, self.degree = True, h, 3
        c1 = step.y1 - step.y0
        self.c0, self.c1 = step.y0, c1
        self.c2 = h * step.f0 - c1
        self.c3 = 2.0 * c1 - h * (step.f0 + step.f1)

    def set_line(self, step):
        """Set the straight line between both ends of a step."""
        self.is_ready, self.h, self.degree = True, step.h_full, 3
        self.c0, self.c1 = step.y0, step.y1 - step.y0
        self.c2 = self.c3 = 0.0

    def evaluate(self, elapsed) -> StateVector:
        """Return the state `elapsed` seconds after the start of the step."""
        s = elapsed / self.h
        r = 1.0 - s
        c = self.c3
        if self.degree > 3:
            if self.degree > 4:
                c = c + r * (self.c4 + s * (self.c5 + r * (self.c6 + s * self.c7)))
            else:
                c = c + r * self.c4
        return self.c0 + s * (self.c1 + r * (self.c2 + s * c))


def smallest_of(a, b, c, d):
    """Return the smallest of four numbers."""
    ab = a if a < b else b
    cd = c if c < d else d
    return ab if ab < cd else cd


def largest_of(a, b, c, d):
    """Return the largest of four numbers."""
    ab = a if a > b else b
    cd = c if c > d else d
    return ab if ab > cd else cd
