"""Rests that begin and end within one integration step: a block on a belt whose static friction hardly exceeds the sliding
friction, solved in closed form.

The slip then just reaches zero, and the block sticks for a small part of a period. While the block slides in the
direction s, its speed v obeys m v'' + c v' + k v = 0, so that v and v' are damped cosines. The slip is monotonic between
the zeros of v', so that no zero of the slip is lost. Nothing here is shared with the code under test.
"""

from dataclasses import asdict, dataclass
from random import Random

from mpmath import MPContext

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
    """Events (time, new mode) and dips up to the time `stop`, which lies far from every event."""

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
    times = []  # of events and dips
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
                    times.append(t + s)
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
        times.append(t)
    if len(events) > n_events:
        horizon = min(horizon, (events[n_events - 1][0] + events[n_events][0]) / 2)
    stop = float(horizon)
    while any(abs(time - stop) < 0.02 * parameters.period for time in times):
        stop -= 0.01 * parameters.period
    return Motion([event for event in events if event[0] < stop], [dip for dip in dips if dip.t < stop], stop)


def random_belt(draw, ratio):
    """Return a random block on a belt that sticks at least once; a third of them without damping."""
    while True:
        m, k, v_b, f_d = (start * 3.0 ** draw.uniform(-1.0, 1.0) for start in (1.0, 100.0, 0.1, 5.0))
        c = draw.choice([0.0, draw.uniform(0.0, 0.2), draw.uniform(0.0, 0.02)])
        belt = Belt(m, k, c, v_b, f_d, ratio, draw.uniform(-1.0, 1.0) * f_d / k, draw.uniform(-1.0, 2.0) * v_b)
        found = motion(belt)
        if len(found.events) > 1:
            return belt, found


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


def chosen(what, number, seed=1, depths=(1e-10, 1e-2)):
    """Return blocks on a belt ("belt") or sleds whose dips have random relative depths, and their motions."""
    draw = Random(f"chosen {what} {seed}")
    low, high = (float(mp.log10(depth)) for depth in depths)
    found = []
    while len(found) < number:
        depth = draw.choice([-1, 1]) * 10.0 ** draw.uniform(low, high)
        parameters, n_periods = (chosen_belt(draw, depth), 15) if what == "belt" else chosen_sled(draw, depth)
        found.append((parameters, motion(parameters, n_periods=n_periods)))
        dips = found[-1][1].dips
        assert abs(dips[0].depth / depth - 1.0) < 1e-4, (parameters, depth, dips[:3])
    return found


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


def first_difference(motion, events, period, bound=0.0):
    """Return the first event that differs from the motion, as (kind, depth of the dip); None if all agree.

    The kinds are "missed" (an event of the reference is missing), "false" (an event too much) and "mode". Events agree
    if their modes agree and their times differ by less than a fifth of a period. Only the events before the first dip
    whose |depth| is below `bound` count.
    """
    limit = min((dip.t for dip in motion.dips if abs(dip.depth) < bound), default=float("inf")) - 0.3 * period
    true = [event for event in motion.events if event[0] < limit]
    for n in range(max(len(true), len(events))):
        t_true = true[n][0] if n < len(true) else float("inf")
        t_found = events[n][0] if n < len(events) else float("inf")
        if min(t_true, t_found) >= limit:
            return None
        if abs(t_true - t_found) > 0.2 * period:
            kind = "missed" if t_true < t_found else "false"
        elif true[n][1] != events[n][1]:
            kind = "mode"
        else:
            continue
        nearest = min(motion.dips, key=lambda dip: abs(dip.t - min(t_true, t_found)), default=None)
        return kind, nearest.depth if nearest else float("nan")
    return None
