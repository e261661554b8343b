"""Model exchange: what an importer's solver asks of an oscillator, and what happens at an event.

Continuous states are those of the model and, where there is one, the position of the driver: so nothing depends on the
time as such.  The modes of friction are discrete states.  They change in `update` only, so that the motion is smooth
between events, and stands exactly still where friction holds it.  An importer finds an event where an indicator of a
contact falls to zero, or at the time that it was told:

    to_rest          mode v while sliding, 1 while stuck
    to_break_away    limit - |load| while stuck, 1 while sliding

At an event that has been handled neither is zero, for solvers take a root there for one that stays: both fall to zero
just beyond the event.
"""

from math import fabs, inf, nan

from . import rules
from .codes import DIVERGED, MODEL_EXCHANGE, OK, RUNNING, STUCK
from .march import NOMINAL
from .rounding import NEAR, ULP
from .step import HUGE, NEARLY
from .vectors import (
    Contacts,
    contacts,
    every,
    first,
    magnitude,
    per_contact,
    per_state,
    places,
    slip,
    some,
    speeds,
    total,
)

BEHIND = 0.1  # share of a slip and what it is made of, by which an importer may find its end too late
BEYOND, LEAST = 4.0 * ULP, 1e-300  # of the limit; of a speed and a force
TOLERANCE = 1e-4  # taken for the importer's, where it tells none


class Exchange:
    """What is read of it, as last asked for: rows over the continuous states and over the event indicators, all to rest
    before all to break away; the indicators one by one, and the rate of the driver; what an event has changed."""

    to_rest: Contacts
    to_break_away: Contacts

    def __init__(self, model):
        y, modes = per_state(), per_contact()
        for i in places:
            y[i] = 0.0
        for i in contacts:
            modes[i] = 1.0
        self.states = [*y, 0.0] if model.driven else [*y]
        self.rates = [*y, 0.0] if model.driven else [*y]
        self.nominals = [*y, 0.0] if model.driven else [*y]
        self.indicators = [*modes, *modes, 1.0]  # the last is nobody's: C has no empty rows
        self.to_rest = self.to_break_away = 1.0
        self.driver = self.finest = 0.0
        self.jumped = self.rescaled = False
        self.due = inf  # when a contact will break away, as far as can be known
        # a communication step in leaps: where it ends, whether a leap ended at an event, and what they may cost
        self.end = 0.0
        self.struck = False
        self.leaps = self.most = 0


class Exchanging:
    """A base before that of a model, which then owns an Exchange."""

    def __init__(self):
        super().__init__()
        self.exchange = Exchange(self)


def take_over(run):
    """The instance is for model exchange."""
    run.interface, run.tolerance = MODEL_EXCHANGE, TOLERANCE


def begin(model):
    """From here on the importer's solver steps: no internal step is in force, and none has been counted."""
    march = model.solver
    step = march.step
    before = step.before
    before.taken = before.refused = before.called = 0
    step.t0, step.t1 = march.t, nan
    nominals(model)


def ready(run, model):
    """Whether the values can be used.  Status."""
    if run.phase >= RUNNING or run.failed:
        return rules.ready(run, model)
    if run.observed:
        return OK
    return rules.observe(run, model)


def move_to(run, model, t):
    """The present time is t, the states stay."""
    run.observed = False
    march = model.solver
    march.t = march.step.t0 = t
    if model.driven:
        model.t_base = t


def put(run, model):
    """Take over the continuous states, which stand in their row; the driver's is at the present time, as it stays."""
    run.observed = False
    exchange = model.exchange
    march = model.solver
    for i in places:
        march.y[i] = exchange.states[i]
    if model.driven:
        model.x_base = exchange.states[len(march.y)]


def states(model):
    """The continuous states."""
    exchange = model.exchange
    march = model.solver
    for i in places:
        exchange.states[i] = march.y[i]
    if model.driven:
        exchange.states[len(march.y)] = model.x_base


def nominals(model):
    """The sizes of the states below which a tolerance is absolute: those of our own solver where nobody sets them."""
    exchange = model.exchange
    march = model.solver
    exchange.finest = model.finest()
    for i in places:
        exchange.nominals[i] = NOMINAL
    for i in speeds:
        exchange.nominals[i] = exchange.finest if exchange.finest < NOMINAL else NOMINAL
    if model.driven:
        exchange.nominals[len(march.y)] = NOMINAL


def rates(model):
    """The derivatives of the continuous states."""
    exchange = model.exchange
    march = model.solver
    y = march.y
    if model.waits and march.step.sticks and every(march.modes == STUCK):
        for i in places:
            exchange.rates[i] = 0.0
    else:
        f = model.rates(march.t, y, march.modes)
        for i in places:
            exchange.rates[i] = f[i]
    if model.driven:
        exchange.rates[len(y)] = model.drive()


def input_rates(model):
    """Set the rates of the inputs that have any."""
    if model.ramps:
        model.input_rates(model.solver.t)


def indicators(model):
    """The event indicators; where the law of friction knows no modes, they are 1."""
    exchange = model.exchange
    march = model.solver
    to_rest, to_break_away = per_contact(), per_contact()
    for i in contacts:
        to_rest[i] = to_break_away[i] = 1.0
    if model.dry and march.step.sticks:
        if model.coupled:
            slips = model.slips(march.t, march.y)
            force, most, terms = model.forces(march.t, march.y, march.modes)
            for i in contacts:
                if march.modes[i] != STUCK:
                    to_rest[i] = march.modes[i] * slips[i] + LEAST
                else:
                    slack = NEAR * (terms[i] + most[i])
                    to_break_away[i] = most[i] + slack + BEYOND * most[i] + LEAST - fabs(force[i])
        else:
            for i in contacts:
                if march.modes[i] != STUCK:
                    to_rest[i] = march.modes[i] * march.y[slip[i]] + LEAST
                else:
                    load, _, limit, slack = model.held(march.t, march.y, i)
                    to_break_away[i] = limit + slack + BEYOND * limit + LEAST - fabs(load)
    for i in contacts:
        exchange.indicators[i] = to_rest[i]
        exchange.indicators[len(march.modes) + i] = to_break_away[i]


def show(model):
    """Set what is read like a variable."""
    exchange = model.exchange
    march = model.solver
    if model.dry:
        indicators(model)
        for i in contacts:
            exchange.to_rest[i], exchange.to_break_away[i] = (
                exchange.indicators[i],
                exchange.indicators[len(march.modes) + i],
            )
    if model.driven:
        exchange.driver = model.drive()


def handle(run, model):
    """An event is handled: `jumped` and `rescaled` tell the importer what is new, `due` when the next is.  Status.

    What was set makes another motion, as a new mode does: some importers restart their solver only where a state is
    said to have jumped, and an input that jumps ends their run.
    """
    exchange = model.exchange
    march = model.solver
    exchange.jumped = exchange.rescaled = run.observed = False
    status = rules.ready(run, model)
    if status != OK or run.interface != MODEL_EXCHANGE:  # co-simulation goes on with what was set
        return status
    if not total(magnitude(march.y)) < HUGE:
        return DIVERGED
    finest = exchange.finest
    nominals(model)
    exchange.rescaled = exchange.finest != finest
    exchange.jumped, run.renewed = run.renewed, False
    if model.dry and march.step.sticks:
        if update(model, march):
            exchange.jumped = True
        exchange.due = release(model, march)
    return OK if total(magnitude(march.y)) < HUGE else DIVERGED


def update(model, march):
    """Let the modes follow the present point; whether the motion is another from here on, as solvers must know.

    The speed is set to zero where a slide has ended.  Without a reason for an event nothing changes, nor does it the
    second time.
    """
    near = NEARLY * march.step.tolerance
    another = changed = False
    fits = True
    if model.coupled:
        y, modes, fits = model.begun(march.t, march.y, march.modes, near, BEHIND)
        another, changed = some(y != march.y), some(modes != march.modes)
        march.y, march.modes = y, modes
    else:
        for i in contacts:
            mode = march.modes[i]
            if not mode * march.y[slip[i]] > 0.0:
                if mode != STUCK and march.y[slip[i]] != 0.0:
                    march.y[slip[i]] = 0.0
                    another = True
                if not model.touches(march.t, march.y, march.modes, 0.0, i):
                    march.modes[i] = model.settle(march.t, march.y, near, i)
                if march.modes[i] == STUCK and march.t >= model.exchange.due:
                    load, rate, limit = model.hold(march.t, march.y, i)  # due, but for rounding
                    if load * rate > 0.0 and limit - fabs(load) <= near * limit:
                        march.modes[i] = 1 if rate > 0.0 else -1
                if march.modes[i] != mode:
                    changed = True
                    if march.modes[i] != STUCK and march.y[slip[i]] == 0.0:
                        fits = fits and model.goes_its_way(march.t, march.y, march.modes, i)
    if not fits:
        for i in places:
            march.y[i] = nan  # no motion obeys the equations
    if changed:
        march.step.before.happened += 1
        march.step.before.t_event = march.t
    return another or changed


def release(model, march):
    """When a contact breaks away if nothing but the driver moves; inf if it never does."""
    if not (model.waits and every(march.modes == STUCK)):
        return inf
    ends, ways = per_contact(), per_contact()
    for i in contacts:
        ends[i], ways[i] = model.release(march.t, march.y, i)
    return first(ends)
