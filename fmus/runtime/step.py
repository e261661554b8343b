"""One internal step: propose, judge, accept; end it at an event; interpolate inside it.

The step goes from t0 to t1.  It is a stick, up to the break-away; or a closed form, up to the next standstill; or a
step of a method that meets the tolerance.  Its size is controlled as the public descriptions of MATLAB's ode23 and
ode45 give it (L. F. Shampine, M. W. Reichelt, The MATLAB ODE Suite, SIAM J. Sci. Comput. 18 (1997) 1-22).
"""

from math import fabs, inf

from .codes import DIVERGED, EXACT, OK, STALLED, STUCK
from .interpolant import Interpolant
from .methods import Methods
from .rounding import NEAR, ULP

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
    """What the doubles t0, x0, t1, x1 of a step lack.

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

    def __init__(self):
        self.methods = Methods()
        # the run: tolerances in force, largest step, stop time (inf where unknown), whether zero speed is a mode
        self.tolerance = self.longest = self.least_x = self.least_v = 0.0
        self.t_end = inf
        self.sticks = False
        # the step: its beginning, its end, the mode within and the mode after
        self.t0 = self.x0 = self.v0 = self.a0 = 0.0
        self.t1 = self.x1 = self.v1 = self.a1 = 0.0
        self.mode0 = self.mode1 = STUCK
        # it stands still; the mode changes at its end; the speed only touches zero there, and the slide goes on
        self.waiting = self.event = self.touches = False
        # the length of the step before an event cut it, and what holds within
        self.span = 0.0
        self.interpolant = Interpolant()
        # counts up to t1, and the size to try next; the same at t0
        self.taken = self.refused = self.called = self.looked = 0
        self.size = 0.0
        self.before = Before()
        self.lost = Lost()

    def begin(self, model, t, x, v):
        """The empty step at the start of a run."""
        before = self.before
        self.taken = self.refused = self.called = before.happened = before.idle = 0
        self.size = before.length = 0.0
        before.t_event = t
        self.event = False
        self.stand(model, t, x, v, STUCK, NEAR)

    def stand(self, model, t, x, v, mode, near):
        """The empty step at t, after a mode: both its ends are there, and a step size is at hand unless the body is
        stuck."""
        lost = self.lost
        lost.t1 = lost.x1 = 0.0
        self.t1, self.x1, self.v1 = t, x, v
        self.settle(model, mode, near)
        self.arrive(model)
        if self.size == 0.0 and self.methods.chosen != EXACT and not (self.sticks and self.mode1 == STUCK):
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
        if self.event:
            self.note_event()
            self.event = False
        before = self.before
        before.length = self.t1 - self.t0
        self.keep_counts()
        self.t0, self.x0, self.v0 = self.t1, self.x1, self.v1
        self.a0, self.mode0 = self.a1, self.mode1
        self.waiting = self.interpolant.ready = False
        status = OK
        if self.sticks and (self.mode0 == STUCK or self.touches) and model.dry:
            self.wait(model)
        elif self.methods.chosen == EXACT and model.linear:
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
        """Stand still until the load exceeds what friction holds."""
        self.lost.carry()
        self.waiting, self.touches = True, False
        self.x1, self.v1 = self.x0, 0.0
        release, direction = model.release(self.t0, self.x0, 0.0)
        if release <= self.t_end and release < inf:
            self.t1, self.mode1 = release, direction
            self.begin_anew(model)
            self.a1 = model.departure(release, self.x1, 0.0, direction)
        else:
            self.t1, self.a1 = self.t_end, 0.0

    def take_piece(self, model):
        """One closed form, up to the next standstill or to the end of the run."""
        lost = self.lost
        lost.carry()
        model.exact.begin(self.x0, self.v0, self.a0, model.push(self.t0, self.mode0), lost.x0)
        self.t1 = self.t_end
        if model.dry:
            ahead = model.exact.standstill(self.mode0)
            elapsed = ahead + lost.t0
            end = self.t0 + elapsed
            if end <= self.t_end and end < inf:
                moved = end - self.t0
                lost.t1 = (self.t0 - (end - moved)) + (elapsed - moved)
                self.t1 = end
                self.x1, lost.x1 = model.exact.end(ahead)
                self.v1 = 0.0
                return self.stop(model)
        if self.t1 < inf:
            lost.x1 = 0.0
            self.x1, self.v1 = model.exact.at(self.t1 - self.t0 - lost.t0)
            self.a1 = model.rates(self.t1, self.x1, self.v1, self.mode1)
            if not fabs(self.x1) + fabs(self.v1) < HUGE:
                return DIVERGED
        return OK

    def take_step(self, model):
        """One step of the method that meets the tolerance, cut where the mode changes."""
        t, x, v, a, mode = self.t0, self.x0, self.v0, self.a0, self.mode0
        tolerance = self.tolerance
        smallest = 16.0 * ULP * (t if t > 0.0 else -t)  # a third of the time of fabs; so below, for it is in each step
        size = self.size if self.size < self.longest else self.longest
        if size < smallest:
            size = smallest
        left = self.t_end - t
        last = 1.1 * size >= left
        h = left if last else size
        size_x, size_v = x if x > 0.0 else -x, v if v > 0.0 else -v
        if size_x < self.least_x:
            size_x = self.least_x
        if size_v < self.least_v:
            size_v = self.least_v
        tries = 0
        methods = self.methods
        while True:
            x1, v1, a1, e_x, e_v = methods.step(model, mode, t, x, v, a, h)
            self.called += methods.stages
            y, w = x1 if x1 > 0.0 else -x1, v1 if v1 > 0.0 else -v1
            p = (e_x if e_x > 0.0 else -e_x) / (y if y > size_x else size_x)
            q = (e_v if e_v > 0.0 else -e_v) / (w if w > size_v else size_v)
            error = h * (p if p > q else q) / tolerance
            if error <= 1.0 and y + w + p + q < HUGE:  # NaN leaves here too
                break
            self.refused += 1
            tries += 1
            if h <= smallest or tries == MOST_TRIES:
                return STALLED if error < inf and y + w < HUGE else DIVERGED
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
        self.t1, self.x1, self.v1, self.a1 = self.t_end if last else t + h, x1, v1, a1
        if mode != STUCK and model.dry:
            end = model.reversal(self)
            if self.interpolant.ready:  # the search had to look inside
                self.called += self.methods.extra
            if end <= self.t1:
                self.t1 = end
                self.x1, _ = self.at(model, end)
                self.v1 = 0.0
                return self.stop(model)
        return OK

    def stop(self, model):
        """The speed has come to zero at t1: stick, or slide the other way, or go on if it only touches zero."""
        self.settle(model, self.mode0, self.near(model))
        self.begin_anew(model)
        return OK if fabs(self.x1) < HUGE else DIVERGED

    def near(self, model):
        """How far what was computed up to here may be from a tie, as a share."""
        return NEAR if self.methods.chosen == EXACT and model.linear else NEARLY * self.tolerance

    def settle(self, model, mode, near):
        """The mode that holds from t1 on, after another."""
        self.mode1, self.touches = STUCK, False
        if self.sticks and model.dry:
            self.mode1 = model.settle(self.t1, self.x1, self.v1, near)
            if self.v1 == 0.0 and self.mode1 != mode != STUCK and model.touches(self.t1, self.x1, self.v1, mode, near):
                self.mode1, self.touches = mode, True

    def arrive(self, model):
        """The acceleration in the mode that holds from t1 on."""
        if self.sticks and self.mode1 == STUCK:
            self.a1 = 0.0
        else:
            self.a1 = model.rates(self.t1, self.x1, self.v1, self.mode1)
            self.called += 1
            if self.sticks and self.v1 == 0.0 and self.mode1 * self.a1 < 0.0:
                self.a1 = 0.0  # the last bit at a break-away without a jump: no body starts against its mode

    def begin_anew(self, model):
        """The step has been cut: forget the slope, but keep the step size of the last slide, if there was one."""
        self.event = self.mode1 != self.mode0  # a slide that only touches zero goes on
        self.arrive(model)
        if self.size == 0.0 and self.methods.chosen != EXACT:
            self.size = self.first_size()

    def first_size(self):
        """The step to try first, from the slopes at t1."""
        x, v = fabs(self.x1), fabs(self.v1)
        p = fabs(self.v1) / (x if x > self.least_x else self.least_x)
        q = fabs(self.a1) / (v if v > self.least_v else self.least_v)
        rate = p if p > q else q
        size = self.methods.safety * self.tolerance**self.methods.power
        return size / rate if size < rate * self.longest else self.longest

    def at(self, model, t):
        """Position and speed at t inside the step."""
        inside = self.interpolant
        if not inside.ready:
            if self.waiting:
                return self.x0, 0.0
            if self.methods.chosen == EXACT and model.linear:
                return model.exact.at(t - self.t0 - self.lost.t0)
            self.methods.expand(model, self)
        return inside.at(t - self.t0)
