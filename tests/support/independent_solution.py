"""Independent closed-form solution of the piecewise linear oscillators in 80-digit arithmetic, the reference for the
FMUs.

Between two changes of mode or of force, with s the time since the last one and y = x - x(0),

    m y'' + c y' + k y = N + R s,    y(0) = 0, y'(0) = v

(N the net force at the start, R its rate).  With r1, r2 the roots of m r^2 + c r + k = 0, and [a, b, ...] the divided
difference of exp(r s) over the nodes a, b, ..., which covers every damping regime in one formula,

    G = [r2, r1],  I = [r2, r1, 0],  J = [r2, r1, 0, 0]          (G, its integral, and the integral of that)
    y = v G + (N I + R J)/m,    y' = v (exp(r2 s) + r1 G) + (N G + R I)/m

Nothing here is shared with the code under test. 80 digits leave a margin for the cancellation of nearly equal nodes.
"""

from bisect import bisect_right
from dataclasses import dataclass
from itertools import count, takewhile

from mpmath import atan2, atanh, exp, factorial, findroot, im, mp, mpf, pi, re, sign, sqrt

mp.dps = 80
TOUCH_TOLERANCE = mpf(10) ** -40  # a smaller speed only touches zero; a load closer to the limit equals the limit
ROUNDING = mpf(10) ** -75  # of a speed; roots cannot be located more accurately


@dataclass(frozen=True)
class System:
    """Forces of one span of time (SI units): `slide` and `hold` are the friction forces, `speed` is that of the
    driver."""

    m: float
    k: float
    c: float = 0.0
    slide: float = 0.0
    hold: float = 0.0
    speed: float = 0.0
    push: float = 0.0
    dry: bool = True

    def load(self, x, drive):
        """Return the force on the mass without friction and damping."""
        return mpf(self.push) + mpf(self.k) * (drive - x)

    @property
    def rate(self):
        """Rate of the load while the mass rests."""
        return mpf(self.k) * mpf(self.speed)


def smd(m=1.0, k=157.9, c=2.0, F_ext=0.0):
    return System(m, k, c, push=F_ext, dry=False)


def coulomb(m=1.0, k=157.9, c=0.0, f=0.5, F_ext=0.0):
    return System(m, k, c, f, f, push=F_ext)


def stickslip(m=12.5, k=742.5, mu_s=0.9, mu_d=0.6, g=9.81, v_driver=0.034, F_ext=0.0):
    weight = mpf(m) * mpf(g)
    return System(m, k, slide=mu_d * weight, hold=mu_s * weight, speed=v_driver, push=F_ext)


class LinearSegment:
    """One linear segment: displacement, speed, and the first sign change of the speed."""

    def __init__(self, system, net, v):
        self.m, self.c, self.k = mpf(system.m), mpf(system.c), mpf(system.k)
        self.net, self.rate, self.v = mpf(net), system.rate, mpf(v)
        spread = sqrt(self.c**2 - 4 * self.m * self.k)
        self.roots = [(-self.c - spread) / (2 * self.m), (-self.c + spread) / (2 * self.m)]

    def at(self, s):
        """Return displacement y and speed y' at s."""
        G, I, J = (divided_difference([*self.roots, *[mpf(0)] * zeros], s) for zeros in range(3))  # noqa: E741
        y = self.v * G + (self.net * I + self.rate * J) / self.m
        v = self.v * (exp(self.roots[0] * s) + self.roots[1] * G) + (self.net * G + self.rate * I) / self.m
        return re(y), re(v)

    def flats(self):
        """Yield the times s > 0, in order, where the acceleration is zero; the speed is monotonic between them.

        a = exp(-d s) (a0 cos(w s) + b/w sin(w s)) with d = c/(2 m), w^2 = k/m - d^2, b = a'(0) + d a0.
        """
        d = self.c / (2 * self.m)
        a = (self.net - self.c * self.v) / self.m
        b = (self.rate - self.c * a - self.k * self.v) / self.m + d * a
        square = self.k / self.m - d**2
        if a == b == 0:
            return
        if square > 0:
            w = sqrt(square)
            first = atan2(-a * w, b) % pi
            yield from ((first + n * pi) / w for n in count(0 if first > 0 else 1))
        elif b != 0:
            w = sqrt(-square)
            if 0 < -a * w / b < 1:
                yield atanh(-a * w / b) / w
            elif w == 0 < -a / b:
                yield -a / b

    def turning_point(self, mode, horizon, catches):
        """Return the first s in (0, horizon] where the speed leaves the sign of `mode`, or None.

        `catches`: static friction is larger, so that a speed that only touches zero sticks.
        """
        low = mpf(0)
        for high in [*takewhile(lambda s: s < horizon, self.flats()), mpf(horizon)]:
            if catches and abs(self.at(high)[1]) <= TOUCH_TOLERANCE:
                return high
            if mode * self.at(high)[1] < -TOUCH_TOLERANCE:
                for _ in range(60):  # the speed may grow by many powers of ten up to `high`
                    middle = (low + high) / 2
                    low, high = (middle, high) if mode * self.at(middle)[1] > 0 else (low, middle)
                return findroot(lambda s: self.at(s)[1], (low, high), solver="anderson", tol=ROUNDING, maxsteps=200)
            low = high
        return None


def divided_difference(nodes, s):
    """Return the divided difference of exp(r s) over the nodes r."""
    nodes = sorted(nodes, key=lambda r: (re(r), im(r)))  # so that equal nodes are neighbours
    row = first = [exp(r * s) for r in nodes]
    for n in range(1, len(nodes)):
        row = [
            (b - a) / (high - low) if high != low else s**n / factorial(n) * start
            for a, b, low, high, start in zip(row, row[1:], nodes, nodes[n:], first, strict=False)
        ]
    return row[0]


class Standstill:
    """A mass at rest."""

    @staticmethod
    def at(s):
        return mpf(0), mpf(0)


class ClosedFormMotion:
    """The motion from the state (x, v) over spans of constant parameters, up to `stop`.

    `spans` is a list of (time, System), the first of them at the start time.  `events` lists (time, new mode) for every
    change of mode (-1, 0, 1; always 1 without dry friction).
    """

    def __init__(self, spans, x, v, stop):
        self.starts, self.modes, self.parts, self.events = [], [], [], []
        self.t, self.x, self.v, self.drive = mpf(spans[0][0]), mpf(x), mpf(v), mpf(0)
        for (_, system), end in zip(spans, [mpf(t) for t, _ in spans[1:]] + [mpf(stop)], strict=True):
            self.span(system, end)

    def span(self, system, end):
        """Append the segments from the current point to `end`."""
        load, rate = system.load(self.x, self.drive), system.rate
        mode = (int(sign(self.v)) or direction(load, rate, system.hold)) if system.dry else 1
        net = load - mode * system.slide
        while True:
            is_stuck = system.dry and mode == 0
            piece = Standstill() if is_stuck else LinearSegment(system, net, self.v)
            self.append(mode, piece)
            if not system.dry:
                s = None
            elif is_stuck:
                s = None if rate == 0 else (sign(rate) * system.hold - load) / rate
            else:
                s = piece.turning_point(mode, end - self.t, catches=system.hold > system.slide)
            if s is None or self.t + s >= end:
                self.move(system, piece, end - self.t)
                return
            self.move(system, piece, s)
            self.v, load = mpf(0), system.load(self.x, self.drive)
            # at a breakaway the load equals the limit by definition, so that rounding does not decide the direction
            mode = int(sign(rate)) if is_stuck else direction(load, rate, system.hold)
            net = mode * (system.hold - system.slide) if is_stuck else load - mode * system.slide

    def append(self, mode, piece):
        if self.modes and mode != self.modes[-1]:
            self.events.append((self.t, mode))
        self.starts.append(self.t)
        self.modes.append(mode)
        self.parts.append((self.x, piece))

    def move(self, system, piece, s):
        y, self.v = piece.at(s)
        self.t, self.x, self.drive = self.t + s, self.x + y, self.drive + mpf(system.speed) * s

    def at(self, t):
        """Return position and speed at time t."""
        i = max(bisect_right(self.starts, t) - 1, 0)
        x, piece = self.parts[i]
        y, v = piece.at(mpf(t) - self.starts[i])
        return x + y, v


def direction(load, rate, limit):
    """Return the direction of motion from rest, or 0 while friction can hold the load.

    A load equal to the limit is held, unless it is about to exceed it.
    """
    for side in (-1, 1):
        if side * load > limit + TOUCH_TOLERANCE or (side * rate > 0 and side * load > limit - TOUCH_TOLERANCE):
            return side
    return 0


def spans(make, values, changes):
    """Return the start of each span between changes of values, and what `make` returns for its values."""
    result = [(0.0, make(**values))]
    for t in sorted(changes):
        values = {**values, **changes[t]}
        result.append((t, make(**values)))
    return result
