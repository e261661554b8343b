"""Limits of internal steps that the error estimate of the method does not provide.

The error estimate does not see event functions that vary while the states do not, nor friction that varies within a
small range of slip velocities (narrow features).
"""

from math import fabs, sqrt

from . import contact_lcp, planar_contact
from .codes import ROUNDOFF_MARGIN, STUCK
from .event_location import update_event_functions
from .interpolant import largest_of, smallest_of
from .step_kind import has_narrow_features
from .time_scale import time_scale
from .vectors import (
    ContactVector,
    StateVector,
    any_of,
    contact_indices,
    contact_vector,
    planar_indices,
    select_kinematic,
    slip_index,
)

MAX_CUBIC_ERROR = 0.02  # share of the range of an event function by which it may differ from a cubic polynomial
MAX_HALVINGS = 20  # of one step; an event function with a kink resembles no polynomial
DIFFERENCE_STEP, FIRST_CHANGE = 1e-5, 0.3  # share of the time scale for differences; change in the first step
# Narrow features, in widths: slips at which they limit a step; where a step from outside is to end, and may end
FEATURE_RANGE, APPROACH, NEAREST_APPROACH = 5.0, 4.5, 3.5
RESOLVED_SHARE = 0.5  # of a step, in which a slip that begins and ends is resolved
MIN_STEP_SHARE = 0.6  # smallest share to which a step near a feature need not be shortened


def limit_step(model, step):
    """Limit the step so that every event function resembles a cubic polynomial.

    The error control of the method does not see event functions that vary without the states, as a load that
    follows a clock while nothing moves.
    """
    location = step.event_location
    largest = largest_cubic_error(model, location)
    if model.is_coupled and largest > MAX_CUBIC_ERROR:
        ignore_rounding_errors(model, step)
        largest = largest_cubic_error(model, location)
    if largest > MAX_CUBIC_ERROR and location.n_halvings < MAX_HALVINGS:
        location.must_shorten = True
    elif largest > 0.0:
        h = 0.8 * step.h_full * sqrt(sqrt(MAX_CUBIC_ERROR / largest))  # the error grows with h^4
        step.h_next = h if h < step.h_next else step.h_next


def largest_cubic_error(model, location):
    """Return the largest difference of an event function from a cubic polynomial, as a share of its range."""
    largest = 0.0
    for j in range(model.n_event_functions):
        error = location.cubic_errors[j]
        largest = error if error > largest else largest
    return largest


def ignore_rounding_errors(model, step):
    """Ignore the shape of slips that change by no more than the rounding errors of their rates in the step.

    A body that creeps, because its load equals its friction but for rounding errors, follows no polynomial.
    """
    location = step.event_location
    y1 = step.y1
    terms = model.rate_magnitudes(step.t1, y1, step.modes0)
    rounding = ROUNDOFF_MARGIN * step.h_full * terms
    y2 = select_kinematic(y1, rounding)
    noise = model.slip_magnitudes(step.t1, y2)
    for i in contact_indices:
        start, early, late, end = location.start[i], location.early[i], location.late[i], location.end[i]
        change = largest_of(start, early, late, end) - smallest_of(start, early, late, end)
        if step.modes0[i] != STUCK and change <= noise[i]:
            location.cubic_errors[i] = 0.0


def is_slip_unresolved(model, step, end):
    """Return whether a slip begins and ends early in the step, `end` seconds after its start, within the tolerance.

    The error control of the step does not see such a slip, so that the interpolant is no motion of the body.
    """
    location = step.event_location
    if end >= RESOLVED_SHARE * step.h_full or location.n_halvings == MAX_HALVINGS:
        return False
    t = step.t0 + 0.5 * end
    y2 = step.state_after(model, 0.5 * end)
    slips = model.slip_velocities(t, y2)
    floors = contact_lcp.slip_floors(model, step, t, y2)
    is_unresolved = False
    for i in contact_indices:
        least = step.tolerance * floors[i]
        ends = step.modes0[i] != STUCK and location.times[i] == end
        is_unresolved = is_unresolved or (ends and location.start[i] <= least and fabs(slips[i]) <= least)
    return is_unresolved


def limit_proposal(model, step, modes: ContactVector, h):
    """Limit the step that is proposed first, by narrow features and by clocks."""
    if has_narrow_features(model, step):
        y1 = step.y0 + h * step.f0
        h *= narrow_feature_share(model, step, h, y1, step.f0)
    if model.has_conditions or (model.is_coupled and any_of(modes == STUCK)):
        h = limit_by_clocks(model, step, h)
    for i in planar_indices:
        h = planar_contact.limit_step(model, step, modes, h, i)
    return h


def limit_by_clocks(model, step, h):
    """Limit a step so that no clock moves the argument of a function by more than its event functions resolve.

    An event function at rest varies by clocks alone.  A longer step may pass a short dip of a periodic function.
    """
    rate = model.fastest_clock(step.t0, step.y0, step.modes0)
    return 1.0 / rate if h * rate > 1.0 else h


def limit_first_step(model, step):
    """Limit the first step after an event, so that no load or condition changes by more than a share of its scale.

    The slopes of the states do not show how fast a load changes that follows a clock.
    """
    if step.h_next == 0.0:
        return  # there is no first step
    location = step.event_location
    delta = DIFFERENCE_STEP * time_scale(model, step, step.t1, step.y1, step.modes1)
    update_event_functions(model, location, step.t1, step.y1, step.modes1)
    for j in range(model.n_event_functions):
        location.start[j] = location.values[j]
        location.peaks[j] = location.scales[j]
    y4 = step.y1 + step.h_next * step.f1
    update_event_functions(model, location, step.t1 + step.h_next, y4, step.modes1)
    for j in range(model.n_event_functions):  # a function that starts at zero is as large as it becomes in the step
        location.peaks[j] = location.scales[j] if location.scales[j] > location.peaks[j] else location.peaks[j]
    y2 = step.y1 + delta * step.f1
    update_event_functions(model, location, step.t1 + delta, y2, step.modes1)
    for j in range(model.n_event_functions):
        location.near_middle[j] = location.values[j]
    y3 = step.y1 + 2.0 * delta * step.f1
    update_event_functions(model, location, step.t1 + 2.0 * delta, y3, step.modes1)
    for i in contact_indices:
        if step.modes1[i] != STUCK:
            location.peaks[i] = location.peaks[len(step.modes1) + i] = 0.0  # the error control resolves slips
    largest = 0.0
    for j in range(model.n_event_functions):
        if location.peaks[j] > 0.0:
            slope = fabs(location.near_middle[j] - location.start[j]) / delta
            bend = fabs(location.start[j] - 2.0 * location.near_middle[j] + location.values[j]) / (delta * delta)
            rate = slope / location.peaks[j] + sqrt(bend / location.peaks[j])
            largest = rate if rate > largest else largest
    if largest > 0.0:
        h = FIRST_CHANGE / largest
        step.h_next = h if h < step.h_next else step.h_next


def shorten_step(step):
    """Go back to the start of the step, to try half of it."""
    step.event_location.must_shorten = False
    step.event_location.n_halvings += 1
    step.h_next = 0.5 * step.h_full
    step.t1, step.roundoff.t1 = step.t0, step.roundoff.t0
    step.y1, step.f1, step.modes1 = step.y0, step.f0, step.modes0
    step.n_accepted -= 1
    step.n_rejected += 1


def narrow_feature_share(model, step, h, y1: StateVector, f1: StateVector):
    """Return the share of a step to which it must be shortened, so that it passes no narrow feature; 1.0 if it fits.

    A step that begins near the zero of a slip may change it by one width; other steps may only come near.  The cubic
    Hermite polynomial of the step lies between its control points, so that a slip that turns within it is seen too.
    """
    width = step.event_location.feature_width
    third = h / 3.0
    y2 = step.y0 + third * step.f0
    y3 = y1 - third * f1
    slips0, slips1, slips2, slips3 = contact_vector(), contact_vector(), contact_vector(), contact_vector()
    if model.is_coupled:
        slips0 = model.slip_velocities(step.t0, step.y0)
        slips1 = model.slip_velocities(step.t0 + h, y1)
        slips2 = model.slip_velocities(step.t0 + third, y2)
        slips3 = model.slip_velocities(step.t0 + h - third, y3)
    else:
        for i in contact_indices:
            slips0[i], slips1[i] = step.y0[slip_index[i]], y1[slip_index[i]]
            slips2[i], slips3[i] = y2[slip_index[i]], y3[slip_index[i]]
    share = 1.0
    for i in contact_indices:
        if step.modes0[i] != STUCK:
            start, end = step.modes0[i] * slips0[i], step.modes0[i] * slips1[i]
            early, late = step.modes0[i] * slips2[i], step.modes0[i] * slips3[i]
            low, high = smallest_of(start, early, late, end), largest_of(start, early, late, end)
            if start < FEATURE_RANGE * width:
                if (high - low) * MIN_STEP_SHARE > width and (high - low) * share > width:
                    share = width / (high - low)
            elif low < NEAREST_APPROACH * width and (start - low) * share > start - APPROACH * width:
                share = (start - APPROACH * width) / (start - low)
    return share
