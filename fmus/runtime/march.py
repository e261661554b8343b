"""The free-running march: propose a step, judge it, end it at an event, interpolate inside it, count.

The march owns the internal step [t0, t1] that covers the present point t.  It steps as the solver likes, whatever
the communication points are, and interpolates at them.  Step control of ode23 as the public descriptions of
MATLAB's program give it (L. F. Shampine, M. W. Reichelt, The MATLAB ODE Suite, SIAM J. Sci. Comput. 18 (1997)).
"""

from math import fabs, inf, nan

from .declare import Choice, Count, Declaring, Fixed, Local
from .methods import EXACT, ITEMS, ODE23, Methods

OK, DIVERGED, STALLED, ENDLESS = 0, 1, 2, 3

STUCK, HYBRID = 0, 1
ULP = 2.220446049250313e-16
MOST_STEPS = 2_000_000  # within one communication step: half a minute at most, then a sentence
MOST_TRIES = 200  # of one step, which halves each time
MOST_IDLE = 100  # steps in a row that hardly move the time


class March(Declaring):
    """Solver settings, counts and the state of the integration."""

    method = Choice(ODE23, "integration method", ITEMS)
    rtol = Fixed(0.0, "1", "relative tolerance; 0 takes the importer's", low=0.0, below=1.0)
    atol = Fixed(0.0, "1", "absolute tolerance in SI units; 0 takes 1e-3 of rtol", low=0.0)
    h_max = Fixed(0.0, "s", "largest internal step; 0 takes a tenth of the run", low=0.0)
    steps = Count("accepted internal steps up to the present point")
    rejected = Count("refused internal steps up to the present point")
    evaluations = Count("right-hand sides evaluated up to the present point")
    h = Local("s", "size of the internal step in force")
    t_next = Local("s", "end of the internal step that covers the time after the present point; computed when read")

    def __init__(self):
        super().__init__()
        self.methods = Methods()
        # the run: tolerances in force, largest step, stop time (inf where unknown)
        self.tolerance = self.threshold = self.longest = 0.0
        self.t_end = inf
        # the present point
        self.t = self.x = self.v = 0.0
        self.mode = STUCK
        # the internal step: its beginning, its end, the mode within and the mode after
        self.t0 = self.x0 = self.v0 = self.a0 = 0.0
        self.t1 = self.x1 = self.v1 = self.a1 = 0.0
        self.mode0 = self.mode1 = STUCK
        self.sticks = self.waiting = self.expanded = self.event = False
        # what the interpolant stands on: the length and the end of the step before an event cut it
        self.span = self.xe = self.ve = self.ae = 0.0
        # counts up to t1 and up to t0, and the size to try next
        self.taken = self.refused = self.called = self.happened = self.idle = 0
        self.taken0 = self.refused0 = self.called0 = 0
        self.size = self.last_size = self.size0 = 0.0
        self.t_event = nan

    # ---- the run

    def start(self, model, t, x, v, t_end, tolerance):
        """Begin a run at t; t_end is inf where the importer does not know it."""
        run = t_end - t if t_end < inf else model.stop_time
        self.tolerance = self.rtol if self.rtol > 0.0 else tolerance
        absolute = self.atol if self.atol > 0.0 else 1e-3 * self.tolerance
        self.threshold = absolute / self.tolerance
        self.longest = self.h_max if self.h_max > 0.0 else 0.1 * run
        self.t_end = t_end
        self.methods.choose(self.method)
        self.taken = self.refused = self.called = self.happened = self.idle = 0
        self.size = self.last_size = 0.0
        self.t_event = nan
        self.event = False
        if model.dry:
            self.sticks = model.friction == HYBRID
        self.t1, self.x1, self.v1 = t, x, v
        self.settle(model)
        self.size = self.first_size()
        self.stand()

    def restart(self, model):
        """Discard what lies beyond the present point, and go on from there with the values that now hold."""
        if self.t > self.t0:
            if self.event and self.t >= self.t1:
                self.note_event()
        else:
            self.taken, self.refused, self.called = self.taken0, self.refused0, self.called0
            self.size = self.size0
        self.event = False
        self.t1, self.x1, self.v1 = self.t, self.x, self.v
        self.settle(model)
        if self.mode1 != self.mode:
            self.note_event()
        if self.size == 0.0:
            self.size = self.first_size()
        self.stand()

    def settle(self, model):
        """The mode and the acceleration that hold from t1 on."""
        self.mode1 = STUCK
        if model.dry and self.sticks:
            self.mode1 = model.settle(self.t1, self.x1, self.v1)
        self.arrive(model)

    def arrive(self, model):
        """The acceleration in the mode that holds from t1 on."""
        if self.sticks and self.mode1 == STUCK:
            self.a1 = 0.0
        else:
            self.a1 = model.acceleration(self.t1, self.x1, self.v1, self.mode1)
            self.called += 1

    def stand(self):
        """The present point is both ends of an empty step."""
        self.t, self.x, self.v, self.mode = self.t1, self.x1, self.v1, self.mode1
        self.t0 = self.t1
        self.remember()

    def remember(self):
        """Counts and step size at the beginning of the step, for when the present point is still there."""
        self.taken0, self.refused0, self.called0, self.size0 = self.taken, self.refused, self.called, self.size

    def note_event(self):
        self.happened += 1
        self.t_event = self.t1

    # ---- the present point

    def advance(self, model, t):
        """Take the present point to t; OK or the reason why not."""
        left = MOST_STEPS
        while self.t1 < t:
            status = self.take(model)
            if status != OK:
                return status
            left -= 1
            if left == 0:
                return ENDLESS
        self.t = t
        if t == self.t1:
            self.x, self.v, self.mode = self.x1, self.v1, self.mode1
        else:
            self.x, self.v = self.at(model, t)
            self.mode = self.mode0
        return OK

    def look_ahead(self, model):
        """Where the internal step that covers the time after the present point ends; NaN if it fails."""
        while self.t >= self.t1 and self.t1 < self.t_end:
            if self.take(model) != OK:
                self.t_next = nan
                return
        self.t_next = self.t1

    def report(self, events):
        """The declared counts, up to the present point."""
        here = self.event and self.t >= self.t1
        events.count = self.happened + 1 if here else self.happened
        events.t_last = self.t1 if here else self.t_event
        if self.t > self.t0:
            self.steps, self.rejected, self.evaluations = self.taken, self.refused, self.called
            self.h = self.t1 - self.t0
        else:
            self.steps, self.rejected, self.evaluations = self.taken0, self.refused0, self.called0
            self.h = self.last_size

    # ---- one internal step

    def take(self, model):
        """The internal step from t1 on."""
        if self.event:
            self.note_event()
            self.event = False
        self.last_size = self.t1 - self.t0
        self.remember()
        self.t0, self.x0, self.v0, self.a0, self.mode0 = self.t1, self.x1, self.v1, self.a1, self.mode1
        self.waiting = False
        status = OK
        if model.dry and self.sticks and self.mode0 == STUCK:
            self.wait(model)
        elif model.linear and self.method == EXACT:
            status = self.take_piece(model)
        else:
            status = self.take_step(model)
        self.taken += 1
        if self.t1 - self.t0 > 16.0 * ULP * fabs(self.t0):
            self.idle = 0
        else:
            self.idle += 1
            if self.idle > MOST_IDLE:
                return STALLED
        return status

    def wait(self, model):
        """Stand still until the load exceeds what friction holds."""
        self.waiting = True
        self.x1, self.v1 = self.x0, 0.0
        release, direction = model.release(self.t0, self.x0)
        if release <= self.t_end and release < inf:
            self.t1, self.mode1 = release, direction
            self.begin_anew(model)
        else:
            self.t1, self.a1 = self.t_end, 0.0

    def take_piece(self, model):
        """One closed form, up to the next standstill or to the end of the run."""
        model.exact.begin(self.x0, self.v0, self.a0, model.push(self.t0, self.mode0))
        self.t1 = self.t_end
        if model.dry:
            end = self.t0 + model.exact.standstill(self.mode0)
            if end <= self.t_end and end < inf:
                self.t1 = end
                self.x1, _ = model.exact.at(end - self.t0)
                self.v1 = 0.0
                return self.stop(model)
        if self.t1 < inf:
            self.x1, self.v1 = model.exact.at(self.t1 - self.t0)
            self.a1 = model.acceleration(self.t1, self.x1, self.v1, self.mode1)
            if not fabs(self.x1) + fabs(self.v1) < inf:
                return DIVERGED
        return OK

    def take_step(self, model):
        """One step of the method that meets the tolerance, cut where the mode changes."""
        t, x, v, a, mode = self.t0, self.x0, self.v0, self.a0, self.mode0
        threshold, tolerance = self.threshold, self.tolerance
        smallest = 16.0 * ULP * fabs(t)
        size = self.size if self.size < self.longest else self.longest
        if size < smallest:
            size = smallest
        left = self.t_end - t
        last = 1.1 * size >= left
        h = left if last else size
        size_x, size_v = fabs(x), fabs(v)
        if size_x < threshold:
            size_x = threshold
        if size_v < threshold:
            size_v = threshold
        tries = 0
        methods = self.methods
        while True:
            x1, v1, a1, e_x, e_v = methods.step(model, mode, t, x, v, a, h)
            self.called += methods.stages
            p, q = fabs(x1), fabs(v1)
            p = fabs(e_x) / (p if p > size_x else size_x)
            q = fabs(e_v) / (q if q > size_v else size_v)
            error = h * (p if p > q else q) / tolerance
            if error <= 1.0 and fabs(x1) + fabs(v1) < inf:
                break
            self.refused += 1
            tries += 1
            if h <= smallest or tries == MOST_TRIES:
                return STALLED if error < inf else DIVERGED
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
        self.span, self.xe, self.ve, self.ae = h, x1, v1, a1
        self.expanded = False
        self.t1, self.x1, self.v1, self.a1 = self.t_end if last else t + h, x1, v1, a1
        if model.dry and mode != STUCK:
            end = model.reversal(self)
            if self.expanded:  # the search had to look inside
                self.called += self.methods.extra
            if end <= self.t1:
                self.t1 = end
                self.x1, _ = self.at(model, end)
                self.v1 = 0.0
                return self.stop(model)
        return OK

    def stop(self, model):
        """The speed has come to zero at t1: stick, or slide the other way."""
        self.mode1 = model.settle(self.t1, self.x1, 0.0)
        self.begin_anew(model)
        return OK if fabs(self.x1) < inf else DIVERGED

    def begin_anew(self, model):
        """An event ends the step: forget the slope and the step size."""
        self.event = True
        self.arrive(model)
        self.size = self.first_size()

    def first_size(self):
        """The step to try first, from the slopes at t1."""
        x, v = fabs(self.x1), fabs(self.v1)
        p = fabs(self.v1) / (x if x > self.threshold else self.threshold)
        q = fabs(self.a1) / (v if v > self.threshold else self.threshold)
        rate = p if p > q else q
        size = self.methods.safety * self.tolerance**self.methods.power
        return size / rate if size < rate * self.longest else self.longest

    def at(self, model, t):
        """Position and speed at t inside the step."""
        if self.waiting:
            return self.x0, 0.0
        if model.linear and self.method == EXACT:
            return model.exact.at(t - self.t0)
        if not self.expanded:
            self.methods.expand(
                model, self.mode0, self.t0, self.x0, self.v0, self.a0, self.span, self.xe, self.ve, self.ae
            )
            self.expanded = True
        return self.methods.at((t - self.t0) / self.span)
