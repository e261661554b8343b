"""The state inside a step: one polynomial for all methods, of the degree that each of them needs.

At the fraction s of the step, with r = 1 - s,

    y = c0 + s (c1 + r (c2 + s (c3 + r (c4 + s (c5 + r (c6 + s c7))))))

so that the ends are met whatever c2 ... c7 are.  c0 ... c3 are the cubic of Hermite; what a method knows of the
inside of its step goes beyond (E. Hairer, S. P. Norsett, G. Wanner, Solving Ordinary Differential Equations I, II.6).
"""

from .vectors import StateVector


class Interpolant:
    """The coefficients for a step of the length `span`, once they are worked out."""

    c0: StateVector
    c1: StateVector
    c2: StateVector
    c3: StateVector
    c4: StateVector
    c5: StateVector
    c6: StateVector
    c7: StateVector

    def __init__(self):
        self.ready = False
        self.h = 0.0
        self.degree = 3
        self.n_event_evals = 0  # how often somebody looked for what may end inside a step
        self.c0 = self.c1 = self.c2 = self.c3 = self.c4 = self.c5 = self.c6 = self.c7 = 0.0

    def set_hermite_cubic(self, step):
        """The cubic with the values and slopes of both ends of a step."""
        h = step.h_full
        self.ready, self.h, self.degree = True, h, 3
        c1 = step.y1 - step.y0
        self.c0, self.c1 = step.y0, c1
        self.c2 = h * step.f0 - c1
        self.c3 = 2.0 * c1 - h * (step.f0 + step.f1)

    def evaluate(self, elapsed) -> StateVector:
        """The state, `elapsed` seconds after the step began."""
        s = elapsed / self.h
        r = 1.0 - s
        c = self.c3
        if self.degree > 3:
            if self.degree > 4:
                c = c + r * (self.c4 + s * (self.c5 + r * (self.c6 + s * self.c7)))
            else:
                c = c + r * self.c4
        return self.c0 + s * (self.c1 + r * (self.c2 + s * c))
