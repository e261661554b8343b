"""Stick and slip of contacts in a plane, where friction opposes the slip velocity and its limit is a circle.

The slip velocity is a vector, and its size is the slip of the contact: mode 0 is stuck, 1 sliding.  At rest the force
equals the load, up to the holding limit; a body that breaks away starts along its load.

While the size of the slip falls, a step covers a share of the time in which the present rate would remove it.  For a
constant load that time is a lower bound on the time to rest, so no step passes the kink of the friction at zero slip.
Where the slip is below the errors of the method and the load below the friction, a step to rest has a closed form:

    d(s (d + w cos(phi)))/dt = w^2 - d^2

with the size s of the slip, the accelerations d by friction and w by the load, and the angle phi between slip and load.
A body whose load exceeds the friction leaves along its load from where its slip is a rounding error.
"""

from math import inf, sqrt

from . import contact_lcp
from .codes import EPSILON, FORWARD, ROUNDOFF_MARGIN, STUCK
from .contact_lcp import CoupledFriction
from .vectors import (
    ContactIndex,
    ContactVector,
    StateVector,
    contact_indices,
    contact_vector,
    elementwise_max,
    error_size,
    select_kinematic,
)

# Of the time in which the present rate would remove the slip, or has built it up
APPROACH_SHARE, GROWTH_SHARE = 0.75, 3.0
GRADUAL, GRADUAL_SHARE = 1.0 + 1e-4, 1e-3  # of the friction, for a load whose excess grows from zero; of the first step
FIRST_SHARE = 1e-12  # of the first step after a break-away: duration after which the slip begins with a direction
ROUNDING_SHARE = 1e-12  # of the largest slip since the last event; a smaller one is a rounding error
ERROR_SHARE = 1e-3  # of the slip, by which errors may change it in a step
SMALLEST_TOLERANCE = 1e-13  # lower ones are rounding errors
RESOLVED_STEPS = 100.0  # shortest steps in which a slip vanishes that a method can resolve
CONSTANT_SHARE = 0.01  # of the excess of friction over load, by which the load may change up to the rest
# Model exchange
BEGINNING, RESTING, PASSING = 2, 3, 4  # phases of a slip; its mode at trial points, with a sign
GROWTH = 10.0  # of the slip since the last event: the solver restarts
GROWTH_ERROR = 1e-6  # by which the solver may find that event early
BEGINNING_SHARE = 1e-3  # of the nominal slip: up to this size the slip has the direction of its load
FOLLOWED_SHARE = 0.1  # of the slip at the last evaluation of rates; a smaller one at an event has passed zero in a step
APPROACH_SIZE, TURNED_FACTOR = 1e-6, 3.0  # of the slip: it may rest; of this, a larger one has turned by a right angle
END_SHARE = 1e-5  # of the slip where it begins to fall along a straight line: there it rests
CLEAR_SHARE = 1.0 - 1e-6  # of the friction, below which a load brings the body to rest
REST_SHARE = 1e-10  # of the largest slip since the last event; a smaller one that has passed zero rests
TINY = 1e-300  # avoids a division by zero
TIME_RESOLUTION = 64.0 * EPSILON  # share of the time since the start; shorter steps stall


class PlanarFriction(CoupledFriction):
    """Oscillator with contacts in a plane."""

    run_tolerance: float  # while a step has a finer one; else 0.0
    # model exchange: direction of the slip at the last completed step or event, and its sizes since an event
    last_x: ContactVector
    last_y: ContactVector
    smallest: ContactVector
    largest: ContactVector
    trial: ContactVector  # its size at the last evaluation of rates
    approach: ContactVector  # its size from which on it may come to rest
    unit_slip: ContactVector  # its size after the last event, of which the event indicator is a multiple
    slip_phase: ContactVector  # STUCK, FORWARD, BEGINNING, RESTING, PASSING

    def __init__(self):
        super().__init__()
        self.run_tolerance = 0.0
        self.last_x = self.last_y = self.smallest = self.largest = self.trial = self.approach = 0.0
        self.unit_slip = 1.0
        self.slip_phase = STUCK

    def planar_motion(
        self, t: float, y: StateVector, modes: ContactVector
    ) -> tuple[ContactVector, ContactVector, ContactVector, ContactVector, ContactVector]:
        """Return both components of the slips, those of their rates without friction, and the rate by friction."""


def slip_direction(slip, other_slip, load, other_load, slide, mode):
    """Return one component of the direction of the friction: that of the slip, and where nothing slips, of the load.

    A slip in the phase RESTING falls along a straight line, for as long as friction needs to stop it.  No direction of
    friction with the force `slide` does that; so the size of this one is less than 1.
    """
    size = sqrt(slip * slip + other_slip * other_slip)
    if size == 0.0 or mode == STUCK or mode == BEGINNING:
        size = sqrt(load * load + other_load * other_load)
        return load / size if size > 0.0 else 0.0
    if slide > 0.0 and mode * mode == RESTING * RESTING:
        excess = slide * slide - load * load - other_load * other_load
        power = slip * load + other_slip * other_load
        return (load + mode * slip * excess / (RESTING * size * slide + mode * power)) / slide
    return slip / size if mode > 0 else -slip / size


def slip_turn(slip, other_slip, load, other_load, slide, mode, change, other_change):
    """Return the change of one component of the direction of the friction by the slip."""
    size = sqrt(slip * slip + other_slip * other_slip)
    if size == 0.0 or mode == STUCK or mode == BEGINNING:
        return 0.0
    turn = other_slip / size * (other_slip / size * change - slip / size * other_change) / size
    if slide > 0.0 and mode * mode == RESTING * RESTING:
        excess = slide * slide - load * load - other_load * other_load
        rest = RESTING * size * slide + mode * (slip * load + other_slip * other_load)
        size_change = (slip * change + other_slip * other_change) / size
        rest_change = RESTING * size_change * slide + mode * (change * load + other_change * other_load)
        return mode * excess / slide * (change - slip * rest_change / rest) / rest
    return turn if mode > 0 else -turn


def slips_freely(model, step, modes: ContactVector, i: ContactIndex):
    """Return whether no friction opposes the slip."""
    force, limit, _sizes, _terms = model.contact_forces(step.t0, step.y0, modes)
    return force[i] == 0.0 and limit[i] == 0.0


def limit_step(model, step, modes: ContactVector, h, i: ContactIndex):
    """Limit a step by the time in which the present rate would remove the slip, or has built it up.

    Friction turns a small slip fast.
    """
    x, y, load_x, load_y, friction = model.planar_motion(step.t0, step.y0, modes)
    size = sqrt(x[i] * x[i] + y[i] * y[i])
    if modes[i] == STUCK or size == 0.0 or slips_freely(model, step, modes, i):
        return h
    rate_x, rate_y = load_x[i] - friction[i] * x[i] / size, load_y[i] - friction[i] * y[i] / size
    share = APPROACH_SHARE if x[i] * rate_x + y[i] * rate_y < 0.0 else GROWTH_SHARE
    longest = share * size / sqrt(rate_x * rate_x + rate_y * rate_y + TINY)
    return longest if longest < h else h


def begin_slip(model, step, i: ContactIndex) -> StateVector:
    """Return the states after an event; a slip that begins there has the direction of its load, not of rounding errors.

    The slip of a moment later is below all errors.
    """
    states, modes = step.y1, step.modes1
    x, y, load_x, load_y, friction = model.planar_motion(step.t1, states, modes)
    load = sqrt(load_x[i] * load_x[i] + load_y[i] * load_y[i])
    if modes[i] != STUCK and x[i] == 0.0 and y[i] == 0.0 and load < GRADUAL * friction[i]:
        return begin_gradually(model, step, states, modes, load - friction[i], i)
    duration = FIRST_SHARE * step.h_next if modes[i] != STUCK and x[i] == 0.0 and y[i] == 0.0 else 0.0
    f = model.rates(step.t1 + duration, states, modes)
    return select_kinematic(states, states + duration * f)


def begin_gradually(model, step, states: StateVector, modes: ContactVector, excess, i: ContactIndex) -> StateVector:
    """Return the states after a break-away with a small excess of the load over the friction.

    An excess that grows from zero moves the slip with the square of the time: half of its growth in a short time acts
    during that time.
    """
    held_modes, stuck_modes = contact_vector(), contact_vector()
    for j in contact_indices:
        held_modes[j], stuck_modes[j] = FORWARD, modes[j]
    held_modes[i] = stuck_modes[i] = STUCK
    duration = GRADUAL_SHARE * step.h_next
    t = step.t1 + duration
    f = model.rates(step.t1, states, stuck_modes)
    y2 = states + duration * f
    y3 = contact_lcp.stop_slips(model, t, y2, held_modes)
    _x, _y, load_x, load_y, friction = model.planar_motion(t, y3, modes)
    later = sqrt(load_x[i] * load_x[i] + load_y[i] * load_y[i]) - friction[i]
    growth = (later - excess) / later if later > excess and later > 0.0 else 0.0
    f2 = model.rates(t, y3, stuck_modes)
    f3 = model.rates(t, y3, modes)
    change = f3 - f2
    return states + (0.5 * growth * duration + FIRST_SHARE * step.h_next) * change


def tighten_tolerance(model, step, modes: ContactVector, i: ContactIndex):
    """Tighten the tolerance of a step by which errors turn the slip, or move its rest; see `restore_tolerance`.

    Errors of a small slip may be within the tolerance and yet turn it.  A load that is nearly as large as the friction
    takes long to stop the body, and an error of the slip moves its rest by that much more.  Slips that vanish in the
    shortest steps that a method can resolve are rounding errors: they do not tighten the tolerance, and are a lower
    limit of the scale of errors, because a body at rest up to now has no other.
    """
    if model.run_tolerance == 0.0:
        model.run_tolerance = step.tolerance
    x, y, load_x, load_y, friction = model.planar_motion(step.t0, step.y0, modes)
    size = sqrt(x[i] * x[i] + y[i] * y[i])
    if modes[i] == STUCK or friction[i] == 0.0 or size == 0.0:
        return
    method = step.active_method
    y2 = model.rate_magnitudes(step.t0, step.y0, modes)
    least = RESOLVED_STEPS * TIME_RESOLUTION * step.t0 * y2
    method.error_scale_floor = elementwise_max(method.error_scale_floor, least)
    y2 = error_size(step.y0)
    y2 = elementwise_max(method.error_scale_floor, y2)
    scales = model.slip_magnitudes(step.t0, y2)
    load = sqrt(load_x[i] * load_x[i] + load_y[i] * load_y[i])
    if size < RESOLVED_STEPS * TIME_RESOLUTION * step.t0 * friction[i]:
        return
    finer = ERROR_SHARE * size / scales[i]
    if load < friction[i] and model.run_tolerance * (1.0 - load / friction[i]) < finer:
        finer = model.run_tolerance * (1.0 - load / friction[i])
    finer = finer if finer > SMALLEST_TOLERANCE else SMALLEST_TOLERANCE
    step.tolerance = finer if finer < step.tolerance else step.tolerance


def restore_tolerance(model, step):
    """Return to the tolerance of the run."""
    if model.run_tolerance > 0.0:
        step.tolerance, model.run_tolerance = model.run_tolerance, 0.0


def has_reversed(model, step, i: ContactIndex):
    """Return whether a step that could be shorter turns the slip by more than a right angle.

    The slip may have passed zero, where its direction changes at once.
    """
    if step.modes0[i] == STUCK or step.event_location.is_frictionless[i] > 0.0:
        return False
    x, y, _load_x, _load_y, _friction = model.planar_motion(step.t0, step.y0, step.modes0)
    x1, y1, _load_x1, _load_y1, _friction1 = model.planar_motion(step.t1, step.y1, step.modes0)
    return x[i] * x1[i] + y[i] * y1[i] < 0.0 and step.h_full > TIME_RESOLUTION * step.t0


def time_to_rest(model, step, i: ContactIndex):
    """Return how long after the start of a step the slip vanishes, if a method need not resolve its fall; else inf."""
    location = step.event_location
    if step.modes0[i] == STUCK or location.is_frictionless[i] > 0.0:
        return inf
    x, y, load_x, load_y, friction = model.planar_motion(step.t0, step.y0, step.modes0)
    size = sqrt(x[i] * x[i] + y[i] * y[i])
    if size == 0.0:
        return inf  # it has just broken away
    along, across = (x[i] * load_x[i] + y[i] * load_y[i]) / size, (x[i] * load_y[i] - y[i] * load_x[i]) / size
    if not along < friction[i]:
        return inf
    rate = sqrt((along - friction[i]) * (along - friction[i]) + across * across)
    rounding = ROUNDING_SHARE * location.peaks[i] + ROUNDOFF_MARGIN * location.roundings[i]
    if size <= rounding + TIME_RESOLUTION * step.t0 * rate:
        return size / (rate + TINY)
    load = sqrt(load_x[i] * load_x[i] + load_y[i] * load_y[i])
    floors = contact_lcp.slip_floors(model, step, step.t0, step.y0)
    peak = location.peaks[i] if location.peaks[i] > floors[i] else floors[i]
    # friction turns a smaller slip in steps that are too short
    unresolved_slip = RESOLVED_STEPS * TIME_RESOLUTION * step.t0 * friction[i]
    if (size > step.tolerance * peak and size > unresolved_slip) or not load < friction[i]:
        return inf
    duration = size * (friction[i] + along) / ((friction[i] - load) * (friction[i] + load))
    y2 = step.y0 + duration * step.f0
    _x2, _y2, load_x2, load_y2, _friction2 = model.planar_motion(step.t0 + duration, y2, step.modes0)
    change = sqrt(
        (load_x2[i] - load_x[i]) * (load_x2[i] - load_x[i]) + (load_y2[i] - load_y[i]) * (load_y2[i] - load_y[i])
    )
    share = CONSTANT_SHARE if size > unresolved_slip else 1.0
    is_constant = change <= share * (friction[i] - load)
    return duration if is_constant and step.t0 + duration < step.t_end else inf


# ---- model exchange
#
# The motion must be smooth between events.  The indicator is `progress`, the slip in its direction at the last
# completed step.  Where it is small and the load below the friction, the phase RESTING begins: the slip falls along a
# straight line in the time that the closed form gives.  Under a larger load the phase PASSING begins: a slip that is
# almost head-on becomes zero where it is a rounding error.  At trial points beyond zero, friction keeps its direction:
# the mode is negative.  A slip that begins has the direction of its load while it is small: phase BEGINNING.
# Friction turns a small slip fast, and implicit solvers keep a Jacobian for many steps: that of a much smaller slip
# hides errors from them.  So they restart where the slip has grown by GROWTH.


def progress(model, t, y: StateVector, i: ContactIndex):
    """Return the slip in its direction at the last completed step."""
    x, other = slip_components(model, t, y, i)
    return x * model.last_x[i] + other * model.last_y[i]


def growth_left(model, t, y: StateVector, i: ContactIndex):
    """Return the share by which the slip may grow until the solver of the importer must restart."""
    return 1.0 - progress(model, t, y, i) / (GROWTH * model.smallest[i] + TINY)


def slip_components(model, t, y: StateVector, i: ContactIndex):
    """Return both components of a slip."""
    modes = contact_vector()
    for j in contact_indices:
        modes[j] = FORWARD  # the slips do not depend on them
    x, other, _load_x, _load_y, _friction = model.planar_motion(t, y, modes)
    return x[i], other[i]


def trial_mode(model, t, y: StateVector, modes: ContactVector, i: ContactIndex):
    """Return the mode at a point that the solver of the importer tries."""
    if modes[i] == STUCK:
        return STUCK
    phase = model.slip_phase[i] if model.slip_phase[i] != STUCK else FORWARD
    return -phase if phase != BEGINNING and progress(model, t, y, i) < 0.0 else phase


def note_trial(model, t, y: StateVector, i: ContactIndex):
    """Note the size of the slip where rates are evaluated."""
    x, other = slip_components(model, t, y, i)
    model.trial[i] = sqrt(x * x + other * other)


def complete_step(model, t, y: StateVector, modes: ContactVector, i: ContactIndex):
    """Note direction and size of the slip at a completed step, unless an event follows."""
    x, other = slip_components(model, t, y, i)
    size = sqrt(x * x + other * other)
    if modes[i] != STUCK and model.slip_phase[i] == FORWARD and progress(model, t, y, i) > model.approach[i]:
        model.last_x[i], model.last_y[i] = x / size, other / size
        model.largest[i] = size if size > model.largest[i] else model.largest[i]
        model.smallest[i] = size if size < model.smallest[i] else model.smallest[i]
        if model.approach[i] > 0.0:
            model.approach[i] = APPROACH_SIZE * model.largest[i]


def is_due(model, t, y: StateVector, i: ContactIndex):
    """Return whether the slip has come near zero, or turned by a right angle, since the last event."""
    return model.slip_phase[i] != STUCK and progress(model, t, y, i) <= model.approach[i]


def ends_last_phase(model, t, y: StateVector, modes: ContactVector, i: ContactIndex):
    """Return whether a slip that rests or passes zero is due."""
    phase = model.slip_phase[i]
    return modes[i] != STUCK and (phase == RESTING or phase == PASSING) and is_due(model, t, y, i)


def is_near_zero(model, step, t, y: StateVector, i: ContactIndex):
    """Return whether a slip that is due is small, or has passed zero in a step; else it has turned."""
    slips = model.slip_velocities(t, y)
    floors = contact_lcp.slip_floors(model, step, t, y)
    least = model.largest[i] + floors[i]
    if slips[i] > step.tolerance * least and slips[i] > TURNED_FACTOR * model.approach[i]:
        return False
    is_small = slips[i] <= TURNED_FACTOR * model.approach[i] or slips[i] <= REST_SHARE * least
    return is_small or slips[i] <= FOLLOWED_SHARE * model.trial[i]


def can_rest(model, t, y: StateVector, modes: ContactVector, i: ContactIndex):
    """Return whether the load is clearly below the friction."""
    _x, _y, load_x, load_y, friction = model.planar_motion(t, y, modes)
    return sqrt(load_x[i] * load_x[i] + load_y[i] * load_y[i]) < CLEAR_SHARE * friction[i]


def stop_passing(model, step, t, y: StateVector, modes: ContactVector, i: ContactIndex) -> StateVector:
    """Return the states at an event, without a slip that has passed zero but for errors of the importer's solver."""
    if modes[i] == STUCK or not is_due(model, t, y, i):
        return y
    if model.slip_phase[i] == FORWARD or model.slip_phase[i] == PASSING:
        has_passed = model.slip_phase[i] == PASSING or progress(model, t, y, i) <= 0.0
        if not (has_passed and is_near_zero(model, step, t, y, i)) or can_rest(model, t, y, modes, i):
            return y
    held_modes = contact_vector()
    for j in contact_indices:
        held_modes[j] = FORWARD
    held_modes[i] = STUCK
    return contact_lcp.stop_slips(model, t, y, held_modes)


def begin_phase(model, step, t, y: StateVector, modes: ContactVector, i: ContactIndex):
    """Begin a phase of the slip after an event, if there is a reason.  Returns whether the solver restarts."""
    if modes[i] == STUCK:
        model.slip_phase[i] = STUCK
        return False
    due = is_due(model, t, y, i)
    if model.slip_phase[i] != STUCK and not due and growth_left(model, t, y, i) > GROWTH_ERROR:
        return False
    is_near = due and model.slip_phase[i] == FORWARD and is_near_zero(model, step, t, y, i)
    x, other, load_x, load_y, _friction = model.planar_motion(t, y, modes)
    floors = contact_lcp.slip_floors(model, step, t, y)
    size = sqrt(x[i] * x[i] + other[i] * other[i])
    model.last_x[i] = slip_direction(x[i], other[i], load_x[i], load_y[i], 0.0, modes[i])
    model.last_y[i] = slip_direction(other[i], x[i], load_y[i], load_x[i], 0.0, modes[i])
    model.largest[i] = model.trial[i] = model.smallest[i] = size
    model.slip_phase[i], model.approach[i], model.unit_slip[i] = FORWARD, 0.0, size
    if size == 0.0:
        model.slip_phase[i], model.unit_slip[i] = BEGINNING, BEGINNING_SHARE * floors[i]
        model.smallest[i] = model.unit_slip[i] / GROWTH
    elif not is_near:
        model.approach[i] = APPROACH_SIZE * size
    elif can_rest(model, t, y, modes, i):
        model.slip_phase[i], model.approach[i] = RESTING, END_SHARE * size
    else:
        model.slip_phase[i], model.approach[i] = PASSING, APPROACH_SIZE * size
    return True
