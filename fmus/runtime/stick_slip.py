"""Dry friction as a mode: backward, stuck, forward; its guard, and where it settles.  coupled.py has several contacts.

Sliding, the friction force is that of the model and opposes the direction of the mode.  Stuck, it is whatever
holds the body at rest, up to the holding limit.  A mode ends where its guard does: a slide when the slip speed comes to
zero, a stick when the load exceeds the limit (M. Otter, H. Elmqvist, S. E. Mattsson, Hybrid modeling in Modelica
based on the synchronous data flow principle, CACSD 1999).
"""

from math import fabs, inf

from .codes import BACKWARD, EXACT, FIRST_RULE, FORWARD, HYBRID, MAX_INPUT_ORDER, SIGN, STUCK, THRESHOLD
from .oscillator import Oscillator
from .rounding import ROUNDOFF_MARGIN
from .vectors import ContactIndex, ContactVector, StateVector, contact_vector, position_index, slip_index

HYBRID_LAW = ("hybrid", HYBRID, "stick and slip are modes, every change of mode is located as an event")
SIGN_LAW = ("sign", SIGN, "sliding force times sign(v) as it stands: no event, no stick; chatters")
THRESHOLD_LAW = ("threshold", THRESHOLD, "as sign, but below a small speed friction balances the spring; chatters")

NO_CONSISTENT_MODES = FIRST_RULE + 2  # status: no modes fit the forces, as the second rule has it
WRONG_WAY_TOLERANCE = 1e-9  # of the force of friction: less than that is the last bits
MAX_BISECTIONS = 200
MAX_TERNARY_STEPS = 25


def sign(v):
    """-1, 0 or 1."""
    return 1 if v > 0.0 else -1 if v < 0.0 else 0


def threshold(v, eps, load, slide, hold):
    """Friction by the threshold law."""
    if fabs(v) >= eps:
        return sign(v) * slide
    return hold if load > hold else -hold if load < -hold else load


class DryFriction(Oscillator):
    """An oscillator of one body, which stands still while it sticks.

    It says of its contact
        hold(t, states)         the load on it at rest, its rate and the holding limit
        terms(t, states)        the sum of the sizes of what the load is made of, of which rounding takes its share
        load_rate(t, states, n) the n-th derivative of the load, where inputs have any
    While the body stands still, the load is linear in time, unless an input bends.
    """

    contacts: dict[str, str] = {"mode": "v"}
    has_dry_friction = rests_when_stuck = True
    rules: tuple[str, ...] = (
        "friction = {friction} with solver.method = 1 (exact): the closed form holds for the hybrid law only; "
        "set friction to 1 (hybrid), or solver.method to 2 (ode23)",
        "the contacts can neither hold nor slip: one of them slides with a larger force than it holds; let no sliding "
        "force be above the holding force",
    )
    own_solver_rule = 1

    def prepare(self):
        return 1 if self.friction != HYBRID and self.solver.method == EXACT else 0

    def resolve_mode(self, t, y: StateVector, tie_tolerance, i: ContactIndex):
        """The mode that holds from here on.

        A load of the limit is a tie, which its rate decides: outward it lets go, inward or without a rate it is held.
        The load is known but for the rounding of its terms, and, where it moves inward, the share `near` of the limit.
        """
        if y[slip_index[i]] > 0.0:
            return FORWARD
        if y[slip_index[i]] < 0.0:
            return BACKWARD
        load, rate, limit, slack = self.stick_balance(t, y, i)
        if rate > 0.0 and load >= limit - slack:
            return FORWARD
        if rate < 0.0 and load <= slack - limit:
            return BACKWARD
        if rate != 0.0:
            slack += tie_tolerance * limit
        if fabs(load) <= limit + slack:
            return STUCK
        return FORWARD if load > 0.0 else BACKWARD

    def stick_balance(self, t, y: StateVector, i: ContactIndex):
        """The load on a contact at rest, its rate, the holding limit, and what rounding may add to that."""
        load, rate, limit = self.stick_load(t, y, i)
        return load, rate, limit, ROUNDOFF_MARGIN * (self.load_magnitude(t, y, i) + limit)

    def is_grazing(self, t, y: StateVector, modes: ContactVector, tie_tolerance, i: ContactIndex):
        """Whether a slide whose speed comes to zero here only touches it: friction lets go so soon that a speed which
        is off by the share `near` would not have come to zero.

        After the wait s the speed grows as v = u (1 - cos(w s)), with the load's rate m w^2 u.
        """
        load, rate, limit = self.stick_load(t, y, i)
        if rate == 0.0:
            return load == 0.0 and limit == 0.0  # nothing stops it: what is left of the speed is the method's error
        if modes[i] * rate < 0.0:
            return False
        wait = (limit - modes[i] * load) / fabs(rate)
        _, J = self.jacobian(t, y, modes)
        stiffness = J[slip_index[i], position_index[i]]
        return (stiffness < 0.0 or wait == 0.0) and -0.5 * stiffness * wait * wait < tie_tolerance

    def breakaway_acceleration(self, t, y: StateVector, modes: ContactVector, i: ContactIndex):
        """The rate of a slip at a break-away, where the load is just the limit."""
        return self.slip_acceleration(t, y, modes, i)

    def slip_acceleration(self, t, y: StateVector, modes: ContactVector, i: ContactIndex):
        """The rate of a slip."""
        f = self.rates(t, y, modes)
        return f[slip_index[i]]

    def is_consistent(self, t, y: StateVector, modes: ContactVector, i: ContactIndex):
        """Whether a body at rest that has been let go starts in the direction of its mode, but for the last bits: one
        that slides with more than it holds does not."""
        back = contact_vector()
        back[i] = -modes[i]
        forward, backward = self.slip_acceleration(t, y, modes, i), self.slip_acceleration(t, y, back, i)
        if modes[i] * backward <= 0.0:
            return True  # nor does it stay: it moves the other way
        load, _, _, slack = self.stick_balance(t, y, i)
        if fabs(load) <= slack:
            return True
        # late in a run a load is the difference of large numbers
        last_bits = WRONG_WAY_TOLERANCE * fabs(forward - backward) + slack / fabs(load) * fabs(forward + backward)
        return modes[i] * forward >= -last_bits

    def breakaway_time(self, t, y: StateVector, i: ContactIndex):
        """When a contact breaks away if nothing moves, and in which direction; inf if it never does."""
        load, rate, limit = self.stick_load(t, y, i)
        if self.has_input_derivatives and self.has_higher_order():
            return self.breakaway_time_by_series(t, y, load, rate, limit, i)
        if rate == 0.0:
            return inf, STUCK
        direction = FORWARD if rate > 0.0 else BACKWARD
        wait = (limit - direction * load) / fabs(rate)
        return t + (wait if wait > 0.0 else 0.0), direction

    def breakaway_time_by_series(self, t, y: StateVector, load, rate, limit, i: ContactIndex):
        """The same where inputs bend; in no direction where it is to be looked for again from there on."""
        series = self.solver.step.load_series
        span = scale = self.solver.step.h_max
        series.c[1] = rate * span
        for n in range(2, MAX_INPUT_ORDER + 1):
            scale *= span / n
            series.c[n] = self.load_derivative(t, y, n, i) * scale
        series.c[0] = load - limit if load < limit else 0.0
        up, forward = series.first_zero(BACKWARD)
        series.c[0] = load + limit if load > -limit else 0.0
        down, backward = series.first_zero(FORWARD)
        if forward and up <= down:
            return t + up * span, FORWARD
        if backward and down <= up:
            return t + down * span, BACKWARD
        return t + (up if up < down else down) * span, STUCK

    def guard(self, step, t, i: ContactIndex):
        """Positive while the mode lasts: the speed, in the direction of the mode."""
        y = step.state_at(self, t)
        return step.modes0[i] * y[slip_index[i]]

    def find_slip_reversal(self, step, i: ContactIndex):
        """When the slip speed leaves the direction of the mode within the step, to the last bit; inf if it does not."""
        mode = step.modes0[i]
        ahead, behind = mode * step.y0[slip_index[i]], mode * step.y1[slip_index[i]]
        high = step.t1
        if behind > 0.0:
            if mode * step.f0[slip_index[i]] >= 0.0 or mode * step.f1[slip_index[i]] <= 0.0:
                return inf
            high = self.find_minimum(step, step.t0, step.t1, i)
            if not high < inf:
                return inf
            behind = self.guard(step, high, i)
        return self.find_root(step, step.t0, high, ahead, behind, i)

    def find_root(self, step, low, high, ahead, behind, i: ContactIndex):
        """The first instant at which the guard is not positive; at `low` it is `ahead`, at `high` `behind`, which is
        not."""
        kept = 0  # the end of the bracket that the last secant left where it was
        looks = 0
        for _ in range(MAX_BISECTIONS):
            middle = 0.5 * (low + high)
            if not low < middle < high:
                break
            if ahead > 0.0 and behind < 0.0:
                secant = low + (high - low) * (ahead / (ahead - behind))
                if low < secant < high:
                    middle = secant
            here = self.guard(step, middle, i)
            looks += 1
            if here > 0.0:
                low, ahead = middle, here
                if kept == 1:
                    behind *= 0.5
                kept = 1
            else:
                high, behind = middle, here
                if kept == -1:
                    ahead *= 0.5
                kept = -1
        step.interpolant.n_event_evals += looks
        return high

    def find_minimum(self, step, low, high, i: ContactIndex):
        """When the guard is found not positive where it falls at first and rises at last; else inf."""
        step.interpolant.n_event_evals += MAX_TERNARY_STEPS
        for _ in range(MAX_TERNARY_STEPS):
            third = (high - low) / 3.0
            left = self.guard(step, low + third, i)
            right = self.guard(step, high - third, i)
            if left <= 0.0:
                return low + third
            if right <= 0.0:
                return high - third
            if left < right:
                high -= third
            else:
                low += third
        return inf
