"""End of a step: state, modes and rates at an event, and what the next step starts with."""

from math import inf

from . import conditions, contact_lcp, phase_repetition, planar_contact, stick_slip, time_scale
from .codes import DIVERGED, EXACT, OK, ROUNDOFF_MARGIN, STUCK
from .step_kind import follows_closed_form, has_events, has_law_without_sticking, is_at_rest
from .vectors import (
    ContactIndex,
    ContactVector,
    any_of,
    contact_indices,
    contact_vector,
    magnitude,
    planar_indices,
    slip_index,
    sum_of,
)

OVERFLOW_LIMIT = 1e100  # larger states are treated as divergence: squares, as in an energy, would overflow
TIE_FACTOR = 30.0  # tolerance for ties between stick and slip, relative to the solver tolerance


def end_at(model, step, h):
    """End the step at an event, h seconds after its start."""
    if model.has_conditions:
        y2 = step.state_after(model, 0.5 * h)
        conditions.update_margins(model, step.event_location, step.t0 + 0.5 * h, y2, step.modes0)
        for j in range(model.n_switches):
            conditions.note_distance(step.event_location, j, step.event_location.margins[j])
    step.y1 = step.state_after(model, h)
    step.t1 = end = step.roundoff.event_time(step.t0, h)
    if model.has_slip_conditions:
        if step.is_hybrid:
            step.y1 = contact_lcp.stop_slips(model, end, step.y1, step.modes0)
        slips = model.slip_velocities(end, step.y1)
    if model.has_conditions:
        conditions.update_at_event(model, step.event_location, end, step.y1, step.modes0)
        if conditions.have_changed(model, step.event_location):
            is_brief = is_brief_change(model, step, end)
            status = conditions.count_changes(step.event_location, end, is_brief)
            if status != OK:
                return status
    if step.is_hybrid:
        location = step.event_location
        ends = contact_vector()
        for i in contact_indices:
            other = location.times[len(step.modes0) + i]
            ends[i] = location.times[i] if location.times[i] < other else other
        if model.has_slip_conditions and contact_lcp.have_jumped(model, step, end, step.y1, slips):
            step.y1, step.modes1, step.event_location.has_consistent_modes = contact_lcp.resolve_at_start(
                model, step, end, step.y1, step.modes0, ROUNDOFF_MARGIN, tie_tolerance(model, step)
            )
        elif model.is_coupled:
            step.y1, step.modes1, step.event_location.has_consistent_modes = contact_lcp.resolve_after_event(
                model, step, h, ends, tie_tolerance(model, step)
            )
        else:
            for i in contact_indices:
                if ends[i] <= h:
                    step.y1[slip_index[i]] = 0.0
    return end_at_event(model, step)


def end_at_rest(model, step, duration, i: ContactIndex):
    """Step to where the slip of a contact in a plane vanishes, `duration` seconds ahead.  Returns a status.

    The duration is so short that the rates at its start give the states.
    """
    step.roundoff.t0 = step.roundoff.t1
    step.h_full = duration
    step.t1 = step.roundoff.event_time(step.t0, duration)
    step.y1 = step.y0 + duration * step.f0
    ends = contact_vector()
    for j in contact_indices:
        ends[j] = inf
    ends[i] = duration
    step.y1, step.modes1, step.event_location.has_consistent_modes = contact_lcp.resolve_after_event(
        model, step, duration, ends, tie_tolerance(model, step)
    )
    step.interpolant.set_line(step)
    step.h_next = 0.0  # the last steps before rest are short
    return end_at_event(model, step)


def is_brief_change(model, step, t):
    """Return whether conditions change at t without a motion away from their edge since the last change.

    Rounding errors decide changes that follow each other faster than they are located in a step.
    """
    dwell = t - step.event_location.t_condition
    has_stayed = conditions.has_stayed_at_edge(model, step.event_location, step.tolerance)
    if has_stayed:
        rate = time_scale.smooth_rate(model, step.t0, step.y0, step.f0, step.modes0)
        has_stayed = dwell * rate < conditions.BRIEF_SHARE
    return has_stayed or dwell <= conditions.RESOLUTION * step.h_full


def end_at_event(model, step):
    """Resolve the event at t1: a slip velocity is zero, or a load has reached its limit."""
    if model.has_dry_friction and not model.is_coupled:
        update_end_modes(model, step, step.modes0, tie_tolerance(model, step))
    restart_after_event(model, step)
    return OK if sum_of(magnitude(step.y1)) < OVERFLOW_LIMIT else DIVERGED


def tie_tolerance(model, step):
    """Return the relative tolerance for deciding ties between stick and slip."""
    return ROUNDOFF_MARGIN if follows_closed_form(model, step) else TIE_FACTOR * step.tolerance


def update_end_modes(model, step, modes: ContactVector, tie_tolerance):
    """Determine the modes after t1, given the previous modes."""
    location = step.event_location
    step.modes1, location.grazes_at_end, location.has_consistent_modes = STUCK, False, True
    if has_law_without_sticking(model, step):
        step.modes1 = modes  # they change at the ends of steps: see update_law_modes
    if step.is_hybrid:
        if model.is_coupled:
            step.y1, step.modes1, location.has_consistent_modes = contact_lcp.resolve_at_start(
                model, step, step.t1, step.y1, modes, tie_tolerance, tie_tolerance
            )
        else:
            for i in contact_indices:
                step.modes1[i] = stick_slip.resolve_mode(model, step.t1, step.y1, tie_tolerance, i)
                if step.y1[slip_index[i]] == 0.0 and step.modes1[i] != modes[i] != STUCK:
                    if stick_slip.is_grazing(model, location, step.t1, step.y1, modes, tie_tolerance, i):
                        step.modes1[i], location.grazes_at_end = modes[i], True


def update_end_rates(model, step):
    """Evaluate the rates at t1 in the new modes."""
    if is_at_rest(model, step, step.modes1):
        step.f1 = 0.0
    else:
        modes = step.modes1
        if has_law_without_sticking(model, step):
            modes = STUCK * modes
        step.f1 = model.rates(step.t1, step.y1, modes)
        step.n_rhs += 1
        if model.has_dry_friction and not model.is_coupled:
            for i in contact_indices:
                has_no_slip = step.is_hybrid and step.y1[slip_index[i]] == 0.0
                if has_no_slip and step.modes1[i] * step.f1[slip_index[i]] < 0.0:
                    location = step.event_location
                    location.has_consistent_modes = location.grazes_at_end or stick_slip.is_consistent(
                        model, step.t1, step.y1, step.modes1, i
                    )
                    step.f1[slip_index[i]] = 0.0  # rounding at a break-away: no body starts against its mode


def restart_after_event(model, step):
    """Restart after an event; the step size of the last slip phase is kept, if there was one."""
    step.event_at_end = any_of(step.modes1 != step.modes0)  # no event if the velocity only touches zero
    if model.has_conditions:
        conditions.check_limits(model, step.event_location, step.t1, step.y1, step.modes1)
    update_end_rates(model, step)
    if model.rests_when_stuck and step.is_stuck:
        for i in contact_indices:
            if step.modes1[i] != STUCK:
                a = model.breakaway_acceleration(step.t1, step.y1, step.modes1, i)
                # rounding, as in update_end_rates(): the slip would end at once, again and again
                step.f1[slip_index[i]] = a if step.modes1[i] * a > 0.0 else 0.0
    if step.h_next == 0.0 and step.active_method.method_number != EXACT:
        step.h_next, _size = time_scale.initial_step(model, step, step.t1, step.y1, step.f1, step.modes1)
    for i in planar_indices:
        step.y1 = planar_contact.begin_slip(model, step, i)
        step.f1 = model.rates(step.t1, step.y1, step.modes1)
    if has_events(model):
        phase_repetition.begin_phase(model, step)


def update_law_modes(model, step):
    """Update the modes at t1 under a law without stick and slip, where a step ends without regard to them."""
    step.modes1 = model.law_modes(step.t1, step.y1)
    if any_of(step.modes1 != step.modes0):
        step.event_at_end = True
        if model.has_conditions:
            phase_repetition.begin_phase(model, step)
