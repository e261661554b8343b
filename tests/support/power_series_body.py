"""One body with friction, spring and damper under a polynomial force, solved by power series in many digits.

m a = F(t) + k u t - k x - c v - mode slide,   stuck while |F(t) + k u t - k x| <= hold
"""

from decimal import Decimal, localcontext
from itertools import pairwise
from math import factorial

import numpy as np

STEP, TERMS, HALVINGS, NEWTONS, DIGITS = Decimal(1) / 16, 50, 100, 8, 34
TIE = Decimal("1e-25")


class Body:
    """The state at time t; `events` lists the times of mode changes."""

    def __init__(self, m=1.0, k=0.0, c=0.0, hold=0.0, slide=0.0, u=0.0, x=0.0, v=0.0):
        self.m, self.k, self.c, self.hold, self.slide, self.u = map(Decimal, (m, k, c, hold, slide, u))
        self.t, self.x, self.v, self.mode, self.events = Decimal(0), Decimal(x), Decimal(v), 0, []
        self.force, self.push_time = [Decimal(0)], Decimal(0)

    def push(self, *force):
        """Set the force and its leading derivatives at the current time; higher derivatives continue."""
        self.force, self.push_time = [*map(Decimal, force), *self.course()[len(force) :]], self.t
        before, self.mode = self.mode, self.next_mode()
        self.events += [self.t] * bool(self.hold and self.t and self.mode != before)

    def course(self):
        """Return the current force and its derivatives."""
        s, n_terms = self.t - self.push_time, len(self.force)
        return [value([self.force[j] / factorial(j - n) for j in range(n, n_terms)][::-1], s) for n in range(n_terms)]

    def forces(self):
        """Return the load and its derivatives while the body does not move."""
        derivatives = [*self.course(), Decimal(0), Decimal(0)]
        derivatives[0] += self.k * (self.u * self.t - self.x)
        derivatives[1] += self.k * self.u
        return derivatives

    def next_mode(self):
        """Return the mode from the current time on; without dry friction any mode is right."""
        load, *rates = self.forces()
        if self.v or not self.hold:
            return sign(self.v)
        outward = next((load * rate > 0 for rate in rates if rate), False)
        return 0 if abs(load) + (TIE if outward else -TIE) <= self.hold else sign(load)

    def series(self):
        """Return the coefficients of position and speed, highest order first."""
        forces = self.forces()
        forces[0] += self.k * self.x - self.mode * self.slide
        x = [self.x, self.v]
        for n in range(TERMS):
            force = forces[n] / factorial(n) if n < len(forces) else 0
            x.append((force - self.k * x[n] - self.c * (n + 1) * x[n + 1]) / (self.m * (n + 1) * (n + 2)))
        return x[::-1], [n * coefficient for n, coefficient in enumerate(x)][:0:-1]

    def release(self):
        """Return the time until breakaway and its direction."""
        load, *others = [derivative / factorial(n) for n, derivative in enumerate(self.forces())]
        candidates = [(Decimal("inf"), 0)]
        for side in 1, -1:
            terms = [load - side * self.hold, *others]
            while terms and not terms[-1]:
                terms.pop()
            rates = [n * term for n, term in enumerate(terms)][1:]
            for root in np.polynomial.polynomial.polyroots([*map(float, terms or [1])]):
                wait = Decimal(root.real)
                for _ in range(NEWTONS * (abs(root.imag) < 1e-9)):
                    wait -= value(terms[::-1], wait) / value(rates[::-1], wait)
                candidates += [(wait, side)] * bool(abs(root.imag) < 1e-9 and wait > TIE)
        return min(candidates)

    def go(self, t):
        """Return position and speed at time t."""
        t = Decimal(t)
        while self.t < t:
            h = min(STEP, t - self.t)
            if self.hold and not self.mode:
                wait, side = self.release()
                if wait > t - self.t:
                    self.t = t
                else:
                    self.t, self.mode = self.t + wait, side
                    self.events.append(self.t)
                continue
            x, v = self.series()
            ends = self.hold and self.mode * value(v, h) <= 0
            if ends:
                low = h * TIE * (not self.v)
                for _ in range(HALVINGS):
                    middle = (low + h) / 2
                    low, h = (middle, h) if self.mode * value(v, middle) > 0 else (low, middle)
            self.t, self.x, self.v = self.t + h, value(x, h), value(v, h) * (not ends)
            if ends:
                self.mode = self.next_mode()
                self.events.append(self.t)
        return self.x, self.v


def sign(number):
    return (number > 0) - (number < 0)


def value(series, h):
    """Evaluate a polynomial from its coefficients, highest order first."""
    total = Decimal(0)
    for coefficient in series:
        total = total * h + coefficient
    return total


def sample_motion(body, pieces, times):
    """Return position, speed and last event time at each of the times, under a force that changes in pieces."""
    rows, remaining_pieces = [], list(pieces)
    with localcontext(prec=DIGITS):
        for t, end in pairwise([0.0, *times]):
            if remaining_pieces and remaining_pieces[0][0] == t:
                body.push(*remaining_pieces.pop(0)[1:])
            rows.append([*map(float, body.go(end)), float(body.events[-1]) if body.events else 0.0])
    return rows
