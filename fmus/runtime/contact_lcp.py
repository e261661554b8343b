"""Stick and slip of coupled contacts: several contacts, belts, contacts that share bodies.

A slip velocity is any expression linear in the velocities.  The forces of all stuck contacts solve A F = b, where A
maps contact forces to slip accelerations.  When contacts come to rest, impulses remove the remaining slip velocities
and conserve momentum.  Which contacts then stick is a linear complementarity problem (F. Pfeiffer, C. Glocker,
Multibody Dynamics with Unilateral Contacts, chapters 5 and 6).  Its pivoting starts with all contacts stuck, releases
those whose load exceeds the limit, and locks again those that would slip against their own friction force.
"""

from math import fabs, inf

from .codes import STUCK
from .rounding import ROUNDOFF_MARGIN
from .stick_slip import DryFriction, sign
from .vectors import ContactIndex, ContactVector, StateVector, any_of, contact_indices, contact_vector, max_of

N_SUBINTERVALS = 5  # parts of a step that are searched for the end of a mode
NEAR_ZERO_SHARE = 0.25  # share of the change of a guard in a step; smaller values are examined more closely
# largest ratio of end difference to second difference of a guard; up to 2 a parabola has a minimum inside
INTERIOR_MINIMUM_RATIO = 3.0
SLIP_SCALE = 1e-3  # m/s or rad/s: scale of slip velocities whose terms are zero
TIE_SHARE = 1.0 - 1e-9  # contacts within this share of the highest relative load are released together
MAX_JOINT_ITERATIONS, MAX_ITERATIONS = 60, 200  # pivots of all contacts at once; then of one at a time
MAX_IMPULSES = 3  # several, since slip velocities may be nonlinear in the positions
TINY_FORCE = 1e-300  # N, avoids a division by zero
SLIPPING, RELOCKED, AT_REST, AT_LIMIT = 0, 1, 2, 3  # status of a contact in the pivoting


class CoupledFriction(DryFriction):
    """Oscillator in which a contact may stick while something moves.

    The generated model also defines, over its contacts,

        slip_velocities(t, states)         slip velocities
        slip_magnitudes(t, states)         sums of their absolute terms
        contact_forces(t, states, modes)   forces, holding limits, and sums of the absolute terms of the forces
        contact_rates(t, states, modes)    rates of forces and limits; residual forces (force required to hold a contact
                                           minus present force) and their rates
        apply_impulses(t, states, modes)   states after impulses that stop the slip of stuck contacts
    """

    is_coupled, rests_when_stuck = True, False

    # ---- end of modes

    def guards(self, t, y: StateVector, modes: ContactVector) -> ContactVector:
        """Return the event functions, positive while the modes last.

        Slip: the slip velocity in the direction of the mode.  Stick: holding limit, with a margin for rounding errors,
        minus absolute load.
        """
        slips = self.slip_velocities(t, y)
        values = contact_vector()
        for i in contact_indices:
            values[i] = modes[i] * slips[i]
        if any_of(modes == STUCK):
            force, limit, terms = self.contact_forces(t, y, modes)
            for i in contact_indices:
                if modes[i] == STUCK:
                    values[i] = limit[i] + ROUNDOFF_MARGIN * (terms[i] + limit[i]) - fabs(force[i])
        return values

    def guard(self, step, t, i: ContactIndex):
        """Return the event function of one contact inside a step; loads are computed only if it sticks."""
        y = step.state_at(self, t)
        if step.modes0[i] != STUCK:
            slips = self.slip_velocities(t, y)
            return step.modes0[i] * slips[i]
        values = self.guards(t, y, step.modes0)
        return values[i]

    def may_cross_zero(self, step, g_start: ContactVector, g_end: ContactVector):
        """Return whether a guard may reach zero inside the step, judged by a parabola through both ends and the middle.

        The state in the middle is that of the cubic Hermite polynomial, so that no interpolant is built.
        """
        h = step.t1 - step.t0
        y2 = 0.5 * (step.y0 + step.y1) + 0.125 * h * (step.f0 - step.f1)
        g_middle = self.guards(step.t0 + 0.5 * h, y2, step.modes0)
        crossing = False
        for i in contact_indices:
            end = g_start[i] if g_start[i] < g_end[i] else g_end[i]
            low = end if end < g_middle[i] else g_middle[i]
            second_difference = g_start[i] + g_end[i] - 2.0 * g_middle[i]
            end_difference = fabs(g_end[i] - g_start[i])
            close = low <= NEAR_ZERO_SHARE * (
                end_difference if end_difference > second_difference else second_difference
            )
            crossing = (
                crossing
                or g_end[i] <= 0.0
                or g_middle[i] <= 0.0
                or (close and end_difference <= INTERIOR_MINIMUM_RATIO * second_difference)
            )
        return crossing

    def mode_end_times(self, step) -> ContactVector:
        """Return when each mode ends within the step, to machine precision; inf if it does not.

        Guards that fall to zero and rise again within the step are detected as well.
        """
        ends, g_before = contact_vector(), contact_vector()
        for i in contact_indices:
            ends[i], g_before[i] = inf, -inf
        g = self.guards(step.t0, step.y0, step.modes0)
        g_end = self.guards(step.t1, step.y1, step.modes0)
        if self.may_cross_zero(step, g, g_end):
            step.interpolant.n_event_evals += N_SUBINTERVALS
            t_before = t_part_start = step.t0
            for part in range(1, N_SUBINTERVALS + 1):
                t, g_part = step.t1, g_end
                if part < N_SUBINTERVALS:
                    t = step.t0 + (step.t1 - step.t0) * part / N_SUBINTERVALS
                    y = step.state_at(self, t)
                    g_part = self.guards(t, y, step.modes0)
                for i in contact_indices:
                    if ends[i] == inf and g_part[i] <= 0.0:
                        ends[i] = self.find_root(step, t_part_start, t, g[i], g_part[i], i)
                    elif ends[i] == inf and g_before[i] > g[i] and g_part[i] > g[i]:  # minimum in between
                        t_low = self.find_minimum(step, t_before, t, i)
                        if t_low < inf:
                            g_min = self.guard(step, t_low, i)
                            ends[i] = self.find_root(step, t_before, t_low, g_before[i], g_min, i)
                g_before, g = g, g_part
                t_before, t_part_start = t_part_start, t
        return ends

    def resolve_after_event(self, step, ends: ContactVector, tie_tolerance) -> tuple[StateVector, ContactVector, bool]:
        """Return states and modes after an event at the end of a step, and whether the modes are consistent."""
        t = step.t1
        slips = self.slip_velocities(t, step.y1)
        terms = self.slip_magnitudes(t, step.y1)
        status, new_modes = contact_vector(), contact_vector()
        for i in contact_indices:
            status[i], new_modes[i] = SLIPPING, step.modes0[i]
            if new_modes[i] == STUCK:
                status[i] = AT_LIMIT if ends[i] <= t else AT_REST
            elif ends[i] <= t or new_modes[i] * slips[i] <= ROUNDOFF_MARGIN * terms[i]:
                status[i], new_modes[i] = AT_REST, STUCK
        y = self.stop_slips(t, step.y1, new_modes)
        modes, consistent = self.solve_modes(t, y, new_modes, status, tie_tolerance)
        return y, modes, consistent

    def resolve_at_start(
        self, t, y: StateVector, modes: ContactVector, tie_tolerance, reach
    ) -> tuple[StateVector, ContactVector, bool]:
        """Return the same at the start of a run or after a change of values: contacts with a slip velocity slide.

        Parameters
        ----------
        t
            Time in s.
        y
            States.
        modes
            Previous modes.
        tie_tolerance, reach
            Slip velocities below these shares of their absolute terms count as zero, for contacts that were stuck and
            for contacts that slip against their mode.
        """
        slips = self.slip_velocities(t, y)
        terms = self.slip_magnitudes(t, y)
        status, new_modes = contact_vector(), contact_vector()
        for i in contact_indices:
            zero_level = ROUNDOFF_MARGIN * terms[i]
            if modes[i] * slips[i] <= 0.0:
                zero_level = (tie_tolerance if modes[i] == STUCK else reach) * (terms[i] + SLIP_SCALE)
            status[i], new_modes[i] = SLIPPING, sign(slips[i])
            if fabs(slips[i]) <= zero_level:
                status[i], new_modes[i] = AT_REST, STUCK
        y = self.stop_slips(t, y, new_modes)
        resolved_modes, consistent = self.solve_modes(t, y, new_modes, status, tie_tolerance)
        return y, resolved_modes, consistent

    # ---- complementarity problem

    def stop_slips(self, t, y: StateVector, modes: ContactVector) -> StateVector:
        """Return the states without slip in the stuck contacts; impulses conserve momentum."""
        for _ in range(MAX_IMPULSES):
            slips = self.slip_velocities(t, y)
            at_rest = True
            for i in contact_indices:
                if modes[i] == STUCK and slips[i] != 0.0:
                    at_rest = False
            if at_rest:
                break
            y = self.apply_impulses(t, y, modes)
        return y

    def solve_modes(
        self, t, y: StateVector, modes: ContactVector, status: ContactVector, tie_tolerance
    ) -> tuple[ContactVector, bool]:
        """Solve the complementarity problem for the modes of contacts at rest.

        Contacts that would slip against their own friction force are locked first; else those with the highest load
        relative to their limit are released together.  If this does not end, one contact changes at a time, the first
        that violates its conditions.

        Returns
        -------
        tuple
            The modes, and whether they are consistent with the forces.
        """
        pivot_modes, pivot_status = contact_vector(), contact_vector()
        for i in contact_indices:
            pivot_modes[i], pivot_status[i] = modes[i], status[i]
        for iteration in range(MAX_ITERATIONS):
            violation, next_modes = self.violations(t, y, pivot_modes, pivot_status, tie_tolerance)
            highest = max_of(violation)
            if not highest > 0.0:
                return pivot_modes, True
            release_level = TIE_SHARE * highest if iteration < MAX_JOINT_ITERATIONS else 0.0
            changed = False
            for i in contact_indices:
                if violation[i] > 0.0 and violation[i] >= release_level and not (changed and release_level == 0.0):
                    pivot_modes[i], changed = next_modes[i], True
                    if next_modes[i] == STUCK:
                        pivot_status[i] = RELOCKED
        return modes, False

    def violations(
        self, t, y: StateVector, modes: ContactVector, status: ContactVector, tie_tolerance
    ) -> tuple[ContactVector, ContactVector]:
        """Return how far each contact at rest violates the conditions of its mode (0: not at all), and its next mode.

        The next derivative decides ties, unless the contact was locked again.  Loads have the rounding errors of their
        terms and, if they decrease, the relative error `tie_tolerance`.
        """
        force, limit, terms = self.contact_forces(t, y, modes)
        force_rate, limit_rate, residual_force, residual_force_rate = self.contact_rates(t, y, modes)
        violation, next_modes = contact_vector(), contact_vector()
        for i in contact_indices:
            violation[i], next_modes[i] = 0.0, STUCK
            slack = ROUNDOFF_MARGIN * (terms[i] + limit[i])
            if status[i] != SLIPPING and modes[i] == STUCK:
                next_modes[i] = sign(force[i]) if fabs(force[i]) > slack else sign(force_rate[i])
                outward = next_modes[i] * force_rate[i] - limit_rate[i]
                if status[i] == AT_LIMIT or (status[i] == AT_REST and outward > 0.0):
                    slack = -slack
                elif outward < 0.0:
                    slack += tie_tolerance * limit[i]
                if next_modes[i] != STUCK and fabs(force[i]) > limit[i] + slack:
                    violation[i] = fabs(force[i]) / (limit[i] + TINY_FORCE)
            elif status[i] != SLIPPING:
                ahead = modes[i] * residual_force[i]
                if ahead < -slack or (ahead <= slack and modes[i] * residual_force_rate[i] <= 0.0):
                    violation[i] = inf
        return violation, next_modes
