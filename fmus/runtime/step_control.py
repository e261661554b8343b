"""One internal step: propose, judge, accept; end it at an event; interpolate inside it.

The step goes from t0 to t1.  It is a stick, up to the break-away; or a closed form, up to the next standstill; or a
step of a method that meets the tolerance.  Its size is controlled as the public descriptions of MATLAB's ode23 and
ode45 give it (L. F. Shampine, M. W. Reichelt, The MATLAB ODE Suite, SIAM J. Sci. Comput. 18 (1997) 1-22).
"""

from math import inf

from .active_method import ActiveMethod
from .codes import DIVERGED, EXACT, OK, STALLED, STUCK
from .interpolant import Interpolant
from .linear_closed_form import HIGHER_ORDER_INPUT
from .power_series import PowerSeries
from .rounding import EPSILON, ROUNDOFF_MARGIN
from .stick_slip import NO_CONSISTENT_MODES
from .vectors import (
    ContactVector,
    StateVector,
    all_of,
    any_of,
    contact_indices,
    contact_vector,
    elementwise_max,
    kinematic_rates,
    magnitude,
    max_of,
    min_of,
    select_kinematic,
    slip_index,
    sum_of,
)

OVERFLOW_LIMIT = 1e100  # beyond it squares, as of an energy, would overflow
MAX_TRIES = 200  # of one step, which halves each time
MAX_STALLED_STEPS = 100  # steps in a row that hardly move the time
TIE_FACTOR = 30.0  # how far a method may be from a tie, over its tolerance


class StepCounters:
    """The beginning of the step: counts up to there, the step size to try there, the length of the step before, how
    many steps before it hardly moved the time, and when the mode last changed (without a change, the start)."""

    def __init__(self):
        self.n_accepted = self.n_rejected = self.n_rhs = self.n_events = self.n_stalled = 0
        self.h_next = self.h_last = self.t_event = 0.0


class RoundoffCompensation:
    """What the times t0, t1 and the positions x0, x1 of a step lack.

    Closed forms carry it on, so that the rounding of one event does not add to that of the others.
    """

    def __init__(self):
        self.t0 = self.x0 = self.t1 = self.x1 = 0.0

    def carry(self):
        """The step begins where the last one ended."""
        self.t0, self.x0 = self.t1, self.x1
        self.t1 = 0.0


class InternalStep:
    """The internal step in force, and the counts up to both its ends.

    CPython 3.11 has the attributes of an object at hand while they are fewer than thirty; with more, a step of ode23
    takes a tenth longer.
    """

    error_scale_floor: StateVector

    def __init__(self):
        self.active_method = ActiveMethod()
        # the run: tolerances in force, largest step, stop time (inf where unknown), whether zero speed is a mode
        self.tolerance = self.h_max = self.error_scale_floor = 0.0
        self.t_end = inf
        self.is_hybrid = False
        # the step: its beginning, its end, the modes within and the modes after
        self.t0 = self.y0 = self.f0 = 0.0
        self.t1 = self.y1 = self.f1 = 0.0
        self.modes0 = self.modes1 = STUCK
        # all stands still; a mode changes at its end; a speed only touches zero there, and the slide goes on
        self.is_stuck = self.event_at_end = self.grazes_at_end = False
        self.has_consistent_modes = True  # whether there are modes that agree with the forces
        # the length of the step before an event cut it, and what holds within
        self.h_full = 0.0
        self.interpolant = Interpolant()
        self.load_series = PowerSeries()  # of a load, where inputs bend
        # counts up to t1, and the size to try next; the same at t0
        self.n_accepted = self.n_rejected = self.n_rhs = 0
        self.h_next = 0.0
        self.start_counters = StepCounters()
        self.roundoff = RoundoffCompensation()

    def begin_run(self, model, t, y: StateVector):
        """The empty step at the start of a run."""
        start_counters = self.start_counters
        self.n_accepted = self.n_rejected = self.n_rhs = start_counters.n_events = start_counters.n_stalled = 0
        self.h_next = start_counters.h_last = 0.0
        start_counters.t_event = t
        self.event_at_end = False
        self.modes0 = STUCK
        self.start_empty_step(model, t, y, self.modes0, ROUNDOFF_MARGIN)

    def start_empty_step(self, model, t, y: StateVector, modes: ContactVector, tie_tolerance):
        """The empty step at t, after these modes: both its ends are there, and a step size is at hand unless all stands
        still."""
        if model.is_linear:
            roundoff = self.roundoff
            roundoff.t1 = roundoff.x1 = 0.0
        self.t1, self.y1 = t, y
        if model.has_dry_friction:
            self.update_end_modes(model, modes, tie_tolerance)
        self.update_end_rates(model)
        if not (model.rests_when_stuck and self.is_hybrid and all_of(self.modes1 == STUCK)):
            if self.h_next == 0.0 and self.active_method.method_number != EXACT:
                self.h_next = self.initial_step_size()
        self.t0 = t
        self.save_counters()

    def save_counters(self):
        """What holds at t1, where the next step begins."""
        start_counters = self.start_counters
        start_counters.n_accepted, start_counters.n_rejected = self.n_accepted, self.n_rejected
        start_counters.n_rhs, start_counters.h_next = self.n_rhs, self.h_next

    def restore_counters(self):
        """Forget what the step that began at t0 has counted."""
        start_counters = self.start_counters
        self.n_accepted, self.n_rejected = start_counters.n_accepted, start_counters.n_rejected
        self.n_rhs, self.h_next = start_counters.n_rhs, start_counters.h_next

    def compute_next(self, model):
        """The internal step from t1 on; OK or the reason why not."""
        if model.has_dry_friction and not self.has_consistent_modes:
            return NO_CONSISTENT_MODES
        if model.has_dry_friction and self.event_at_end:
            self.count_event()
            self.event_at_end = False
        start_counters = self.start_counters
        if self.t1 > self.t0:
            start_counters.h_last = self.t1 - self.t0
        self.save_counters()
        self.t0, self.y0 = self.t1, self.y1
        self.f0, self.modes0 = self.f1, self.modes1
        self.is_stuck = self.interpolant.ready = False
        if model.rests_when_stuck and self.is_hybrid and (all_of(self.modes0 == STUCK) or self.grazes_at_end):
            status = self.advance_stuck(model)
        elif model.is_linear and self.active_method.method_number == EXACT:
            if model.has_input_derivatives and self.active_method.exact.regime == HIGHER_ORDER_INPUT:
                status = self.advance_power_series(model)
            else:
                status = self.advance_linear_segment(model)
        else:
            status = self.advance_with_method(model)
        self.n_accepted += 1
        t = self.t0
        if self.t1 - t > 16.0 * EPSILON * (t if t > 0.0 else -t):
            start_counters.n_stalled = 0
        else:
            start_counters.n_stalled += 1
            if start_counters.n_stalled > MAX_STALLED_STEPS:
                return STALLED
        return status

    def count_event(self):
        self.start_counters.n_events += 1
        self.start_counters.t_event = self.t1

    def advance_stuck(self, model):
        """Stand still until a load exceeds what friction holds."""
        if model.is_linear:
            self.roundoff.carry()
        self.is_stuck, self.grazes_at_end = True, False
        self.y1 = self.y0
        for i in contact_indices:
            self.y1[slip_index[i]] = 0.0
        ends, ways = contact_vector(), contact_vector()
        for i in contact_indices:
            ends[i], ways[i] = model.breakaway_time(self.t0, self.y1, i)
        end = min_of(ends)
        if end <= self.t_end and end < inf:
            self.t1 = end
            for i in contact_indices:
                self.modes1[i] = ways[i]
            self.restart_after_event(model)
            for i in contact_indices:
                if self.modes1[i] != STUCK:
                    self.f1[slip_index[i]] = model.breakaway_acceleration(end, self.y1, self.modes1, i)
        else:
            self.t1, self.f1 = self.t_end, 0.0
        return OK

    def advance_linear_segment(self, model):
        """One closed form, up to the next standstill or to the end of the run."""
        exact = self.active_method.exact
        roundoff = self.roundoff
        roundoff.carry()
        exact.start_segment(self.y0, self.f0, model.applied_acceleration(self.t0, self.modes0), roundoff.x0)
        self.t1 = self.t_end
        if model.has_dry_friction:
            ahead = exact.next_standstill(self.modes0)
            elapsed = ahead + roundoff.t0
            end = self.t0 + elapsed
            if end <= self.t_end and end < inf:
                moved = end - self.t0
                roundoff.t1 = (self.t0 - (end - moved)) + (elapsed - moved)
                self.t1 = end
                self.y1, roundoff.x1 = exact.state_at_standstill(ahead)
                return self.end_at_event(model)
        if self.t1 < inf:
            roundoff.x1 = 0.0
            self.y1 = exact.evaluate(self.t1 - self.t0 - roundoff.t0)
            self.f1 = model.rates(self.t1, self.y1, self.modes1)
            if not sum_of(magnitude(self.y1)) < OVERFLOW_LIMIT:
                return DIVERGED
        return OK

    def advance_power_series(self, model):
        """A stretch of a motion under a force that bends, up to the next standstill."""
        exact = self.active_method.exact
        pace = exact.z + exact.w
        span = self.h_max if self.h_max * pace < 1.0 else 1.0 / pace
        left = self.t_end - self.t0
        last = span >= left
        if last:
            span = left
        exact.start_segment(self.y0, self.f0, 0.0, 0.0)
        exact.expand_series(model, self.t0, span)
        self.t1 = self.t_end if last else self.t0 + span
        if model.has_dry_friction:
            share, ends = exact.velocity_series.first_zero(self.modes0)
            if share < 1.0:
                self.t1 = self.t0 + share * span
            if ends:
                self.y1 = exact.evaluate(share * span)
                for i in contact_indices:
                    self.y1[slip_index[i]] = 0.0
                return self.end_at_event(model)
        self.y1 = exact.evaluate(self.t1 - self.t0)
        self.f1 = model.rates(self.t1, self.y1, self.modes1)
        return OK if sum_of(magnitude(self.y1)) < OVERFLOW_LIMIT else DIVERGED

    def advance_with_method(self, model):
        """One step of the method that meets the tolerance, cut where the mode changes."""
        t, y, f, modes = self.t0, self.y0, self.f0, self.modes0
        tolerance = self.tolerance
        smallest = (
            16.0 * EPSILON * (t if t > 0.0 else -t)
        )  # a third of the time of fabs; so below, for it is in each step
        size = self.h_next if self.h_next < self.h_max else self.h_max
        if size < smallest:
            size = smallest
        left = self.t_end - t
        last = 1.1 * size >= left
        h = left if last else size
        scale = magnitude(y)
        scale = elementwise_max(self.error_scale_floor, scale)
        tries = 0
        methods = self.active_method
        while True:
            y1, f1, e = methods.propose(model, modes, t, y, f, h)
            self.n_rhs += methods.stages
            far = magnitude(y1)
            e = magnitude(e) / elementwise_max(far, scale)
            error = h * max_of(e) / tolerance
            if error <= 1.0 and sum_of(far, e) < OVERFLOW_LIMIT:  # NaN leaves here too
                break
            self.n_rejected += 1
            tries += 1
            if h <= smallest or tries == MAX_TRIES:
                return STALLED if error < inf and sum_of(far) < OVERFLOW_LIMIT else DIVERGED
            shrink = methods.safety * error**-methods.power if 1.0 < error < inf and tries == 1 else 0.5
            lowest = methods.shrink if tries == 1 else 0.5
            size = h * (shrink if shrink > lowest else lowest)
            if size < smallest:
                size = smallest
            h = size
            last = False
        if tries == 0:
            grow = methods.safety * error**-methods.power if error > 1e-9 else methods.grow
            size = h * (grow if grow < methods.grow else methods.grow)
        self.h_next = size
        self.h_full = h
        self.t1, self.y1, self.f1 = self.t_end if last else t + h, y1, f1
        if model.has_dry_friction and self.is_hybrid:
            ends = contact_vector()
            if model.is_coupled:
                ends = model.mode_end_times(self)
            else:
                for i in contact_indices:
                    ends[i] = model.find_slip_reversal(self, i)
            if self.interpolant.ready:  # the search had to look inside
                self.n_rhs += self.active_method.extra
            end = min_of(ends)
            if end <= self.t1:
                self.y1 = self.state_at(model, end)
                self.t1 = end
                if model.is_coupled:
                    self.y1, self.modes1, self.has_consistent_modes = model.resolve_after_event(
                        self, ends, self.tie_tolerance(model)
                    )
                else:
                    for i in contact_indices:
                        self.y1[slip_index[i]] = 0.0
                return self.end_at_event(model)
            if model.is_coupled:
                self.y1 = model.stop_slips(self.t1, self.y1, modes)
                self.f1 = select_kinematic(kinematic_rates(self.y1), self.f1)
        return OK

    def end_at_event(self, model):
        """The speed of a contact has come to zero at t1: stick, or slide the other way, or go on if it only touches
        zero; or its load has come to the limit: let go."""
        if not model.is_coupled:
            self.update_end_modes(model, self.modes0, self.tie_tolerance(model))
        self.restart_after_event(model)
        return OK if sum_of(magnitude(self.y1)) < OVERFLOW_LIMIT else DIVERGED

    def tie_tolerance(self, model):
        """How far what was computed up to here may be from a tie, as a share."""
        return (
            ROUNDOFF_MARGIN
            if model.is_linear and self.active_method.method_number == EXACT
            else TIE_FACTOR * self.tolerance
        )

    def update_end_modes(self, model, modes: ContactVector, tie_tolerance):
        """The modes that hold from t1 on, after these."""
        self.modes1, self.grazes_at_end, self.has_consistent_modes = STUCK, False, True
        if self.is_hybrid:
            if model.is_coupled:
                self.y1, self.modes1, self.has_consistent_modes = model.resolve_at_start(
                    self.t1, self.y1, modes, tie_tolerance, tie_tolerance
                )
            else:
                for i in contact_indices:
                    self.modes1[i] = model.resolve_mode(self.t1, self.y1, tie_tolerance, i)
                    if self.y1[slip_index[i]] == 0.0 and self.modes1[i] != modes[i] != STUCK:
                        if model.is_grazing(self.t1, self.y1, modes, tie_tolerance, i):
                            self.modes1[i], self.grazes_at_end = modes[i], True

    def update_end_rates(self, model):
        """The rates in the modes that hold from t1 on."""
        if model.rests_when_stuck and self.is_hybrid and all_of(self.modes1 == STUCK):
            self.f1 = 0.0
        else:
            self.f1 = model.rates(self.t1, self.y1, self.modes1)
            self.n_rhs += 1
            if model.has_dry_friction and not model.is_coupled:
                for i in contact_indices:
                    if (
                        self.is_hybrid
                        and self.y1[slip_index[i]] == 0.0
                        and self.modes1[i] * self.f1[slip_index[i]] < 0.0
                    ):
                        self.has_consistent_modes = self.grazes_at_end or model.is_consistent(
                            self.t1, self.y1, self.modes1, i
                        )
                        self.f1[slip_index[i]] = 0.0  # the last bit at a break-away: no body starts against its mode

    def restart_after_event(self, model):
        """The step has been cut: forget the slopes, but keep the step size of the last slide, if there was one."""
        self.event_at_end = any_of(self.modes1 != self.modes0)  # a slide that only touches zero goes on
        self.update_end_rates(model)
        if self.h_next == 0.0 and self.active_method.method_number != EXACT:
            self.h_next = self.initial_step_size()

    def initial_step_size(self):
        """The step to try first, from the slopes at t1."""
        far = magnitude(self.y1)
        pace = magnitude(self.f1) / elementwise_max(far, self.error_scale_floor)
        rate = max_of(pace)
        size = self.active_method.safety * self.tolerance**self.active_method.power
        return size / rate if size < rate * self.h_max else self.h_max

    def state_at(self, model, t) -> StateVector:
        """The state at t inside the step."""
        inside = self.interpolant
        if not inside.ready:
            if model.rests_when_stuck and self.is_stuck:
                return self.y1
            if model.is_linear and self.active_method.method_number == EXACT:
                return self.active_method.exact.evaluate(t - self.t0 - self.roundoff.t0)
            self.active_method.build_interpolant(model, self)
        return inside.evaluate(t - self.t0)
