"""Stick and slip of coupled contacts: several contacts, belts, contacts that share bodies.

A slip velocity is any expression linear in the velocities.  The forces of all stuck contacts solve A F = b, where A
maps contact forces to slip accelerations.  When contacts come to rest, impulses remove the remaining slip velocities
and conserve momentum.  Which contacts then stick is a linear complementarity problem (F. Pfeiffer, C. Glocker,
Multibody Dynamics with Unilateral Contacts, chapters 5 and 6).  Its pivoting starts with all contacts stuck, releases
those whose load exceeds the limit, and locks again those that would slip against their own friction force.
"""

from math import fabs, inf

from .codes import HYBRID, STUCK
from .rounding import ROUNDOFF_MARGIN
from .stick_slip import DryFriction, sign
from .vectors import ContactVector, StateVector, any_of, contact_indices, contact_vector, max_of

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

    def update_contact_event_functions(self, location, t, y: StateVector, modes: ContactVector):
        """Evaluate the event functions of all contacts, with margins for rounding errors."""
        slips = self.slip_velocities(t, y)
        slip_terms = self.slip_magnitudes(t, y)
        for i in contact_indices:
            location.scales[i] = location.scales[len(modes) + i] = slip_terms[i]
            location.values[i] = modes[i] * slips[i] + ROUNDOFF_MARGIN * slip_terms[i]
            location.values[len(modes) + i] = 1.0
        if self.friction != HYBRID:
            for i in contact_indices:
                location.values[i] = 1.0
        elif any_of(modes == STUCK):
            force, limit, terms = self.contact_forces(t, y, modes)
            for i in contact_indices:
                if modes[i] == STUCK:
                    limit_with_margin = limit[i] + ROUNDOFF_MARGIN * (terms[i] + limit[i])
                    location.scales[i] = location.scales[len(modes) + i] = terms[i] + limit[i]
                    location.values[i] = limit_with_margin - force[i]
                    location.values[len(modes) + i] = limit_with_margin + force[i]

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
