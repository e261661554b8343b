"""Model exchange: what an importer's solver asks of an oscillator, and what happens at an event.

Continuous states are those of the model and, where there is one, the position of the driver: nobody tells when the
importer's run begins, so nothing may depend on the time as such.  The modes of friction are discrete states.  They
change in `update` only, so that the motion is smooth between events, and stands exactly still where friction holds it.
An importer finds an event where an indicator of a contact falls to zero:

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
from .vectors import Contacts, contacts, every, per_contact, per_state, places, slip, some, speeds

BEHIND = 0.1  # share of a slip and what it is made of, by which an importer may find its end too late
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
    return [*march.y, model.x_base] if model.driven else [*march.y]


def put(model, march, values):
    """Take over the continuous states."""
    for i in places:
        march.y[i] = values[i]
    if model.driven:
        model.x_base = values[len(march.y)]  # at the present time, which move_to keeps


def nominals(model):
    """The sizes of the states below which a tolerance is absolute: those of our own solver where nobody sets them."""
    size = per_state()
    for i in places:
        size[i] = NOMINAL
    finest = model.finest()
    for i in speeds:
        size[i] = finest if finest < NOMINAL else NOMINAL
    return [*size, NOMINAL] if model.driven else [*size]


def rates(model, march):
    """The derivatives of the continuous states."""
    if model.waits and march.step.sticks and every(march.modes == STUCK):
        still = per_state()
        for i in places:
            still[i] = 0.0
        return [*still, model.drive()] if model.driven else [*still]
    y = march.y
    f = model.rates(march.t, y, march.modes)
    return [*f, model.drive()] if model.driven else [*f]


def indicators(model, march):
    """The event indicators of a model with dry friction, all to rest before all to break away; where its law knows no
    modes, they are 1."""
    to_rest, to_break_away = per_contact(), per_contact()
    for i in contacts:
        to_rest[i] = to_break_away[i] = 1.0
    if not (model.dry and march.step.sticks):
        return [*to_rest, *to_break_away]
    if model.coupled:
        slips = model.slips(march.t, march.y)
        force, most, _terms = model.forces(march.t, march.y, march.modes)
        for i in contacts:
            if march.modes[i] != STUCK:
                to_rest[i] = march.modes[i] * slips[i] + LEAST
            else:
                to_break_away[i] = most[i] + BEYOND * most[i] + LEAST - fabs(force[i])
    else:
        for i in contacts:
            if march.modes[i] != STUCK:
                to_rest[i] = march.modes[i] * march.y[slip[i]] + LEAST
            else:
                load, _, limit = model.hold(march.t, march.y, i)
                to_break_away[i] = limit + BEYOND * limit + LEAST - fabs(load)
    return [*to_rest, *to_break_away]


def update(model, march):
    """Let the modes follow the present point; whether the motion is another from here on, as solvers must know.

    The speed is set to zero where a slide has ended.  Without a reason for an event nothing changes, nor does it the
    second time.
    """
    if not (model.dry and march.step.sticks):
        return False
    near = NEARLY * (march.rtol if march.rtol > 0.0 else TOLERANCE)
    another = changed = False
    if model.coupled:
        y, modes, fits = model.begun(march.t, march.y, march.modes, near, BEHIND)
        another, changed = some(y != march.y), some(modes != march.modes)
        march.y, march.modes = y, modes
        if not fits:
            for i in places:
                march.y[i] = nan  # no motion obeys the equations
    else:
        for i in contacts:
            mode = march.modes[i]
            if not mode * march.y[slip[i]] > 0.0:
                if mode != STUCK and march.y[slip[i]] != 0.0:
                    march.y[slip[i]] = 0.0
                    another = True
                if not model.touches(march.t, march.y, march.modes, 0.0, i):
                    march.modes[i] = model.settle(march.t, march.y, near, i)
                if march.modes[i] != mode:
                    changed = True
    if changed:
        march.step.before.happened += 1
        march.step.before.t_event = march.t
    return another or changed


class Exchange:
    """What is read of it like a variable, as last shown."""

    to_rest: Contacts
    to_break_away: Contacts

    def __init__(self):
        self.to_rest = self.to_break_away = 1.0
        self.driver = 0.0

    def show(self, model, march):
        if model.dry:
            found = indicators(model, march)
            for i in contacts:
                self.to_rest[i], self.to_break_away[i] = found[i], found[len(march.modes) + i]
        if model.driven:
            self.driver = model.drive()


class Exchanging:
    """A base before that of a model, which then owns an Exchange."""

    def __init__(self):
        super().__init__()
        self.exchange = Exchange()
