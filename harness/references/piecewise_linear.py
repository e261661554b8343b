"""Closed forms of the piecewise linear models, in 120 digits.

    m x'' + c x' + k x = P + k u s          P is constant from one event to the next, u is the velocity of the driver
    x = q + u s + A e^(r1 s) + B e^(r2 s)   r1, r2 the roots of m r^2 + c r + k,  q = (P - c u)/k

A double root is separated, and a missing spring replaced, by 1e-40; this costs at most 80 of the digits.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

from mpmath import MPContext

from .segments import (
    FrictionLaw,
    MotionFunction,
    ParameterSpan,
    ParameterValues,
    Segment,
    constant_velocity,
    shift_time,
)

mp = MPContext()  # a context of its own, so that the precision of other users of mpmath does not change
mp.dps = 120
mpf = mp.mpf
TINY = mpf(10) ** -40
GRAZING_FRACTION = mpf(10) ** -30  # of the velocity: a motion that only touches zero does not stop


@dataclass(frozen=True)
class SpringMassSystem:
    """The constants of one span.

    Attributes
    ----------
    m, k, c : mpf
        Mass, stiffness and damping.
    slide, hold : mpf
        Friction while sliding, and the largest load that friction holds.
    u : mpf
        Velocity of the driver. An input with a rate counts as a driver too; its velocity alone is `ramp`.
    force : mpf
        Constant part of the input.
    has_dry_friction : bool
        Whether the body can stick.
    """

    m: Any
    k: Any
    c: Any
    slide: Any
    hold: Any
    u: Any
    ramp: Any
    force: Any
    has_dry_friction: bool

    def load(self, x: Any, drive: Any) -> Any:
        """Return the load on a body at rest, without friction."""
        return self.force + self.k * (drive - x)

    def direction(self, load: Any) -> int:
        """Return the direction in which a body at rest starts; 0 while friction can hold the load."""
        return 0 if abs(load) <= self.hold else 1 if load > 0 else -1


def make_system(values: ParameterValues, friction: FrictionLaw | None) -> SpringMassSystem:
    """Return the system with the given parameter values."""
    value = {name: mpf(number) for name, number in values.items()}
    slide, hold = friction(value) if friction else (mpf(0), mpf(0))
    rate = value.get("rate", mpf(0))
    ramp = rate / value["k"] if rate else rate
    c, u = value.get("c", mpf(0)), value.get("v_driver", mpf(0)) + ramp
    return SpringMassSystem(value["m"], value["k"], c, slide, hold, u, ramp, value["F_ext"], friction is not None)


def solve_segments(spans: list[ParameterSpan], friction: FrictionLaw | None = None) -> Iterator[Segment]:
    """Yield the segments of the motion, each from an event or a change of values on."""
    x, v, drive = mpf(spans[0][2]["x0"]), mpf(spans[0][2]["v0"]), mpf(0)
    for begin, end, values in spans:
        s = make_system(values, friction)
        t, load = mpf(begin), s.load(x, drive)
        mode = 1 if not s.has_dry_friction else (1 if v > 0 else -1) if v != 0 else s.direction(load)
        while True:
            is_stuck = s.has_dry_friction and mode == 0
            at = constant_velocity(x, mpf(0)) if is_stuck else sliding_motion(s, x, v, load - mode * s.slide)
            yield Segment(t, mode, shift_time(at, t))
            if not s.has_dry_friction:
                duration = None
            elif is_stuck:
                duration = time_to_breakaway(s, load)
            else:
                duration = time_to_standstill(s, mode, v, load - mode * s.slide)
            step = mpf(end) - t if duration is None or t + duration >= end else duration
            x, v = at(step)
            t, drive = t + step, drive + s.u * step
            if step != duration:
                break
            v, load = mpf(0), s.load(x, drive)
            if is_stuck:  # set the load to the limit, so that rounding cannot decide the direction
                mode = 1 if s.u > 0 else -1
                load = mode * s.hold
            else:
                mode = s.direction(load)
        drive -= s.ramp * (mpf(end) - mpf(begin))


def threshold_segments(s: SpringMassSystem, eps: float, stop: float) -> Iterator[Segment]:
    """Yield the segments of the sled, from rest, under the threshold law in the limit of exact integration.

    Below the speed `eps` (m/s) friction balances the load up to static friction.  The sled accelerates under static
    friction until its speed is eps, then slides.  When it has slowed down to eps, it keeps that speed until the load
    exceeds static friction.
    """
    level = mpf(eps)
    t, x, v = mpf(0), mpf(0), mpf(0)
    while t < stop:
        yield Segment(t, 0, shift_time(constant_velocity(x, v), t))
        duration = (s.hold - s.load(x, s.u * t)) / (s.k * (s.u - v))
        t, x = t + duration, x + v * duration
        if v < level:
            accelerated_motion = sliding_motion(s, x, v, s.load(x, s.u * t) - s.hold)
            yield Segment(t, 0, shift_time(accelerated_motion, t))
            duration = mp.acos((s.u - level) / (s.u - v)) / mp.sqrt(s.k / s.m)  # v = u - (u - v0) cos(w s)
            t, x = t + duration, accelerated_motion(duration)[0]
        net = s.load(x, s.u * t) - s.slide
        slip = sliding_motion(s, x, level, net)
        yield Segment(t, 1, shift_time(slip, t))
        duration = time_to_standstill(replace(s, u=s.u - level), 1, mpf(0), net)  # in a frame that moves at eps
        t, x, v = t + duration, slip(duration)[0], level


def sliding_motion(s: SpringMassSystem, x: Any, v: Any, net: Any) -> MotionFunction:
    """Return the motion from x, v on; `net` is the force at its beginning without that of the damper."""
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
    """Return the roots of m r^2 + c r + k, never equal."""
    root = mp.sqrt((s.c * s.c - 4 * s.m * k) or TINY)
    return (-s.c + root) / (2 * s.m), (-s.c - root) / (2 * s.m)


def time_to_breakaway(s: SpringMassSystem, load: Any) -> Any:
    """Return the time until the load on a body at rest reaches the largest that friction holds, or None."""
    rate = s.k * s.u
    return None if rate == 0 else (s.hold - mp.sign(rate) * load) / abs(rate)


def time_to_standstill(s: SpringMassSystem, mode: int, v: Any, net: Any) -> Any:
    """Return the time until the velocity no longer has the sign of the mode, or None."""
    k = s.k or TINY
    if s.c == 0:  # v = u + size cos(w s - phase)
        w = mp.sqrt(k / s.m)
        p, q = v - s.u, net / s.m / w
        size, phase = mp.hypot(p, q), mp.atan2(q, p)
        if size - abs(s.u) <= GRAZING_FRACTION * size:
            return None
        return positive_angle(phase + mode * mp.acos(-s.u / size), 2 * mp.pi) / w
    if s.u != 0:
        raise ValueError("with a damper and a moving driver the time to standstill has no closed form")
    r1, r2 = characteristic_roots(s, k)
    a = (net - s.c * v) / s.m
    ratio = (a - r1 * v) / (a - r2 * v) if a != r2 * v else mpf(0)  # v = 0 where e^((r1 - r2) s) equals this
    if mp.im(r1) != 0:
        return positive_angle(mp.arg(ratio), 2 * mp.pi) / (2 * mp.im(r1))
    time = mp.log(ratio) / (r1 - r2) if ratio > 0 else mpf(0)
    return time if time > TINY else None


def positive_angle(angle: Any, period: Any) -> Any:
    """Return the angle modulo `period` in (0, period]; zero, also with a rounding error, becomes a whole period."""
    remainder = angle % period
    return period if remainder < TINY else remainder
