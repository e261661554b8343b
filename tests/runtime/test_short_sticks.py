"""Rests that begin and end within one integration step are found, and slips that nearly reach zero go on."""

import itertools
from dataclasses import asdict, dataclass
from functools import cache
from itertools import pairwise
from random import Random

import numpy as np
import pytest
from build_cache import build_user_model
from models import DOP853, EXACT, ODE23, ODE45, RADAU9, RODAS
from mpmath import MPContext
from native_fmus import build_native_fmus
from scipy.linalg import expm
from scipy.optimize import brentq

# Rests that begin and end within one integration step, solved in closed form: a block on a belt, the shipped sled,
# and two blocks upon each other, whose static friction hardly exceeds the sliding friction.
mp = MPContext()
mp.dps = 40
TOUCH = mp.mpf(10) ** -30  # a dip of the slip to less than this share of the largest slip is a touch

BELT = '''"""Block on a belt, with constant sliding and static friction."""

from fmus import Contact, Fixed, Mode, Model, Output, Parameter, State


class Belt(Model):
    """Block on a spring, on a belt: m a = -k x - c v - F_friction."""

    m = Parameter(1.0, "kg", "mass", above=0.0)
    k = Parameter(100.0, "N/m", "stiffness", low=0.0)
    c = Parameter(0.0, "N.s/m", "damping", low=0.0)
    v_b = Parameter(0.1, "m/s", "speed of the belt")
    f_d = Parameter(5.0, "N", "sliding friction", low=0.0)
    ratio = Parameter(1.002, "1", "static over sliding friction", low=1.0)
    x0 = Fixed(0.0, "m", "initial position")
    v0 = Fixed(0.0, "m/s", "initial speed")

    x = State("m", "position", start=x0)
    v = State("m/s", "speed", start=v0, rate_of=x)
    mode = Mode()
    F_friction = Contact("N", "friction", mode=mode, slip=v - v_b, slide=f_d, hold=ratio * f_d)
    a = Output("m/s2", "acceleration", (-k * x - c * v - F_friction) / m, rate_of=v)

    stop_time = 20.0
'''

STACK = '''"""Two blocks upon each other; a driver pulls the upper one."""

from fmus import Contact, Mode, Model, Output, Parameter, State


class Stack(Model):
    """Two blocks upon each other: m1 a1 = -c x1 + F2 - F1,   m2 a2 = k (x_driver - x2) - F2."""

    m1 = Parameter(4.0, "kg", "mass of the lower block", above=0.0)
    m2 = Parameter(2.0, "kg", "mass of the upper block", above=0.0)
    k = Parameter(400.0, "N/m", "stiffness of the spring of the driver", low=0.0)
    c = Parameter(150.0, "N/m", "stiffness of the spring of the lower block", low=0.0)
    f1 = Parameter(9.0, "N", "sliding friction of the lower block", low=0.0)
    f2 = Parameter(10.0, "N", "sliding friction of the upper block", low=0.0)
    ratio = Parameter(1.002, "1", "static over sliding friction", low=1.0)
    v_driver = Parameter(0.2, "m/s", "speed of the driver")

    x1 = State("m", "position of the lower block")
    v1 = State("m/s", "speed of the lower block", rate_of=x1)
    x2 = State("m", "position of the upper block")
    v2 = State("m/s", "speed of the upper block", rate_of=x2)
    x_driver = State("m", "position of the driver", rate=v_driver)
    mode1, mode2 = Mode(), Mode()
    F1 = Contact("N", "friction on the ground", mode=mode1, slip=v1, slide=f1, hold=ratio * f1)
    F2 = Contact("N", "friction between the blocks", mode=mode2, slip=v2 - v1, slide=f2, hold=ratio * f2)
    a1 = Output("m/s2", "acceleration of the lower block", (F2 - c * x1 - F1) / m1, rate_of=v1)
    a2 = Output("m/s2", "acceleration of the upper block", (k * (x_driver - x2) - F2) / m2, rate_of=v2)

    stop_time = 20.0
'''


@dataclass(frozen=True)
class Belt:
    """Parameters of the block on the belt, in SI units."""

    m: float
    k: float
    c: float
    v_b: float
    f_d: float
    ratio: float
    x0: float = 0.0
    v0: float = 0.0

    @property
    def period(self):
        """Period of the undamped oscillation in s."""
        return 6.283185307179586 * (self.m / self.k) ** 0.5

    def values(self):
        """Return the values to set in the FMU."""
        return asdict(self)


@dataclass(frozen=True)
class Sled:
    """Parameters of the shipped sled, in SI units; seen from the driver, its ground is a belt of speed -v_driver."""

    m: float
    k: float
    mu_d: float
    mu_s: float
    g: float
    v_driver: float
    x0: float = 0.0
    v0: float = 0.0

    period = Belt.period

    def values(self):
        """Return the values to set in the FMU."""
        return asdict(self)


@dataclass(frozen=True)
class Dip:
    """A minimum of the slip while the block slides.

    `depth` is the slip there over the largest slip of the phase before; it is negative if the slip reaches zero (it is
    then the minimum that the slip would have without the rest). `n_events` counts the events before.
    """

    t: float
    depth: float
    n_events: int


@dataclass(frozen=True)
class Motion:
    """Events (time, new modes) and dips up to the time `stop`, which lies far from every event."""

    events: list
    dips: list
    stop: float


class Slide:
    """A phase of sliding in the direction `mode`: the slip, seen in that direction, over the time since its start."""

    def __init__(self, block, mode, x, v):
        m, c, k = block.m, block.c, block.k
        self.block, self.mode, self.x, self.v = block, mode, x, v
        self.a = (-k * x - c * v - mode * block.slide) / m
        self.d, self.square = c / (2 * m), k / m
        self.w = mp.sqrt(self.square - self.d**2)

    def cosine(self, start, rate, s):
        """Return the damped cosine with this value and rate at the start."""
        return mp.exp(-self.d * s) * (
            start * mp.cos(self.w * s) + (rate + self.d * start) / self.w * mp.sin(self.w * s)
        )

    def speed(self, s):
        return self.cosine(self.v, self.a, s)

    def acceleration(self, s):
        return self.cosine(self.a, -self.square * self.v - 2 * self.d * self.a, s)

    def position(self, s):
        b = self.block
        return (-b.m * self.acceleration(s) - b.c * self.speed(s) - self.mode * b.slide) / b.k

    def slip(self, s):
        return self.mode * (self.speed(s) - self.block.v_b)

    def extrema(self):
        """Yield the times s > 0 of zero acceleration, in order."""
        b = (-self.square * self.v - self.d * self.a) / self.w
        s = mp.atan2(-self.a, b) % mp.pi / self.w
        if s * self.w < TOUCH:
            s += mp.pi / self.w
        while True:
            yield s
            s += mp.pi / self.w

    def first_zero(self, high_slip, low_slip):
        """Return when the slip reaches zero between a maximum and a minimum, by safeguarded Newton iteration."""
        low, high = high_slip, low_slip
        s = (low + high) / 2
        for _ in range(200):
            g = self.slip(s)
            low, high = (s, high) if g > 0 else (low, s)
            slope = self.mode * self.acceleration(s)
            newton = s - g / slope if slope < 0 else low
            following = newton if low < newton < high else (low + high) / 2
            if abs(following - s) < mp.mpf(10) ** -36 * high_slip + mp.mpf(10) ** -37:
                return following
            s = following
        return s


class Block:
    """Numbers of the block on the belt with 40 digits."""

    def __init__(self, parameters):
        p = parameters
        if isinstance(p, Sled):
            weight = mp.mpf(p.m) * mp.mpf(p.g)
            self.m, self.k, self.c, self.v_b = mp.mpf(p.m), mp.mpf(p.k), mp.mpf(0), -mp.mpf(p.v_driver)
            self.slide, self.hold = p.mu_d * weight, p.mu_s * weight
            self.x0, self.v0 = mp.mpf(p.x0), mp.mpf(p.v0) + self.v_b
        else:
            self.m, self.k, self.c, self.v_b = (mp.mpf(value) for value in (p.m, p.k, p.c, p.v_b))
            self.slide = mp.mpf(p.f_d)
            self.hold, self.x0, self.v0 = self.slide * p.ratio, mp.mpf(p.x0), mp.mpf(p.v0)

    def mode_at_rest(self, x):
        """Return the mode of the block without slip."""
        load = -self.k * x - self.c * self.v_b
        return int(mp.sign(load)) if abs(load) > self.hold else 0


def motion(parameters, n_events=31, n_periods=15):
    """Return the motion up to `n_events` events or `n_periods` periods, whichever is first."""
    block = Block(parameters)
    t, x, v = mp.mpf(0), block.x0, block.v0
    horizon, events, dips = mp.mpf(n_periods * parameters.period), [], []
    mode = int(mp.sign(v - block.v_b)) or block.mode_at_rest(x)
    while t < horizon and len(events) <= n_events:
        if mode == 0:
            rest = (-block.hold * mp.sign(-block.v_b) - block.c * block.v_b - block.k * x) / (block.k * block.v_b)
            t, x, mode = t + rest, x + rest * block.v_b, -int(mp.sign(block.v_b))
        else:
            slide = Slide(block, mode, x, v)
            largest, before = max(slide.slip(mp.mpf(0)), mp.mpf(0)), mp.mpf(0)
            end = None
            for s in slide.extrema():
                g = slide.slip(s)
                depth = g / largest if largest else mp.mpf(1)
                if g < slide.slip(before):
                    dips.append(Dip(float(t + s), float(depth), len(events)))
                    if depth < -TOUCH or (depth < TOUCH and block.hold > block.slide):
                        end = slide.first_zero(before, s) if depth < -TOUCH else s
                        break
                largest, before = max(largest, g), s
                if t + s > horizon:
                    break
            if end is None:
                break
            t, x, v = t + end, slide.position(end), block.v_b
            mode = block.mode_at_rest(x)
        events.append((float(t), mode))
    if len(events) > n_events:
        horizon = min(horizon, (events[n_events - 1][0] + events[n_events][0]) / 2)
    return motion_to_a_calm_time(events, dips, horizon, parameters.period)


def motion_to_a_calm_time(events, dips, horizon, period):
    """Return the motion up to a time at or before the horizon that is far from all events and dips."""
    stop = float(horizon)
    while any(abs(t - stop) < 0.02 * period for t in [event[0] for event in events] + [dip.t for dip in dips]):
        stop -= 0.01 * period
    return Motion([event for event in events if event[0] < stop], [dip for dip in dips if dip.t < stop], stop)


@dataclass(frozen=True)
class Stack:
    """Parameters of two blocks upon each other, in SI units."""

    m1: float
    m2: float
    k: float
    c: float
    f1: float
    f2: float
    ratio: float
    v_driver: float

    @property
    def period(self):
        """Period of the upper block on the spring of the driver in s."""
        return 6.283185307179586 * (self.m2 / self.k) ** 0.5

    def values(self):
        """Return the values to set in the FMU."""
        return asdict(self)


class AmbiguousError(Exception):
    """More than one combination of modes is possible."""


class StackPhase:
    """Linear motion of the stack in given modes; the state is (x1, v1, x2, v2, x_driver, 1).

    `rates` is its matrix; `slips` and `forces` map it to slips and friction forces.
    """

    slips = np.array([[0.0, 1.0, 0.0, 0.0, 0.0, 0.0], [0.0, -1.0, 0.0, 1.0, 0.0, 0.0]])

    def __init__(self, p, modes):
        constant = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 1.0])
        back, pull = np.array([-p.c, 0.0, 0.0, 0.0, 0.0, 0.0]), np.array([0.0, 0.0, -p.k, 0.0, p.k, 0.0])
        first, second = modes[0] * p.f1 * constant, modes[1] * p.f2 * constant
        zero = 0.0 * constant
        if modes == (0, 0):
            a1, a2, second = zero, zero, pull
            first = back + pull
        elif modes[1] == 0:
            a1 = a2 = (pull + back - first) / (p.m1 + p.m2)
            second = pull - p.m2 * a2
        else:
            a2 = (pull - second) / p.m2
            first, a1 = (first, (back + second - first) / p.m1) if modes[0] else (back + second, zero)
        self.rates = np.array([[0.0, 1.0, 0, 0, 0, 0], a1, [0.0, 0, 0, 1.0, 0, 0], a2, p.v_driver * constant, zero])
        self.forces, holds = np.array([first, second]), (p.ratio * p.f1, p.ratio * p.f2)
        self.guards = []  # contact, its direction after the end of the mode, row of the guard, its scale
        for i in range(2):
            if modes[i]:
                self.guards.append((i, 0, modes[i] * self.slips[i], None))
            else:
                self.guards += [(i, side, holds[i] * constant - side * self.forces[i], holds[i]) for side in (-1, 1)]

    def follow(self, row, y):
        """Return the value of a row as a function of the time since the state y."""
        return lambda s: row @ expm(self.rates * s) @ y

    def grid(self, dt):
        """Return the matrices that map a state to the states at the multiples of dt."""
        step, powers = expm(self.rates * dt), [np.eye(6)]
        for _ in range(300):
            powers.append(step @ powers[-1])
        return np.array(powers)

    def search(self, path, dt):
        """Search the states at the multiples of dt for the end of a mode.

        Returns
        -------
        tuple
            The first zero of a guard as (time, contact, next mode), or None; and the minima of guards above zero as
            (time, value, contact, scale).
        """
        ends, minima = [], []
        for i, side, row, scale in self.guards:
            values, slopes = path @ row, path @ (row @ self.rates)
            for n in np.flatnonzero(
                ((slopes[:-1] < 0.0) & (slopes[1:] > 0.0)) | ((values[:-1] > 0.0) & (values[1:] < 0.0))
            ):
                high = dt
                if slopes[n] < 0.0 < slopes[n + 1]:
                    high = brentq(self.follow(row @ self.rates, path[n]), 0.0, dt, xtol=1e-15)
                    least = self.follow(row, path[n])(high)
                    if least >= 0.0:
                        minima.append((n * dt + high, least, i, scale))
                        continue
                if values[n] > 0.0:
                    ends.append((n * dt + brentq(self.follow(row, path[n]), 0.0, high, xtol=1e-16), i, side))
                    break
        return min(ends, default=None), minima

    def next_minimum(self, row, y, s, dt):
        """Return time and value of the next minimum of a row after s, on the continued motion."""
        slope = self.follow(row @ self.rates, y)
        if slope(s) >= 0.0:  # it was in the same grid interval
            return s, 0.0
        high = s
        while slope(high) < 0.0:
            high += dt
        least = brentq(slope, s, high, xtol=1e-15)
        return least, self.follow(row, y)(least)


def stack_motion(p, n_events=31, n_periods=30):
    """Return the motion of the stack from rest.

    Guards (slips, and distances of the loads from their limits) are searched for zeros between their extrema, which
    are located as zeros of their rates on a grid of 200 points in the shortest period.
    """
    t, y, modes, horizon = 0.0, np.array([0.0, 0.0, 0.0, 0.0, 0.0, 1.0]), (0, 0), n_periods * p.period
    dt = 6.283185307179586 * (min(p.m1, p.m2) / (p.k + p.c)) ** 0.5 / 200
    events, dips, largest = [], [], [0.0, 0.0]
    while t < horizon and len(events) <= n_events:
        phase = StackPhase(p, modes)
        powers = phase.grid(dt)
        end = None
        while end is None and t < horizon:
            path = powers @ y
            end, minima = phase.search(path, dt)
            last = len(path) - 1 if end is None else int(end[0] / dt)
            for i in range(2):
                largest[i] = max(largest[i], modes[i] * (path[: last + 1] @ phase.slips[i]).max())
            for s, value, i, scale in minima:
                if (end is None or s < end[0]) and (scale is None or value < 0.05 * scale):
                    dips.append(Dip(t + s, value / (scale or largest[i]), len(events)))
            if end is None:
                t, y = t + last * dt, path[last]
        if end is None:
            break
        duration, i, side = end
        if side == 0:
            s, least = phase.next_minimum(modes[i] * phase.slips[i], y, duration, dt)
            dips.append(Dip(t + s, least / largest[i], len(events)))
        before, t, y = modes, t + duration, expm(phase.rates * duration) @ y
        y, modes = modes_after(p, y, modes, i, side, t, dips, len(events))
        for j in range(2):
            if not (before[j] and modes[j] == before[j]):
                largest[j] = 0.0
                continue
            slip = modes[j] * phase.slips[j]
            if slip @ phase.rates @ y < 0.0 < slip @ StackPhase(p, modes).rates @ y:  # a dip with a kink
                dips.append(Dip(t, slip @ y / largest[j], len(events)))
        events.append((t, *modes))
    if len(events) > n_events:
        horizon = min(horizon, (events[n_events - 1][0] + events[n_events][0]) / 2)
    return motion_to_a_calm_time(events, dips, horizon, p.period)


def modes_after(p, y, modes, i, side, t, dips, n_events):
    """Return state and modes after contact i changes to the mode `side`: loads above their limits break away."""
    modes = tuple(side if j == i else mode for j, mode in enumerate(modes))
    y = y.copy()
    if modes[0] == 0:
        y[1] = 0.0
    if modes[1] == 0:
        y[3] = y[1] = 0.0 if modes[0] == 0 else (p.m1 * y[1] + p.m2 * y[3]) / (p.m1 + p.m2)
    holds = (p.ratio * p.f1, p.ratio * p.f2)
    released_contacts = {i} if side else set()
    while True:
        phase = StackPhase(p, modes)
        loads = phase.forces @ y
        margins = [(holds[j] - abs(loads[j])) / holds[j] for j in range(2)]
        over = [j for j in range(2) if modes[j] == 0 and margins[j] < 0.0]
        dips.extend(Dip(t, margins[j], n_events) for j in (1 - i,) if modes[j] == 0 and abs(margins[j]) < 0.01)
        if not over:
            break
        if len(over) > 1:
            raise AmbiguousError
        modes = tuple(int(np.sign(loads[j])) if j in over else mode for j, mode in enumerate(modes))
        released_contacts.update(over)
    accelerations = phase.slips @ phase.rates @ y
    if any(modes[j] * accelerations[j] <= 0.0 for j in released_contacts):
        raise AmbiguousError
    return y, modes


def random_stack(draw, ratio):
    """Return a random stack of which both contacts slide, with at least six events."""
    while True:
        m1, m2, k, c, f1, u = (start * 2.0 ** draw.uniform(-1.0, 1.0) for start in (4.0, 2.0, 400.0, 150.0, 9.0, 0.2))
        stack = Stack(m1, m2, k, c, f1, f1 * draw.uniform(1.02, 2.0), ratio, u)
        try:
            motion_of_stack = stack_motion(stack)
        except AmbiguousError:
            continue
        if len(motion_of_stack.events) > 5 and any(mode for _, mode, _ in motion_of_stack.events):
            return stack, motion_of_stack


def stacks(ratio, number=20, seed=1):
    """Return random stacks and their motions."""
    draw = Random(f"stack {ratio} {seed}")
    return [random_stack(draw, ratio) for _ in range(number)]


def random_belt(draw, ratio):
    """Return a random block on a belt that sticks at least once; a third of them without damping."""
    while True:
        m, k, v_b, f_d = (start * 3.0 ** draw.uniform(-1.0, 1.0) for start in (1.0, 100.0, 0.1, 5.0))
        c = draw.choice([0.0, draw.uniform(0.0, 0.2), draw.uniform(0.0, 0.02)])
        belt = Belt(m, k, c, v_b, f_d, ratio, draw.uniform(-1.0, 1.0) * f_d / k, draw.uniform(-1.0, 2.0) * v_b)
        block_motion = motion(belt)
        if len(block_motion.events) > 1:
            return belt, block_motion


def random_touch(draw):
    """Return a random block that rides once and then touches the speed of the belt in every period."""
    while True:
        m, k, v_b, f_d = (start * 3.0 ** draw.uniform(-1.0, 1.0) for start in (1.0, 100.0, 0.1, 5.0))
        if f_d > 1.5 * v_b * (k * m) ** 0.5:
            belt = Belt(m, k, 0.0, v_b, f_d, 1.0)
            return belt, motion(belt)


def random_sled(draw, ratio):
    """Return a random sled."""
    m, k, g, u = (start * 3.0 ** draw.uniform(-1.0, 1.0) for start in (12.5, 742.5, 9.81, 0.034))
    mu_d = draw.uniform(0.1, 0.9)
    sled = Sled(m, k, mu_d, ratio * mu_d, g, draw.choice([-1, 1]) * u)
    # the first break-away is late
    start = sled.mu_s * m * g / (k * u * sled.period)
    return sled, motion(sled, n_periods=start + 15)


def chosen_belt(draw, depth):
    """Return a random block on a belt with a dip of the slip of the given relative depth, negative if it rests there.

    In a third of the sets the static friction is chosen, in a third the damping, in a third the start.
    """
    m, k, v_b, f_d = (start * 3.0 ** draw.uniform(-1.0, 1.0) for start in (1.0, 100.0, 0.1, 5.0))
    family = draw.choice(["friction", "damping", "start"] if depth < 0.0 else ["damping", "start"])
    w = (k / m) ** 0.5
    if family == "start":
        return Belt(m, k, 0.0, v_b, f_d, draw.choice([1.001, 1.5]), *start_with_dip(draw, m, k, v_b, f_d, depth))
    extra = 1.0 if family == "friction" else 10.0 ** draw.uniform(0.1, 2.0)
    without_damping = min(abs(depth) * extra, 0.3)  # depth of the dip for c = 0
    ratio = 1.0 + 2.0 * without_damping**0.5 / (1.0 - without_damping) * v_b * m * w / f_d
    c = 0.0

    def excess(c):
        block = Block(Belt(m, k, c, v_b, f_d, ratio))
        slide = Slide(block, -1, (block.hold - block.c * block.v_b) / block.k, block.v_b)
        extrema = slide.extrema()
        largest, least = slide.slip(next(extrema)), slide.slip(next(extrema))
        return least / largest - depth

    if family == "damping":
        c = float(mp.findroot(excess, (0, m * w), solver="anderson", tol=1e-50, maxsteps=100))
    x0 = (ratio * f_d - c * v_b) / k - draw.uniform(0.05, 0.9) * min(f_d / k, v_b / w)
    return Belt(m, k, c, v_b, f_d, ratio, x0, v_b)


def start_with_dip(draw, m, k, v_b, f_d, depth):
    """Return position and speed at the start of an undamped slide whose first dip has the given relative depth.

    The speed is A cos(w t + angle), the slip v_b - v lies between v_b - A and v_b + A.
    """
    amplitude, angle = v_b * (1.0 - depth) / (1.0 + depth), draw.uniform(1.7, 3.0)
    sine, cosine = float(mp.sin(angle)), float(mp.cos(angle))
    return f_d / k + amplitude * (m / k) ** 0.5 * sine, amplitude * cosine


def chosen_sled(draw, depth):
    """Return a random sled with a dip of the given relative depth."""
    m, k, g, u = (start * 3.0 ** draw.uniform(-1.0, 1.0) for start in (12.5, 742.5, 9.81, 0.034))
    mu_d = draw.uniform(0.1, 0.9)
    f_d, w = mu_d * m * g, (k / m) ** 0.5
    if depth < 0.0 and draw.random() < 0.5:
        ratio = 1.0 + 2.0 * abs(depth) ** 0.5 / (1.0 - abs(depth)) * u * m * w / f_d
        sled = Sled(m, k, mu_d, ratio * mu_d, g, draw.choice([-1, 1]) * u)
        return sled, sled.mu_s * m * g / (k * u * sled.period) + 15
    # seen from the driver, with the opposite sign, the ground is a belt of speed u
    x, v = start_with_dip(draw, m, k, u, f_d, depth)
    sled = Sled(m, k, mu_d, draw.choice([1.001, 1.5]) * mu_d, g, u, -x, u - v)
    return sled, 15


def choose_motions(kind, number, seed=1, depths=(1e-10, 1e-2)):
    """Return blocks on a belt ("belt") or sleds whose dips have random relative depths, and their motions."""
    draw = Random(f"chosen {kind} {seed}")
    low, high = (float(mp.log10(depth)) for depth in depths)
    pairs = []
    while len(pairs) < number:
        depth = draw.choice([-1, 1]) * 10.0 ** draw.uniform(low, high)
        parameters, n_periods = (chosen_belt(draw, depth), 15) if kind == "belt" else chosen_sled(draw, depth)
        pairs.append((parameters, motion(parameters, n_periods=n_periods)))
        dips = pairs[-1][1].dips
        assert abs(dips[0].depth / depth - 1.0) < 1e-4, (parameters, depth, dips[:3])
    return pairs


def belts(ratio, number=60, seed=1):
    """Return random blocks on a belt and their motions."""
    draw = Random(f"belt {ratio} {seed}")
    return [random_belt(draw, ratio) for _ in range(number)]


def sleds(ratio, number=40, seed=1):
    """Return random sleds and their motions."""
    draw = Random(f"sled {ratio} {seed}")
    return [random_sled(draw, ratio) for _ in range(number)]


def touches(number=40, seed=1):
    """Return random blocks that touch the speed of the belt, and their motions."""
    draw = Random(f"touch {seed}")
    return [random_touch(draw) for _ in range(number)]


def checkpoints(motion, period, bound):
    """Return (t, number of events, modes) in the middle of every long phase, up to the first dip whose |depth| is below
    `bound`. Modes are None before the first event.
    """
    limit = min((dip.t for dip in motion.dips if abs(dip.depth) < bound), default=motion.stop)
    times = [0.0, *(event[0] for event in motion.events), motion.stop]
    return [
        (0.5 * (start + end), n, motion.events[n - 1][1:] if n else None)
        for n, (start, end) in enumerate(pairwise(times))
        if end - start > 0.1 * period and end <= limit
    ]


pytestmark = pytest.mark.slow

RESOLUTION = 100.0  # the slip is accurate to this multiple of the tolerance, relative to the largest slip of the phase
NATIVE = ("--native", "--platform", "linux64")
METHODS = [f"--method={label}" for label in ("ode23", "ode45", "dop853", "rodas", "radau9")]
MODES = {"belt": ["mode"], "sled": ["mode"], "stack": ["mode1", "mode2"]}


def native_fmu(model, folder):
    """Return the native FMU of a block on a belt, a stack or the shipped sled."""
    if model == "sled":
        return build_native_fmus() / "stickslip.fmu"
    file = folder / f"short_{model}.py"
    file.write_text({"belt": BELT, "stack": STACK}[model])
    return build_user_model(file, *NATIVE, *METHODS, optimise=True) / "native" / f"short_{model}.fmu"


@cache
def cases(model):
    """Return parameters and reference motions: static friction hardly above sliding friction, and chosen depths."""
    if model == "stack":
        return stacks(1.02, 3) + stacks(1.005, 5)
    randoms = belts if model == "belt" else sleds
    random_cases = [case for ratio in (1.02, 1.01, 1.005) for case in randoms(ratio, 10)]
    return random_cases + choose_motions(model, 40, depths=(1e-9, 1e-2))


def wrong_sets(worker, path, model, method, rtol):
    """Return the parameter sets with another number of events or other modes than the reference."""
    wrong = []
    fmu = worker.instantiate(path)
    for parameters, motion in cases(model):
        points = checkpoints(motion, parameters.period, RESOLUTION * rtol)
        fmu.reset()
        fmu.begin({**parameters.values(), "solver.method": method, "solver.rtol": rtol}, stop=motion.stop)
        rows = fmu.run([0.0, *(t for t, _, _ in points)], ["events.count", *MODES[model]])[1:]
        for (t, n_events, modes), (n_found, *present_modes) in zip(points, rows, strict=True):
            if n_found != n_events or (modes and tuple(present_modes) != modes):
                wrong.append((t, n_events, n_found, parameters))
                break
    fmu.free()
    return wrong


@pytest.mark.campaign
@pytest.mark.parametrize("rtol", [1e-6, pytest.param(1e-11, marks=pytest.mark.campaign)])
@pytest.mark.parametrize(
    ("model", "method"),
    [*itertools.product(MODES, [ODE23, ODE45, DOP853, RODAS]), ("belt", RADAU9), ("stack", RADAU9)],
)
def test_every_rest_deeper_than_the_error_is_found(worker, tmp_path, model, method, rtol):
    assert wrong_sets(worker, native_fmu(model, tmp_path), model, method, rtol) == []


def test_the_closed_form_finds_every_rest(worker, tmp_path):
    assert wrong_sets(worker, native_fmu("sled", tmp_path), "sled", EXACT, 1e-11) == []


@pytest.mark.parametrize("method", [ODE23, ODE45, DOP853, RODAS, RADAU9])
def test_a_slip_that_touches_zero_on_a_belt_goes_on(worker, tmp_path, method):
    """Static and sliding friction are equal: the block rides along once, and its slip then touches zero in each
    period."""
    fmu, counts = worker.instantiate(native_fmu("belt", tmp_path)), []
    for rtol in (1e-6, 1e-9):
        for parameters, motion in touches(10):
            fmu.reset()
            fmu.begin({**parameters.values(), "solver.method": method, "solver.rtol": rtol}, stop=motion.stop)
            counts.append(fmu.run([0.0, motion.stop], ["events.count"])[-1][0])
    fmu.free()
    assert counts == [2] * 20
