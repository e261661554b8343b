"""A communication step in leaps, for an importer that handles events itself or looks inside: each goes to the end of an
internal step, so that none passes an event.

An event at the end of a leap may wait to be handled: until then the outputs are those before it.
"""

from . import rules
from .codes import BAD_STEP, ENDLESS, OK
from .march import MOST_CALLS, MOST_STEPS


def aim(run, model, t, h):
    """Begin a communication step of h from t.  Status."""
    status = rules.ready(run, model)
    if status != OK:
        return status
    exchange = model.exchange
    march = model.solver
    step = march.step
    exchange.end = rules.end_of_step(run, march, t, h)
    if not exchange.end >= march.t:
        return BAD_STEP
    exchange.leaps = 0
    exchange.most = step.called + step.interpolant.looked + MOST_CALLS
    exchange.struck = run.observed = False
    if march.t >= step.t1:
        march.arrive()
    return OK


def leap(run, model, waits):
    """Go on to the end of an internal step, or to that of the communication step; whether an event there waits to be
    handled.  Status."""
    exchange = model.exchange
    march = model.solver
    step = march.step
    run.observed = False
    status = rules.ready(run, model)  # an input may have been set here
    if status == OK and march.t >= step.t1:
        status = step.take(model)
    if status != OK:
        return status
    exchange.leaps += 1
    if exchange.leaps > MOST_STEPS or step.called + step.interpolant.looked > exchange.most:
        return ENDLESS
    status = march.advance(model, exchange.end if exchange.end < step.t1 else step.t1)
    if model.dry:
        exchange.struck = step.event and march.t >= step.t1
        if waits and exchange.struck:
            march.modes = step.modes0
    return status


def handle(run, model):
    """The event at the present point takes place."""
    march = model.solver
    run.observed = False
    if march.t >= march.step.t1:
        march.arrive()
