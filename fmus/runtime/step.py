"""One internal step: propose, judge, accept; end it at an event; interpolate inside it.

The step goes from t0 to t1.  It is a stick, up to the break-away; or a closed form, up to the next standstill; or a
step of a method that meets the tolerance.  Its size is controlled as the public descriptions of MATLAB's ode23 and
ode45 give it (L. F. Shampine, M. W. Reichelt, The MATLAB ODE Suite, SIAM J. Sci. Comput. 18 (1997) 1-22).
"""

from math import inf

from .automaton import UNSETTLED
from .codes import DIVERGED, EXACT, OK, STALLED, STUCK
from .exact import BENT
from .interpolant import Interpolant
from .methods import Methods
from .rounding import NEAR, ULP
from .series import Series
from .vectors import (
    Contacts,
    States,
    contacts,
    every,
    first,
    greater,
    kinematic,
    largest,
    magnitude,
    per_contact,
    slip,
    some,
    speeds_of,
    total,
)

HUGE = 1e100  # beyond it squares, as of an energy, would overflow
MOST_TRIES = 200  # of one step, which halves each time
MOST_IDLE = 100  # steps in a row that hardly move the time
NEARLY = 30.0  # how far a method may be from a tie, over its tolerance


class Before:
    """The beginning of the step: counts up to there, the step size to try there, the length of the step before, how
    many steps before it hardly moved the time, and when the mode last changed (without a change, the start)."""

    def __init__(self):
        self.taken = self.refused = self.called = self.happened = self.idle = 0
        self.size = self.length = self.t_event = 0.0


class Lost:
    """What the times t0, t1 and the positions x0, x1 of a step lack.

    Closed forms carry it on, so that the rounding of one event does not add to that of the others.
    """

    def __init__(self):
        self.t0 = self.x0 = self.t1 = self.x1 = 0.0

    def carry(self):
        """The step begins where the last one ended."""
        self.t0, self.x0 = self.t1, self.x1
        self.t1 = 0.0


class Step:
    """The internal step in force, and the counts up to both its ends.

    CPython 3.11 has the attributes of an object at hand while they are fewer than thirty; with more, a step of ode23
    takes a tenth longer.
    """

    least: States

    def __init__(self):
        self.methods = Methods()
        # the run: tolerances in force, largest step, stop time (inf where unknown), whether zero speed is a mode
        self.tolerance = self.longest = self.least = 0.0
        self.t_end = inf
        self.sticks = False
        # the step: its beginning, its end, the modes within and the modes after
        self.t0 = self.y0 = self.f0 = 0.0
        self.t1 = self.y1 = self.f1 = 0.0
        self.modes0 = self.modes1 = STUCK
        # all stands still; a mode changes at its end; a speed only touches zero there, and the slide goes on
        self.waiting = self.event = self.touches = False
        self.fits = True  # whether there are modes that agree with the forces
        # the length of the step before an event cut it, and what holds within
        self.span = 0.0
        self.interpolant = Interpolant()
        self.series = Series()  # of a load, where inputs bend
        # counts up to t1, and the size to try next; the same at t0
        self.taken = self.refused = self.called = 0
        self.size = 0.0
        self.before = Before()
        self.lost = Lost()

    def begin(self, model, t, y: States):
        """The empty step at the start of a run."""
        before = self.before
        self.taken = self.refused = self.called = before.happened = before.idle = 0
        self.size = before.length = 0.0
        before.t_event = t
        self.event = False
        self.modes0 = STUCK
        self.stand(model, t, y, self.modes0, NEAR)

    def stand(self, model, t, y: States, modes: Contacts, near):
        """The empty step at t, after these modes: both its ends are there, and a step size is at hand unless all stands
        still."""
        if model.linear:
            lost = self.lost
            lost.t1 = lost.x1 = 0.0
        self.t1, self.y1 = t, y
        if model.dry:
            self.set_modes(model, modes, near)
        self.arrive(model)
        if not (model.waits and self.sticks and every(self.modes1 == STUCK)):
            if self.size == 0.0 and self.methods.chosen != EXACT:
                self.size = self.first_size()
        self.t0 = t
        self.keep_counts()

    def keep_counts(self):
        """What holds at t1, where the next step begins."""
        before = self.before
        before.taken, before.refused = self.taken, self.refused
        before.called, before.size = self.called, self.size

    def go_back(self):
        """Forget what the step that began at t0 has counted."""
        before = self.before
        self.taken, self.refused = before.taken, before.refused
        self.called, self.size = before.called, before.size

    def take(self, model):
        """The internal step from t1 on; OK or the reason why not."""
        if model.dry and not self.fits:
            return UNSETTLED
        if model.dry and self.event:
            self.note_event()
            self.event = False
        before = self.before
        if self.t1 > self.t0:
            before.length = self.t1 - self.t0
        self.keep_counts()
        self.t0, self.y0 = self.t1, self.y1
        self.f0, self.modes0 = self.f1, self.modes1
        self.waiting = self.interpolant.ready = False
        if model.waits and self.sticks and (every(self.modes0 == STUCK) or self.touches):
            status = self.wait(model)
        elif model.linear and self.methods.chosen == EXACT:
            if model.ramps and self.methods.exact.kind == BENT:
                status = self.take_stretch(model)
            else:
                status = self.take_piece(model)
        else:
            status = self.take_step(model)
        self.taken += 1
        t = self.t0
        if self.t1 - t > 16.0 * ULP * (t if t > 0.0 else -t):
            before.idle = 0
        else:
            before.idle += 1
            if before.idle > MOST_IDLE:
                return STALLED
        return status

    def note_event(self):
        self.before.happened += 1
        self.before.t_event = self.t1

    def wait(self, model):
        """Stand still until a load exceeds what friction holds."""
        if model.linear:
            self.lost.carry()
        self.waiting, self.touches = True, False
        self.y1 = self.y0
        for i in contacts:
            self.y1[slip[i]] = 0.0
        ends, ways = per_contact(), per_contact()
        for i in contacts:
            ends[i], ways[i] = model.release(self.t0, self.y1, i)
        end = first(ends)
        if end <= self.t_end and end < inf:
            self.t1 = end
            for i in contacts:
                self.modes1[i] = ways[i]
            self.begin_anew(model)
            for i in contacts:
                if self.modes1[i] != STUCK:
                    self.f1[slip[i]] = model.departure(end, self.y1, self.modes1, i)
        else:
            self.t1, self.f1 = self.t_end, 0.0
        return OK

    def take_piece(self, model):
        """One closed form, up to the next standstill or to the end of the run."""
        exact = self.methods.exact
        lost = self.lost
        lost.carry()
        exact.begin(self.y0, self.f0, model.push(self.t0, self.modes0), lost.x0)
        self.t1 = self.t_end
        if model.dry:
            ahead = exact.standstill(self.modes0)
            elapsed = ahead + lost.t0
            end = self.t0 + elapsed
            if end <= self.t_end and end < inf:
                moved = end - self.t0
                lost.t1 = (self.t0 - (end - moved)) + (elapsed - moved)
                self.t1 = end
                self.y1, lost.x1 = exact.end(ahead)
                return self.stop(model)
        if self.t1 < inf:
            lost.x1 = 0.0
            self.y1 = exact.at(self.t1 - self.t0 - lost.t0)
            self.f1 = model.rates(self.t1, self.y1, self.modes1)
            if not total(magnitude(self.y1)) < HUGE:
                return DIVERGED
        return OK

    def take_stretch(self, model):
        """A stretch of a motion under a force that bends, up to the next standstill."""
        exact = self.methods.exact
        pace = exact.z + exact.w
        span = self.longest if self.longest * pace < 1.0 else 1.0 / pace
        left = self.t_end - self.t0
        last = span >= left
        if last:
            span = left
        exact.begin(self.y0, self.f0, 0.0, 0.0)
        exact.bend(model, self.t0, span)
        self.t1 = self.t_end if last else self.t0 + span
        if model.dry:
            share, ends = exact.series.first_zero(self.modes0)
            if share < 1.0:
                self.t1 = self.t0 + share * span
            if ends:
                self.y1 = exact.at(share * span)
                for i in contacts:
                    self.y1[slip[i]] = 0.0
                return self.stop(model)
        self.y1 = exact.at(self.t1 - self.t0)
        self.f1 = model.rates(self.t1, self.y1, self.modes1)
        return OK if total(magnitude(self.y1)) < HUGE else DIVERGED

    def take_step(self, model):
        """One step of the method that meets the tolerance, cut where the mode changes."""
        t, y, f, modes = self.t0, self.y0, self.f0, self.modes0
        tolerance = self.tolerance
        smallest = 16.0 * ULP * (t if t > 0.0 else -t)  # a third of the time of fabs; so below, for it is in each step
        size = self.size if self.size < self.longest else self.longest
        if size < smallest:
            size = smallest
        left = self.t_end - t
        last = 1.1 * size >= left
        h = left if last else size
        scale = magnitude(y)
        scale = greater(self.least, scale)
        tries = 0
        methods = self.methods
        while True:
            y1, f1, e = methods.propose(model, modes, t, y, f, h)
            self.called += methods.stages
            far = magnitude(y1)
            e = magnitude(e) / greater(far, scale)
            error = h * largest(e) / tolerance
            if error <= 1.0 and total(far, e) < HUGE:  # NaN leaves here too
                break
            self.refused += 1
            tries += 1
            if h <= smallest or tries == MOST_TRIES:
                return STALLED if error < inf and total(far) < HUGE else DIVERGED
            shrink = methods.safety * error**-methods.power if 1.0 < error < inf and tries == 1 else 0.5
            lowest = methods.shrink if tries == 1 else 0.5
            size = h * (shrink if shrink > lowest else lowest)
            if size < smallest:
                size = smallest
            h = size
            last = False
        if tries == 0:
            grow = methods.safety * error**-methods.power if error > 1e-9 else methods.grow
            size = h * (grow if grow < methods.grow else methods.grow)
        self.size = size
        self.span = h
        self.t1, self.y1, self.f1 = self.t_end if last else t + h, y1, f1
        if model.dry and self.sticks:
            ends = per_contact()
            if model.coupled:
                ends = model.ends(self)
            else:
                for i in contacts:
                    ends[i] = model.reversal(self, i)
            if self.interpolant.ready:  # the search had to look inside
                self.called += self.methods.extra
            end = first(ends)
            if end <= self.t1:
                self.y1 = self.at(model, end)
                self.t1 = end
                if model.coupled:
                    self.y1, self.modes1, self.fits = model.after(self, ends, self.near(model))
                else:
                    for i in contacts:
                        self.y1[slip[i]] = 0.0
                return self.stop(model)
            if model.coupled:
                self.y1 = model.at_rest(self.t1, self.y1, modes)
                self.f1 = kinematic(speeds_of(self.y1), self.f1)
        return OK

    def stop(self, model):
        """The speed of a contact has come to zero at t1: stick, or slide the other way, or go on if it only touches
        zero; or its load has come to the limit: let go."""
        if not model.coupled:
            self.set_modes(model, self.modes0, self.near(model))
        self.begin_anew(model)
        return OK if total(magnitude(self.y1)) < HUGE else DIVERGED

    def near(self, model):
        """How far what was computed up to here may be from a tie, as a share."""
        return NEAR if model.linear and self.methods.chosen == EXACT else NEARLY * self.tolerance

    def set_modes(self, model, modes: Contacts, near):
        """The modes that hold from t1 on, after these."""
        self.modes1, self.touches, self.fits = STUCK, False, True
        if self.sticks:
            if model.coupled:
                self.y1, self.modes1, self.fits = model.begun(self.t1, self.y1, modes, near, near)
            else:
                for i in contacts:
                    self.modes1[i] = model.settle(self.t1, self.y1, near, i)
                    if self.y1[slip[i]] == 0.0 and self.modes1[i] != modes[i] != STUCK:
                        if model.touches(self.t1, self.y1, modes, near, i):
                            self.modes1[i], self.touches = modes[i], True

    def arrive(self, model):
        """The rates in the modes that hold from t1 on."""
        if model.waits and self.sticks and every(self.modes1 == STUCK):
            self.f1 = 0.0
        else:
            self.f1 = model.rates(self.t1, self.y1, self.modes1)
            self.called += 1
            if model.dry and not model.coupled:
                for i in contacts:
                    if self.sticks and self.y1[slip[i]] == 0.0 and self.modes1[i] * self.f1[slip[i]] < 0.0:
                        self.fits = self.touches or model.goes_its_way(self.t1, self.y1, self.modes1, i)
                        self.f1[slip[i]] = 0.0  # the last bit at a break-away: no body starts against its mode

    def begin_anew(self, model):
        """The step has been cut: forget the slopes, but keep the step size of the last slide, if there was one."""
        self.event = some(self.modes1 != self.modes0)  # a slide that only touches zero goes on
        self.arrive(model)
        if self.size == 0.0 and self.methods.chosen != EXACT:
            self.size = self.first_size()

    def first_size(self):
        """The step to try first, from the slopes at t1."""
        far = magnitude(self.y1)
        pace = magnitude(self.f1) / greater(far, self.least)
        rate = largest(pace)
        size = self.methods.safety * self.tolerance**self.methods.power
        return size / rate if size < rate * self.longest else self.longest

    def at(self, model, t) -> States:
        """The state at t inside the step."""
        inside = self.interpolant
        if not inside.ready:
            if model.waits and self.waiting:
                return self.y1
            if model.linear and self.methods.chosen == EXACT:
                return self.methods.exact.at(t - self.t0 - self.lost.t0)
            self.methods.expand(model, self)
        return inside.at(t - self.t0)
