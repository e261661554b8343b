"""Step control: decides which way the next internal step is taken, and whether it is repeated.

rest_step.py         nothing moves, up to the break-away
closed_form_step.py  closed form, up to the next standstill
method_step.py       a step of an integration method that meets the tolerance, up to the first event in it
step_end.py          state, modes and rates at the end of each
internal_step.py     the step itself, with its counters
"""

from . import closed_form_step, conditions, method_step, phase_repetition, rest_step, step_end, step_limits
from .codes import NEEDS_REPETITION, NO_CONSISTENT_MODES, OK, STALLED
from .method_step import SHORTEST_STEP
from .step_kind import follows_closed_form, has_events, has_law_without_sticking, stays_at_rest

MAX_REPEATED_STEPS = 1_000_000  # steps of a motion that is repeated
MAX_STALLED_STEPS = 100  # consecutive steps that hardly advance the time


def compute_next(model, step):
    """Compute the internal step that starts at t1, repeating it where that is needed.  Returns a status."""
    if has_events(model):
        step.event_location.n_halvings = 0
    status = try_next(model, step)
    if has_events(model) and status == NEEDS_REPETITION:
        status = repeat_steps(model, step)
    return status


def try_next(model, step):
    """Compute the internal step that starts at t1.  Returns a status, or NEEDS_REPETITION."""
    if model.has_conditions:
        # names the contact if its sliding force exceeds what it holds
        status = conditions.violation_status(model, step.event_location)
        if status != OK:
            return status
        conditions.begin_step(model, step.event_location)
    if model.has_dry_friction and not step.event_location.has_consistent_modes:
        return NO_CONSISTENT_MODES
    step.begin(model)
    if stays_at_rest(model, step):
        status = rest_step.advance_stuck(model, step)
    elif follows_closed_form(model, step):
        status = closed_form_step.advance_linear_segment(model, step)
    else:
        status = method_step.advance_with_method(model, step)
    step.n_accepted += 1
    counters = step.start_counters
    if counters.has_raised_floor and status != NEEDS_REPETITION:
        counters.has_raised_floor, step.active_method.error_scale_floor = False, counters.error_scale_floor
    if has_law_without_sticking(model, step) and status == OK:
        step_end.update_law_modes(model, step)
    if model.has_conditions:
        conditions.select_sides(model, step.event_location, False)
    if step.t1 - step.t0 > SHORTEST_STEP * step.t0:
        counters.n_stalled = 0
    else:
        counters.n_stalled += 1
        if counters.n_stalled > MAX_STALLED_STEPS:
            return STALLED
    return status


def repeat_steps(model, step):
    """Repeat the step in parts, or the motion since the last event, up to the time reached before."""
    location = step.event_location
    t_reported, status, repeats = step.t0, OK, False
    for _ in range(MAX_REPEATED_STEPS):
        if location.must_shorten:
            step_limits.shorten_step(step)
        else:
            location.n_halvings = 0
            if location.must_repeat:
                phase_repetition.repeat_phase(step)
                repeats = True
            elif not repeats or step.t1 > t_reported:
                break
        status = try_next(model, step)
        if status != OK and status != NEEDS_REPETITION:
            break
    return status
