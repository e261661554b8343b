"""A step in closed form: up to the next standstill, the end of the run, or the horizon of the formula."""

from math import inf

from . import step_end
from .codes import DIVERGED, OK
from .step_end import OVERFLOW_LIMIT
from .vectors import magnitude, sum_of, velocity_indices


def advance_linear_segment(model, step):
    """Follow the closed form up to the next standstill, the end of the run, or the horizon."""
    exact = step.active_method.exact
    roundoff = step.roundoff
    roundoff.carry()
    p = model.applied_acceleration(step.t0, step.modes0)
    for i in velocity_indices:  # one
        exact.start_segment(step.y0, step.f0[i], p, roundoff.x0)
    if model.has_dry_friction:
        duration = exact.next_standstill(step.modes0)  # may shorten the horizon
    step.t1 = step.t_end if step.t_end - step.t0 <= exact.horizon else step.t0 + exact.horizon
    if model.has_dry_friction:
        end = step.t0 + (duration + roundoff.t0)
        if end <= step.t1 and end < inf:
            step.t1 = roundoff.event_time(step.t0, duration)
            step.y1, roundoff.x1 = exact.state_at_standstill(duration)
            return step_end.end_at_event(model, step)
    if step.t1 < inf:
        roundoff.x1 = 0.0
        step.y1 = exact.evaluate(step.t1 - step.t0 - roundoff.t0)
        step.f1 = model.rates(step.t1, step.y1, step.modes1)
        if not sum_of(magnitude(step.y1)) < OVERFLOW_LIMIT:
            return DIVERGED
    return OK
