"""Location of events inside an internal step.

Every state that may end in a step has an event function, positive while the state lasts: two for each contact (slip
velocity in the direction of the mode while it slides, distance of the load from both holding limits while it sticks)
and one for each condition of the equations.  An event function that falls to zero and rises again within one step is
located as well: the step is searched along a polynomial whose curvature is bounded, not by samples.

Where the error of the method could decide whether an event function reaches zero, the motion since the last event is
computed again with a tighter tolerance (phase_repetition.py).
"""

from math import fabs, inf, pi, sin, sqrt

from . import conditions, contact_lcp, stick_slip
from .codes import EPSILON, ROUNDOFF_MARGIN
from .conditions import CONDITION_MARGIN, TINY
from .interpolant import largest_of, smallest_of
from .vectors import ContactVector, StateVector, contact_indices, slip_index

DEGREE = 8  # of the polynomial through an event function; interpolants have degree 7 at most
# The interpolant adds less than this share of the range of the cubic Hermite polynomial, except in a search
INTERPOLANT_SHARE = 1.0 / 12.0
NEAR_ZERO_SHARE = 0.002  # of the largest value since the last event; larger event functions are in no doubt
MAX_SEARCH_STEPS, MAX_SECANTS, MAX_BISECTIONS = 1000, 200, 200
# The polynomial differs by less than this share of its two highest coefficients; search of a minimum closer to zero
POLYNOMIAL_ERROR = 1.0 / 32768.0
MINIMUM_RANGE, MAX_SECTIONS, GOLDEN_SECTION = 0.0625, 40, 0.6180339887498949
MAX_DOUBLINGS = 9  # of the share of a step where a search begins
START_OF_SLIP = 1e-3  # share of a step after which a slip that starts at zero is larger than its rounding error
ERROR_FACTOR = 100.0  # bound on the error of an event function, in multiples of the tolerance and of its scale
NO_ZERO, ONE_ZERO, UNKNOWN = 0, 1, 2  # what the cubic polynomial shows


class EventLocation:
    """Event functions, their values in the current step, and the start of the motion since the last event.

    Lists run over the event functions: upper and lower ones of all contacts, then the conditions.
    """

    phase_y: StateVector
    phase_f: StateVector

    def __init__(self, n):
        # at the end of a step: a velocity only touches zero and the slip continues; modes satisfy the force balance
        self.grazes_at_end, self.has_consistent_modes = False, True
        # of each event function at the latest evaluation: value, size (of its terms), scale of its rounding errors
        self.values, self.scales, self.roundings = [0.0] * n, [0.0] * n, [0.0] * n
        self.near_middle = [0.0] * n  # values after 0.4 of the step
        self.cubic_errors = [0.0] * n  # differences from a cubic polynomial, as shares of the range in the step
        # Bernstein coefficients of the cubic Hermite polynomial; largest scale since the last event; first zero, in
        # seconds after the start of the step: a resolution that does not depend on the time
        self.start, self.early, self.late, self.end = [0.0] * n, [0.0] * n, [0.0] * n, [0.0] * n
        self.peaks, self.times = [0.0] * n, [inf] * n
        # conditions: left minus right side, scale of rounding errors; 1.0 if true else -1.0, before and after t1
        self.margins, self.margin_scales = [0.0] * n, [0.0] * n
        self.sides_before, self.sides_after = [1.0] * n, [1.0] * n
        self.is_frictionless = [0.0] * n  # of each contact: 1.0 if it neither slides nor holds with a force
        self.t_condition = -inf  # time of the last change of a condition
        self.n_chatter = 0  # changes of a condition in brief succession
        self.distances, self.largest_distances = [0.0] * n, [0.0] * n  # from its edge: since its last change; ever
        self.violated_limit = -1  # condition that must hold but does not; -1 if there is none
        # nodes (fractions of a step) of the polynomial through an event function, and its coefficients
        self.nodes, self.samples, self.polynomial = [0.0] * (DEGREE + 1), [0.0] * (DEGREE + 1), [0.0] * (DEGREE + 1)
        for k in range(DEGREE + 1):
            root = sin(0.5 * pi * k / DEGREE)
            self.nodes[k] = root * root
        # start of the motion since the last event; factor of the tolerance since then
        self.phase_t = self.phase_roundoff = self.phase_y = self.phase_f = self.phase_h = 0.0
        self.tolerance_factor, self.tolerance = 1.0, 0.0  # now; tolerance of the run, if the factor is less
        self.t_doubt = 0.0  # end of the step that was in doubt
        self.in_doubt = self.must_repeat = self.must_shorten = False
        self.n_halvings = 0  # of the current step, for event functions
        self.must_search = False  # inputs move: a body may rest and start again within a long step
        self.feature_width = inf  # slip velocity below which friction varies


# ---- event functions


def update_event_functions(model, location, t, y: StateVector, modes: ContactVector):
    """Evaluate all event functions."""
    if model.has_dry_friction:
        if model.is_coupled:
            contact_lcp.update_contact_event_functions(model, location, t, y, modes)
        else:
            stick_slip.update_contact_event_functions(model, location, t, y, modes)
    if model.has_conditions:
        conditions.update_margins(model, location, t, y, modes)
        for j in range(model.n_event_functions - model.first_condition):
            k = model.first_condition + j
            location.scales[k] = location.roundings[k] = location.margin_scales[j]
            if model.has_pieces and is_edge(model, k):  # the margin is relative to the current piece
                location.values[k] = location.margins[j] + CONDITION_MARGIN * location.roundings[k] + TINY
            else:
                location.values[k] = (
                    model.condition_sides[j] * location.margins[j] + CONDITION_MARGIN * location.roundings[k] + TINY
                )


def event_function(model, step, elapsed, j):
    """Return the value of one event function `elapsed` seconds after the start of the step."""
    y = step.state_after(model, elapsed)
    if model.has_dry_friction and not model.is_coupled and not model.has_conditions:
        for i in contact_indices:
            return step.modes0[i] * y[slip_index[i]]
    location = step.event_location
    update_event_functions(model, location, step.t0 + elapsed, y, step.modes0)
    return location.values[j]


# ---- search of a step


def locate_events(model, step):
    """Search the step just computed for the first zero of each event function, given its Bernstein coefficients.

    Returns
    -------
    float
        Seconds from the start of the step to the first event; inf if there is none.
    """
    location = step.event_location
    location.in_doubt = False
    # a single contact without conditions has one function
    n = model.n_event_functions if model.is_coupled or model.has_conditions else 1
    first = inf
    for j in range(n):
        location.times[j] = inf
        if model.has_pieces and is_edge(model, j):
            n_zeros = examine_edge(location, step, j)
        else:
            n_zeros = examine_cubic(location, step, j)
        if n_zeros == ONE_ZERO:
            location.times[j] = find_root(model, step, step.h_full, location.start[j], location.end[j], j)
        elif n_zeros == UNKNOWN:
            location.times[j] = search_polynomial(model, step, j)
        if location.times[j] < first:
            first = location.times[j]
    return first


def evaluate_on_cubic(model, step):
    """Compute the Bernstein coefficients of all event functions on the cubic Hermite polynomial of the step."""
    location = step.event_location
    t0, h = step.t0, step.h_full
    y2 = (20.0 * step.y0 + 7.0 * step.y1 + h * (4.0 * step.f0 - 2.0 * step.f1)) / 27.0
    y3 = (7.0 * step.y0 + 20.0 * step.y1 + h * (2.0 * step.f0 - 4.0 * step.f1)) / 27.0
    if model.is_coupled:
        contact_lcp.find_frictionless_contacts(model, location, step)
    update_event_functions(model, location, t0, step.y0, step.modes0)
    for j in range(model.n_event_functions):
        location.start[j] = location.values[j]
        if location.scales[j] > location.peaks[j]:
            location.peaks[j] = location.scales[j]
    y4 = 0.648 * step.y0 + 0.352 * step.y1 + h * (0.144 * step.f0 - 0.096 * step.f1)
    update_event_functions(model, location, t0 + 0.4 * h, y4, step.modes0)
    for j in range(model.n_event_functions):
        location.near_middle[j] = location.values[j]
    update_event_functions(model, location, t0 + h / 3.0, y2, step.modes0)
    for j in range(model.n_event_functions):
        location.early[j] = location.values[j]
    update_event_functions(model, location, t0 + h * 2.0 / 3.0, y3, step.modes0)
    for j in range(model.n_event_functions):
        location.late[j] = location.values[j]
    update_event_functions(model, location, step.t1, step.y1, step.modes0)
    for j in range(model.n_event_functions):
        start, third, two_thirds, end = location.start[j], location.early[j], location.late[j], location.values[j]
        location.end[j] = end
        location.early[j] = (18.0 * third - 5.0 * start - 9.0 * two_thirds + 2.0 * end) / 6.0
        location.late[j] = (18.0 * two_thirds - 5.0 * end - 9.0 * third + 2.0 * start) / 6.0
        value_range = largest_of(start, third, two_thirds, end) - smallest_of(start, third, two_thirds, end)
        cubic = 0.216 * start + 0.432 * location.early[j] + 0.288 * location.late[j] + 0.064 * end
        excess = fabs(location.near_middle[j] - cubic) - ROUNDOFF_MARGIN * rounding_scale(location, j)
        location.cubic_errors[j] = excess / value_range if excess > 0.0 and value_range > 0.0 else 0.0
        if location.scales[j] > location.peaks[j]:
            location.peaks[j] = location.scales[j]


def rounding_scale(location, j):
    """Return the scale of the rounding errors of an event function since the last event."""
    return location.peaks[j] if location.peaks[j] > location.roundings[j] else location.roundings[j]


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
    high = largest_of(start, early, late, end)
    if end > 0.0:
        if location.must_search:
            return UNKNOWN
        low = smallest_of(start, early, late, end)
        coefficient = late if start <= 0.0 or late < early else early  # a slip starts at zero
        return NO_ZERO if coefficient >= INTERPOLANT_SHARE * (high - low) else UNKNOWN
    return UNKNOWN if start > 0.0 and early < INTERPOLANT_SHARE * (high - end) and late > early else ONE_ZERO


def is_edge(model, j):
    """Return whether an event function is the distance from an edge of a piece of a table."""
    return j >= model.first_condition and model.condition_pieces[j - model.first_condition] >= 0.0


def examine_edge(location, step, j):
    """Return how many zeros the cubic polynomial of such a distance has.

    The table is continuous at the edge, so that an edge in doubt does not change the motion by more than the tolerance.
    """
    in_doubt = location.in_doubt
    n_zeros = examine_cubic(location, step, j)
    location.in_doubt = in_doubt
    return n_zeros


def search_polynomial(model, step, j):
    """Return the first zero of one event function in the step; inf if there is none.

    The polynomial of degree 8 through the function is searched from the start.  It stays above the parabola of its
    largest curvature, so that steps to the zero of that parabola cannot pass a zero.  Where the function is still
    positive at a zero of the polynomial, the polynomial is raised to the function and the search goes on.  Where the
    polynomial stays above zero by less than its error, the minimum of the function decides.
    """
    location = step.event_location
    h = step.h_full
    fit_polynomial(model, step, j)
    polynomial_error = POLYNOMIAL_ERROR * (fabs(location.samples[DEGREE]) + fabs(location.samples[DEGREE - 1]))
    lowest, u_lowest = inf, 0.0
    largest_curvature = 0.0
    for k in range(DEGREE - 1):
        largest_curvature += (k + 2.0) * (k + 1.0) * fabs(location.polynomial[k + 2])
    least = CONDITION_MARGIN * rounding_scale(location, j)  # smaller values are rounding errors
    u = START_OF_SLIP if location.start[j] <= least else 0.0
    error = ERROR_FACTOR * step.tolerance * location.peaks[j]
    if location.start[j] <= error and location.early[j] > location.start[j]:
        u = end_of_interpolation_error(location, least, error)
    for _ in range(MAX_SEARCH_STEPS):
        value = slope = 0.0
        for k in range(DEGREE + 1):
            slope = value + slope * u
            value = location.polynomial[DEGREE - k] + value * u
        if value <= least:
            elapsed = u * h
            if slope < 0.0:
                elapsed += 2.0 * least / -slope * h
            if elapsed >= h:
                break
            g = event_function(model, step, elapsed, j)
            if g <= 0.0:
                return find_root(model, step, elapsed, location.start[j], g, j)
            if g <= least:
                return elapsed  # the function only touches zero
            location.polynomial[0] += g - value
        else:
            if value < lowest and slope <= 0.0:
                lowest, u_lowest = value, u
            descent = sqrt(slope * slope + 2.0 * largest_curvature * value) - slope
            if not 2.0 * value < (1.0 - u) * descent:
                break
            u += 2.0 * value / descent
    if location.end[j] > 0.0:
        if lowest < polynomial_error < location.start[j]:
            return search_minimum(model, step, u_lowest, j)
        return inf
    return find_root(model, step, h, location.start[j], location.end[j], j)


def search_minimum(model, step, u, j):
    """Return the first zero of one event function near a minimum, by golden sections; inf if the minimum is positive.

    `u` is the place of the minimum, as a share of the step.
    """
    location = step.event_location
    h = step.h_full
    low = u - MINIMUM_RANGE if u > MINIMUM_RANGE else 0.0
    high = u + MINIMUM_RANGE if u < 1.0 - MINIMUM_RANGE else 1.0
    left, right = high - GOLDEN_SECTION * (high - low), low + GOLDEN_SECTION * (high - low)
    g_left = event_function(model, step, left * h, j)
    g_right = event_function(model, step, right * h, j)
    step.interpolant.n_event_evals += 2
    for _ in range(MAX_SECTIONS):
        if g_left <= 0.0:
            return find_root(model, step, left * h, location.start[j], g_left, j)
        if g_right <= 0.0:
            return find_root(model, step, right * h, location.start[j], g_right, j)
        step.interpolant.n_event_evals += 1
        if g_left < g_right:
            high, right, g_right = right, left, g_left
            left = high - GOLDEN_SECTION * (high - low)
            g_left = event_function(model, step, left * h, j)
        else:
            low, left, g_left = left, right, g_right
            right = low + GOLDEN_SECTION * (high - low)
            g_right = event_function(model, step, right * h, j)
    return inf


def end_of_interpolation_error(location, least, error):
    """Return where the polynomial of a slip that begins has become positive.

    The slopes at the ends of the step show that it begins; the interpolant may fall below zero first, by its error.
    """
    u = START_OF_SLIP
    for _ in range(MAX_DOUBLINGS):
        value = 0.0
        for k in range(DEGREE + 1):
            value = location.polynomial[DEGREE - k] + value * u
        if value > least or value < -error:
            break
        u *= 2.0
    return u


def fit_polynomial(model, step, j):
    """Compute the coefficients of the polynomial through one event function at the nodes, by divided differences."""
    location = step.event_location
    step.interpolant.n_event_evals += DEGREE
    location.samples[0], location.samples[DEGREE] = location.start[j], location.end[j]
    for k in range(DEGREE - 1):
        location.samples[k + 1] = event_function(model, step, location.nodes[k + 1] * step.h_full, j)
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


def find_root(model, step, high, g_low, g_high, j):
    """Return after how many seconds of the step an event function is no longer positive.

    By the Illinois method, then by bisection, to the resolution of the step size: an absolute time late in a run would
    be coarser.  The function has the value `g_low` > 0 at the start of the step and `g_high` <= 0 after `high` seconds.
    """
    low, resolution = 0.0, EPSILON * step.h_full
    kept_end = 0  # end of the bracket that the last iteration kept: 1 high, -1 low
    evaluations = 0
    for k in range(MAX_SECANTS + MAX_BISECTIONS):
        middle = 0.5 * (low + high)
        if not low < middle < high or high - low <= resolution:
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
