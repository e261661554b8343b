"""Position and speed inside a step: one polynomial for all methods, of the degree that each of them needs.

At the fraction s of the step, with r = 1 - s,

    x = p0 + s (p1 + r (p2 + s (p3 + r (p4 + s (p5 + r (p6 + s p7))))))          v likewise from q0 ... q7

so that the ends are met whatever p2 ... p7 are.  p0 ... p3 are the cubic of Hermite; what a method knows of the
inside of its step goes beyond (E. Hairer, S. P. Norsett, G. Wanner, Solving Ordinary Differential Equations I, II.6).
"""


class Interpolant:
    """The coefficients for a step of the length `span`, once they are worked out."""

    def __init__(self):
        self.ready = False
        self.span = 0.0
        self.degree = 3
        self.p0 = self.p1 = self.p2 = self.p3 = self.p4 = self.p5 = self.p6 = self.p7 = 0.0
        self.q0 = self.q1 = self.q2 = self.q3 = self.q4 = self.q5 = self.q6 = self.q7 = 0.0

    def meet(self, step):
        """The cubic with the values and slopes of both ends of a step."""
        self.meet_values(step)
        h, q = step.span, self.q1
        self.q2, self.q3 = h * step.a0 - q, 2.0 * q - h * (step.a0 + step.a1)

    def meet_values(self, step):
        """The same but for the slopes of the speed, q2 and q3."""
        h, x, v, v1 = step.span, step.x0, step.v0, step.v1
        self.ready, self.span, self.degree = True, h, 3
        p = step.x1 - x
        self.p0, self.p1 = x, p
        self.p2, self.p3 = h * v - p, 2.0 * p - h * (v + v1)
        self.q0, self.q1 = v, v1 - v

    def at(self, elapsed):
        """Position and speed, `elapsed` seconds after the step began."""
        s = elapsed / self.span
        r = 1.0 - s
        p, q = self.p3, self.q3
        if self.degree > 3:
            if self.degree > 4:
                p += r * (self.p4 + s * (self.p5 + r * (self.p6 + s * self.p7)))
                q += r * (self.q4 + s * (self.q5 + r * (self.q6 + s * self.q7)))
            else:
                p, q = p + r * self.p4, q + r * self.q4
        return self.p0 + s * (self.p1 + r * (self.p2 + s * p)), self.q0 + s * (self.q1 + r * (self.q2 + s * q))
