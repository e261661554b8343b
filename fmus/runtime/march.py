"""The free-running march: the solver steps as it likes, whatever the communication points are, and interpolates there.

The march owns the internal step that covers the present point t, and tells the counts up to t: what was computed
beyond it, because somebody looked ahead, does not show.
"""

from math import inf, nan

from . import ode23
from .codes import DIVERGED, ENDLESS, HYBRID, OK, STUCK
from .declare import Choice, Count, Declaring, Fixed, Local
from .exact import BENT
from .methods import ITEMS
from .step import HUGE, Step
from .vectors import Contacts, States, contacts, every, magnitude, slip, some, speeds, total

NOMINAL = 1e-3  # size of a position or a speed, in SI units, where nobody sets one
# Within one communication step, so that a sentence comes after half a minute at most, on a slow machine too:
ROUNDS, ROUND = 2000, 1000  # the calls are counted after each round
MOST_STEPS = ROUNDS * ROUND  # internal steps
MOST_CALLS = 8_000_000  # right-hand sides, and looks inside a step for its events


class March(Declaring):
    """Solver settings, counts, and the present point."""

    method = Choice(ode23.NUMBER, "integration method", ITEMS)
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

    modes_then: Contacts

    def __init__(self):
        super().__init__()
        self.step = Step()
        self.t = self.y = 0.0
        self.modes = STUCK
        self.run = 1.0  # length of the default run
        # what the present point was before its values were renewed
        self.renewed_at = nan
        self.called_then = self.happened_then = 0
        self.modes_then = STUCK
        self.size_then = 0.0
        self.t_event_then = nan

    # ---- the run

    def start(self, model, t, y: States, t_end, tolerance):
        """Begin a run at t; t_end is inf where the importer does not know it."""
        step = self.step
        run = t_end - t if t_end < inf else model.stop_time
        step.tolerance = self.rtol if self.rtol > 0.0 else tolerance
        step.longest = self.h_max if self.h_max > 0.0 else 0.1 * run
        step.t_end = t_end
        self.run = model.stop_time
        step.methods.choose(self.method)
        if model.dry:
            step.sticks = model.friction == HYBRID
        self.fit(model)
        step.begin(model, t, y)
        self.renewed_at = nan
        self.arrive()

    def restart(self, model):
        """Discard what lies beyond the present point, and go on from there with the values that now hold.

        Whoever sets two values at one point may read between them: the second time starts from where the first did.
        """
        step = self.step
        if self.t > step.t0:
            step.before.length = self.told_end() - step.t0
            if model.dry and step.event and self.t >= step.t1:
                step.note_event()
                self.modes = step.modes1  # if the event still waited to be handled, it has been now
        else:
            step.go_back()
        step.event = False
        before = step.before
        if self.renewed_at == self.t:
            step.called, before.happened, step.size = self.called_then, self.happened_then, self.size_then
            before.t_event = self.t_event_then
        else:
            self.renewed_at = self.t
            self.called_then, self.happened_then, self.size_then = step.called, before.happened, step.size
            self.t_event_then, self.modes_then = before.t_event, self.modes
        self.fit(model)
        if model.dry and step.sticks and not model.coupled:
            for i in contacts:
                if self.modes_then[i] * self.y[slip[i]] < 0.0:
                    self.y[slip[i]] = 0.0  # within a slide a speed against its mode is rounding
        step.stand(model, self.t, self.y, self.modes_then, step.near(model))
        if model.dry and some(step.modes1 != self.modes_then):
            step.note_event()
        self.arrive()

    def fit(self, model):
        """The sizes of the states below which the tolerance is absolute; and what closed forms follow from."""
        step = self.step
        size = self.atol / step.tolerance if self.atol > 0.0 else NOMINAL
        size = size if size > 1e-300 else 1e-300  # a divisor
        step.least = size
        finest = model.finest()
        if self.atol == 0.0 and finest < size:
            for i in speeds:
                step.least[i] = finest
        if model.linear:
            mass, damping, stiffness, drift = model.piece()
            step.methods.exact.prepare(mass, damping, stiffness, drift)
            if model.ramps and model.bends():
                step.methods.exact.kind = BENT
            elif model.ramps:
                step.methods.exact.follow(model.push_rate(self.t, 1))

    # ---- the present point

    def advance(self, model, t):
        """Take the present point to t; OK or the reason why not."""
        step = self.step
        if step.t1 < t:
            status = step.take(model)
            if status == OK and step.t1 < t:
                status = self.cover(model, t)
            if status != OK:
                return status
        if t < step.t1:
            self.t, self.modes = t, step.modes0
            inside = step.interpolant
            if inside.ready:  # as step.at has it, and one call less in most communication steps
                self.y = inside.at(t - step.t0)
                return OK
            self.y = step.at(model, t)
            if step.t1 == inf and not total(magnitude(self.y)) < HUGE:
                return DIVERGED  # a step without end has not been judged at its end
        else:
            self.arrive()
        return OK

    def arrive(self):
        """The present point is the end of the step."""
        step = self.step
        self.t, self.y, self.modes = step.t1, step.y1, step.modes1

    def cover(self, model, t):
        """Take internal steps until one of them covers t."""
        step = self.step
        most = step.called + step.interpolant.looked + MOST_CALLS
        for _ in range(ROUNDS):
            for _ in range(ROUND):
                status = step.take(model)
                if status != OK or step.t1 >= t:
                    return status
            if step.called + step.interpolant.looked > most:
                break
        return ENDLESS

    def look_ahead(self, model):
        """Where the internal step that covers the time after the present point ends; NaN if it fails.

        One without an end is told as if it ended a default run after the present point.
        """
        step = self.step
        while self.t >= step.t1 and step.t1 < step.t_end:
            if step.take(model) != OK:
                self.t_next = nan
                return
        self.t_next = self.told_end()

    def told_end(self):
        """The end of the internal step in force, made finite."""
        end = self.step.t1
        return end if end < inf else self.t + self.run

    def report(self, events):
        """The declared counts, up to the present point."""
        step = self.step
        before = step.before
        here = step.event and self.t >= step.t1 and every(self.modes == step.modes1)  # and does not wait to be handled
        events.count = before.happened + 1 if here else before.happened
        events.t_last = step.t1 if here else before.t_event
        if self.t > step.t0:
            self.steps, self.rejected, self.evaluations = step.taken, step.refused, step.called
            self.h = self.told_end() - step.t0
        else:
            self.steps, self.rejected, self.evaluations = before.taken, before.refused, before.called
            self.h = before.length
