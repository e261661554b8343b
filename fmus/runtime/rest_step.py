"""A step at rest: all contacts stick and nothing moves, up to the break-away."""

from math import inf

from . import step_end, stick_slip
from .codes import OK
from .vectors import contact_indices, contact_vector, min_of, slip_index


def advance_stuck(model, step):
    """Stay at rest until a load exceeds the holding limit."""
    step.roundoff.carry()
    step.is_stuck, step.event_location.grazes_at_end = True, False
    step.y1 = step.y0
    for i in contact_indices:
        step.y1[slip_index[i]] = 0.0
    ends, directions = contact_vector(), contact_vector()
    for i in contact_indices:
        ends[i], directions[i] = stick_slip.breakaway_time(model, step.t0, step.y1, i)
    end = min_of(ends)
    if end <= step.t_end and end < inf:
        step.t1 = end
        for i in contact_indices:
            step.modes1[i] = directions[i]
        step_end.restart_after_event(model, step)
    else:
        step.t1, step.f1 = step.t_end, 0.0
    return OK
