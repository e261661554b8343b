"""An input that changes while nobody sets it: a polynomial in time, known by its derivatives."""

from .codes import MAX_INPUT_ORDER


class InputPolynomial:
    """Its derivatives at one time, from order 0 on; s is how many seconds have passed since."""

    def __init__(self):
        self.order = 0  # of the highest that is not zero; where one has been set, a higher one until begin()
        self.derivatives = [0.0] * (MAX_INPUT_ORDER + 1)
        self.c = [0.0] * (MAX_INPUT_ORDER + 1)  # the coefficients of the powers of s

    def set_value(self, value):
        """The value is this one; some derivatives may have been set."""
        self.derivatives[0] = self.c[0] = value
        highest, self.order = self.order, 0
        factorial = 1.0
        for n in range(1, highest + 1):
            factorial *= n
            self.c[n] = self.derivatives[n] / factorial
            if self.derivatives[n] != 0.0:
                self.order = n

    def value_at(self, s):
        """The value; without loops and faults, for every right-hand side wants it."""
        return (
            self.c[0]
            if self.order == 0
            else self.c[0] + s * (self.c[1] if self.order == 1 else self.higher_order_change(s))
        )

    def higher_order_change(self, s):
        """What it has changed by since then, over s."""
        c = self.c[4] + s * (self.c[5] + s * (self.c[6] + s * (self.c[7] + s * self.c[8])))
        return self.c[1] + s * (self.c[2] + s * (self.c[3] + s * c))

    def rate_at(self, s):
        """The first derivative."""
        return self.c[1] if self.order < 2 else self.derivative_at(s, 1)

    def derivative_at(self, s, n):
        """The n-th derivative."""
        total = 0.0
        for i in range(self.order + 1 - n):
            k = self.order - i
            total = self.derivatives[k] + total * s / (k + 1 - n)
        return total

    def shift_to(self, s):
        """Tell all derivatives as they are now, and the value."""
        if self.order > 0:
            for n in range(self.order):
                self.derivatives[n] = self.derivative_at(s, n)
        return self.derivatives[0]
