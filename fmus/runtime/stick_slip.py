"""Stick and slip of a single contact as a hybrid automaton with the modes backward, stuck and forward.

While it slides, the friction force follows the model and opposes the direction of the mode.  While it sticks, the force
balances the load, up to the holding limit.  Slip ends when the slip velocity reaches zero, stick when the load exceeds
the limit (M. Otter, H. Elmqvist, S. E. Mattsson, Hybrid modeling in Modelica based on the synchronous data flow
principle, CACSD 1999).  contact_lcp.py treats several contacts.

The model states loads and accelerations; the functions below, which belong to the solver, decide on modes.
"""

from math import fabs, inf

from .codes import (
    BACKWARD,
    FORWARD,
    HYBRID,
    HYBRID_LAW_ONLY,
    NO_CONSISTENT_MODES,
    ROUNDOFF_MARGIN,
    SIGN,
    STUCK,
    THRESHOLD,
)
from .oscillator import Oscillator
from .vectors import (
    ContactIndex,
    ContactVector,
    StateVector,
    contact_indices,
    contact_vector,
    position_index,
    slip_index,
)

HYBRID_LAW = ("hybrid", HYBRID, "stick and slip are modes; every change of mode is an event")
SIGN_LAW = ("sign", SIGN, "sliding force times sign(v); no sticking; events are not located; chatters")
THRESHOLD_LAW = ("threshold", THRESHOLD, "as sign, but friction balances the load below a small velocity; chatters")

WRONG_WAY_TOLERANCE = 1e-9  # accelerations below this share of that due to friction are rounding errors


def sign(v):
    """Return the sign of v: -1, 0 or 1."""
    return 1 if v > 0.0 else -1 if v < 0.0 else 0


def threshold(v, eps, load, slide, hold):
    """Return the friction force of the threshold law."""
    if fabs(v) >= eps:
        return sign(v) * slide
    return hold if load > hold else -hold if load < -hold else load


class DryFriction(Oscillator):
    """Oscillator with one body, which is at rest while its contact sticks.

    At rest the load is linear in time, unless an input has a higher order.
    """

    contacts: dict[str, str] = {"mode": "v"}
    has_dry_friction = rests_when_stuck = True
    rules: dict[int, str] = {
        HYBRID_LAW_ONLY: "friction = {friction} with solver.method = 1 (exact) is refused: the closed form covers the "
        "hybrid law only; set friction to 1 (hybrid), or choose another solver.method if the FMU has one",
        NO_CONSISTENT_MODES: "no combination of stick and slip satisfies the force balance: a contact slides with a "
        "larger force than it holds; set no sliding force above the holding force",
    }

    def stick_load(self, t: float, y: StateVector, i: ContactIndex) -> tuple[float, float, float]:
        """Return the load on the contact at rest, its rate, and the holding limit."""

    def load_magnitude(self, t: float, y: StateVector, i: ContactIndex) -> float:
        """Return the sum of the absolute terms of the load, which scales its rounding error."""

    def law_modes(self, t: float, y: StateVector) -> ContactVector:
        """Return the directions of slip under the laws sign and threshold, whose forces do not depend on modes."""

    def breakaway_acceleration(self, t, y: StateVector, modes: ContactVector, i: ContactIndex):
        """Return the slip acceleration at a break-away, where the load equals the limit."""
        return self.slip_acceleration(t, y, modes, i)

    def slip_acceleration(self, t, y: StateVector, modes: ContactVector, i: ContactIndex):
        """Return the slip acceleration."""
        f = self.rates(t, y, modes)
        return f[slip_index[i]]


def resolve_mode(model, t, y: StateVector, tie_tolerance, i: ContactIndex):
    """Return the mode from time t on.

    A load at the limit is a tie, which the rate of the load decides: the contact breaks away if the load grows and
    sticks otherwise.

    Parameters
    ----------
    t
        Time in s.
    y
        States.
    tie_tolerance
        Relative tolerance of the limit for a decreasing load, besides the rounding errors of its terms.
    i
        Index of the contact.
    """
    if y[slip_index[i]] > 0.0:
        return FORWARD
    if y[slip_index[i]] < 0.0:
        return BACKWARD
    load, rate, limit, slack = stick_balance(model, t, y, i)
    if rate > 0.0 and load >= limit - slack:
        return FORWARD
    if rate < 0.0 and load <= slack - limit:
        return BACKWARD
    if rate != 0.0:
        slack += tie_tolerance * limit
    if fabs(load) <= limit + slack:
        return STUCK
    return FORWARD if load > 0.0 else BACKWARD


def stick_balance(model, t, y: StateVector, i: ContactIndex):
    """Return the load on a contact at rest, its rate, the holding limit, and the rounding error of that."""
    load, rate, limit = model.stick_load(t, y, i)
    return load, rate, limit, ROUNDOFF_MARGIN * (model.load_magnitude(t, y, i) + limit)


def is_grazing(model, location, t, y: StateVector, modes: ContactVector, tie_tolerance, i: ContactIndex):
    """Return whether the slip velocity only touches zero here and the slip continues.

    A contact that holds more than its sliding force comes to rest.  Another one goes on slipping if it would break
    away again so soon that a velocity with the relative error `tie_tolerance` might not reach zero.  After s
    seconds the velocity grows as v = u (1 - cos(w s)), where the load has the rate m w^2 u.
    A load that varies by itself can make u larger than any velocity of the motion.  So the velocity must also not
    go further in the other direction than its error, which the largest slip velocity bounds, if it is known.
    """
    load, rate, limit = model.stick_load(t, y, i)
    if rate == 0.0:
        return load == 0.0 and limit == 0.0  # no friction: the remaining velocity is the error of the method
    if modes[i] * rate < 0.0 or jumps_at_breakaway(model, t, y, modes, i):
        return False
    delay = (limit - modes[i] * load) / fabs(rate)
    _, J = model.jacobian(t, y, modes)
    stiffness = J[slip_index[i], position_index[i]]
    if not ((stiffness < 0.0 or delay == 0.0) and -0.5 * stiffness * delay * delay < tie_tolerance):
        return False
    largest_slip = location.peaks[i]
    reversed_velocity = -0.5 * modes[i] * model.slip_acceleration(t, y, modes, i) * delay
    return largest_slip == 0.0 or reversed_velocity < tie_tolerance * largest_slip


def jumps_at_breakaway(model, t, y: StateVector, modes: ContactVector, i: ContactIndex):
    """Return whether the holding force exceeds the sliding force, except for rounding errors."""
    reverse_modes = contact_vector()
    reverse_modes[i] = -modes[i]
    forward, backward = model.slip_acceleration(t, y, modes, i), model.slip_acceleration(t, y, reverse_modes, i)
    jump = modes[i] * model.breakaway_acceleration(t, y, modes, i)
    return jump > WRONG_WAY_TOLERANCE * fabs(forward - backward)


def is_consistent(model, t, y: StateVector, modes: ContactVector, i: ContactIndex):
    """Return whether a body that breaks away starts in the direction of its mode.

    It does not if the sliding force exceeds the holding force; rounding errors are tolerated.
    """
    reverse_modes = contact_vector()
    reverse_modes[i] = -modes[i]
    forward, backward = model.slip_acceleration(t, y, modes, i), model.slip_acceleration(t, y, reverse_modes, i)
    if modes[i] * backward <= 0.0:
        return True  # it does not stay at rest either, it moves the other way
    load, _, _, slack = stick_balance(model, t, y, i)
    if fabs(load) <= slack:
        return True
    # late in a run a load is a small difference of large numbers
    rounding = WRONG_WAY_TOLERANCE * fabs(forward - backward) + slack / fabs(load) * fabs(forward + backward)
    return modes[i] * forward >= -rounding


def breakaway_time(model, t, y: StateVector, i: ContactIndex):
    """Return when a contact breaks away if nothing moves (inf if never), and the direction."""
    load, rate, limit = model.stick_load(t, y, i)
    if rate == 0.0:
        return inf, STUCK
    direction = FORWARD if rate > 0.0 else BACKWARD
    delay = (limit - direction * load) / fabs(rate)
    return t + (delay if delay > 0.0 else 0.0), direction


def update_contact_event_functions(model, location, t, y: StateVector, modes: ContactVector):
    """Evaluate the event functions of the contact: the slip velocity in the direction of the mode."""
    for i in contact_indices:
        location.values[i] = location.values[len(modes) + i] = 1.0
        location.scales[i] = location.scales[len(modes) + i] = 0.0
        if model.friction == HYBRID and modes[i] != STUCK:
            location.values[i] = modes[i] * y[slip_index[i]]
            location.scales[i] = fabs(y[slip_index[i]])
