"""Model exchange: what an importer's solver asks of an oscillator, and what happens at an event.

Continuous states are the position, the speed and, where there is one, the position of the driver: nobody tells when the
importer's run begins, so nothing may depend on the time as such.  The mode of friction is a discrete state.  It changes
in `update` only, so that the motion is smooth between events, and stands exactly still where friction holds it.
An importer finds an event where an indicator falls to zero:

    to_rest          mode v while sliding, 1 while stuck
    to_break_away    limit - |load| while stuck, 1 while sliding

At an event that has been handled neither is zero, for solvers take a root there for one that stays: both fall to zero
just beyond the event.
"""

from math import fabs, nan

from .codes import STUCK
from .march import NOMINAL
from .rounding import ULP
from .step import NEARLY

BEYOND, LEAST = 4.0 * ULP, 1e-300  # of the limit; of a speed and a force
TOLERANCE = 1e-4  # taken for the importer's, which nobody tells, where solver.rtol is 0


def begin(march):
    """From here on the importer's solver steps: no internal step is in force, and none has been counted."""
    step, before = march.step, march.step.before
    before.taken = before.refused = before.called = 0
    step.t0, step.t1 = march.t, nan


def move_to(model, march, t):
    """The present time is t, the states stay."""
    march.t = march.step.t0 = t
    if model.driven:
        model.t_base = t


def states(model, march):
    """The continuous states."""
    return [march.x, march.v, model.x_base] if model.driven else [march.x, march.v]


def put(model, march, values):
    """Take over the continuous states."""
    march.x, march.v = values[0], values[1]
    if model.driven:
        model.x_base = values[2]  # at the present time, which move_to keeps


def nominals(model):
    """The sizes of the states below which a tolerance is absolute: those of our own solver where nobody sets them."""
    finest = model.finest()
    speed = finest if finest < NOMINAL else NOMINAL
    return [NOMINAL, speed, NOMINAL] if model.driven else [NOMINAL, speed]


def rates(model, march):
    """The derivatives of the continuous states."""
    v = a = 0.0
    if not (march.step.sticks and march.mode == STUCK):
        v, a = march.v, model.rates(march.t, march.x, march.v, march.mode)
    return [v, a, model.drive()] if model.driven else [v, a]


def indicators(model, march):
    """The event indicators of a model with dry friction; where its law knows no modes, both are 1."""
    if not march.step.sticks:
        return [1.0, 1.0]
    if march.mode != STUCK:
        return [march.mode * march.v + LEAST, 1.0]
    load, _, limit = model.hold(march.t, march.x, march.v)
    return [1.0, limit + BEYOND * limit + LEAST - fabs(load)]


def update(model, march):
    """Let the mode follow the present point; whether the motion is another from here on, as solvers must know.

    The speed is set to zero where the slide has ended.  Without a reason for an event nothing changes, nor does it the
    second time.
    """
    step, mode = march.step, march.mode
    if not step.sticks or mode * march.v > 0.0:
        return False
    stopped = mode != STUCK and march.v != 0.0
    if stopped:
        march.v = 0.0
    tolerance = march.rtol if march.rtol > 0.0 else TOLERANCE
    if not model.touches(march.t, march.x, march.v, mode, 0.0):
        march.mode = model.settle(march.t, march.x, march.v, NEARLY * tolerance)
    changed = march.mode != mode
    if changed:
        step.before.happened += 1
        step.before.t_event = march.t
    return stopped or changed


class Exchange:
    """What is read of it like a variable, as last shown."""

    def __init__(self):
        self.to_rest = self.to_break_away = 1.0
        self.driver = 0.0

    def show(self, model, march):
        if model.dry:
            self.to_rest, self.to_break_away = indicators(model, march)
        if model.driven:
            self.driver = model.drive()


class Exchanging:
    """A base before that of a model, which then owns an Exchange."""

    def __init__(self):
        super().__init__()
        self.exchange = Exchange()
