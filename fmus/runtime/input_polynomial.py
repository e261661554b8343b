"""Polynomial in time for an input between two settings, given by its derivatives."""

from .codes import MAX_INPUT_ORDER


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
        return (
            self.c[0]
            if self.order == 0
            else self.c[0] + s * (self.c[1] if self.order == 1 else self.higher_order_change(s))
        )

    def higher_order_change(self, s):
        """Return (u(s) - u(0)) / s."""
        c = self.c[4] + s * (self.c[5] + s * (self.c[6] + s * (self.c[7] + s * self.c[8])))
        return self.c[1] + s * (self.c[2] + s * (self.c[3] + s * c))

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
