"""Step-size control: computes one internal step, ends it at an event and interpolates inside it.

A step from t0 to t1 is one of: standstill up to the break-away; closed form up to the next standstill; a step of an
integration method that meets the tolerance.  The step size is controlled as in MATLAB's ode23 and ode45
(L. F. Shampine, M. W. Reichelt, The MATLAB ODE Suite, SIAM J. Sci. Comput. 18 (1997) 1-22).
"""

from math import inf

from . import conditions, contact_lcp, event_location, phase_repetition, step_limits, stick_slip, time_scale
from .active_method import ActiveMethod
from .codes import DIVERGED, EPSILON, EXACT, NEEDS_REPETITION, NO_CONSISTENT_MODES, OK, ROUNDOFF_MARGIN, STALLED, STUCK
from .event_location import INTERPOLANT_SHARE, NEAR_ZERO_SHARE, EventLocation
from .interpolant import Interpolant, largest_of
from .vectors import (
    ContactVector,
    RateVector,
    StateVector,
    all_of,
    any_of,
    complete_rates,
    contact_indices,
    contact_vector,
    dynamic_part,
    elementwise_max,
    error_size,
    kinematic_rates,
    magnitude,
    max_of,
    min_of,
    select_kinematic,
    slip_index,
    sum_of,
)

OVERFLOW_LIMIT = 1e100  # larger states are treated as divergence: squares, as in an energy, would overflow
MAX_TRIES = 60  # attempts for one step; each one halves the step size
MAX_REPEATED_STEPS = 1_000_000  # steps of a motion that is repeated

ROUGH_ERROR, ROUGH_CHANGE = 0.5, 10.0  # relative error and change of states in a proposal that is roughly right
MAX_STALLED_STEPS = 100  # consecutive steps that hardly advance the time
SHORTEST_STEP = 16.0 * EPSILON  # share of the time since the start; the solver stalls at shorter ones
# Rounding error of a rate, relative to the sum of its absolute terms, below which no step is rejected.  A product and a
# sum round by half EPSILON each, as does each operand.  With 128 EPSILON, dop853 was allowed errors of 4e-10 in pacejka
# at any tolerance below 1e-12.
RATE_ROUNDING = 2.0 * EPSILON
INTERPOLATION_ERROR = 10.0  # of a state at an event, relative to the solver tolerance
TIE_FACTOR = 30.0  # tolerance for ties between stick and slip, relative to the solver tolerance


class StepCounters:
    """Counters at the start of the step, and the scale floor there if a proposal or an estimate has raised it since.

    `h_next` is the step size to try there, `h_last` the size of the previous step, `n_stalled` the number of
    consecutive steps that hardly advanced the time, `t_event` the time of the last change of mode (or of the start).
    """

    error_scale_floor: StateVector

    def __init__(self):
        self.n_accepted = self.n_rejected = self.n_rhs = self.n_events = self.n_stalled = 0
        self.error_scale_floor = 0.0
        self.has_raised_floor = False
        self.h_next = self.h_last = self.t_event = 0.0


class RoundoffCompensation:
    """Rounding errors of the times t0, t1 and, in closed forms, of the positions x0, x1 of a step.

    They are carried along, so that they do not accumulate over steps and events: the step starts at t0 + roundoff.t0.
    """

    def __init__(self):
        self.t0 = self.x0 = self.t1 = self.x1 = 0.0

    def carry(self):
        """Move the errors at the end of the last step to the start of the next one."""
        self.t0 = self.t1
        self.x0 = self.x1
        self.t1 = 0.0

    def end_time(self, t0, h):
        """Return the time h seconds after the start t0 of a step; note its rounding error."""
        elapsed = h + self.t0
        t1 = t0 + elapsed
        t_step = t1 - t0
        self.t1 = (t0 - (t1 - t_step)) + (elapsed - t_step)
        return t1

    def event_time(self, t0, h):
        """Return the end time of a step that ends at an event: two events never have the same time."""
        t1 = self.end_time(t0, h)
        if t1 <= t0 and h > 0.0:
            t1 = t0 * (1.0 + EPSILON)
            self.t1 = h + self.t0 - (t1 - t0)
        return t1


class InternalStep:
    """Current internal step, with counters up to both ends.

    A model of one body has 29 attributes here.  CPython 3.11 stores fewer than thirty inline; one more, and a step of
    ode23 in stickslip took 4.4 us instead of 3.8 (November 2026).
    """

    y0: StateVector
    f0: RateVector
    y1: StateVector
    f1: RateVector
    modes0: ContactVector
    modes1: ContactVector

    def __init__(self, model):
        self.active_method = ActiveMethod(model)
        if model.has_dry_friction or model.has_conditions:
            self.event_location = EventLocation(model.n_event_functions)
        # run: relative tolerance, largest step; stop time (inf if unknown)
        self.tolerance = self.h_max = 0.0
        self.t_end = inf
        self.is_hybrid = False  # law of friction with stick and slip; a constant where the FMU offers no choice
        # step: start, end, modes inside and after it
        self.t0 = self.y0 = self.f0 = 0.0
        self.t1 = self.y1 = self.f1 = 0.0
        self.modes0 = self.modes1 = STUCK
        # nothing moves; a mode changes at t1; a velocity only touches zero at t1 and the slip continues
        self.is_stuck = self.event_at_end = self.grazes_at_end = False
        self.has_consistent_modes = True  # False if no modes satisfy the force balance at t1
        # step size before an event shortened the step; interpolant
        self.h_full = 0.0
        self.interpolant = Interpolant()
        self.largest_slip = 0.0  # bound on the slip velocity of a single contact since the last event
        # counters up to t1 and the step size to try next; the same at t0
        self.n_accepted = self.n_rejected = self.n_rhs = 0
        self.h_next = 0.0
        self.start_counters = StepCounters()
        self.roundoff = RoundoffCompensation()

    def begin_run(self, model, y: StateVector):
        """Start a run with an empty step at 0 s."""
        counters = self.start_counters
        self.n_accepted = self.n_rejected = self.n_rhs = counters.n_events = counters.n_stalled = 0
        self.h_next = counters.h_last = 0.0
        counters.t_event = 0.0
        counters.has_raised_floor = self.event_at_end = False
        self.modes0 = STUCK
        if model.has_other_laws and not self.is_hybrid:
            self.y1 = y
            self.modes0 = model.law_modes(0.0, self.y1)
        self.start_empty_step(model, 0.0, y, self.modes0, ROUNDOFF_MARGIN)

    def start_empty_step(self, model, t, y: StateVector, modes: ContactVector, tie_tolerance):
        """Start an empty step at t, given the previous modes; choose a step size unless nothing moves."""
        self.roundoff.t1 = self.roundoff.x1 = 0.0
        self.t1, self.y1 = t, y
        size = error_size(self.y1)
        self.active_method.raise_scale_floor(model, size)
        if model.has_conditions:
            conditions.initialize(model, self.event_location, t, self.y1, modes)
        if model.has_dry_friction:
            self.update_end_modes(model, modes, tie_tolerance)
        if model.has_conditions:
            conditions.check_limits(model, self.event_location, t, self.y1, self.modes1)
        self.update_end_rates(model)
        if not (model.rests_when_stuck and self.is_hybrid and all_of(self.modes1 == STUCK)):
            if self.h_next == 0.0 and self.active_method.method_number != EXACT:
                self.h_next, size = time_scale.initial_step(model, self, t, self.y1, self.f1, self.modes1)
                self.save_scale_floor()
                self.active_method.raise_scale_floor(model, size)
        self.t0 = t
        self.save_counters()
        if model.has_dry_friction or model.has_conditions:
            phase_repetition.begin_phase(model, self)

    def save_counters(self):
        """Save the counters at t1, where the next step starts."""
        counters = self.start_counters
        counters.n_accepted = self.n_accepted
        counters.n_rejected = self.n_rejected
        counters.n_rhs = self.n_rhs
        counters.h_next = self.h_next

    def restore_counters(self):
        """Restore the counters at t0 and discard those of the step."""
        counters = self.start_counters
        self.n_accepted, self.n_rejected = counters.n_accepted, counters.n_rejected
        self.n_rhs, self.h_next = counters.n_rhs, counters.h_next

    def save_scale_floor(self):
        """Save the scale floor before an estimate raises it, to restore it after the step."""
        if not self.start_counters.has_raised_floor:
            self.start_counters.error_scale_floor = self.active_method.error_scale_floor
            self.start_counters.has_raised_floor = True

    def compute_next(self, model):
        """Compute the internal step that starts at t1, repeating it where that is needed.  Returns a status."""
        if model.has_dry_friction or model.has_conditions:
            self.event_location.n_halvings = 0
        status = self.try_next(model)
        if (model.has_dry_friction or model.has_conditions) and status == NEEDS_REPETITION:
            status = self.repeat_steps(model)
        return status

    def try_next(self, model):
        """Compute the internal step that starts at t1.  Returns a status, or NEEDS_REPETITION."""
        if model.has_conditions:
            # names the contact if its sliding force exceeds what it holds
            status = conditions.violation_status(model, self.event_location)
            if status != OK:
                return status
            conditions.begin_step(model, self.event_location)
        if model.has_dry_friction and not self.has_consistent_modes:
            return NO_CONSISTENT_MODES
        if model.has_dry_friction and self.event_at_end:
            self.count_event()
            self.event_at_end = False
        counters = self.start_counters
        if self.t1 > self.t0:
            counters.h_last = self.t1 - self.t0
        self.save_counters()
        self.t0, self.y0 = self.t1, self.y1
        self.f0, self.modes0 = self.f1, self.modes1
        self.is_stuck = self.interpolant.ready = False
        if model.rests_when_stuck and self.is_hybrid and (all_of(self.modes0 == STUCK) or self.grazes_at_end):
            status = self.advance_stuck(model)
        elif model.is_linear and self.active_method.method_number == EXACT:
            status = self.advance_linear_segment(model)
        else:
            status = self.advance_with_method(model)
        self.n_accepted += 1
        if counters.has_raised_floor and status != NEEDS_REPETITION:
            counters.has_raised_floor, self.active_method.error_scale_floor = False, counters.error_scale_floor
        if model.has_other_laws and not self.is_hybrid and status == OK:
            self.update_law_modes(model)
        if model.has_conditions:
            conditions.select_sides(model, self.event_location, False)
        if self.t1 - self.t0 > SHORTEST_STEP * self.t0:
            counters.n_stalled = 0
        else:
            counters.n_stalled += 1
            if counters.n_stalled > MAX_STALLED_STEPS:
                return STALLED
        return status

    def repeat_steps(self, model):
        """Repeat the step in parts, or the motion since the last event, up to the time reached before."""
        location = self.event_location
        t_reported, status, repeats = self.t0, OK, False
        for _ in range(MAX_REPEATED_STEPS):
            if location.must_shorten:
                step_limits.shorten_step(self)
            else:
                location.n_halvings = 0
                if location.must_repeat:
                    phase_repetition.repeat_phase(self)
                    repeats = True
                elif not repeats or self.t1 > t_reported:
                    break
            status = self.try_next(model)
            if status != OK and status != NEEDS_REPETITION:
                break
        return status

    def update_law_modes(self, model):
        """Update the modes at t1 under a law without stick and slip, where a step ends without regard to them."""
        self.modes1 = model.law_modes(self.t1, self.y1)
        if any_of(self.modes1 != self.modes0):
            self.event_at_end = True
            if model.has_conditions:
                phase_repetition.begin_phase(model, self)

    def count_event(self):
        """Count the change of mode at t1."""
        self.start_counters.n_events += 1
        self.start_counters.t_event = self.t1

    def advance_stuck(self, model):
        """Stay at rest until a load exceeds the holding limit."""
        self.roundoff.carry()
        self.is_stuck, self.grazes_at_end = True, False
        self.y1 = self.y0
        for i in contact_indices:
            self.y1[slip_index[i]] = 0.0
        ends, directions = contact_vector(), contact_vector()
        for i in contact_indices:
            ends[i], directions[i] = stick_slip.breakaway_time(model, self.t0, self.y1, i)
        end = min_of(ends)
        if end <= self.t_end and end < inf:
            self.t1 = end
            for i in contact_indices:
                self.modes1[i] = directions[i]
            self.restart_after_event(model)
        else:
            self.t1, self.f1 = self.t_end, 0.0
        return OK

    def advance_linear_segment(self, model):
        """Follow the closed form up to the next standstill, the end of the run, or the horizon."""
        exact = self.active_method.exact
        roundoff = self.roundoff
        roundoff.carry()
        exact.start_segment(self.y0, self.f0, model.applied_acceleration(self.t0, self.modes0), roundoff.x0)
        if model.has_dry_friction:
            duration = exact.next_standstill(self.modes0)  # may shorten the horizon
        self.t1 = self.t_end if self.t_end - self.t0 <= exact.horizon else self.t0 + exact.horizon
        if model.has_dry_friction:
            end = self.t0 + (duration + roundoff.t0)
            if end <= self.t1 and end < inf:
                self.t1 = roundoff.event_time(self.t0, duration)
                self.y1, roundoff.x1 = exact.state_at_standstill(duration)
                return self.end_at_event(model)
        if self.t1 < inf:
            roundoff.x1 = 0.0
            self.y1 = exact.evaluate(self.t1 - self.t0 - roundoff.t0)
            self.f1 = model.rates(self.t1, self.y1, self.modes1)
            if not sum_of(magnitude(self.y1)) < OVERFLOW_LIMIT:
                return DIVERGED
        return OK

    def advance_with_method(self, model):
        """Compute a step of the method that meets the tolerance; end it at a change of mode."""
        t, y, f, modes = self.t0, self.y0, self.f0, self.modes0
        if model.has_other_laws and not self.is_hybrid:
            modes = STUCK * modes
        tolerance = self.tolerance
        h_min = SHORTEST_STEP * t
        roundoff = self.roundoff
        roundoff.t0 = roundoff.t1
        h_new = self.h_next if self.h_next < self.h_max else self.h_max
        if model.has_nominal_velocity and self.is_hybrid:
            y1 = y + h_new * f
            h_new *= step_limits.narrow_feature_share(model, self, h_new, y1, f)
        if model.has_conditions or (model.is_coupled and any_of(modes == STUCK)):
            h_new = step_limits.limit_by_clocks(model, self, h_new)
        if h_new < h_min:
            h_new = h_min
        remaining = self.t_end - t - roundoff.t0
        last = 1.1 * h_new >= remaining
        h = remaining if last else h_new
        scale = error_size(y)
        method = self.active_method
        method.raise_scale_floor(model, scale)
        scale = elementwise_max(method.error_scale_floor, scale)
        attempts = 0
        while True:
            y1, f1, e = method.propose(model, self, modes, t, y, f, h)
            self.n_rhs += method.stages
            size1 = error_size(y1)
            size2 = elementwise_max(size1, scale)
            d = magnitude(e)
            e = d / size2
            error = h * max_of(e) / tolerance
            if error > 1.0 and method.floor_share > 0.0:
                # It may be a rounding error of the rates: of velocities, and of positions by these.
                terms = model.rate_magnitudes(t + h, y, modes)  # y1 may be unstable
                rounding = dynamic_part(RATE_ROUNDING * h / tolerance * terms)
                least = select_kinematic(h * kinematic_rates(rounding), rounding)
                e = d / elementwise_max(size2, least)
                error = h * max_of(e) / tolerance
            share = 1.0
            if error <= 1.0 and sum_of(size1, e) < OVERFLOW_LIMIT:  # False for NaN
                if model.has_nominal_velocity and self.is_hybrid:
                    share = step_limits.narrow_feature_share(model, self, h, y1, f1)
                if not (model.has_dry_friction and model.has_nominal_velocity) or share == 1.0 or h <= h_min:
                    break
            self.n_rejected += 1
            if attempts == 0:
                self.save_scale_floor()
            attempts += 1
            if error * tolerance < ROUGH_ERROR:
                # The proposal shows how large states become that are zero so far, and whose error is always large
                # relative to what they reach.  A rate that is large relative to that shows an unstable proposal.
                # So does a change that the rates at neither end explain.
                rate0, rate1 = magnitude(f), magnitude(f1)
                change = y1 - y
                change = magnitude(change)
                most = elementwise_max(rate0, rate1)
                excess = change - ROUGH_CHANGE * h * most
                d = rate1 / size2
                if h * max_of(d) < ROUGH_CHANGE and max_of(excess) <= 0.0:
                    method.error_scale_floor = self.start_counters.error_scale_floor
                    method.raise_scale_floor(model, size1)
                    scale = elementwise_max(method.error_scale_floor, scale)
            if h <= h_min or attempts == MAX_TRIES:
                return STALLED if error < inf and sum_of(size1) < OVERFLOW_LIMIT else DIVERGED
            shrink = method.safety * error**-method.power if 1.0 < error < inf and attempts == 1 else 0.5
            shrink_limit = method.shrink if attempts == 1 else 0.5
            h_new = h * (shrink if shrink > shrink_limit else shrink_limit)
            if model.has_dry_friction and model.has_nominal_velocity and share < 1.0:
                h_new = h * share
            if h_new < h_min:
                h_new = h_min
            h = h_new
            last = False
        if attempts == 0:
            grow = method.safety * error**-method.power if error > 1e-9 else method.grow
            h_new = h * (grow if grow < method.grow else method.grow)
        else:
            h_new = h * method.shrink_after_rejection
        self.h_next = h_new
        self.h_full = h
        if last:
            self.t1, roundoff.t1 = self.t_end, 0.0
        else:
            self.t1 = roundoff.end_time(t, h)
        self.y1, self.f1 = y1, f1
        if model.has_dry_friction and not model.is_coupled and not model.has_conditions:
            # Most steps end here.  The Bernstein coefficients of the cubic Hermite polynomial of the slip velocity are
            # compared with their sum, which bounds the largest.  Without calls: these take a tenth of a step of ode23.
            for i in contact_indices:
                start, end, third = modes[i] * y[slip_index[i]], modes[i] * y1[slip_index[i]], modes[i] * h / 3.0
                early, late = start + third * f[slip_index[i]], end - third * f1[slip_index[i]]
                total = start + early + late + end
                if total > self.largest_slip:
                    self.largest_slip = total
                low = early if early < late else late
                low = low if low < end else end
                continues = low >= INTERPOLANT_SHARE * total and low >= NEAR_ZERO_SHARE * self.largest_slip
                if continues or not self.is_hybrid:
                    return OK
                location = self.event_location
                location.start[i], location.early[i], location.late[i], location.end[i] = start, early, late, end
                if self.largest_slip < inf:
                    location.peaks[i] = self.largest_slip
                else:
                    location.peaks[i] = largest_of(total, start, end, location.peaks[i])
        if self.is_hybrid or model.has_conditions:
            if model.is_coupled or model.has_conditions:
                event_location.evaluate_on_cubic(model, self)
                step_limits.limit_step(model, self)
                if self.event_location.must_shorten:
                    return NEEDS_REPETITION
            end = event_location.locate_events(model, self)
            if self.interpolant.ready:  # the event search built the interpolant
                self.n_rhs += self.active_method.extra
            phase_repetition.decide_repetition(self)
            if self.event_location.must_repeat:
                return NEEDS_REPETITION
            if end <= h:
                if model.is_coupled and self.is_hybrid:
                    is_unresolved = step_limits.is_slip_unresolved(model, self, end)
                    if is_unresolved:
                        self.event_location.must_shorten = True
                        return NEEDS_REPETITION
                if model.checks_event_steps and not self.is_accurate_at(model, end):
                    self.event_location.must_shorten = True
                    return NEEDS_REPETITION
                return self.end_at(model, end)
            if model.is_coupled and self.is_hybrid:
                self.y1 = contact_lcp.stop_slips(model, self.t1, self.y1, modes)
                self.f1 = complete_rates(self.y1, self.f1)
            if model.has_conditions:
                for j in range(model.n_switches):
                    conditions.note_distance(self.event_location, j, self.event_location.end[model.first_condition + j])
            phase_repetition.end_phase_in_doubt(model, self)
        return OK

    def is_accurate_at(self, model, h):
        """Return whether a step to an event after h seconds agrees with the interpolated state there.

        Friction that varies within a small range of slip velocities, or a condition that changes, may lie between the
        stages of a long step, whose error estimate does not see it.  A step that ends at the event does.
        """
        if self.event_location.n_halvings == step_limits.MAX_HALVINGS:
            return True
        method = self.active_method
        y_end = self.state_after(model, h)
        modes = self.modes0
        if model.has_other_laws and not self.is_hybrid:
            modes = STUCK * modes
        y2, _f2, e = method.propose(model, self, modes, self.t0, self.y0, self.f0, h)
        self.n_rhs += method.stages
        scale = error_size(self.y0)
        scale = elementwise_max(method.error_scale_floor, scale)
        size2 = error_size(y2)
        scale = elementwise_max(size2, scale)
        e = magnitude(e) / scale
        difference = y2 - y_end
        difference = magnitude(difference) / scale
        self.h_full = h
        return h * max_of(e) <= self.tolerance and max_of(difference) <= INTERPOLATION_ERROR * self.tolerance

    def end_at(self, model, h):
        """End the step at an event, h seconds after its start."""
        if model.has_conditions:
            y2 = self.state_after(model, 0.5 * h)
            conditions.update_margins(model, self.event_location, self.t0 + 0.5 * h, y2, self.modes0)
            for j in range(model.n_switches):
                conditions.note_distance(self.event_location, j, self.event_location.margins[j])
        self.y1 = self.state_after(model, h)
        self.t1 = end = self.roundoff.event_time(self.t0, h)
        if model.has_slip_conditions:
            if self.is_hybrid:
                self.y1 = contact_lcp.stop_slips(model, end, self.y1, self.modes0)
            slips = model.slip_velocities(end, self.y1)
        if model.has_conditions:
            conditions.update_at_event(model, self.event_location, end, self.y1, self.modes0)
            if conditions.have_changed(model, self.event_location):
                is_brief = self.is_brief(model, end)
                status = conditions.count_changes(self.event_location, end, is_brief)
                if status != OK:
                    return status
        if self.is_hybrid:
            location = self.event_location
            ends = contact_vector()
            for i in contact_indices:
                other = location.times[len(self.modes0) + i]
                ends[i] = location.times[i] if location.times[i] < other else other
            if model.has_slip_conditions and contact_lcp.have_jumped(model, self, end, self.y1, slips):
                self.y1, self.modes1, self.has_consistent_modes = contact_lcp.resolve_at_start(
                    model, self, end, self.y1, self.modes0, ROUNDOFF_MARGIN, self.tie_tolerance(model)
                )
            elif model.is_coupled:
                self.y1, self.modes1, self.has_consistent_modes = contact_lcp.resolve_after_event(
                    model, self, h, ends, self.tie_tolerance(model)
                )
            else:
                for i in contact_indices:
                    if ends[i] <= h:
                        self.y1[slip_index[i]] = 0.0
        return self.end_at_event(model)

    def is_brief(self, model, t):
        """Return whether conditions change at t without a motion away from their edge since the last change.

        Rounding errors decide changes that follow each other faster than they are located in a step.
        """
        dwell = t - self.event_location.t_condition
        stayed = conditions.stayed_at_edge(model, self.event_location, self.tolerance)
        if stayed:
            rate = time_scale.smooth_rate(model, self.t0, self.y0, self.f0, self.modes0)
            stayed = dwell * rate < conditions.BRIEF_SHARE
        return stayed or dwell <= conditions.RESOLUTION * self.h_full

    def end_at_event(self, model):
        """Resolve the event at t1: a slip velocity is zero, or a load has reached its limit."""
        if model.has_dry_friction and not model.is_coupled:
            self.update_end_modes(model, self.modes0, self.tie_tolerance(model))
        self.restart_after_event(model)
        return OK if sum_of(magnitude(self.y1)) < OVERFLOW_LIMIT else DIVERGED

    def tie_tolerance(self, model):
        """Return the relative tolerance for deciding ties between stick and slip."""
        return (
            ROUNDOFF_MARGIN
            if model.is_linear and self.active_method.method_number == EXACT
            else TIE_FACTOR * self.tolerance
        )

    def update_end_modes(self, model, modes: ContactVector, tie_tolerance):
        """Determine the modes after t1, given the previous modes."""
        self.modes1, self.grazes_at_end, self.has_consistent_modes = STUCK, False, True
        if model.has_other_laws and not self.is_hybrid:
            self.modes1 = modes  # they change at the ends of steps: see update_law_modes
        if self.is_hybrid:
            if model.is_coupled:
                self.y1, self.modes1, self.has_consistent_modes = contact_lcp.resolve_at_start(
                    model, self, self.t1, self.y1, modes, tie_tolerance, tie_tolerance
                )
            else:
                for i in contact_indices:
                    self.modes1[i] = stick_slip.resolve_mode(model, self.t1, self.y1, tie_tolerance, i)
                    if self.y1[slip_index[i]] == 0.0 and self.modes1[i] != modes[i] != STUCK:
                        if stick_slip.is_grazing(model, self.event_location, self.t1, self.y1, modes, tie_tolerance, i):
                            self.modes1[i], self.grazes_at_end = modes[i], True

    def update_end_rates(self, model):
        """Evaluate the rates at t1 in the new modes."""
        if model.rests_when_stuck and self.is_hybrid and all_of(self.modes1 == STUCK):
            self.f1 = 0.0
        else:
            modes = self.modes1
            if model.has_other_laws and not self.is_hybrid:
                modes = STUCK * modes
            self.f1 = model.rates(self.t1, self.y1, modes)
            self.n_rhs += 1
            if model.has_dry_friction and not model.is_coupled:
                for i in contact_indices:
                    is_at_rest = self.is_hybrid and self.y1[slip_index[i]] == 0.0
                    if is_at_rest and self.modes1[i] * self.f1[slip_index[i]] < 0.0:
                        self.has_consistent_modes = self.grazes_at_end or stick_slip.is_consistent(
                            model, self.t1, self.y1, self.modes1, i
                        )
                        self.f1[slip_index[i]] = 0.0  # rounding at a break-away: no body starts against its mode

    def restart_after_event(self, model):
        """Restart after an event; the step size of the last slip phase is kept, if there was one."""
        self.event_at_end = any_of(self.modes1 != self.modes0)  # no event if the velocity only touches zero
        if model.has_conditions:
            conditions.check_limits(model, self.event_location, self.t1, self.y1, self.modes1)
        self.update_end_rates(model)
        if model.rests_when_stuck and self.is_stuck:
            for i in contact_indices:
                if self.modes1[i] != STUCK:
                    a = model.breakaway_acceleration(self.t1, self.y1, self.modes1, i)
                    # rounding, as in update_end_rates(): the slip would end at once, again and again
                    self.f1[slip_index[i]] = a if self.modes1[i] * a > 0.0 else 0.0
        if self.h_next == 0.0 and self.active_method.method_number != EXACT:
            self.h_next, _size = time_scale.initial_step(model, self, self.t1, self.y1, self.f1, self.modes1)
        if model.has_dry_friction or model.has_conditions:
            phase_repetition.begin_phase(model, self)

    def state_at(self, model, t) -> StateVector:
        """Interpolate the state at t inside the step."""
        interpolant = self.interpolant
        if not interpolant.ready:
            if model.rests_when_stuck and self.is_stuck:
                return self.y1
            if model.is_linear and self.active_method.method_number == EXACT:
                return self.active_method.exact.evaluate(t - self.t0 - self.roundoff.t0)
            self.active_method.build_interpolant(model, self)
        return interpolant.evaluate(t - self.t0 - self.roundoff.t0)

    def state_after(self, model, elapsed) -> StateVector:
        """Interpolate the state `elapsed` seconds after the start of a step of a method."""
        if not self.interpolant.ready:
            self.active_method.build_interpolant(model, self)
        return self.interpolant.evaluate(elapsed)
