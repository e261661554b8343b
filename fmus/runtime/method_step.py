"""A step of an integration method: proposals until one meets the tolerance, then the first event in it.

The step size is controlled as in MATLAB's ode23 and ode45 (L. F. Shampine, M. W. Reichelt, The MATLAB ODE Suite,
SIAM J. Sci. Comput. 18 (1997) 1-22).
"""

from math import inf

from . import (
    conditions,
    contact_lcp,
    event_location,
    phase_repetition,
    planar_contact,
    step_end,
    step_limits,
    time_scale,
)
from .active_method import SMALLEST_FLOOR
from .codes import DIVERGED, EPSILON, NEEDS_REPETITION, OK, STALLED, STUCK
from .event_location import INTERPOLANT_SHARE, NEAR_ZERO_SHARE
from .interpolant import largest_of
from .rate_rounding import smallest_sizes
from .step_end import OVERFLOW_LIMIT
from .step_kind import has_law_without_sticking, has_narrow_features
from .vectors import (
    ContactVector,
    StateVector,
    complete_rates,
    contact_indices,
    elementwise,
    elementwise_max,
    error_size,
    magnitude,
    max_of,
    planar_indices,
    slip_index,
    sum_of,
)

MAX_TRIES = 60  # attempts for one step; each one halves the step size
ROUGH_ERROR, ROUGH_CHANGE = 0.5, 10.0  # relative error and change of states in a proposal that is roughly right
SHORTEST_STEP = 16.0 * EPSILON  # share of the time since the start; the solver stalls at shorter ones
INTERPOLATION_ERROR = 10.0  # of a state at an event, relative to the solver tolerance


def advance_with_method(model, step):
    """Compute a step that meets the tolerance, and end it at the first event in it.  Returns a status."""
    for i in planar_indices:
        duration = planar_contact.time_to_rest(model, step, i)
        if duration < inf:
            return step_end.end_at_rest(model, step, duration, i)
    for i in planar_indices:
        planar_contact.tighten_tolerance(model, step, step.modes0, i)
    status = accept_proposal(model, step)
    for _ in planar_indices:
        planar_contact.restore_tolerance(model, step)
        if status == STALLED:  # rounding errors exceed the tighter tolerance
            status = accept_proposal(model, step)
    if status != OK:
        return status
    if model.has_dry_friction and step.is_hybrid and not model.is_coupled and not model.has_conditions:
        # Most steps end here.  The Bernstein coefficients of the cubic Hermite polynomial of the slip velocity are
        # compared with their sum, which bounds the largest.  Without calls: these take a tenth of a step of ode23.
        for i in contact_indices:
            mode = step.modes0[i]
            start, end, third = mode * step.y0[slip_index[i]], mode * step.y1[slip_index[i]], mode * step.h_full / 3.0
            early, late = start + third * step.f0[slip_index[i]], end - third * step.f1[slip_index[i]]
            total = start + early + late + end
            if total > step.largest_slip:
                step.largest_slip = total
            low = early if early < late else late
            low = low if low < end else end
            if low >= INTERPOLANT_SHARE * total and low >= NEAR_ZERO_SHARE * step.largest_slip:
                return OK
            location = step.event_location
            location.start[i], location.early[i], location.late[i], location.end[i] = start, early, late, end
            if step.largest_slip < inf:
                location.peaks[i] = step.largest_slip
            else:
                location.peaks[i] = largest_of(total, start, end, location.peaks[i])
    if step.is_hybrid or model.has_conditions:
        return end_at_first_event(model, step)
    return OK


def accept_proposal(model, step):
    """Propose steps, each one shorter than the last, until one meets the tolerance.  Returns a status."""
    t, y, f, modes = step.t0, step.y0, step.f0, step.modes0
    if has_law_without_sticking(model, step):
        modes = STUCK * modes
    method = step.active_method
    roundoff = step.roundoff
    tolerance = step.tolerance
    roundoff.t0 = roundoff.t1
    h_min = SHORTEST_STEP * t
    h = step.h_next if step.h_next < step.h_max else step.h_max
    if model.has_nominal_velocity or model.has_conditions or model.is_coupled:
        h = step_limits.limit_proposal(model, step, modes, h)
    if h < h_min:
        h = h_min
    remaining_time = step.t_end - t - roundoff.t0
    is_last = 1.1 * h >= remaining_time
    h = remaining_time if is_last else h
    scale = error_size(y)
    method.raise_scale_floor(model, scale)
    scale = elementwise_max(method.error_scale_floor, scale)
    floor = scale  # of the step, without proposals; set when one is rejected
    attempts = 0
    while True:
        y1, f1, e = method.propose(model, step, modes, t, y, f, h)
        step.n_rhs += method.stages
        size1 = error_size(y1)
        size2 = elementwise_max(size1, scale)
        d = magnitude(e)
        e = d / size2
        error = h * max_of(e) / tolerance
        if error > 1.0 and method.floor_share > 0.0:
            least = smallest_sizes(model, step, t + h, y, modes, h)  # the proposed state may be unstable
            e = d / elementwise_max(size2, least)
            error = h * max_of(e) / tolerance
        share = 1.0
        if error <= 1.0 and sum_of(size1, e) < OVERFLOW_LIMIT:  # False for NaN
            if has_narrow_features(model, step):
                share = step_limits.narrow_feature_share(model, step, h, y1, f1)
            if not has_narrow_features(model, step) or share == 1.0 or h <= h_min:
                break
        step.n_rejected += 1
        if attempts == 0:
            step.save_scale_floor()
            floor = step.start_counters.error_scale_floor
        attempts += 1
        scale, floor = scales_after_rejection(model, step, modes, h, y1, f1, d, error, scale, floor)
        if h <= h_min or attempts == MAX_TRIES:
            return STALLED if error < inf and sum_of(size1) < OVERFLOW_LIMIT else DIVERGED
        shrink = 0.5
        if attempts == 1 and (1.0 < error < inf or not sum_of(size1) < OVERFLOW_LIMIT):
            # Where numbers overflow depends on the units: the step shrinks there as after a large error.
            shrink = method.safety * error**-method.power
            shrink = shrink if shrink > method.shrink else method.shrink
        h_new = h * shrink
        if has_narrow_features(model, step) and share < 1.0:
            h_new = h * share
        h = h_min if h_new < h_min else h_new
        is_last = False
    if attempts == 0:
        grow = method.safety * error**-method.power if error > 1e-9 else method.grow
        step.h_next = h * (grow if grow < method.grow else method.grow)
    else:
        step.h_next = h * method.shrink_after_rejection
    step.h_full = h
    if is_last:
        step.t1, roundoff.t1 = step.t_end, 0.0
    else:
        step.t1 = roundoff.end_time(t, h)
    step.y1, step.f1 = y1, f1
    return OK


def scales_after_rejection(
    model,
    step,
    modes: ContactVector,
    h,
    y1: StateVector,
    f1: StateVector,
    d: StateVector,
    error,
    scale: StateVector,
    floor: StateVector,
) -> tuple[StateVector, StateVector]:
    """Return the scale of the errors, and its floor without proposals, after a rejected one with the error estimate d.

    A proposal that is roughly right shows how large states become that are zero so far.
    """
    method = step.active_method
    size = error_size(y1)
    size1 = elementwise_max(size, scale)
    most, second, other_error = size, scale, error  # with these derivatives, no state is at rest
    if error * step.tolerance >= ROUGH_ERROR:  # False for NaN
        second, _f3, _f4 = time_scale.derivatives(model, step.t0, step.y0, step.f0, modes)
        change = h * magnitude(f1)
        most = elementwise_max(size, change)
        d = d - if_at_rest(step.y0, step.f0, second, scale, d)
        e = d / size1
        other_error = h * max_of(e) / step.tolerance
    if other_error * step.tolerance < ROUGH_ERROR and is_roughly_right(step, h, y1, f1, size1, scale, second):
        if other_error < error:
            e = method.floor_share * if_at_rest(step.y0, step.f0, second, scale, most)
            floor = elementwise_max(floor, e)
        method.error_scale_floor = floor
        method.raise_scale_floor(model, size)
        scale = elementwise_max(method.error_scale_floor, scale)
    return scale, floor


@elementwise
def if_at_rest(value, first, second, scale, number):
    """Return a number for a state that has always been zero and starts with t^3 or later, and 0 for others.

    In a method of order 3, the error of a state that starts with t^4 is as large as the state, however short the step.
    It is relative to what the state reaches in the first proposal whose other states are roughly right.
    """
    return number if value == first == second == 0.0 and scale <= SMALLEST_FLOOR else 0.0


def is_roughly_right(
    step, h, y1: StateVector, f1: StateVector, size: StateVector, scale: StateVector, second: StateVector
):
    """Return whether a rejected proposal shows how large states become that are zero so far.

    Their error is always large relative to what they reach.  A rate that is large relative to that shows an unstable
    proposal.  So does a change that the rates at neither end explain.
    """
    rate0, rate1 = magnitude(step.f0), magnitude(f1)
    change = y1 - step.y0
    change = magnitude(change)
    most = elementwise_max(rate0, rate1)
    excess = change - ROUGH_CHANGE * h * most
    d = rate1 / size
    d = d - if_at_rest(step.y0, step.f0, second, scale, d)
    return h * max_of(d) < ROUGH_CHANGE and max_of(excess) <= 0.0


def end_at_first_event(model, step):
    """End the accepted step at the first event in it.  Returns a status, or NEEDS_REPETITION.

    The step is repeated in parts where it does not show the event functions, and with a tighter tolerance since the
    last event where the error of the method decides whether there is an event.
    """
    location = step.event_location
    h = step.h_full
    if model.is_coupled or model.has_conditions:
        event_location.evaluate_on_cubic(model, step)
        step_limits.limit_step(model, step)
        for i in planar_indices:
            location.must_shorten = location.must_shorten or planar_contact.has_reversed(model, step, i)
        if location.must_shorten:
            return NEEDS_REPETITION
    end = event_location.locate_events(model, step)
    if step.interpolant.is_ready:  # the event search built the interpolant
        step.n_rhs += step.active_method.extra
    phase_repetition.decide_repetition(step)
    if location.must_repeat:
        return NEEDS_REPETITION
    if end <= h:
        if model.is_coupled and step.is_hybrid:
            location.must_shorten = step_limits.is_slip_unresolved(model, step, end)
        if model.checks_event_steps and not location.must_shorten:
            location.must_shorten = not is_accurate_at(model, step, end)
        if location.must_shorten:
            return NEEDS_REPETITION
        return step_end.end_at(model, step, end)
    if model.is_coupled and step.is_hybrid:
        step.y1 = contact_lcp.stop_slips(model, step.t1, step.y1, step.modes0)
        step.f1 = complete_rates(step.y1, step.f1)
    if model.has_conditions:
        for j in range(model.n_switches):
            conditions.note_distance(location, j, location.end[model.first_condition + j])
    phase_repetition.end_phase_in_doubt(model, step)
    return OK


def is_accurate_at(model, step, h):
    """Return whether a step to an event after h seconds agrees with the interpolated state there.

    Friction that varies within a small range of slip velocities, or a condition that changes, may lie between the
    stages of a long step, whose error estimate does not see it.  A step that ends at the event does.
    """
    if step.event_location.n_halvings == step_limits.MAX_HALVINGS:
        return True
    method = step.active_method
    y_end = step.state_after(model, h)
    modes = step.modes0
    if has_law_without_sticking(model, step):
        modes = STUCK * modes
    y2, _f2, e = method.propose(model, step, modes, step.t0, step.y0, step.f0, h)
    step.n_rhs += method.stages
    scale = error_size(step.y0)
    scale = elementwise_max(method.error_scale_floor, scale)
    size2 = error_size(y2)
    scale = elementwise_max(size2, scale)
    e = magnitude(e) / scale
    difference = y2 - y_end
    difference = magnitude(difference) / scale
    step.h_full = h
    return h * max_of(e) <= step.tolerance and max_of(difference) <= INTERPOLATION_ERROR * step.tolerance
