"""Location of events inside an internal step.

Every state that may end in a step has an event function, positive while the state lasts: two for each contact (slip
velocity in the direction of the mode while it slides, distance of the load from both holding limits while it sticks)
and one for each condition of the equations.  An event function that falls to zero and rises again within one step is
located as well: the step is searched along a polynomial whose curvature is bounded, not by samples.

Where the error of the method could decide whether an event function reaches zero, the motion since the last event is
computed again with a tighter tolerance.
"""

from math import fabs, inf, sin, sqrt

from .codes import CHATTERING, FIRST_RULE, OK, STUCK
from .power_series import PowerSeries
from .rounding import EPSILON, ROUNDOFF_MARGIN
from .vectors import (
    ContactVector,
    RateVector,
    StateVector,
    contact_indices,
    contact_vector,
    slip_index,
)

DEGREE = 8  # of the polynomial through an event function; interpolants have degree 7 at most
QUARTER_TURN = 1.5707963267948966
# The interpolant adds less than this share of the range of the cubic Hermite polynomial, except in a search
INTERPOLANT_SHARE = 1.0 / 12.0
NEAR_ZERO_SHARE = 0.002  # of the largest value since the last event; larger event functions are in no doubt
MAX_SEARCH_STEPS, MAX_SECANTS, MAX_BISECTIONS = 1000, 200, 200
START_OF_SLIP = 1e-3  # share of a step after which a slip that starts at zero is larger than its rounding error
ERROR_FACTOR = 100.0  # bound on the error of an event function, in multiples of the tolerance and of its scale
REFINEMENT, SMALLEST_TOLERANCE = 1e-3, 1e-13  # factor of the tolerance where an event is in doubt; lower limit
WORTHWHILE_REFINEMENT = 0.3
CONDITION_MARGIN, TINY = 4.0 * EPSILON, 1e-300  # margins of conditions: relative and absolute
# share of the largest step; number of such short times in succession, below the limit of steps that stall
SHORTEST_DWELL, MAX_CHATTER = 1e-9, 50
# Narrow features, in widths: slips at which they limit a step; where a step from outside is to end, and may end
FEATURE_RANGE, APPROACH, NEAREST_APPROACH = 5.0, 4.5, 3.5
MIN_STEP_SHARE = 0.6  # smallest share to which a step near a feature need not be shortened
MAX_CUBIC_ERROR = 0.02  # share of the range of an event function by which it may differ from a cubic polynomial
SHORTEST_STEP = 1e-6  # share of the largest step; shorter steps are not shortened for an event function
DIFFERENCE_STEP, FIRST_CHANGE = 1e-5, 0.3  # share of the largest step for differences; change in the first step
NO_ZERO, ONE_ZERO, UNKNOWN = 0, 1, 2  # what the cubic polynomial shows


class EventLocation:
    """Event functions, their values in the current step, and the start of the motion since the last event.

    Lists run over the event functions: upper and lower ones of all contacts, then the conditions.
    """

    phase_y: StateVector
    phase_f: RateVector

    def __init__(self, n):
        # value and scale (sum of absolute terms) of each event function at the latest evaluation
        self.values, self.scales = [0.0] * n, [0.0] * n
        self.near_middle = [0.0] * n  # values after 0.4 of the step
        self.cubic_errors = [0.0] * n  # differences from a cubic polynomial, as shares of the range in the step
        # Bernstein coefficients of the cubic Hermite polynomial; largest scale since the last event; first zero
        self.start, self.early, self.late, self.end = [0.0] * n, [0.0] * n, [0.0] * n, [0.0] * n
        self.peaks, self.times = [0.0] * n, [inf] * n
        # conditions: left minus right side, sum of absolute terms; 1.0 if true else -1.0: now, before and after t1
        self.margins, self.margin_scales = [0.0] * n, [0.0] * n
        self.sides, self.sides_before, self.sides_after = [1.0] * n, [1.0] * n, [1.0] * n
        self.is_frictionless = [0.0] * n  # of each contact: 1.0 if it neither slides nor holds with a force
        self.t_condition = -inf  # time of the last change of a condition
        self.n_chatter = 0  # changes of a condition in quick succession
        self.violated = -1  # condition that must hold but does not; -1 if there is none
        # nodes (fractions of a step) of the polynomial through an event function, and its coefficients
        self.nodes, self.samples, self.polynomial = [0.0] * (DEGREE + 1), [0.0] * (DEGREE + 1), [0.0] * (DEGREE + 1)
        for k in range(DEGREE + 1):
            root = sin(QUARTER_TURN * k / DEGREE)
            self.nodes[k] = root * root
        # start of the motion since the last event; factor of the tolerance since then
        self.phase_t = self.phase_y = self.phase_f = self.phase_h = 0.0
        self.tolerance_factor, self.tolerance = 1.0, 0.0  # now; tolerance of the run, if the factor is less
        self.t_doubt = 0.0  # end of the step that was in doubt
        self.in_doubt = self.must_repeat = self.must_shorten = False
        self.load_series = PowerSeries()  # of a load, for inputs of higher order
        self.feature_width = inf  # slip velocity below which friction varies


# ---- event functions


def update_event_functions(model, t, y: StateVector, modes: ContactVector):
    """Evaluate all event functions."""
    location = model.event_location
    if model.has_dry_friction:
        model.update_contact_event_functions(location, t, y, modes)
    if model.has_conditions:
        model.update_conditions(t, y, modes)
        for j in range(model.n_event_functions - model.first_condition):
            k = model.first_condition + j
            location.scales[k] = location.margin_scales[j]
            location.values[k] = (
                location.sides[j] * location.margins[j] + CONDITION_MARGIN * location.margin_scales[j] + TINY
            )


def event_function(model, step, t, j):
    """Return the value of one event function inside the step."""
    y = step.state_at(model, t)
    if model.has_dry_friction and not model.is_coupled and not model.has_conditions:
        for i in contact_indices:
            return step.modes0[i] * y[slip_index[i]]
    update_event_functions(model, t, y, step.modes0)
    return model.event_location.values[j]


# ---- search of a step


def locate_events(model, step):
    """Search the step just computed for the first zero of each event function.

    Returns
    -------
    float
        Time of the first event; inf if there is none.
    """
    location = model.event_location
    location.in_doubt = location.must_shorten = False
    n = 1  # a single contact without conditions has one function, which the caller has evaluated
    if model.is_coupled or model.has_conditions:
        n = model.n_event_functions
        evaluate_on_cubic(model, step)
        limit_step(model, step)
        if location.must_shorten:
            return inf
    first = inf
    for j in range(n):
        location.times[j] = inf
        found = examine_cubic(location, step, j)
        if found == ONE_ZERO:
            location.times[j] = find_root(model, step, step.t0, step.t1, location.start[j], location.end[j], j)
        elif found == UNKNOWN:
            location.times[j] = search_polynomial(model, step, j)
        if location.times[j] < first:
            first = location.times[j]
    return first


def evaluate_on_cubic(model, step):
    """Compute the Bernstein coefficients of all event functions on the cubic Hermite polynomial of the step."""
    location = model.event_location
    t0, h = step.t0, step.t1 - step.t0
    y2 = (20.0 * step.y0 + 7.0 * step.y1 + h * (4.0 * step.f0 - 2.0 * step.f1)) / 27.0
    y3 = (7.0 * step.y0 + 20.0 * step.y1 + h * (2.0 * step.f0 - 4.0 * step.f1)) / 27.0
    if model.is_coupled:
        model.find_frictionless_contacts(location, step)
    update_event_functions(model, t0, step.y0, step.modes0)
    for j in range(model.n_event_functions):
        location.start[j] = location.values[j]
        if location.scales[j] > location.peaks[j]:
            location.peaks[j] = location.scales[j]
    y4 = 0.648 * step.y0 + 0.352 * step.y1 + h * (0.144 * step.f0 - 0.096 * step.f1)
    update_event_functions(model, t0 + 0.4 * h, y4, step.modes0)
    for j in range(model.n_event_functions):
        location.near_middle[j] = location.values[j]
    update_event_functions(model, t0 + h / 3.0, y2, step.modes0)
    for j in range(model.n_event_functions):
        location.early[j] = location.values[j]
    update_event_functions(model, t0 + h * 2.0 / 3.0, y3, step.modes0)
    for j in range(model.n_event_functions):
        location.late[j] = location.values[j]
    update_event_functions(model, step.t1, step.y1, step.modes0)
    for j in range(model.n_event_functions):
        start, third, two_thirds, end = location.start[j], location.early[j], location.late[j], location.values[j]
        location.end[j] = end
        location.early[j] = (18.0 * third - 5.0 * start - 9.0 * two_thirds + 2.0 * end) / 6.0
        location.late[j] = (18.0 * two_thirds - 5.0 * end - 9.0 * third + 2.0 * start) / 6.0
        low = start if start < end else end
        low = third if third < low else low
        low = two_thirds if two_thirds < low else low
        high = start if start > end else end
        high = third if third > high else high
        high = two_thirds if two_thirds > high else high
        cubic = 0.216 * start + 0.432 * location.early[j] + 0.288 * location.late[j] + 0.064 * end
        excess = fabs(location.near_middle[j] - cubic) - ROUNDOFF_MARGIN * location.peaks[j]
        location.cubic_errors[j] = excess / (high - low) if excess > 0.0 and high > low else 0.0
        if location.scales[j] > location.peaks[j]:
            location.peaks[j] = location.scales[j]


def limit_step(model, step):
    """Limit the step so that every event function resembles a cubic polynomial.

    The error control of the method does not see event functions that vary without the states, as a load that
    follows a clock while nothing moves.
    """
    location = model.event_location
    largest = 0.0
    for j in range(model.n_event_functions):
        error = location.cubic_errors[j]
        largest = error if error > largest else largest
    if largest > MAX_CUBIC_ERROR and step.t1 - step.t0 > SHORTEST_STEP * step.h_max:
        location.must_shorten = True
    elif largest > 0.0:
        h = 0.8 * step.h_full * sqrt(sqrt(MAX_CUBIC_ERROR / largest))  # the error grows with h^4
        step.h_next = h if h < step.h_next else step.h_next


def limit_first_step(model, step):
    """Limit the first step after an event, so that no load or condition changes by more than a share of its scale.

    The slopes of the states do not show how fast a load changes that follows a clock.
    """
    location = model.event_location
    delta = DIFFERENCE_STEP * step.h_max
    update_event_functions(model, step.t1, step.y1, step.modes1)
    for j in range(model.n_event_functions):
        location.start[j] = location.values[j]
        location.peaks[j] = location.scales[j]
    y2 = step.y1 + delta * step.f1
    update_event_functions(model, step.t1 + delta, y2, step.modes1)
    for j in range(model.n_event_functions):
        location.near_middle[j] = location.values[j]
    y3 = step.y1 + 2.0 * delta * step.f1
    update_event_functions(model, step.t1 + 2.0 * delta, y3, step.modes1)
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
        least = SHORTEST_STEP * step.h_max
        h = h if h > least else least
        step.h_next = h if h < step.h_next else step.h_next


def examine_cubic(location, step, j):
    """Return how many zeros the cubic Hermite polynomial has; note whether an event is in doubt.

    A polynomial has no more zeros than its Bernstein coefficients have changes of sign, and lies between them.
    """
    start, early, late, end = location.start[j], location.early[j], location.late[j], location.end[j]
    # lowest value, by the parabola at the end of the step if the function still falls there
    lowest = early if early < late else late
    if end < late:
        curvature = end - 2.0 * late + early
        lowest = end - 0.75 * (end - late) * (end - late) / curvature if curvature > 0.0 else -inf
    elif not early < start:
        lowest = inf
    if fabs(lowest) <= ERROR_FACTOR * step.tolerance / location.tolerance_factor * location.peaks[j]:
        location.in_doubt = True
    low = early if early < late else late
    high = early if early > late else late
    high = high if high > start else start
    high = high if high > end else end
    if end > 0.0:
        least = end if end < start else start
        least = least if least < low else low
        inside = late if start <= 0.0 else low  # a slip starts at zero
        return NO_ZERO if inside >= INTERPOLANT_SHARE * (high - least) else UNKNOWN
    return UNKNOWN if start > 0.0 and early < INTERPOLANT_SHARE * (high - end) and late > early else ONE_ZERO


def search_polynomial(model, step, j):
    """Return the first zero of one event function in the step; inf if there is none.

    The polynomial of degree 8 through the function is searched from the start.  It stays above the parabola of its
    largest curvature, so that steps to the zero of that parabola cannot pass a zero.  Where the function is still
    positive at a zero of the polynomial, the polynomial is raised to the function and the search goes on.
    """
    location = model.event_location
    fit_polynomial(model, step, j)
    largest_curvature = 0.0
    for k in range(DEGREE - 1):
        largest_curvature += (k + 2.0) * (k + 1.0) * fabs(location.polynomial[k + 2])
    least = CONDITION_MARGIN * location.peaks[j]  # smaller values are rounding errors
    u = START_OF_SLIP if location.start[j] <= least else 0.0
    for _ in range(MAX_SEARCH_STEPS):
        value = slope = 0.0
        for k in range(DEGREE + 1):
            slope = value + slope * u
            value = location.polynomial[DEGREE - k] + value * u
        if value <= least:
            t = step.t0 + u * (step.t1 - step.t0)
            if slope < 0.0:
                t += 2.0 * least / -slope * (step.t1 - step.t0)
            if t >= step.t1:
                break
            g = event_function(model, step, t, j)
            if g <= 0.0:
                return find_crossing(model, step, t, g, j)
            if g <= least:
                return t  # the function only touches zero
            location.polynomial[0] += g - value
        else:
            descent = sqrt(slope * slope + 2.0 * largest_curvature * value) - slope
            if not 2.0 * value < (1.0 - u) * descent:
                break
            u += 2.0 * value / descent
    if location.end[j] > 0.0:
        return inf
    return find_crossing(model, step, step.t1, location.end[j], j)


def find_crossing(model, step, end, g_end, j):
    """Return the zero of one event function between the start of the step and a time at which it is not positive."""
    g_start = model.event_location.start[j]
    return find_root(model, step, step.t0, end, g_start, g_end, j)


def fit_polynomial(model, step, j):
    """Compute the coefficients of the polynomial through one event function at the nodes, by divided differences."""
    location = model.event_location
    step.interpolant.n_event_evals += DEGREE
    location.samples[0], location.samples[DEGREE] = location.start[j], location.end[j]
    for k in range(DEGREE - 1):
        location.samples[k + 1] = event_function(model, step, step.t0 + location.nodes[k + 1] * (step.t1 - step.t0), j)
    for order in range(DEGREE):
        for back in range(DEGREE - order):
            k = DEGREE - back
            location.samples[k] = (location.samples[k] - location.samples[k - 1]) / (
                location.nodes[k] - location.nodes[k - 1 - order]
            )
    for k in range(DEGREE + 1):
        location.polynomial[k] = 0.0
    for back in range(DEGREE + 1):
        node = location.nodes[DEGREE - back]
        for low in range(DEGREE):
            k = DEGREE - low
            location.polynomial[k] = location.polynomial[k - 1] - node * location.polynomial[k]
        location.polynomial[0] = location.samples[DEGREE - back] - node * location.polynomial[0]


def find_root(model, step, low, high, g_low, g_high, j):
    """Return the first time at which an event function is not positive, by the Illinois method, then by bisection.

    The function has the value `g_low` > 0 at time `low` and `g_high` <= 0 at time `high`.
    """
    kept_end = 0  # end of the bracket that the last iteration kept: 1 high, -1 low
    evaluations = 0
    for k in range(MAX_SECANTS + MAX_BISECTIONS):
        middle = 0.5 * (low + high)
        if not low < middle < high:
            break
        if k < MAX_SECANTS and g_low > 0.0 and g_high < 0.0:
            secant = low + (high - low) * (g_low / (g_low - g_high))
            if low < secant < high:
                middle = secant
        g = event_function(model, step, middle, j)
        evaluations += 1
        if g > 0.0:
            low, g_low = middle, g
            if kept_end == 1:
                g_high *= 0.5
            kept_end = 1
        else:
            high, g_high = middle, g
            if kept_end == -1:
                g_low *= 0.5
            kept_end = -1
    step.interpolant.n_event_evals += evaluations
    return high


# ---- events in doubt


def begin_phase(model, step):
    """Note the start of a motion: its state, and the step size to try."""
    if model.is_coupled or model.has_conditions:
        limit_first_step(model, step)
    location = model.event_location
    location.phase_t, location.phase_y, location.phase_f = step.t1, step.y1, step.f1
    location.phase_h = step.h_next
    restore_tolerance(model, step)
    location.in_doubt = location.must_repeat = False
    step.largest_slip = 0.0
    if model.is_coupled or model.has_conditions:
        for j in range(model.n_event_functions):
            location.peaks[j] = 0.0


def restore_tolerance(model, step):
    """Return to the tolerance of the run."""
    location = model.event_location
    if location.tolerance_factor < 1.0:
        step.tolerance, location.tolerance_factor = location.tolerance, 1.0


def decide_repetition(model, step):
    """Decide whether the motion since the last event must be repeated with a tighter tolerance."""
    location = model.event_location
    if location.in_doubt and location.tolerance_factor == 1.0:
        least = SMALLEST_TOLERANCE / step.tolerance
        factor = REFINEMENT if REFINEMENT > least else least
        if factor < WORTHWHILE_REFINEMENT:
            location.tolerance_factor, location.must_repeat, location.t_doubt = factor, True, step.t1
            location.tolerance = step.tolerance
            step.tolerance *= factor
            step.largest_slip = inf  # every step is examined


def repeat_phase(model, step):
    """Go back to the start of the motion, to repeat it with the tighter tolerance."""
    location = model.event_location
    location.must_repeat = False
    step.t1, step.y1, step.f1, step.modes1 = location.phase_t, location.phase_y, location.phase_f, step.modes0
    step.h_next = location.phase_h * location.tolerance_factor**step.active_method.power


def end_phase_in_doubt(model, step):
    """Return to the usual tolerance after a step without doubt."""
    location = model.event_location
    if location.tolerance_factor < 1.0 and step.t1 >= location.t_doubt and not location.in_doubt:
        step.h_next *= location.tolerance_factor**-step.active_method.power
        begin_phase(model, step)


def shorten_step(model, step):
    """Go back to the start of the step, to try half of it."""
    model.event_location.must_shorten = False
    step.h_next = 0.5 * step.h_full
    step.t1, step.y1, step.f1, step.modes1 = step.t0, step.y0, step.f0, step.modes0
    step.n_accepted -= 1
    step.n_rejected += 1


# ---- conditions


def update_sides(model, t, y: StateVector, modes: ContactVector):
    """Determine which conditions hold; a condition may depend on others."""
    location = model.event_location
    for _ in range(model.n_event_functions + 1):
        model.update_conditions(t, y, modes)
        changed = False
        for j in range(model.n_switches):
            side = 1.0 if location.margins[j] > 0.0 else -1.0
            if side != location.sides[j]:
                location.sides[j], changed = side, True
        if not changed:
            break
    for j in range(model.n_switches):
        location.sides_after[j] = location.sides[j]


def check_limits(model, t, y: StateVector, modes: ContactVector):
    """Note the first limit that does not hold."""
    location = model.event_location
    location.violated = -1
    model.update_conditions(t, y, modes)
    for j in range(model.n_event_functions - model.first_condition - model.n_switches):
        k = model.n_switches + j
        if location.violated < 0 and location.margins[k] + CONDITION_MARGIN * location.margin_scales[k] + TINY <= 0.0:
            location.violated = k
            model.violation_time, model.violation_value = t, location.margins[k]


def start_conditions(model, t, y: StateVector, modes: ContactVector):
    """Determine the conditions where a run starts or restarts with changed values."""
    model.event_location.t_condition = -inf  # changes that were computed beyond t have not occurred
    update_sides(model, t, y, modes)
    begin_step(model)


def begin_step(model):
    """Begin a step with the conditions after the previous one."""
    location = model.event_location
    for j in range(model.n_switches):
        location.sides[j] = location.sides_before[j] = location.sides_after[j]


def update_at_event(model, t, y: StateVector, modes: ContactVector, h_max):
    """Determine the conditions after an event.

    Returns
    -------
    int
        Status: OK, or CHATTERING if a condition keeps changing.
    """
    location = model.event_location
    for j in range(model.n_switches):
        location.sides_before[j] = location.sides[j]
    update_sides(model, t, y, modes)
    if conditions_changed(model):
        is_quick = t - location.t_condition <= SHORTEST_DWELL * h_max
        location.n_chatter = location.n_chatter + 1 if is_quick else 0
        location.t_condition = t
    return CHATTERING if location.n_chatter > MAX_CHATTER else OK


def violation_status(model):
    """Return OK, or the status of the rule for a condition that must hold but does not."""
    location = model.event_location
    return FIRST_RULE + model.first_condition_rule + location.violated if location.violated >= 0 else OK


def select_sides(model, after_event):
    """Select the conditions before or after the event at the end of the step."""
    location = model.event_location
    for j in range(model.n_switches):
        location.sides[j] = location.sides_after[j] if after_event else location.sides_before[j]


def conditions_changed(model):
    """Return whether a condition changes at the end of the step."""
    location = model.event_location
    changed = False
    for j in range(model.n_switches):
        changed = changed or location.sides_after[j] != location.sides_before[j]
    return changed


# ---- narrow features


def step_share(model, step, h, y1: StateVector, f1: RateVector):
    """Return the share of a step to which it must be shortened, so that it passes no narrow feature; 1.0 if it fits.

    A step that begins near the zero of a slip may change it by one width; other steps may only come near.  The cubic
    Hermite polynomial of the step lies between its control points, so that a slip that turns within it is seen too.
    """
    width = model.event_location.feature_width
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
            low, high = start, start
            low = low if low < early else early
            low = low if low < late else late
            low = low if low < end else end
            high = high if high > early else early
            high = high if high > late else late
            high = high if high > end else end
            if start < FEATURE_RANGE * width:
                if (high - low) * MIN_STEP_SHARE > width and (high - low) * share > width:
                    share = width / (high - low)
            elif low < NEAREST_APPROACH * width and (start - low) * share > start - APPROACH * width:
                share = (start - APPROACH * width) / (start - low)
    return share
