"""Stick and slip of coupled contacts: several contacts, belts, contacts that share bodies.

A slip velocity is any expression linear in the velocities.  The forces of all stuck contacts solve A F = b, where A
maps contact forces to slip accelerations.  When contacts come to rest, impulses remove the remaining slip velocities
and conserve momentum.  Which contacts then stick is a linear complementarity problem (F. Pfeiffer, C. Glocker,
Multibody Dynamics with Unilateral Contacts, chapters 5 and 6).  Its pivoting starts with all contacts stuck, releases
those whose load exceeds the limit, and locks again those that would slip against their own friction force.  With
holding limits above the sliding forces, several combinations of modes may be consistent; the solution is the one with
the most contacts held.

The model states slips, forces and impulses; the functions below, which belong to the solver, decide on modes.
"""

from math import fabs, inf

from .codes import BACKWARD, EPSILON, FORWARD, HYBRID, ROUNDOFF_MARGIN, STUCK
from .stick_slip import DryFriction, sign
from .time_scale import time_scale
from .vectors import (
    ContactIndex,
    ContactVector,
    StateVector,
    any_of,
    contact_indices,
    contact_vector,
    is_planar,
    max_of,
    planar_indices,
    select_kinematic,
)

SIMULTANEITY_MARGIN = 1e-11  # relative; smaller slips come to rest together with one that is zero
TIE_SHARE = 1.0 - 1e-9  # contacts within this share of the highest relative load are released together
MAX_JOINT_ITERATIONS, MAX_ITERATIONS = 60, 200  # pivots of all contacts at once; then of one at a time
MAX_IMPULSES = 3  # several, since slip velocities may be nonlinear in the positions
TINY_FORCE = 1e-300  # N, avoids a division by zero
EQUAL_SHARE = 1.0 - 1e-9  # of the holding limit: a larger sliding force equals it
PREDICTION_SHARE = 1e-4  # of the time scale of the motion: how far slips and loads are predicted
REVERSED_SHARE = 1e-8  # relative; larger slips against the mode are no rounding errors
MAX_ENUMERATED = 6  # contacts at rest of which all modes are tried
SLIPPING, RELOCKED, AT_REST, AT_LIMIT = 0, 1, 2, 3  # status of a contact in the pivoting


class CoupledFriction(DryFriction):
    """Oscillator in which a contact may stick while something moves.

    A contact whose sliding force and holding limit are zero has no friction: it never sticks, and a reversal of its
    slip is no event.  Its mode, 1 or -1, stays the direction of the last slip with friction, or of the first slip.
    """

    is_coupled, rests_when_stuck = True, False

    def slip_velocities(self, t: float, y: StateVector) -> ContactVector:
        """Return the slip velocities."""

    def slip_magnitudes(self, t: float, y: StateVector) -> ContactVector:
        """Return the sums of their absolute terms."""

    def slip_roundings(self, t: float, y: StateVector) -> ContactVector:
        """Return the scales of their rounding errors, which for an angle of many revolutions are larger than these."""

    def slip_deviations(self, t: float, y: StateVector) -> ContactVector:
        """Return how far new values of inputs move the slips without a jump, because their rates have changed."""

    def contact_forces(
        self, t: float, y: StateVector, modes: ContactVector
    ) -> tuple[ContactVector, ContactVector, ContactVector, ContactVector]:
        """Return forces, holding limits, and of both together the sums of absolute terms and the rounding scales."""

    def contact_rates(
        self, t: float, y: StateVector, modes: ContactVector
    ) -> tuple[ContactVector, ContactVector, ContactVector, ContactVector]:
        """Return the rates of forces and limits; residual forces (required minus present force) and their rates."""

    def apply_impulses(self, t: float, y: StateVector, modes: ContactVector) -> StateVector:
        """Return the states after impulses that stop the slip of stuck contacts."""


# ---- end of modes


def update_contact_event_functions(model, location, t, y: StateVector, modes: ContactVector):
    """Evaluate the event functions of all contacts, with margins for rounding errors."""
    slips = model.slip_velocities(t, y)
    sizes = model.slip_magnitudes(t, y)
    roundings = model.slip_roundings(t, y)
    for i in contact_indices:
        location.scales[i] = location.scales[len(modes) + i] = sizes[i]
        location.roundings[i] = location.roundings[len(modes) + i] = roundings[i]
        location.values[i] = modes[i] * slips[i] + ROUNDOFF_MARGIN * roundings[i]
        location.values[len(modes) + i] = 1.0
        if model.friction != HYBRID or location.is_frictionless[i] > 0.0:
            location.values[i] = 1.0
    if model.friction == HYBRID and any_of(modes == STUCK):
        force, limit, load_sizes, terms = model.contact_forces(t, y, modes)
        for i in contact_indices:
            if modes[i] == STUCK:
                widened_limit = limit[i] + ROUNDOFF_MARGIN * terms[i]
                location.scales[i] = location.scales[len(modes) + i] = load_sizes[i]
                location.roundings[i] = location.roundings[len(modes) + i] = terms[i]
                location.values[i] = widened_limit - force[i]
                location.values[len(modes) + i] = widened_limit + force[i]
                if is_planar[i] and widened_limit > 0.0:  # smooth where the load, a size, passes zero
                    location.values[i] *= location.values[len(modes) + i] / widened_limit
    for i in planar_indices:
        if modes[i] != STUCK:
            location.values[i] = 1.0  # a size has no change of sign: see planar_contact.comes_to_rest


def find_frictionless_contacts(model, location, step):
    """Note which contacts have no friction in a step: a reversal of their slips is no event."""
    force, limit, _sizes, _terms = model.contact_forces(step.t0, step.y0, step.modes0)
    force_at_end, limit_at_end, _sizes_at_end, _terms_at_end = model.contact_forces(step.t1, step.y1, step.modes0)
    for i in contact_indices:
        sizes = fabs(force[i]) + limit[i] + fabs(force_at_end[i]) + limit_at_end[i]
        location.is_frictionless[i] = 1.0 if step.modes0[i] != STUCK and sizes == 0.0 else 0.0


def resolve_after_event(model, step, h, ends: ContactVector, tie_tolerance) -> tuple[StateVector, ContactVector, bool]:
    """Return states and modes after an event at the end of a step, and whether the modes are consistent.

    The event is `h` seconds after the start of the step; contact i has its first zero after `ends[i]` seconds.
    """
    t = step.t1
    slips = model.slip_velocities(t, step.y1)
    terms = model.slip_magnitudes(t, step.y1)
    roundings = model.slip_roundings(t, step.y1)
    floors = slip_floors(model, step, t, step.y1)
    force, limit, _sizes, _terms = model.contact_forces(t, step.y1, step.modes0)
    delta = PREDICTION_SHARE * time_scale(model, step, t, step.y1, step.modes0)
    status, new_modes = contact_vector(), contact_vector()
    y = step.y1
    for i in contact_indices:
        status[i], new_modes[i] = SLIPPING, step.modes0[i]
        size, rounding = terms[i] + step.event_location.peaks[i], ROUNDOFF_MARGIN * roundings[i]
        if new_modes[i] == STUCK:
            status[i] = AT_LIMIT if ends[i] <= h else AT_REST
        elif not (force[i] == 0.0 and limit[i] == 0.0):
            if new_modes[i] * slips[i] < -REVERSED_SHARE * (size + floors[i]):
                new_modes[i] = sign(slips[i])  # it reversed without friction, which has returned
            elif ends[i] <= h or new_modes[i] * slips[i] <= SIMULTANEITY_MARGIN * size + rounding:
                depth = inf
                if not is_planar[i] and fabs(force[i]) >= EQUAL_SHARE * limit[i]:
                    depth = reversal_depth(model, t, y, step.modes0, delta, limit[i], i)
                if depth <= tie_tolerance * (terms[i] + start_slip(model, step, i) + floors[i]):
                    y = raise_slip(model, t, y, step.modes0, 2.0 * depth + rounding, i)
                else:
                    status[i], new_modes[i] = AT_REST, STUCK
    return resolve_contacts(model, t, y, step.modes0, new_modes, status, delta, tie_tolerance)


def reversal_depth(model, t, y: StateVector, modes: ContactVector, delta, holding_limit, i: ContactIndex):
    """Return how far a slip velocity, zero now, would go against its mode before it returns; inf if it does not.

    With a holding limit equal to the sliding force, the contact breaks away again when the slip would return; after
    a slip velocity that only touches zero the depth is zero, except for errors of the method.
    """
    _force_rate, _limit_rate, residual_force, residual_force_rate = model.contact_rates(t, y, modes)
    ahead, rate = modes[i] * residual_force[i], modes[i] * residual_force_rate[i]
    if fabs(ahead) > holding_limit:  # far from breaking away, or at a dead point
        return inf
    if ahead > 0.0:
        return 0.0
    if not rate > 0.0:
        return inf
    f = model.rates(t, y, modes)
    y2 = y + delta * f
    slips = model.slip_velocities(t, y)
    slips_ahead = model.slip_velocities(t + delta, y2)
    return 0.5 * fabs(slips_ahead[i] - slips[i]) / delta * (-ahead / rate)


def start_slip(model, step, i: ContactIndex):
    """Return the absolute slip velocity at the start of a step."""
    slips = model.slip_velocities(step.t0, step.y0)
    return fabs(slips[i])


def raise_slip(model, t, y: StateVector, modes: ContactVector, amount, i: ContactIndex) -> StateVector:
    """Return the states after an impulse in a contact that changes its slip in the direction of its mode."""
    reverse_modes = contact_vector()
    for j in contact_indices:
        reverse_modes[j] = modes[j]
    reverse_modes[i] = -modes[i]
    f = model.rates(t, y, modes)
    f2 = model.rates(t, y, reverse_modes)
    impulse = f2 - f
    y3 = y + impulse
    slips = model.slip_velocities(t, y)
    slips_after = model.slip_velocities(t, y3)
    effect = modes[i] * (slips_after[i] - slips[i])
    if effect > 0.0:
        share = amount / effect
        return y + share * impulse
    return y


def slip_floors(model, step, t, y: StateVector) -> ContactVector:
    """Return the slip velocities below which errors do not count: those of velocities at their scale floors."""
    y2 = select_kinematic(y, step.active_method.error_scale_floor)
    return model.slip_magnitudes(t, y2)


def have_jumped(model, step, t, y: StateVector, slips_before: ContactVector):
    """Return whether a slip velocity differs from its value before conditions changed, by more than rounding errors."""
    slips = model.slip_velocities(t, y)
    terms = model.slip_magnitudes(t, y)
    floors = slip_floors(model, step, t, y)
    has_jumped = False
    for i in contact_indices:
        size = terms[i] + floors[i] + step.event_location.peaks[i]
        has_jumped = has_jumped or fabs(slips[i] - slips_before[i]) > REVERSED_SHARE * size
    return has_jumped


def follow_inputs(model, t, y: StateVector, modes: ContactVector, deviations: ContactVector) -> StateVector:
    """Return the states after new values of prescribed inputs, which stuck contacts follow.

    Slips up to `deviations` are errors of the continued inputs, or of the importer's solver; impulses remove them.
    """
    slips = model.slip_velocities(t, y)
    held_modes = contact_vector()
    for i in contact_indices:
        is_error = modes[i] * slips[i] <= 0.0 and fabs(slips[i]) <= deviations[i]
        held_modes[i] = STUCK if is_error else FORWARD
    return stop_slips(model, t, y, held_modes)


def resolve_at_start(
    model, step, t, y: StateVector, modes: ContactVector, tie_tolerance, reach
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
    slips = model.slip_velocities(t, y)
    terms = model.slip_magnitudes(t, y)
    roundings = model.slip_roundings(t, y)
    floors = slip_floors(model, step, t, y)
    force, limit, _sizes, _terms = model.contact_forces(t, y, modes)
    status, new_modes, sliding_modes = contact_vector(), contact_vector(), contact_vector()
    for i in contact_indices:
        sliding_modes[i] = sign(slips[i]) if slips[i] != 0.0 else sign(force[i]) if force[i] != 0.0 else FORWARD
        zero_level = ROUNDOFF_MARGIN * roundings[i]
        if modes[i] * slips[i] <= 0.0:
            zero_level += (tie_tolerance if modes[i] == STUCK else reach) * (terms[i] + floors[i])
        status[i], new_modes[i] = SLIPPING, sign(slips[i])
        if modes[i] != STUCK and force[i] == 0.0 and limit[i] == 0.0:
            new_modes[i] = modes[i]
        elif fabs(slips[i]) <= zero_level:
            status[i], new_modes[i] = AT_REST, STUCK
    delta = PREDICTION_SHARE * time_scale(model, step, t, y, sliding_modes)  # stuck loads may have no lever
    return resolve_contacts(model, t, y, modes, new_modes, status, delta, tie_tolerance)


def resolve_contacts(
    model,
    t,
    y: StateVector,
    modes: ContactVector,
    new_modes: ContactVector,
    status: ContactVector,
    delta,
    tie_tolerance,
) -> tuple[StateVector, ContactVector, bool]:
    """Return the states without slip in the contacts at rest, their modes, and whether these are consistent.

    Where levers change, a slip velocity also vanishes at a dead point, where the contact has no lever on anything
    that moves.  An impulse must not stop the motion there.  So the modes are first determined with the velocities
    as they are: the load that would hold the slip at zero exceeds every limit at a dead point, and the contact
    slips on.

    Parameters
    ----------
    t, y
        Time in s; states.
    modes
        Modes before.
    new_modes, status
        Modes in which contacts at rest are stuck, and the status of each contact.
    delta
        Time in s ahead at which slips and loads are predicted.
    tie_tolerance
        See `violations`.
    """
    if model.has_variable_levers:
        slips = model.slip_velocities(t, y)
        _force, limit, _sizes, terms = model.contact_forces(t, y, new_modes)
        moving_modes, _consistent = solve_modes(model, t, y, new_modes, status, delta, tie_tolerance)
        slips_ahead = predict_slips(model, t, y, moving_modes, delta)
        for i in contact_indices:
            if status[i] == AT_REST and moving_modes[i] != STUCK:
                status[i], new_modes[i] = SLIPPING, moving_modes[i]
                if modes[i] * slips[i] > 0.0:
                    new_modes[i] = modes[i]  # it has not quite reached zero
                elif ROUNDOFF_MARGIN * terms[i] > limit[i] and slips_ahead[i] != 0.0:
                    new_modes[i] = sign(slips_ahead[i])  # at a dead point; the load has rounding errors only
    y = stop_slips(model, t, y, new_modes)
    resolved_modes, consistent = solve_modes(model, t, y, new_modes, status, delta, tie_tolerance)
    return y, resolved_modes, consistent


# ---- complementarity problem


def stop_slips(model, t, y: StateVector, modes: ContactVector) -> StateVector:
    """Return the states without slip in the stuck contacts; impulses conserve momentum."""
    for _ in range(MAX_IMPULSES):
        slips = model.slip_velocities(t, y)
        at_rest = True
        for i in contact_indices:
            if modes[i] == STUCK and slips[i] != 0.0:
                at_rest = False
        if model.has_variable_levers and not at_rest:  # products with levers have rounding errors
            roundings = model.slip_roundings(t, y)
            at_rest = True
            for i in contact_indices:
                if modes[i] == STUCK and fabs(slips[i]) > 4.0 * EPSILON * roundings[i]:
                    at_rest = False
        if at_rest:
            break
        y = model.apply_impulses(t, y, modes)
    return y


def solve_modes(
    model, t, y: StateVector, modes: ContactVector, status: ContactVector, delta, tie_tolerance
) -> tuple[ContactVector, bool]:
    """Solve the complementarity problem for the modes of contacts at rest.

    Contacts that would slip against their own friction force are locked first; else those with the highest load
    relative to their limit are released together.  If this does not end, one contact changes at a time, the first
    that violates its conditions.

    If more than one contact was released, perhaps a contact could be held that is not.  For up to MAX_ENUMERATED
    contacts at rest, all combinations of modes are then tried; with more, each released contact is locked again
    where this is consistent.

    Returns
    -------
    tuple
        The modes, and whether they are consistent with the forces.
    """
    pivot_modes, pivot_status = contact_vector(), contact_vector()
    for i in contact_indices:
        pivot_modes[i], pivot_status[i] = modes[i], status[i]
    consistent = False
    for iteration in range(MAX_ITERATIONS):
        violation, next_modes = violations(model, t, y, pivot_modes, pivot_status, delta, tie_tolerance)
        highest = max_of(violation)
        if not highest > 0.0:
            consistent = True
            break
        release_level = TIE_SHARE * highest if iteration < MAX_JOINT_ITERATIONS else 0.0
        has_changed = False
        for i in contact_indices:
            if violation[i] > 0.0 and violation[i] >= release_level and not (has_changed and release_level == 0.0):
                pivot_modes[i], has_changed = next_modes[i], True
                if next_modes[i] == STUCK:
                    pivot_status[i] = RELOCKED
    n_at_rest = n_released = 0
    for i in contact_indices:
        if status[i] != SLIPPING:
            n_at_rest += 1
            if pivot_modes[i] != STUCK:
                n_released += 1
    if consistent and n_released < 2:
        return pivot_modes, True
    if n_at_rest > MAX_ENUMERATED:
        if not consistent:
            return modes, False
        relocked_modes = relock(model, t, y, pivot_modes, status, delta, tie_tolerance)
        return relocked_modes, True
    best_modes, has_solution = most_held(
        model, t, y, modes, status, delta, tie_tolerance, n_at_rest, n_released if consistent else n_at_rest + 1
    )
    if has_solution:
        return best_modes, True
    if consistent:
        return pivot_modes, True
    return modes, False


def predict_slips(model, t, y: StateVector, modes: ContactVector, delta) -> ContactVector:
    """Return the slip velocities a short time ahead, also if the motion only starts."""
    f = model.rates(t, y, modes)
    y2 = y + delta * f
    f2 = model.rates(t + delta, y2, modes)
    y3 = y2 + delta * f2
    return model.slip_velocities(t + 2.0 * delta, y3)


def contact_balance_ahead(
    model, t, y: StateVector, modes: ContactVector, delta
) -> tuple[ContactVector, ContactVector, ContactVector, ContactVector, ContactVector, ContactVector]:
    """Return forces, holding limits and the terms of forces a short time ahead; rates of forces, limits and residuals.

    They decide a tie where the rates at t are zero, or where the load touches the limit.
    """
    f = model.rates(t, y, modes)
    y2 = y + delta * f
    force, limit, _sizes, terms = model.contact_forces(t + delta, y2, modes)
    force_rate, limit_rate, _residual_force, residual_force_rate = model.contact_rates(t + delta, y2, modes)
    return force, limit, terms, force_rate, limit_rate, residual_force_rate


def relock(
    model, t, y: StateVector, modes: ContactVector, status: ContactVector, delta, tie_tolerance
) -> ContactVector:
    """Return consistent modes in which released contacts are locked again, one after another, where this fits."""
    trial_modes = contact_vector()
    for i in contact_indices:
        trial_modes[i] = modes[i]
    for i in contact_indices:
        if status[i] != SLIPPING and modes[i] != STUCK:
            trial_modes[i] = STUCK
            if not are_consistent(model, t, y, trial_modes, status, delta, tie_tolerance):
                trial_modes[i] = modes[i]
    return trial_modes


def most_held(
    model, t, y: StateVector, modes: ContactVector, status: ContactVector, delta, tie_tolerance, n_at_rest, n_released
) -> tuple[ContactVector, bool]:
    """Return the consistent modes that release the fewest contacts at rest, fewer than `n_released`, if any.

    Of several such, those count whose held contacts have the lowest load relative to their limit.
    """
    n_combinations = 1
    for _ in range(n_at_rest):
        n_combinations *= 3
    best_modes, trial_modes = contact_vector(), contact_vector()
    for i in contact_indices:
        best_modes[i] = modes[i]
    lowest = inf
    for n in range(n_released):
        for i in contact_indices:
            trial_modes[i] = modes[i] if status[i] == SLIPPING else STUCK
        for _ in range(n_combinations):
            n_sliding = 0
            for i in contact_indices:
                if status[i] != SLIPPING and trial_modes[i] != STUCK:
                    n_sliding += 1
            if n_sliding == n:
                if are_consistent(model, t, y, trial_modes, status, delta, tie_tolerance):
                    force, limit, _sizes, _terms = model.contact_forces(t, y, trial_modes)
                    highest = 0.0
                    for i in contact_indices:
                        if status[i] != SLIPPING and trial_modes[i] == STUCK:
                            relative_load = fabs(force[i]) / (limit[i] + TINY_FORCE)
                            highest = relative_load if relative_load > highest else highest
                    if highest < lowest:
                        lowest = highest
                        for i in contact_indices:
                            best_modes[i] = trial_modes[i]
            carry = True  # to the next combination
            for i in contact_indices:
                if carry and status[i] != SLIPPING:
                    trial_modes[i] = (
                        FORWARD if trial_modes[i] == STUCK else BACKWARD if trial_modes[i] == FORWARD else STUCK
                    )
                    carry = trial_modes[i] == STUCK
        if lowest < inf:
            return best_modes, True
    return best_modes, False


def are_consistent(model, t, y: StateVector, modes: ContactVector, status: ContactVector, delta, tie_tolerance):
    """Return whether no contact at rest violates the conditions of its mode."""
    violation, _next_modes = violations(model, t, y, modes, status, delta, tie_tolerance)
    return not max_of(violation) > 0.0


def violations(
    model, t, y: StateVector, modes: ContactVector, status: ContactVector, delta, tie_tolerance
) -> tuple[ContactVector, ContactVector]:
    """Return how far each contact at rest violates the conditions of its mode (0: not at all), and its next mode.

    The next derivative decides ties, unless the contact was locked again.  Loads have the rounding errors of their
    terms and, if they decrease, the relative error `tie_tolerance`.  A contact also sticks where its load only touches
    the limit: it does not exceed the limit now, nor a short time ahead, where it does not approach the limit either.
    """
    force, limit, _sizes, terms = model.contact_forces(t, y, modes)
    force_rate, limit_rate, residual_force, residual_force_rate = model.contact_rates(t, y, modes)
    later_force, later_limit, later_terms, later_force_rate, later_limit_rate, later_residual_rate = (
        contact_balance_ahead(model, t, y, modes, delta)
    )
    violation, next_modes = contact_vector(), contact_vector()
    for i in contact_indices:
        violation[i], next_modes[i] = 0.0, STUCK
        slack = ROUNDOFF_MARGIN * terms[i]
        # without a lever, a load is unknown, except for no load at all
        has_lever = not (model.has_variable_levers and ROUNDOFF_MARGIN * terms[i] > limit[i])
        can_hold = limit[i] > 0.0 and has_lever
        later_slack = ROUNDOFF_MARGIN * later_terms[i]
        approach = sign(later_force[i]) * later_force_rate[i] - later_limit_rate[i]
        holds_later = later_limit[i] > 0.0 and fabs(later_force[i]) <= later_limit[i] + later_slack
        holds_later = holds_later and approach * delta <= later_slack
        is_within = fabs(force[i]) < limit[i] + slack or (force[i] == 0.0 and limit[i] == 0.0)
        only_touches = has_lever and is_within and holds_later
        if status[i] != SLIPPING and modes[i] == STUCK:
            next_modes[i] = sign(force[i]) if fabs(force[i]) > slack else sign(force_rate[i])
            outward = next_modes[i] * force_rate[i] - limit_rate[i]
            if outward == 0.0:
                later = next_modes[i] * later_force_rate[i] - later_limit_rate[i]
                outward = later if fabs(later) * delta > slack else 0.0
            if status[i] == AT_LIMIT or (status[i] == AT_REST and outward > 0.0):
                slack = -slack
            elif outward < 0.0:
                slack += tie_tolerance * limit[i]
            if only_touches:
                next_modes[i] = STUCK
            elif not can_hold:
                violation[i] = inf
                if next_modes[i] == STUCK:
                    next_modes[i] = FORWARD
            elif next_modes[i] != STUCK and fabs(force[i]) > limit[i] + slack:
                violation[i] = fabs(force[i]) / limit[i]
        elif status[i] != SLIPPING:
            ahead = modes[i] * residual_force[i]
            if not can_hold:
                if ahead < -slack:
                    violation[i], next_modes[i] = inf, -modes[i]
            else:
                ahead_rate = modes[i] * residual_force_rate[i]
                if ahead_rate == 0.0:
                    later = modes[i] * later_residual_rate[i]
                    ahead_rate = later if fabs(later) * delta > slack else 0.0
                if ahead < -slack or (ahead <= slack and ahead_rate <= 0.0):
                    violation[i] = inf
    return violation, next_modes
