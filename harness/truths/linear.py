"""Piecewise linear motion in closed form, in 40 digits.

In a piece the body swings about a resting point that moves at the constant speed u:

    x = p + u s + exp(-z s) (A cos(w s) + B sin(w s))         s from the beginning of the piece
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

from mpmath import acos, atan2, cos, exp, inf, mpf, pi, sin, sqrt, workdps

DIGITS = 40
ZERO = mpf(0)

Samples = list[tuple[mpf, mpf]]
ModeChanges = list[tuple[mpf, int]]


@dataclass(frozen=True)
class Swing:
    """Oscillation from x, v about p + u s: angular frequency w in 1/s, decay z in 1/s."""

    x: mpf
    v: mpf
    p: mpf
    u: mpf
    w: mpf
    z: mpf = ZERO

    def at(self, s: mpf) -> tuple[mpf, mpf]:
        a = self.x - self.p
        b = (self.v - self.u + self.z * a) / self.w
        e, c, d = exp(-self.z * s), cos(self.w * s), sin(self.w * s)
        swing = e * (a * c + b * d)
        return self.p + self.u * s + swing, self.u - self.z * swing + self.w * e * (b * c - a * d)

    def falls_to(self, level: mpf, mode: int) -> mpf:
        """When, without decay, mode v next falls to the level; inf if it never does.

        v = u + R cos(w s - phi) falls where the argument of the cosine lies in (0, pi).
        """
        along, across = mode * (self.v - self.u), mode * self.w * (self.p - self.x)
        reach, phi = sqrt(along**2 + across**2), atan2(across, along)
        share = (level - mode * self.u) / reach
        if abs(share) > 1:
            return inf
        turn = phi + acos(share)
        return (turn if turn > 0 else turn + 2 * pi) / self.w


@dataclass(frozen=True)
class Glide:
    """Constant speed v, zero for a stuck body."""

    x: mpf
    v: mpf

    def at(self, s: mpf) -> tuple[mpf, mpf]:
        return self.x + self.v * s, self.v


Leg = tuple[mpf, int, Swing | Glide]  # its beginning, the mode, the motion


def smd() -> Iterator[Leg]:
    """Spring, mass and damper: one piece."""
    m, k, c = mpf(1.0), mpf(157.9), mpf(2.0)
    z = c / (2 * m)
    yield mpf(0), 1, Swing(mpf(0.1), mpf(0), mpf(0), mpf(0), sqrt(k / m - z * z), z)


def coulomb() -> Iterator[Leg]:
    """Spring and mass with Coulomb friction: swings about +- f/k."""
    m, k, f = mpf(1.0), mpf(157.9), mpf(0.5)
    t, x = mpf(0), mpf(0.1)
    while abs(k * x) > f:
        mode = -1 if x > 0 else 1
        piece = Swing(x, mpf(0), -mode * f / k, mpf(0), sqrt(k / m))
        yield t, mode, piece
        s = piece.falls_to(mpf(0), mode)
        t, x = t + s, piece.at(s)[0]
    yield t, 0, Glide(x, mpf(0))


def stickslip(eps: mpf | None = None) -> Iterator[Leg]:
    """The sled, pulled at u; with `eps` (m/s) that of the threshold law, in the limit of exact integration.

    There the sled is held below the speed eps only as far as friction can: it starts with the friction mu_s until
    it is as fast as eps, slides, and, once it has slowed down to eps, glides on at that speed until the pull exceeds
    what friction holds.
    """
    m, k, g, mu_s, mu_d, u = (mpf(value) for value in (12.5, 742.5, 9.81, 0.9, 0.6, 0.034))
    w, sliding, holding = sqrt(k / m), mu_d * m * g / k, mu_s * m * g / k  # as stretch of the spring
    level = eps or mpf(0)
    t, x, v = mpf(0), mpf(0), mpf(0)
    while True:
        yield t, 0, Glide(x, v)
        t, x = (s := (holding - (u * t - x)) / (u - v)) + t, x + v * s
        if v < level:
            heavy = Swing(x, v, u * t - holding, u, w)
            yield t, 0, heavy
            s = acos((u - level) / (u - v)) / w  # v = u - (u - v0) cos(w s)
            t, x = t + s, heavy.at(s)[0]
        slip = Swing(x, level, u * t - sliding, u, w)
        yield t, 1, slip
        s = slip.falls_to(level, 1)
        t, x, v = t + s, slip.at(s)[0], level


def threshold() -> Iterator[Leg]:
    return stickslip(mpf(1e-7))


def sampled(law: Callable[[], Iterator[Leg]], times: list[float]) -> tuple[Samples, ModeChanges]:
    """The motion of a law at the times, and the changes of mode up to the last of them."""
    motion: Samples = []
    events: ModeChanges = []
    with workdps(DIGITS):
        pieces = law()
        current = next(pieces)
        coming = next(pieces, None)
        for t in times:
            while coming is not None and coming[0] <= t:
                if coming[1] != current[1]:
                    events.append(coming[:2])
                current, coming = coming, next(pieces, None)
            motion.append(current[2].at(mpf(t) - current[0]))
    return motion, events
