"""The current internal step: its two ends, the counters up to both, and the state inside it.

step_control.py computes the next one.
"""

from math import inf

from . import conditions, phase_repetition, planar_contact, step_end, time_scale
from .active_method import ActiveMethod
from .codes import EXACT, ROUNDOFF_MARGIN, STUCK
from .event_location import EventLocation
from .interpolant import Interpolant
from .step_counters import RoundoffCompensation, StepCounters
from .step_kind import follows_closed_form, has_events, has_law_without_sticking, is_at_rest
from .vectors import ContactVector, StateVector, error_size, planar_indices


class InternalStep:
    """Current internal step, with counters up to both ends.

    A model of one body has 29 attributes here.  CPython 3.11 stores fewer than thirty inline; one more, and a step of
    ode23 in stickslip took 4.4 us instead of 3.8 (November 2026).
    """

    y0: StateVector
    f0: StateVector
    y1: StateVector
    f1: StateVector
    modes0: ContactVector
    modes1: ContactVector

    def __init__(self, model):
        self.active_method = ActiveMethod(model)
        if has_events(model):
            self.event_location = EventLocation(model.n_event_functions)
        # run: relative tolerance, largest step; stop time (inf if unknown)
        self.tolerance = self.h_max = 0.0
        self.t_end = inf
        self.is_hybrid = False  # law of friction with stick and slip; a constant where the FMU offers no choice
        # step: start, end, modes inside and after it
        self.t0 = self.y0 = self.f0 = 0.0
        self.t1 = self.y1 = self.f1 = 0.0
        self.modes0 = self.modes1 = STUCK
        self.is_stuck = self.event_at_end = False  # nothing moves; a mode changes at t1
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
        if has_law_without_sticking(model, self):
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
            step_end.update_end_modes(model, self, modes, tie_tolerance)
        if model.has_conditions:
            conditions.check_limits(model, self.event_location, t, self.y1, self.modes1)
        step_end.update_end_rates(model, self)
        if not is_at_rest(model, self, self.modes1):
            if self.h_next == 0.0 and self.active_method.method_number != EXACT:
                self.h_next, size = time_scale.initial_step(model, self, t, self.y1, self.f1, self.modes1)
                self.save_scale_floor()
                self.active_method.raise_scale_floor(model, size)
        for i in planar_indices:
            self.y1 = planar_contact.begin_slip(model, self, i)
            self.f1 = model.rates(t, self.y1, self.modes1)
        self.t0 = t
        self.save_counters()
        if has_events(model):
            phase_repetition.begin_phase(model, self)

    def begin(self, model):
        """Begin the step at the end of the last one, and count what that one did."""
        counters = self.start_counters
        if model.has_dry_friction and self.event_at_end:
            self.count_event()
            self.event_at_end = False
        if self.t1 > self.t0:
            counters.h_last = self.t1 - self.t0
        self.save_counters()
        self.t0, self.y0 = self.t1, self.y1
        self.f0, self.modes0 = self.f1, self.modes1
        self.is_stuck = self.interpolant.is_ready = False

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

    def count_event(self):
        """Count the change of mode at t1."""
        self.start_counters.n_events += 1
        self.start_counters.t_event = self.t1

    def state_at(self, model, t) -> StateVector:
        """Interpolate the state at t inside the step."""
        interpolant = self.interpolant
        if not interpolant.is_ready:
            if model.rests_when_stuck and self.is_stuck:
                return self.y1
            if follows_closed_form(model, self):
                return self.active_method.exact.evaluate(t - self.t0 - self.roundoff.t0)
            self.active_method.build_interpolant(model, self)
        return interpolant.evaluate(t - self.t0 - self.roundoff.t0)

    def state_after(self, model, elapsed) -> StateVector:
        """Interpolate the state `elapsed` seconds after the start of a step of a method."""
        if not self.interpolant.is_ready:
            self.active_method.build_interpolant(model, self)
        return self.interpolant.evaluate(elapsed)
