"""The free-running march: the solver steps as it likes, whatever the communication points are, and interpolates there.

The march owns the internal step that covers the present point t, and tells the counts up to t: what was computed
beyond it, because somebody looked ahead, does not show.
"""

from math import fabs, inf, nan

from .declare import Choice, Count, Fixed, Local
from .methods import ITEMS, ODE23
from .step import DIVERGED, HUGE, HYBRID, OK, STUCK, Step

ENDLESS = 3
MOST_STEPS = 2_000_000  # within one communication step: half a minute at most, then a sentence


class March(Step):
    """Solver settings, counts, and the present point."""

    method = Choice(ODE23, "integration method", ITEMS)
    rtol = Fixed(0.0, "1", "relative tolerance; 0 takes the importer's", low=0.0, below=1.0)
    atol = Fixed(
        0.0,
        "1",
        "absolute tolerance in SI units; 0 takes 1e-3 of rtol, less where creep matters",
        low=0.0,
    )
    h_max = Fixed(0.0, "s", "largest internal step; 0 takes a tenth of the run", low=0.0)
    steps = Count("accepted internal steps up to the present point")
    rejected = Count("refused internal steps up to the present point")
    evaluations = Count("right-hand sides evaluated up to the present point")
    h = Local("s", "size of the internal step in force")
    t_next = Local("s", "end of the internal step that covers the time after the present point; computed when read")

    def __init__(self):
        super().__init__()
        self.t = self.x = self.v = 0.0
        self.mode = STUCK
        # what the present point was before its values were renewed
        self.renewed = False
        self.called_then = self.happened_then = self.mode_then = 0
        self.size_then = 0.0
        self.t_event_then = nan

    # ---- the run

    def start(self, model, t, x, v, t_end, tolerance):
        """Begin a run at t; t_end is inf where the importer does not know it."""
        run = t_end - t if t_end < inf else model.stop_time
        self.tolerance = self.rtol if self.rtol > 0.0 else tolerance
        self.longest = self.h_max if self.h_max > 0.0 else 0.1 * run
        self.t_end = t_end
        self.methods.choose(self.method)
        self.taken = self.refused = self.called = self.happened = self.idle = 0
        self.size = self.last_size = 0.0
        self.t_event = nan
        self.event = self.renewed = False
        if model.dry:
            self.sticks = model.friction == HYBRID
        self.t1, self.x1, self.v1 = t, x, v
        self.scale(model)
        self.settle(model)
        self.stand()

    def restart(self, model):
        """Discard what lies beyond the present point, and go on from there with the values that now hold.

        Whoever sets two values at one point may read between them: the second time starts from where the first did.
        """
        if self.t > self.t0:
            self.last_size = self.t1 - self.t0
            if self.event and self.t >= self.t1:
                self.note_event()
        else:
            self.taken, self.refused, self.called = self.taken0, self.refused0, self.called0
            self.size = self.size0
        self.event = False
        if self.renewed:
            self.called, self.happened, self.size = self.called_then, self.happened_then, self.size_then
            self.t_event = self.t_event_then
        else:
            self.renewed = True
            self.called_then, self.happened_then, self.size_then = self.called, self.happened, self.size
            self.t_event_then, self.mode_then = self.t_event, self.mode
        self.t1, self.x1, self.v1 = self.t, self.x, self.v
        self.scale(model)
        self.settle(model)
        if self.mode1 != self.mode_then:
            self.note_event()
        self.stand()

    def scale(self, model):
        """The sizes of position and speed below which the tolerance is absolute."""
        size = self.atol / self.tolerance if self.atol > 0.0 else 1e-3
        self.least_x = self.least_v = size if size > 1e-300 else 1e-300  # divisors
        finest = model.finest()
        if self.atol == 0.0 and finest < self.least_v:
            self.least_v = finest

    def stand(self):
        """The present point is both ends of an empty step, and a step size is at hand unless the body is stuck."""
        if self.size == 0.0 and not (self.sticks and self.mode1 == STUCK):
            self.size = self.first_size()
        self.t, self.x, self.v, self.mode = self.t1, self.x1, self.v1, self.mode1
        self.t0 = self.t1
        self.taken0, self.refused0, self.called0, self.size0 = self.taken, self.refused, self.called, self.size

    # ---- the present point

    def advance(self, model, t):
        """Take the present point to t; OK or the reason why not."""
        if self.t1 < t:
            status = self.cover(model, t)
            if status != OK:
                return status
        self.t, self.renewed = t, False
        if t < self.t1:
            self.x, self.v = self.at(model, t)
            self.mode = self.mode0
            if self.t1 == inf and not fabs(self.x) + fabs(self.v) < HUGE:
                return DIVERGED  # a step without end has not been judged at its end
        else:
            self.x, self.v, self.mode = self.x1, self.v1, self.mode1
        return OK

    def cover(self, model, t):
        """Take internal steps until one of them covers t."""
        for _ in range(MOST_STEPS):
            status = self.take(model)
            if status != OK or self.t1 >= t:
                return status
        return ENDLESS

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
