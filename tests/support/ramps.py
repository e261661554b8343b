"""One body under a force that changes at a constant rate, by power series in many digits: friction, spring and damper.

m a = F + R t + k u t - k x - c v - mode slide,   stuck while |F + R t + k u t - k x| <= hold
"""

from mpmath import mp, mpf

STEP, TERMS, HALVINGS = mpf(1) / 32, 50, 100
TIE = mpf("1e-25")


class Body:
    """Where it is at time t, under a force in whose course it has been pushed; `events` tells when its mode changed."""

    def __init__(self, m=1.0, k=0.0, c=0.0, hold=0.0, slide=0.0, u=0.0, x=0.0, v=0.0):
        self.m, self.k, self.c, self.hold, self.slide, self.u = map(mpf, (m, k, c, hold, slide, u))
        self.t, self.x, self.v, self.mode, self.events = mpf(0), mpf(x), mpf(v), 0, []

    def push(self, force, rate):
        """From here on there is this force, and it changes at this rate."""
        self.rate = rate + self.k * self.u
        self.force = force + self.k * self.u * self.t - self.rate * self.t
        self.mode = self.settled()

    def load(self):
        return self.force + self.rate * self.t - self.k * self.x

    def settled(self):
        """The mode that holds from here on; without dry friction any does."""
        load = self.load()
        if self.v or not self.hold:
            return mp.sign(self.v)
        near = TIE if load * self.rate > 0 else -TIE
        return 0 if abs(load) + near <= self.hold else mp.sign(load)

    def series(self):
        """The coefficients of position and speed, the highest first."""
        forces = [self.load() + self.k * self.x - self.mode * self.slide, self.rate]
        x = [self.x, self.v]
        for n in range(TERMS):
            force = forces[n] if n < 2 else 0
            x.append((force - self.k * x[n] - self.c * (n + 1) * x[n + 1]) / (self.m * (n + 1) * (n + 2)))
        return x[::-1], [n * one for n, one in enumerate(x)][:0:-1]

    def go(self, t):
        """Position and speed at time t."""
        while self.t < t:
            h = min(STEP, t - self.t)
            if self.hold and not self.mode:
                wait = (mp.sign(self.rate) * self.hold - self.load()) / self.rate if self.rate else mp.inf
                if wait > t - self.t:
                    self.t = mpf(t)
                else:
                    self.t, self.mode = self.t + wait, mp.sign(self.rate)
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
                self.mode = self.settled()
                self.events.append(self.t)
        return self.x, self.v


def value(series, h):
    """Of a polynomial, by its coefficients, the highest first."""
    total = mpf(0)
    for one in series:
        total = total * h + one
    return total
