"""Dry friction where a contact may be stuck while something moves: several contacts, a belt, bodies that they share.

A slip is any expression that is linear in the speeds, so that a contact at rest bears what the equations ask for: the
loads of all stuck contacts together solve A F = b, where A says how each acts on the slips of all.  Where contacts come
to rest, impulses in them take what is left of their slips, which keeps the momentum.  Which of them then hold is a
linear complementarity problem (F. Pfeiffer, C. Glocker, Multibody Dynamics with Unilateral Contacts, chapters 5 and 6):
all are held; whatever bears more than it holds is let go, and what would slip against its own force is held again.
"""

from math import fabs, inf

from .codes import STUCK
from .rounding import ROUNDOFF_MARGIN
from .stick_slip import DryFriction, sign
from .vectors import ContactIndex, ContactVector, StateVector, any_of, contact_indices, contact_vector, max_of

N_SUBINTERVALS = 5  # parts of a step in which something may end, each looked at by its end
NEAR_ZERO_SHARE = 0.25  # of what a guard changes in a step: below, it is looked at more closely
INTERIOR_MINIMUM_RATIO = (
    3.0  # times the second difference over the middle: by up to 2 the ends differ where a parabola turns inside
)
SLIP_SCALE = 1e-3  # m/s or rad/s: the size of a slip, where it is of no size itself
TIE_SHARE = 1.0 - 1e-9  # of the greatest load, as a share of what is held: what is let go with it
MAX_JOINT_ITERATIONS, MAX_ITERATIONS = (
    60,
    200,
)  # of letting go and holding again: of all contacts; then of one at a time
MAX_IMPULSES = 3  # for slips that are not linear in positions
TINY_FORCE = 1e-300  # a force
SLIPPING, RELOCKED, AT_REST, AT_LIMIT = (
    0,
    1,
    2,
    3,
)  # contacts with a slip, held again, at rest, with a load at the limit


class CoupledFriction(DryFriction):
    """An oscillator that sticks in one contact while it moves in another, or with a belt.

    It says, in the order of its contacts,
        slips(t, states)               their slips
        slip_terms(t, states)          the sums of the sizes of what these are made of
        forces(t, states, modes)       their forces, their limits, and the sums of the sizes that the forces consist of
        changes(t, states, modes)      the rates of forces and limits; what each force lacks to hold its contact, and
                                       the rate of that
        struck(t, states, modes)       the states after impulses in the stuck contacts, which end their slips
    """

    is_coupled, rests_when_stuck = True, False

    # ---- where modes end

    def guards(self, t, y: StateVector, modes: ContactVector) -> ContactVector:
        """Positive while the modes last: what the load of a stuck contact lacks to the limit, where one that stays
        there, but for rounding, is held; or the slip, in the direction of the mode."""
        slips = self.slip_velocities(t, y)
        left = contact_vector()
        for i in contact_indices:
            left[i] = modes[i] * slips[i]
        if any_of(modes == STUCK):
            force, limit, terms = self.contact_forces(t, y, modes)
            for i in contact_indices:
                if modes[i] == STUCK:
                    left[i] = limit[i] + ROUNDOFF_MARGIN * (terms[i] + limit[i]) - fabs(force[i])
        return left

    def guard(self, step, t, i: ContactIndex):
        """That of one contact, within a step; while it slides nobody asks for loads."""
        y = step.state_at(self, t)
        if step.modes0[i] != STUCK:
            slips = self.slip_velocities(t, y)
            return step.modes0[i] * slips[i]
        left = self.guards(t, y, step.modes0)
        return left[i]

    def may_cross_zero(self, step, first: ContactVector, last: ContactVector):
        """Whether a guard may come to zero between the ends of the step, where it has these values, as far as the
        parabola through its middle tells: no interpolant is worked out for that, the middle is that of the cubic with
        the values and slopes of both ends."""
        h = step.t1 - step.t0
        y2 = 0.5 * (step.y0 + step.y1) + 0.125 * h * (step.f0 - step.f1)
        middle = self.guards(step.t0 + 0.5 * h, y2, step.modes0)
        found = False
        for i in contact_indices:
            end = first[i] if first[i] < last[i] else last[i]
            low = end if end < middle[i] else middle[i]
            expand_series = first[i] + last[i] - 2.0 * middle[i]
            rise = fabs(last[i] - first[i])
            close = low <= NEAR_ZERO_SHARE * (rise if rise > expand_series else expand_series)
            found = (
                found
                or last[i] <= 0.0
                or middle[i] <= 0.0
                or (close and rise <= INTERIOR_MINIMUM_RATIO * expand_series)
            )
        return found

    def mode_end_times(self, step) -> ContactVector:
        """When each mode ends within the step, to the last bit; inf where it does not.

        A guard that falls to zero and rises again within the step is found as well.
        """
        found, before = contact_vector(), contact_vector()
        for i in contact_indices:
            found[i], before[i] = inf, -inf
        here = self.guards(step.t0, step.y0, step.modes0)
        last = self.guards(step.t1, step.y1, step.modes0)
        if self.may_cross_zero(step, here, last):
            step.interpolant.n_event_evals += N_SUBINTERVALS
            t_before = t_here = step.t0
            for part in range(1, N_SUBINTERVALS + 1):
                t, ahead = step.t1, last
                if part < N_SUBINTERVALS:
                    t = step.t0 + (step.t1 - step.t0) * part / N_SUBINTERVALS
                    y = step.state_at(self, t)
                    ahead = self.guards(t, y, step.modes0)
                for i in contact_indices:
                    if found[i] == inf and ahead[i] <= 0.0:
                        found[i] = self.find_root(step, t_here, t, here[i], ahead[i], i)
                    elif found[i] == inf and before[i] > here[i] and ahead[i] > here[i]:  # lowest in between
                        low = self.find_minimum(step, t_before, t, i)
                        if low < inf:
                            least = self.guard(step, low, i)
                            found[i] = self.find_root(step, t_before, low, before[i], least, i)
                before, here = here, ahead
                t_before, t_here = t_here, t
        return found

    def resolve_after_event(self, step, ends: ContactVector, tie_tolerance) -> tuple[StateVector, ContactVector, bool]:
        """State and modes at the end of a step that has been cut there, and whether the modes fit."""
        t = step.t1
        slips = self.slip_velocities(t, step.y1)
        terms = self.slip_magnitudes(t, step.y1)
        rest, first = contact_vector(), contact_vector()
        for i in contact_indices:
            rest[i], first[i] = SLIPPING, step.modes0[i]
            if first[i] == STUCK:
                rest[i] = AT_LIMIT if ends[i] <= t else AT_REST
            elif ends[i] <= t or first[i] * slips[i] <= ROUNDOFF_MARGIN * terms[i]:
                rest[i], first[i] = AT_REST, STUCK
        y = self.stop_slips(t, step.y1, first)
        modes, fit = self.solve_modes(t, y, first, rest, tie_tolerance)
        return y, modes, fit

    def resolve_at_start(
        self, t, y: StateVector, modes: ContactVector, tie_tolerance, reach
    ) -> tuple[StateVector, ContactVector, bool]:
        """The same where a motion begins, or values have changed, after these modes: what has a slip slides.

        Of its size the share `near` is none where a contact was stuck, and the share `reach` where it is against the
        direction of a slide.
        """
        slips = self.slip_velocities(t, y)
        terms = self.slip_magnitudes(t, y)
        rest, first = contact_vector(), contact_vector()
        for i in contact_indices:
            known = ROUNDOFF_MARGIN * terms[i]
            if modes[i] * slips[i] <= 0.0:
                known = (tie_tolerance if modes[i] == STUCK else reach) * (terms[i] + SLIP_SCALE)
            rest[i], first[i] = SLIPPING, sign(slips[i])
            if fabs(slips[i]) <= known:
                rest[i], first[i] = AT_REST, STUCK
        y = self.stop_slips(t, y, first)
        after, fit = self.solve_modes(t, y, first, rest, tie_tolerance)
        return y, after, fit

    # ---- which contacts hold

    def stop_slips(self, t, y: StateVector, modes: ContactVector) -> StateVector:
        """The nearest state whose stuck contacts have no slip: impulses in these keep the momentum."""
        for _ in range(MAX_IMPULSES):
            slips = self.slip_velocities(t, y)
            still = True
            for i in contact_indices:
                if modes[i] == STUCK and slips[i] != 0.0:
                    still = False
            if still:
                break
            y = self.apply_impulses(t, y, modes)
        return y

    def solve_modes(
        self, t, y: StateVector, modes: ContactVector, rest: ContactVector, tie_tolerance
    ) -> tuple[ContactVector, bool]:
        """The modes that hold from here on, of which those of contacts at rest may be others than these; and whether
        they fit the forces.

        What would slip against its own force is held; else what bears most of what it holds is let go, and what bears
        as much with it.  If that comes to no end, one contact is changed at a time, the first that has to.
        """
        after, state = contact_vector(), contact_vector()
        for i in contact_indices:
            after[i], state[i] = modes[i], rest[i]
        for turn in range(MAX_ITERATIONS):
            urgency, other = self.violations(t, y, after, state, tie_tolerance)
            worst = max_of(urgency)
            if not worst > 0.0:
                return after, True
            least = TIE_SHARE * worst if turn < MAX_JOINT_ITERATIONS else 0.0
            changed = False
            for i in contact_indices:
                if urgency[i] > 0.0 and urgency[i] >= least and not (changed and least == 0.0):
                    after[i], changed = other[i], True
                    if other[i] == STUCK:
                        state[i] = RELOCKED
        return modes, False

    def violations(
        self, t, y: StateVector, modes: ContactVector, rest: ContactVector, tie_tolerance
    ) -> tuple[ContactVector, ContactVector]:
        """How urgently each contact at rest must change, not at all where its mode fits, and to which mode.

        A tie is decided by the next derivative, unless the contact has been held again.  A load is known but for the
        rounding of what it is made of, and, where it moves inward, the share `near` of the limit.
        """
        force, limit, terms = self.contact_forces(t, y, modes)
        force_rate, limit_rate, residual_force, residual_force_rate = self.contact_rates(t, y, modes)
        urgency, other = contact_vector(), contact_vector()
        for i in contact_indices:
            urgency[i], other[i] = 0.0, STUCK
            slack = ROUNDOFF_MARGIN * (terms[i] + limit[i])
            if rest[i] != SLIPPING and modes[i] == STUCK:
                other[i] = sign(force[i]) if fabs(force[i]) > slack else sign(force_rate[i])
                outward = other[i] * force_rate[i] - limit_rate[i]
                if rest[i] == AT_LIMIT or (rest[i] == AT_REST and outward > 0.0):
                    slack = -slack
                elif outward < 0.0:
                    slack += tie_tolerance * limit[i]
                if other[i] != STUCK and fabs(force[i]) > limit[i] + slack:
                    urgency[i] = fabs(force[i]) / (limit[i] + TINY_FORCE)
            elif rest[i] != SLIPPING:
                ahead = modes[i] * residual_force[i]
                if ahead < -slack or (ahead <= slack and modes[i] * residual_force_rate[i] <= 0.0):
                    urgency[i] = inf
        return urgency, other
