"""Closed forms of the piecewise linear models, in 120 digits.

    m x'' + c x' + k x = P + k u s          P holds from one event to the next, u is the speed of the driver
    x = q + u s + A e^(r1 s) + B e^(r2 s)   r1, r2 the roots of m r^2 + c r + k,  q = (P - c u)/k

A double root and a missing spring are approached to 1e-40, which costs at most 80 of the digits.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

from mpmath import MPContext

from .segments import Friction, MotionFunction, ParameterSpan, ParameterValues, Segment, constant_velocity, shift_time

mp = MPContext()  # a context of its own: the precision of others stays theirs
mp.dps = 120
mpf = mp.mpf
TINY = mpf(10) ** -40
GRAZING_FRACTION = mpf(10) ** -30  # of the speed: what only touches zero is no standstill


@dataclass(frozen=True)
class SpringMassSystem:
    """The forces of one span: `slide` and `hold` are those of friction; `u` is the speed of the driver, and of one that
    pulls as the input does that grows, which alone has the speed `ramp`."""

    m: Any
    k: Any
    c: Any
    slide: Any
    hold: Any
    u: Any
    ramp: Any
    push: Any
    dry: bool

    def load(self, x: Any, drive: Any) -> Any:
        """What a body at rest feels without friction."""
        return self.push + self.k * (drive - x)

    def direction(self, load: Any) -> int:
        """Where a body at rest goes: nowhere while friction can hold the load."""
        return 0 if abs(load) <= self.hold else 1 if load > 0 else -1


def system(values: ParameterValues, friction: Friction | None) -> SpringMassSystem:
    """The system that a model's values make."""
    value = {name: mpf(number) for name, number in values.items()}
    slide, hold = friction(value) if friction else (mpf(0), mpf(0))
    rate = value.get("rate", mpf(0))
    ramp = rate / value["k"] if rate else rate
    c, u = value.get("c", mpf(0)), value.get("v_driver", mpf(0)) + ramp
    return SpringMassSystem(value["m"], value["k"], c, slide, hold, u, ramp, value["F_ext"], friction is not None)


def pieces(spans: list[ParameterSpan], friction: Friction | None = None) -> Iterator[Segment]:
    """The pieces of the motion, each from an event or a change of values on; `friction` tells what slides and what
    holds."""
    x, v, drive = mpf(spans[0][2]["x0"]), mpf(spans[0][2]["v0"]), mpf(0)
    for begin, end, values in spans:
        s = system(values, friction)
        t, load = mpf(begin), s.load(x, drive)
        mode = 1 if not s.dry else (1 if v > 0 else -1) if v != 0 else s.direction(load)
        while True:
            stuck = s.dry and mode == 0
            at = constant_velocity(x, mpf(0)) if stuck else sliding_motion(s, x, v, load - mode * s.slide)
            yield Segment(t, mode, shift_time(at, t))
            wait = (
                time_to_breakaway(s, load)
                if stuck
                else time_to_standstill(s, mode, v, load - mode * s.slide)
                if s.dry
                else None
            )
            ahead = mpf(end) - t if wait is None or t + wait >= end else wait
            x, v = at(ahead)
            t, drive = t + ahead, drive + s.u * ahead
            if ahead != wait:
                break
            v, load = mpf(0), s.load(x, drive)
            if stuck:  # the load is the limit by definition: no rounding decides the direction
                mode = 1 if s.u > 0 else -1
                load = mode * s.hold
            else:
                mode = s.direction(load)
        drive -= s.ramp * (mpf(end) - mpf(begin))


def threshold_segments(s: SpringMassSystem, eps: float, stop: float) -> Iterator[Segment]:
    """The sled, from rest, under the threshold law with `eps` (m/s) in the limit of exact integration.

    It is held below the speed eps only as far as friction can: it starts with the friction that holds until it is as
    fast as eps, slides, and, once it has slowed down to eps, glides on at that speed until the pull exceeds what
    friction holds.
    """
    level = mpf(eps)
    t, x, v = mpf(0), mpf(0), mpf(0)
    while t < stop:
        yield Segment(t, 0, shift_time(constant_velocity(x, v), t))
        wait = (s.hold - s.load(x, s.u * t)) / (s.k * (s.u - v))
        t, x = t + wait, x + v * wait
        if v < level:
            heavy = sliding_motion(s, x, v, s.load(x, s.u * t) - s.hold)
            yield Segment(t, 0, shift_time(heavy, t))
            wait = mp.acos((s.u - level) / (s.u - v)) / mp.sqrt(s.k / s.m)  # v = u - (u - v0) cos(w s)
            t, x = t + wait, heavy(wait)[0]
        net = s.load(x, s.u * t) - s.slide
        slip = sliding_motion(s, x, level, net)
        yield Segment(t, 1, shift_time(slip, t))
        wait = time_to_standstill(replace(s, u=s.u - level), 1, mpf(0), net)  # seen by who moves at the level
        t, x, v = t + wait, slip(wait)[0], level


def sliding_motion(s: SpringMassSystem, x: Any, v: Any, net: Any) -> MotionFunction:
    """Position and speed from x, v on; `net` is the force at the beginning without that of the damper."""
    k = s.k or TINY
    r1, r2 = characteristic_roots(s, k)
    rest = (net - s.c * s.u) / k  # of q - x
    a = (v - s.u + r2 * rest) / (r1 - r2)
    b = -rest - a

    def at(time: Any) -> tuple[Any, Any]:
        first, second = a * mp.exp(r1 * time), b * mp.exp(r2 * time)
        return x + rest + s.u * time + mp.re(first + second), s.u + mp.re(r1 * first + r2 * second)

    return at


def characteristic_roots(s: SpringMassSystem, k: Any) -> tuple[Any, Any]:
    """The roots of m r^2 + c r + k, never equal."""
    spread = mp.sqrt((s.c * s.c - 4 * s.m * k) or TINY)
    return (-s.c + spread) / (2 * s.m), (-s.c - spread) / (2 * s.m)


def time_to_breakaway(s: SpringMassSystem, load: Any) -> Any:
    """Time until the load on a body at rest is what friction can hold, or None."""
    rate = s.k * s.u
    return None if rate == 0 else (s.hold - mp.sign(rate) * load) / abs(rate)


def time_to_standstill(s: SpringMassSystem, mode: int, v: Any, net: Any) -> Any:
    """Time until the speed leaves the sign of the mode, or None."""
    k = s.k or TINY
    if s.c == 0:  # v = u + size cos(w s - phase)
        w = mp.sqrt(k / s.m)
        p, q = v - s.u, net / s.m / w
        size, phase = mp.hypot(p, q), mp.atan2(q, p)
        if size - abs(s.u) <= GRAZING_FRACTION * size:
            return None
        return positive_angle(phase + mode * mp.acos(-s.u / size), 2 * mp.pi) / w
    if s.u != 0:
        raise ValueError("a damper and a moving driver have no closed standstill")
    r1, r2 = characteristic_roots(s, k)
    a = (net - s.c * v) / s.m
    ratio = (a - r1 * v) / (a - r2 * v) if a != r2 * v else mpf(0)  # v = 0 where e^((r1 - r2) s) is this
    if mp.im(r1) != 0:
        return positive_angle(mp.arg(ratio), 2 * mp.pi) / (2 * mp.im(r1))
    late = mp.log(ratio) / (r1 - r2) if ratio > 0 else mpf(0)
    return late if late > TINY else None


def positive_angle(angle: Any, whole: Any) -> Any:
    """The angle in (0, whole]; one that is zero but for rounding is a whole turn."""
    part = angle % whole
    return whole if part < TINY else part
