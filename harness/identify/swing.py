"""The free swing of an oscillator with viscous damping, dry friction and drag, one half cycle after the other.

In the time theta = omega t, with y the distance from rest and s the direction of motion, +1 or -1,

    y'' + 2 zeta y' + s b y'^2 + s r + y = 0         (a pendulum: sin y in place of y)

zeta = c/(2 m omega), r = f/k (a length), b = q/m (1/length) for a drag q v |v|, omega^2 = k/m.
Between turning points this is smooth, and y is its Taylor series: the terms follow from each other, so the swing is
known to rounding error whatever the law (A. Jorba, M. Zou, Experimental Mathematics 14 (2005), section 3).
"""

from collections.abc import Iterator
from dataclasses import dataclass
from math import copysign, cos, inf, isfinite, nan, pi, sin
from operator import mul

import numpy as np

ORDER = 30  # pi^30/30! = 3e-18: for a spring without drag one series lasts for a half cycle
SMALL = 1e-17  # share of the series that its last terms may be
LONGEST = 3.3  # of a series, in theta
MOST = 10_000  # half cycles

Piece = tuple[float, float, list[float]]  # begin and end in theta, and the series about the begin


@dataclass(frozen=True)
class Swing:
    """The constants of the motion; `sine`: the restoring torque is that of a pendulum."""

    zeta: float = 0.0
    r: float = 0.0
    b: float = 0.0
    sine: bool = False

    def series(self, y: float, v: float, s: float) -> list[float]:
        """Taylor coefficients (ORDER + 1,) of y in theta, from the state y, v and the direction s.

        sin y has a series that grows along: (sin y)' = y' cos y, (cos y)' = -y' sin y.
        """
        damping, drag, sine = 2 * self.zeta, s * self.b, self.sine
        y = y if isfinite(y) else nan  # a law that a fit tries may grow beyond all numbers
        terms, speeds, sines, cosines = [y, v], [v], [sin(y)], [cos(y)]
        for k in range(ORDER - 1):
            force = (sines if sine else terms)[k] + damping * speeds[k]
            if k == 0:
                force += s * self.r
            if drag:
                force += drag * sum(map(mul, speeds, reversed(speeds)))
            if sine:
                rise = sum(map(mul, speeds, reversed(cosines)))
                cosines.append(-sum(map(mul, speeds, reversed(sines))) / (k + 1))
                sines.append(rise / (k + 1))
            terms.append(-force / ((k + 1) * (k + 2)))
            speeds.append((k + 2) * terms[-1])
        return terms

    def sticks(self, y: float) -> bool:
        """Whether the motion ends at a turning point y."""
        return abs(sin(y) if self.sine and isfinite(y) else y) <= self.r

    def halves(self, y: float) -> Iterator[list[Piece]]:
        """The stretches of each half cycle from the turning point y at theta = 0 on, until the motion ends."""
        side, at = (1.0 if y > 0 else -1.0), 0.0
        for _ in range(MOST):
            if self.sticks(y):
                break
            stretches = list(self.half(at, y, -side, 1.0))
            yield stretches
            begin, at, terms = stretches[-1]
            y, side = value(terms, at - begin), -side

    def pieces(self, y: float) -> Iterator[Piece]:
        """All stretches from the turning point y at theta = 0 on, the rest at their end included."""
        at = 0.0
        for stretches in self.halves(y):
            yield from stretches
            begin, at, terms = stretches[-1]
            y = value(terms, at - begin)
        yield at, inf, [y]

    def half(self, at: float, y: float, s: float, way: float) -> Iterator[Piece]:
        """The stretches of a half cycle from the turning point y at theta = `at`, forward or backward in time."""
        v, fresh = 0.0, True
        for _ in range(100):  # more would be a motion that diverges backward in time
            terms = self.series(y, v, s)
            h = way * reach(terms)
            root = standstill(terms, h, fresh)
            yield at, at + (h if root is None else root), terms
            if root is not None:
                break
            at, y, v, fresh = at + h, value(terms, h), value(slopes(terms), h), False


def reach(terms: list[float]) -> float:
    """How far a series is good: where its last two terms are SMALL beside its largest."""
    size = max(map(abs, terms))
    steps = [(SMALL * size / abs(terms[k])) ** (1 / k) for k in (ORDER - 1, ORDER) if terms[k]]
    return min([LONGEST, *(1.5 * h for h in steps)])


def standstill(terms: list[float], h: float, fresh: bool) -> float | None:
    """Where between 0 and h the speed of a series is zero, or None; `fresh`: but for the turning point at 0."""
    speed = slopes(terms)[1:] if fresh else slopes(terms)  # a root at zero is divided out
    bend, low, high = slopes(speed), 0.0, h
    at_low = value(speed, low)
    if not at_low * value(speed, high) < 0:
        return None
    root = high if abs(high) < pi else copysign(pi, high)
    for _ in range(60):
        f = value(speed, root)
        low, high = (root, high) if f * at_low > 0 else (low, root)
        slope = value(bend, root)
        new = root - f / slope if slope else low
        if not min(low, high) <= new <= max(low, high):
            new = 0.5 * (low + high)
        if abs(new - root) <= 1e-16 * abs(root):
            break
        root = new
    return root


def slopes(terms: list[float]) -> list[float]:
    """The series of the derivative."""
    return [k * term for k, term in enumerate(terms)][1:]


def value(terms: list[float], h: float) -> float:
    """A series at h, by Horner's rule."""
    total = 0.0
    for term in reversed(terms):
        total = total * h + term
    return total


def motion(swing: Swing, omega: float, turn: float, y: float, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Positions and speeds (n,) at the rising times t (n,) in s, where y at the time `turn` is a turning point.

    The times may begin up to a half cycle before it.
    """
    theta = omega * (t - turn)
    places, speeds = np.empty_like(theta), np.empty_like(theta)
    done = first = int(np.searchsorted(theta, 0.0))
    for begin, end, terms in swing.half(0.0, y, copysign(1.0, y), -1.0):
        if not done:
            break
        low = int(np.searchsorted(theta[:done], end))
        fill(theta, places, speeds, low, done, begin, terms)
        done = low
    places[:done], speeds[:done] = value(terms, end - begin), 0.0
    done = first
    for begin, end, terms in swing.pieces(y):
        high = int(np.searchsorted(theta, end))
        fill(theta, places, speeds, done, high, begin, terms)
        done = high
        if done == len(theta):
            break
    return places, omega * speeds


def fill(
    theta: np.ndarray, places: np.ndarray, speeds: np.ndarray, low: int, high: int, begin: float, terms: list[float]
) -> None:
    """Evaluate a series and its slope for the samples from low to high."""
    if low < high:
        h = theta[low:high] - begin
        total, slope = np.zeros_like(h), np.zeros_like(h)
        for term in reversed(terms):
            slope = slope * h + total
            total = total * h + term
        places[low:high], speeds[low:high] = total, slope
