"""Systems with dry friction contacts, solved by a second route that measures how well each decision is conditioned.

    M v' = f(t, q, v) - G^T F,   q' = v,   slip = G v - belt(t)

A contact slides with F = mode * slide(slip, load), or sticks with slip = 0 while |F| <= hold.  While its limit is
zero it neither sticks nor makes events, and its mode stays that of its last slip with friction (unless
`reversals_are_events`).  Nothing here is shared with the code under test: the motion between events is a Taylor series
of high order, so every guard is a polynomial whose first root is located to rounding errors; the modes after an event
come from all combinations of stick and slip, judged by the first Taylor coefficients that do not vanish.

References
----------
A. Jorba, M. Zou, A software package for the numerical integration of ODEs by means of high-order Taylor methods,
Experimental Mathematics 14 (2005) 99-117.
"""

from bisect import bisect_right
from dataclasses import dataclass, field
from itertools import product
from math import cos, factorial, inf, sin

import numpy as np
from scipy.optimize import brentq

ORDER = 24  # of the Taylor series between events
DECISION_ORDER = 6  # of the series that decide between modes
STEP_SHARE = 0.2  # step over radius of convergence: 0.2^24 is below rounding errors
FLAT_RATIO = 6.5  # exp(-ratio^2) is below rounding errors beyond this ratio
MAX_RATIO_CHANGE = 0.5  # of a step: then 24 terms of exp(-ratio^2) are exact to rounding errors
TIE = 1e-10  # smaller shares of the scale of a quantity are rounding errors: the quantity is zero
TOUCH = 1e-12  # a guard that falls to zero within this share of its scale, and rises again, touches zero: no event
MIN_SPEED = 1e-3  # m/s: floor of the scale of slips
ORDERS = np.arange(ORDER + 2.0)[:, None]
GRID = np.linspace(0.0, 1.0, 65)  # points of a step where guards are evaluated
GRID_POWERS = GRID[:, None] ** np.arange(ORDER + 1)
MAX_EVENTS = 2000
MAX_PIECES = 10_000  # series of one motion; hundreds are usual


@dataclass(frozen=True)
class Spring:
    """Spring and damper with the elongation `row` q - `drive` x_driver."""

    row: tuple[float, ...]
    k: float
    h: float = 0.0  # cubic stiffness
    c: float = 0.0  # damping
    drive: float = 0.0


@dataclass(frozen=True)
class Contact:
    """Contact with the slip `row` v - belt - belt_1 sin(angle).

    load = load_0 + load_1 sin(angle) + load_t t + load_q q, at least 0 if it `is_limited`
    slide = load (mu_d + (mu_p - mu_d) exp(-(slip/v_s)^2)),   hold = load mu_s
    """

    row: tuple[float, ...]
    mu_d: float
    mu_p: float
    mu_s: float
    load_0: float
    load_1: float = 0.0
    load_t: float = 0.0
    load_q: tuple[float, ...] = ()
    is_limited: bool = False
    v_s: float = 1.0
    belt: float = 0.0
    belt_1: float = 0.0


@dataclass(frozen=True)
class System:
    """Bodies, springs, contacts and the forces force_0 + force_1 sin(angle), angle = angle_0 + omega t.

    `reversals_are_events` says that contacts have events at reversals of their slips also without friction.
    """

    masses: tuple[float, ...]
    springs: tuple[Spring, ...]
    contacts: tuple[Contact, ...]
    force_0: tuple[float, ...]
    force_1: tuple[float, ...]
    q_0: tuple[float, ...]
    v_0: tuple[float, ...]
    omega: float = 1.0
    angle_0: float = 0.0
    v_driver: float = 0.0
    stop: float = 4.0
    reversals_are_events: bool = False


class UnsolvableError(Exception):
    """The system has no motion that this module can compute; the text gives the reason and the time."""


@dataclass
class Decision:
    """A decision and its margin: how far it is from the opposite one, relative to the scale of the quantity.

    `kind` is "dip" (a guard nearly falls to zero), "crossing" (a guard falls below zero and would rise again),
    "order" (another guard falls to zero nearly at the same time), "touch" (a guard touches zero, which is no event, but
    errors decide whether a slip that would then be held ends there),
    "modes" (which contacts stick) or "choice" (several
    combinations hold equally many contacts, so the rule that prefers held contacts does not decide).
    """

    t: float
    kind: str
    contact: int
    margin: float


@dataclass
class Series:
    """Taylor coefficients of the motion from `t` on, one row per order."""

    t: float
    modes: tuple[int, ...]
    q: np.ndarray
    v: np.ndarray
    slip: np.ndarray
    force: np.ndarray
    hold: np.ndarray
    load: np.ndarray

    def state(self, t):
        """Return positions and velocities at time t."""
        powers = (t - self.t) ** np.arange(len(self.v))
        return powers @ self.q[: len(powers)], powers @ self.v


@dataclass
class Solution:
    """Events as (t, modes), states between them, and the margins of all decisions."""

    first_modes: tuple[int, ...] = ()
    events: list = field(default_factory=list)
    steepness: dict = field(default_factory=dict)  # 1/s, by time of the event: slope of its guard relative to its size
    decisions: list[Decision] = field(default_factory=list)
    pieces: list[Series] = field(default_factory=list)
    samples: dict = field(default_factory=dict)
    free: list = field(default_factory=list)  # (t, which contacts are without friction from then on)
    kinks: list = field(default_factory=list)  # times at which limited loads begin or end
    end: float = 0.0
    failure: str = ""  # why the motion ends before the stop time

    def sample(self, times):
        """Keep only the states at these times, which take less memory."""
        self.samples, self.pieces = {t: self.states(t) for t in times}, []

    def states(self, t):
        """Return positions and velocities at a time."""
        if self.samples:
            return self.samples[t]
        i = bisect_right(self.pieces, t, key=lambda piece: piece.t) - 1
        return np.concatenate(self.pieces[max(i, 0)].state(t))

    def modes(self, t):
        """Return the modes at a time, None for contacts without friction."""
        i = bisect_right(self.events, t, key=lambda event: event[0]) - 1
        modes = self.events[i][1] if i >= 0 else self.first_modes
        free = self.free[bisect_right(self.free, t, key=lambda change: change[0]) - 1][1]
        return tuple(None if is_free else mode for mode, is_free in zip(modes, free, strict=True))

    def decided_until(self, bound):
        """Return the time of the first decision with a margin below `bound`, and that decision."""
        near = [decision for decision in self.decisions if decision.margin < bound]
        return (near[0].t, near[0]) if near else (inf, None)


def solve(system):
    """Return the motion of a system from 0 to its stop time."""
    run = _Run(system)
    try:
        run.integrate()
    except UnsolvableError as error:
        run.solution.failure = str(error)
    run.solution.end = run.t
    run.relate_margins()
    return run.solution


class _Run:
    """The state of an integration."""

    def __init__(self, system):
        self.system, self.solution = system, Solution()
        self.inverse_masses = 1.0 / np.array(system.masses)
        self.rows = np.array([c.row for c in system.contacts])
        self.spring_rows = np.array([s.row for s in system.springs])
        self.k, self.h, self.c, self.drive = (
            np.array([getattr(s, name) for s in system.springs]) for name in ("k", "h", "c", "drive")
        )
        self.force_0, self.force_1 = np.array(system.force_0), np.array(system.force_1)
        n = len(system.masses)
        self.mu_d, self.mu_p, self.mu_s, self.load_0, self.load_1, self.load_t, self.v_s, self.belt, self.belt_1 = (
            np.array([getattr(c, name) for c in system.contacts])
            for name in ("mu_d", "mu_p", "mu_s", "load_0", "load_1", "load_t", "v_s", "belt", "belt_1")
        )
        self.load_q = np.array([c.load_q or (0.0,) * n for c in system.contacts])
        self.has_cubic = bool(np.any(self.h))
        self.has_curve = bool(np.any(self.mu_p != self.mu_d))
        self.t, self.q, self.v = 0.0, np.array(system.q_0, float), np.array(system.v_0, float)
        self.modes = [0] * len(system.contacts)
        self.is_pressed = np.ones(len(system.contacts))  # 0 where a limited load is zero
        self.largest_slip = np.full(len(system.contacts), MIN_SPEED)
        self.largest_hold = np.full(len(system.contacts), 1e-12)
        stiffness = sum(self.k) + 3.0 * sum(self.h) * max(np.abs(self.q).max(), 0.1) ** 2
        self.time_scale = 1.0 / (np.sqrt(stiffness * self.inverse_masses.max()) + system.omega + 1.0)

    # ---- Taylor series

    def expand(self, modes, order):
        """Return the Taylor series of the motion from the current state in the given modes."""
        s, n_contacts = self.system, len(self.modes)
        n, angle = len(s.masses), s.angle_0 + s.omega * self.t
        sines = [
            s.omega**k / factorial(k) * (sin(angle), cos(angle), -sin(angle), -cos(angle))[k % 4]
            for k in range(order + 2)
        ]
        q, v = np.zeros((order + 2, n)), np.zeros((order + 2, n))
        slip, force, load, slide, r, u, curve = np.zeros((7, order + 1, n_contacts))
        e, square = np.zeros((2, order + 1, len(s.springs)))
        q[0], v[0] = self.q, self.v
        modes = np.array(modes)
        direction = modes * self.is_pressed
        stuck_contacts = np.flatnonzero(modes == 0)
        held_rows = self.rows[stuck_contacts]
        response = np.linalg.inv(held_rows * self.inverse_masses @ held_rows.T) if len(stuck_contacts) else None
        for k in range(order + 1):
            e[k] = self.spring_rows @ q[k]
            spring = self.c * (self.spring_rows @ v[k])
            if k == 0:
                e[k] -= self.drive * (s.v_driver * self.t)
                spring -= self.c * self.drive * s.v_driver
            elif k == 1:
                e[k] -= self.drive * s.v_driver
            spring += self.k * e[k]
            if self.has_cubic:
                square[k] = convolve(e[: k + 1], e[k::-1])
                spring += self.h * convolve(square[: k + 1], e[k::-1])
            applied_force = self.force_1 * sines[k] - self.spring_rows.T @ spring
            slip[k] = self.rows @ v[k] - self.belt_1 * sines[k]
            load[k] = self.load_q @ q[k] + self.load_1 * sines[k]
            if k == 0:
                applied_force += self.force_0
                slip[k] -= self.belt
                load[k] += self.load_0 + self.load_t * self.t
            elif k == 1:
                load[k] += self.load_t
            slide[k] = self.mu_d * load[k]
            if self.has_curve:
                r[k] = slip[k] / self.v_s
                u[k] = -convolve(r[: k + 1], r[k::-1])
                if k == 0:
                    curve[0] = np.exp(u[0])
                else:
                    curve[k] = convolve(ORDERS[1 : k + 1] * u[1 : k + 1], curve[k - 1 :: -1]) / k
                slide[k] += (self.mu_p - self.mu_d) * convolve(load[: k + 1], curve[k::-1])
            force[k] = direction * slide[k]
            if len(stuck_contacts):
                free = self.inverse_masses * (applied_force - self.rows.T @ force[k])
                belt_rate = self.belt_1[stuck_contacts] * sines[k + 1] * (k + 1)
                force[k, stuck_contacts] = response @ (held_rows @ free - belt_rate)
            v[k + 1] = self.inverse_masses * (applied_force - self.rows.T @ force[k]) / (k + 1)
            q[k + 1] = v[k] / (k + 1)
        hold, slide = self.mu_s * load * self.is_pressed, slide * self.is_pressed
        self.force_scale = max(np.abs(applied_scale(self, slide)), 1e-12)
        return Series(self.t, tuple(int(m) for m in modes), q, v, slip, force, hold, load)

    def step_size(self, series):
        """Return the step that the decay of the last coefficients allows."""
        sizes = []
        forces = self.force_scale
        for table, floor in ((series.q, 1e-2), (series.v, 1e-1), (series.force, forces), (series.load, forces)):
            scale = max(np.abs(table[0]).max(), floor)
            sizes += [
                (scale / last) ** (1.0 / k)
                for k in (ORDER - 1, ORDER)
                if (last := np.abs(table[k]).max()) > 0.0
            ]  # fmt: skip
        h = min(STEP_SHARE * min(sizes, default=inf), 0.1 * self.system.stop)
        while self.has_curve and not self.resolves_curve(series, h):
            h *= 0.7
        return h

    def resolves_curve(self, series, h):
        """Return whether the series cover the friction curves: the coefficients of exp(-ratio^2) do not show a curve
        that lies ahead."""
        ratios = GRID_POWERS * h ** np.arange(ORDER + 1) @ series.slip / self.v_s
        flat = np.abs(ratios).min(0) > FLAT_RATIO
        return bool(np.all(flat | (np.ptp(ratios, axis=0) < MAX_RATIO_CHANGE) | (self.mu_p == self.mu_d)))

    # ---- integration

    def integrate(self):
        """Integrate from event to event."""
        stop = self.system.stop
        self.resolve(set(range(len(self.modes))))
        self.solution.first_modes = tuple(self.modes)
        at_event = True
        while self.t < stop:
            series = self.expand(self.modes, ORDER)
            self.solution.pieces.append(series)
            if len(self.solution.pieces) > MAX_PIECES:
                raise UnsolvableError(f"more than {MAX_PIECES} series until {self.t}")
            h_full = self.step_size(series)
            h = min(h_full, stop - self.t)
            guards = self.guards(series, at_event)
            values, slopes = guard_tables(guards, h)
            self.note_scales(series, h)
            roots = [first_root(g, h, column) for g, column in zip(guards, values.T, strict=True)]
            end = min(roots, default=inf)
            self.note_dips(guards, values, slopes, h, end)
            if end == inf:
                self.advance(series, stop if h == stop - self.t else self.t + h)
                at_event = False
                continue
            self.note_crossings(guards, roots, end, h_full)
            due = [g for g, root in zip(guards, roots, strict=True) if root == end]
            self.advance(series, self.t + end)
            if any(g.kind == "load" for g in due):
                self.solution.kinks.append(self.t)
            before = tuple(self.modes)
            self.resolve({g.contact for g in due if g.kind == "slip"}, {g.contact for g in due if g.kind == "hold"})
            at_event = True
            if any(a != b and not self.is_free(i) for i, (a, b) in enumerate(zip(before, self.modes, strict=True))):
                self.solution.events.append((self.t, tuple(self.modes)))
                self.solution.steepness[self.t] = min(self.steepness(g, end) for g in due)
                if len(self.solution.events) > MAX_EVENTS:
                    raise UnsolvableError(f"more than {MAX_EVENTS} events until {self.t}")

    def steepness(self, g, end):
        """Return the slope of a guard at its zero, relative to its largest value so far."""
        scale = self.largest_slip[g.contact] if g.kind == "slip" else g.scale
        return abs(g.slope(end)) * end**g.power / scale

    def is_free(self, i):
        """Return whether a contact has neither friction nor events at present."""
        return not self.system.reversals_are_events and (self.mu_s[i] == 0.0 or not self.is_pressed[i])

    def advance(self, series, t):
        self.q, self.v = series.state(t)
        self.t = t

    def guards(self, series, at_event):
        """Return the guards of the present modes; those that start at zero are divided by a power of the time."""
        result = []
        for i, mode in enumerate(self.modes):
            slip_scale = self.largest_slip[i]
            if self.is_free(i):
                pass
            elif mode:
                result.append(_Guard(i, "slip", mode * series.slip[:, i], slip_scale))
            else:
                scale = self.force_scale
                result.append(_Guard(i, "hold", series.hold[:, i] - series.force[:, i], scale))
                result.append(_Guard(i, "hold", series.hold[:, i] + series.force[:, i], scale))
            contact = self.system.contacts[i]
            sign = 1.0 if self.is_pressed[i] else -1.0
            if contact.is_limited:
                result.append(_Guard(i, "load", sign * series.load[:, i], max(contact.load_0, contact.load_1)))
            elif series.load[0, i] < -TIE * self.force_scale:
                raise UnsolvableError(f"the load of contact {i} is negative at {self.t}")
        if at_event:
            for g in result:
                g.skip_zeros(self.time_scale)
        return [g for g in result if g.coefficients is not None]

    def note_scales(self, series, h):
        powers = GRID_POWERS * h ** np.arange(ORDER + 1)
        self.largest_slip = np.maximum(self.largest_slip, np.abs(powers @ series.slip).max(0))
        self.largest_hold = np.maximum(self.largest_hold, (powers @ series.hold).max(0))

    # ---- margins

    def note(self, kind, contact, value, scale_kind, t=None):
        """Record a decision; margins of slips and forces become relative at the end of the run."""
        scale = {"slip": self.largest_slip, "hold": self.largest_hold}[scale_kind][contact]
        if value < 0.05 * scale:
            self.solution.decisions.append(Decision(self.t if t is None else t, kind, contact, (value, scale_kind)))

    def relate_margins(self):
        """Relate all margins to the largest slip or limit of the run."""
        for decision in self.solution.decisions:
            if isinstance(decision.margin, tuple):
                value, kind = decision.margin
                scales = {"slip": self.largest_slip, "hold": self.largest_hold}[kind]
                decision.margin = float(value / scales[decision.contact])
        self.solution.decisions.sort(key=lambda decision: decision.t)

    def note_dips(self, guards, values, slopes, h, end):
        """Record the depth of minima of guards before the event."""
        for n, g in enumerate(guards):
            if g.kind == "load" or g.power:  # a guard that starts at zero grows first
                continue
            for j in np.flatnonzero((slopes[:-1, n] < 0.0) & (slopes[1:, n] >= 0.0)):
                if GRID[j] * h < end and min(values[j, n], values[j + 1, n]) > -TOUCH * g.scale:
                    low = brentq(g.slope, GRID[j] * h, GRID[j + 1] * h, xtol=1e-16)
                    if low < end and abs(g.value(low)) <= TOUCH * g.scale:
                        # a slip that touches zero ends there if a static limit above the sliding force holds it
                        ends = g.kind == "slip" and self.mu_s[g.contact] > self.mu_p[g.contact]
                        margin = 0.0 if ends else inf
                        self.solution.decisions.append(Decision(self.t + low, "touch", g.contact, margin))
                    elif low < end:
                        self.note("dip", g.contact, g.value(low), g.kind, self.t + low)

    def note_crossings(self, guards, roots, end, h):
        """Record how far guards fall below zero after the event, and guards that fall to zero just after it."""
        s = end + GRID * h
        for g, root in zip(guards, roots, strict=True):
            if g.kind == "load":
                continue
            values, rising_points = g.value(s), np.flatnonzero(g.slope(s) > 0.0)
            if root == end and len(rising_points) and rising_points[0]:
                j = rising_points[0]
                low = brentq(g.slope, s[j - 1], s[j], xtol=1e-16)
                self.note("crossing", g.contact, -g.value(low), g.kind, self.t + end)
            elif root > end and values[0] > TIE * g.scale and values.min() < 0.0:
                self.note("order", g.contact, values[0], g.kind, self.t + end)

    # ---- modes after an event

    def resolve(self, arrivals, at_limit=frozenset()):
        """Choose the modes by trying all combinations of the contacts at rest.

        `arrivals` are the contacts whose slips have just reached zero, `at_limit` those whose loads have just reached
        their limits.  Of the consistent combinations, the one with the most contacts held is chosen.  Of several, the
        one that holds the most contacts that have been stuck below their limits: their loads have not changed, so they
        do not let go by themselves.
        """
        slips = self.rows @ self.v - self.belt - self.belt_1 * sin(self.system.angle_0 + self.system.omega * self.t)
        at_start = not self.solution.pieces
        self.update_loads()
        free = tuple(self.is_free(i) for i in range(len(self.modes)))
        self.solution.free.append((self.t, free))
        rest = [
            i
            for i, mode in enumerate(self.modes)
            if not free[i]
            and (abs(slips[i]) <= TIE * self.largest_slip[i] or (not at_start and (mode == 0 or i in arrivals)))
        ]  # fmt: skip
        for i, mode in enumerate(self.modes):
            if i not in rest and (at_start or mode == 0 or (mode * slips[i] < 0.0 and not free[i])):
                self.modes[i] = 1 if slips[i] > 0.0 else -1
        self.stop_slips(rest)
        below_limit = [i for i in rest if self.modes[i] == 0 and i not in at_limit]
        trials = []
        for trial in product((0, 1, -1), repeat=len(rest)):
            modes = list(self.modes)
            for i, mode in zip(rest, trial, strict=True):
                modes[i] = mode
            verdicts = self.judge(modes, rest)
            n_held = sum(mode == 0 for mode in trial)
            n_below_limit = sum(modes[i] == 0 for i in below_limit)
            trials.append((n_held, n_below_limit, modes, verdicts))
        good = [candidate for candidate in trials if all(ok for ok, _ in candidate[3])]
        if not good:
            raise UnsolvableError(f"no consistent modes at {self.t}")
        n_held, n_below_limit, modes, verdicts = max(good, key=lambda candidate: candidate[:2])
        best = [
            candidate for candidate in good if candidate[0] == n_held and (candidate[1] == n_below_limit or arrivals)
        ]
        if len(best) > 1:
            self.solution.decisions.append(Decision(self.t, "choice", -1, 0.0))
        margin = min((size for _, size in verdicts), default=inf)
        for other_n_held, other_n_below_limit, _, others in trials:
            if (
                other_n_held >= n_held
                and (other_n_below_limit >= n_below_limit or arrivals)
                and not all(ok for ok, _ in others)
            ):
                margin = min(margin, max(size for ok, size in others if not ok))
        if margin < 0.05:
            self.solution.decisions.append(Decision(self.t, "modes", -1, float(margin)))
        self.modes = modes

    def stop_slips(self, rest):
        """Remove the remaining slips of contacts at rest by impulses, which conserve momentum."""
        if rest:
            rows = self.rows[rest]
            belt = self.belt + self.belt_1 * sin(self.system.angle_0 + self.system.omega * self.t)
            slip = rows @ self.v - belt[rest]
            impulses = np.linalg.solve(rows * self.inverse_masses @ rows.T, slip)
            self.v = self.v - self.inverse_masses * (rows.T @ impulses)

    def update_loads(self):
        """Find out which limited loads press: a load at zero is judged by its rate."""
        s = self.system
        angle = s.angle_0 + s.omega * self.t
        load = self.load_0 + self.load_1 * sin(angle) + self.load_t * self.t + self.load_q @ self.q
        rate = self.load_1 * s.omega * cos(angle) + self.load_t + self.load_q @ self.v
        for i, contact in enumerate(s.contacts):
            if contact.is_limited:
                at_zero = abs(load[i]) <= TIE * max(contact.load_0, contact.load_1)
                self.is_pressed[i] = float(rate[i] > 0.0 if at_zero else load[i] > 0.0)

    def judge(self, modes, rest):
        """Return for each contact at rest whether its mode is consistent, and by what margin."""
        series = self.expand(modes, DECISION_ORDER)
        weights = self.time_scale ** np.arange(DECISION_ORDER + 1)
        verdicts = []
        for i in rest:
            if modes[i]:
                row = self.rows[i]
                scale = self.force_scale * (row * self.inverse_masses @ row) * self.time_scale
                slip = modes[i] * series.slip[1:, i] * weights[1:] / scale
                first = leading_coefficient(slip)
                verdicts.append((first > 0.0, abs(first)))
            else:
                sides = [
                    leading_coefficient((series.hold[:, i] + side * series.force[:, i]) * weights / self.force_scale)
                    for side in (1, -1)
                ]
                ok = min(sides) >= 0.0
                verdicts.append((ok, min((s for s in sides if s > 0.0), default=inf) if ok else -min(sides)))
        return verdicts


def convolve(a, b):
    """Return the sums of the products of the rows."""
    return np.einsum("ij,ij->j", a, b)


def applied_scale(run, slide):
    """Return the size of the forces at the start of a series: limits, sliding forces and applied forces."""
    s = run.system
    springs = run.spring_rows @ run.q - run.drive * s.v_driver * run.t
    return max(
        np.abs(run.force_0).max() + np.abs(run.force_1).max(),
        np.abs(run.k * springs + run.h * springs**3).max(initial=0.0),
        np.abs(run.mu_s * (run.load_0 + np.abs(run.load_1))).max(),
        np.abs(slide[0]).max(),
    )


def leading_coefficient(coefficients):
    """Return the first coefficient that is not a rounding error, or 0."""
    for c in coefficients:
        if abs(c) > TIE:
            return c
    return 0.0


class _Guard:
    """A polynomial in the time since the start of the step, positive while the modes last."""

    def __init__(self, contact, kind, coefficients, scale):
        self.contact, self.kind, self.scale = contact, kind, scale
        self.coefficients, self.power = coefficients.copy(), 0  # of the guard divided by this power of the time

    def skip_zeros(self, time_scale):
        """Divide by the power of the time with which the guard starts; a guard that is zero throughout is dropped."""
        weighted_coefficients = self.coefficients * time_scale ** np.arange(len(self.coefficients)) / self.scale
        order = next((k for k, c in enumerate(weighted_coefficients[: DECISION_ORDER + 1]) if abs(c) > TIE), None)
        if order is None:
            self.coefficients = None
        elif order:
            self.coefficients, self.power = np.concatenate([self.coefficients[order:], np.zeros(order)]), order

    def value(self, s):
        return np.polynomial.polynomial.polyval(s, self.coefficients)

    def slope(self, s):
        return np.polynomial.polynomial.polyval(s, derivative(self.coefficients))


def derivative(coefficients):
    return coefficients[1:] * np.arange(1, len(coefficients))


def guard_tables(guards, h):
    """Return values and slopes of all guards on the grid of a step."""
    if not guards:
        return np.zeros((len(GRID), 0)), np.zeros((len(GRID), 0))
    table = np.array([g.coefficients for g in guards]).T
    table = table * (h ** np.arange(len(table)))[:, None]
    rates = table[1:] * np.arange(1, len(table))[:, None] / h
    return GRID_POWERS[:, : len(table)] @ table, GRID_POWERS[:, : len(rates)] @ rates


def first_root(g, h, values):
    """Return the first time at which a guard falls to zero; inf if there is none in the step.

    A guard that falls no further than `TOUCH` below zero only touches it, which is no event.
    """
    depth = -TOUCH * g.scale if not g.power else 0.0
    below = np.flatnonzero(values <= depth)
    end = below[0] if len(below) else len(values)
    for j in range(1, min(end, len(values) - 1)):  # minima between two points of the grid
        if values[j] < values[j - 1] and values[j] <= values[j + 1] and values[j] < 0.1 * values.max():
            low, high = GRID[j - 1] * h, GRID[j + 1] * h
            if g.slope(low) < 0.0 < g.slope(high):
                bottom = brentq(g.slope, low, high, xtol=1e-16)
                if g.value(bottom) <= depth:
                    return zero_between(g, low, bottom)
    if not len(below):
        return inf
    return zero_between(g, GRID[max(end - 1, 0)] * h, GRID[end] * h)


def zero_between(g, low, high):
    """Return the zero of a guard that is not positive at `high`; `low` if it is not positive there either."""
    return low if g.value(low) <= 0.0 else brentq(g.value, low, high, xtol=1e-16, rtol=1e-15)
