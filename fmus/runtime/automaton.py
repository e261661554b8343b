"""Dry friction as modes: backward, stuck, forward; their guards, and where they settle.

Sliding, the friction force is that of the model and opposes the direction of the mode.  Stuck, it is whatever
holds the body at rest, up to the holding limit.  A mode ends where its guard does: a slide when the speed comes to
zero, a stick when the load exceeds the limit (M. Otter, H. Elmqvist, S. E. Mattsson, Hybrid modeling in Modelica
based on the synchronous data flow principle, CACSD 1999).
"""

from math import fabs, inf

from .codes import BACKWARD, EXACT, FORWARD, HYBRID, SIGN, STUCK, THRESHOLD
from .oscillator import Oscillator
from .rounding import NEAR

HYBRID_LAW = ("hybrid", HYBRID, "stick and slip are modes, every change of mode is located as an event")
SIGN_LAW = ("sign", SIGN, "sliding force times sign(v) as it stands: no event, no stick; chatters")
THRESHOLD_LAW = ("threshold", THRESHOLD, "as sign, but below a small speed friction balances the spring; chatters")

MOST_HALVINGS = 200
MOST_THIRDS = 25


def sign(v):
    """-1, 0 or 1."""
    return 1 if v > 0.0 else -1 if v < 0.0 else 0


def threshold(v, eps, load, slide, hold):
    """Friction by the threshold law."""
    if fabs(v) >= eps:
        return sign(v) * slide
    return hold if load > hold else -hold if load < -hold else load


class DryFriction(Oscillator):
    """An oscillator that sticks.

    hold(t, x, v) tells the load on the body at rest, its rate and the holding limit; terms(t, x, v) the sum of the
    sizes of what the load is made of, of which rounding takes its share.  While the body rests, the load is linear in
    time.
    """

    dry = True
    rules: tuple[str, ...] = (
        "friction = {friction} with solver.method = 1 (exact): the closed form holds for the hybrid law only; "
        "set friction to 1 (hybrid), or solver.method to 2 (ode23)",
    )
    own_solver = 1

    def prepare(self):
        return 1 if self.friction != HYBRID and self.solver.method == EXACT else 0

    def settle(self, t, x, v, near):
        """The mode that holds from here on.

        A load of the limit is a tie, which its rate decides: outward it lets go, inward or without a rate it is held.
        The load is known but for the rounding of its terms, and, where it moves inward, the share `near` of the limit.
        """
        if v > 0.0:
            return FORWARD
        if v < 0.0:
            return BACKWARD
        load, rate, limit = self.hold(t, x, v)
        slack = NEAR * (self.terms(t, x, v) + limit)
        if rate > 0.0 and load >= limit - slack:
            return FORWARD
        if rate < 0.0 and load <= slack - limit:
            return BACKWARD
        if rate != 0.0:
            slack += near * limit
        if fabs(load) <= limit + slack:
            return STUCK
        return FORWARD if load > 0.0 else BACKWARD

    def touches(self, t, x, v, mode, near):
        """Whether a slide whose speed comes to zero here only touches it: friction lets go so soon that a speed which
        is off by the share `near` would not have come to zero.

        After the wait s the speed grows as v = u (1 - cos(w s)), with the load's rate m w^2 u.
        """
        load, rate, limit = self.hold(t, x, v)
        if rate == 0.0:
            return load == 0.0 and limit == 0.0  # nothing stops it: what is left of the speed is the method's error
        if mode * rate < 0.0:
            return False
        wait = (limit - mode * load) / fabs(rate)
        _, stiffness, _ = self.jacobian(t, x, v, mode)
        return -0.5 * stiffness * wait * wait < near

    def departure(self, t, x, v, mode):
        """The acceleration at a break-away, where the load is just the limit."""
        return self.rates(t, x, v, mode)

    def release(self, t, x, v):
        """When a body at rest at x breaks away, and in which direction; inf if it never does."""
        load, rate, limit = self.hold(t, x, v)
        if rate == 0.0:
            return inf, STUCK
        direction = FORWARD if rate > 0.0 else BACKWARD
        wait = (limit - direction * load) / fabs(rate)
        return t + (wait if wait > 0.0 else 0.0), direction

    def reversal(self, step):
        """When the speed leaves the direction of the mode within the step, to the last bit; inf if it does not."""
        mode = step.mode0
        low, high = step.t0, step.t1
        ahead, behind = mode * step.v0, mode * step.v1
        if behind > 0.0:
            high = self.dip(step)
            if not high < inf:
                return inf
            _, v = step.at(self, high)
            behind = mode * v
        kept = 0  # the end of the bracket that the last secant left where it was
        looks = 0
        for _ in range(MOST_HALVINGS):
            middle = 0.5 * (low + high)
            if not low < middle < high:
                break
            if ahead > 0.0 and behind < 0.0:
                secant = low + (high - low) * (ahead / (ahead - behind))
                if low < secant < high:
                    middle = secant
            _, v = step.at(self, middle)
            looks += 1
            v *= mode
            if v > 0.0:
                low, ahead = middle, v
                if kept == 1:
                    behind *= 0.5
                kept = 1
            else:
                high, behind = middle, v
                if kept == -1:
                    ahead *= 0.5
                kept = -1
        step.looked += looks
        return high

    def dip(self, step):
        """When the speed is found against the mode within a step that it enters falling and leaves rising; else inf."""
        mode = step.mode0
        if mode * step.a0 >= 0.0 or mode * step.a1 <= 0.0:
            return inf
        low, high = step.t0, step.t1
        step.looked += MOST_THIRDS
        for _ in range(MOST_THIRDS):
            third = (high - low) / 3.0
            _, left = step.at(self, low + third)
            _, right = step.at(self, high - third)
            if mode * left <= 0.0:
                return low + third
            if mode * right <= 0.0:
                return high - third
            if mode * left < mode * right:
                high -= third
            else:
                low += third
        return inf
