"""Polynomial in time for an input between two settings, given by its derivatives.

A prescribed motion is an input whose declared rate, another input, continues it. Where a model declares no rate, an
importer of FMI 2.0 may set the first derivative.
"""

from math import fabs

from .codes import MAX_INPUT_ORDER

SAME_VALUE, EXPLAINED_SHARE = 1e-6, 0.5  # relative jumps of a value that do not matter; share of its change
MAX_JUMPS = 3  # communication points in succession at which a value jumps


class InputPolynomial:
    """Input u(s) as a polynomial in s, the seconds since its derivatives were set."""

    def __init__(self):
        self.order = 0  # highest non-zero order; setting a derivative may raise it until set_value() is called
        self.derivatives = [0.0] * (MAX_INPUT_ORDER + 1)  # at s = 0, from order 0 on
        self.c = [0.0] * (MAX_INPUT_ORDER + 1)  # coefficients of the powers of s

    def set_value(self, value):
        """Set the value at s = 0 and recompute the coefficients from the derivatives."""
        self.derivatives[0] = self.c[0] = value
        highest, self.order = self.order, 0
        factorial = 1.0
        for n in range(1, highest + 1):
            factorial *= n
            self.c[n] = self.derivatives[n] / factorial
            if self.derivatives[n] != 0.0:
                self.order = n

    def value_at(self, s):
        """Return the value at s.

        There is no loop, because every evaluation of the right-hand side calls this.
        """
        return self.c[0] if self.order == 0 else self.c[0] + s * (self.c[1] + s * (self.c[2] + s * self.c[3]))

    def rate_at(self, s):
        """Return the first derivative at s."""
        return self.c[1] if self.order < 2 else self.derivative_at(s, 1)

    def derivative_at(self, s, n):
        """Return the n-th derivative at s."""
        total = 0.0
        for i in range(self.order + 1 - n):
            k = self.order - i
            total = self.derivatives[k] + total * s / (k + 1 - n)
        return total

    def shift_to(self, s):
        """Move the origin to s: update all derivatives there and return the value."""
        if self.order > 0:
            for n in range(self.order):
                self.derivatives[n] = self.derivative_at(s, n)
        return self.derivatives[0]


class PrescribedMotion(InputPolynomial):
    """Input with a declared rate.

    A new value need not be the one to which the rate has led, because the rate itself varies between communication
    points.  `deviation` bounds the difference that a change of the rate explains; a larger one is a jump.
    """

    def __init__(self):
        super().__init__()
        # before the last change: value at the previous change and time since then; the continued value and its rate
        self.last_value = self.elapsed = self.continued_value = self.continued_rate = 0.0
        # how far changes of the rate move the value: since it was set, up to now and up to the previous change; until
        # it was set
        self.drift = self.earlier_drift = self.last_drift = 0.0
        self.deviation = 0.0
        self.was_set = self.has_jumped = False
        self.n_jumps = 0  # communication points in succession at which the value has jumped

    def begin(self):
        """Start a run with the present value."""
        self.last_value = self.continued_value = self.derivatives[0]
        self.continued_rate = self.derivatives[1]
        self.elapsed = self.deviation = self.drift = self.earlier_drift = self.last_drift = 0.0
        self.was_set = self.has_jumped = False
        self.n_jumps = 0

    def continue_by(self, n, value):
        """Set the n-th derivative according to the rate."""
        self.derivatives[n] = value
        if n > self.order:
            self.order = n

    def shift_to(self, s):
        """Move the origin to s: update all derivatives there and return the value."""
        if s > 0.0:
            self.last_value, self.elapsed = self.derivatives[0], s
            if self.was_set:
                self.last_drift, self.earlier_drift = self.drift, 0.0
            else:
                self.earlier_drift = self.drift
            self.was_set = self.has_jumped = False
        if self.order > 0:
            for n in range(self.order):
                self.derivatives[n] = self.derivative_at(s, n)
        if s > 0.0:
            self.continued_value, self.continued_rate = self.derivatives[0], self.derivatives[1]
        return self.derivatives[0]

    def set_motion(self, value):
        """Set the value at s = 0, and note whether it jumps."""
        self.set_value(value)
        self.drift = self.earlier_drift + fabs(self.derivatives[1] - self.continued_rate) * self.elapsed
        # around an extremum of the rate, its values at both ends of a step may be equal
        self.deviation = self.drift if self.drift > self.last_drift else self.last_drift
        jump = fabs(value - self.continued_value)
        if jump != 0.0:
            self.was_set = True
        self.has_jumped = (
            jump > self.deviation
            and jump > SAME_VALUE * fabs(value)
            and jump > EXPLAINED_SHARE * fabs(value - self.last_value)
        )

    def count_jump(self):
        """Count the communication points in succession at which the value jumps; return whether they are many."""
        self.n_jumps = self.n_jumps + 1 if self.has_jumped else 0
        self.has_jumped = False
        return self.n_jumps >= MAX_JUMPS
