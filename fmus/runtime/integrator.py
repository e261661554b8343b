"""Free-running integrator: internal steps do not depend on communication points; results there are interpolated.

The integrator owns the internal step that covers the current time t.  Reported counts end at t: work that has been done
ahead of t does not show.
"""

from math import fabs, inf, nan

from . import conditions, contact_lcp, ode23, phase_repetition, step_control, step_end
from .active_method import METHOD_ITEMS, SMALLEST_FLOOR
from .codes import DIVERGED, EXACT, HYBRID, HYBRID_LAW_ONLY, OK, STUCK, TOO_MANY_STEPS
from .internal_step import InternalStep
from .step_end import OVERFLOW_LIMIT
from .variable_declarations import Count, Enumeration, Local, Setting, VariableOwner
from .vectors import (
    ContactVector,
    StateVector,
    all_of,
    any_of,
    contact_indices,
    magnitude,
    slip_index,
    sum_of,
)

FLOOR_SHARE = 0.03  # of the largest magnitude of a state so far; errors are relative to no less
STEP_END_TOLERANCE = 1e-15  # relative; communication points this close to the end of an internal step are there
# Limits for one communication step, so that an error comes within half a minute, on a slow machine too:
MAX_BATCHES, BATCH_STEPS = 2000, 1000  # evaluations are checked after each batch
MAX_STEPS = MAX_BATCHES * BATCH_STEPS  # internal steps
MAX_EVALUATIONS = 8_000_000  # evaluations of the right-hand side and of event functions


class Integrator(VariableOwner):
    """Solver settings, counts, and the state at the current time."""

    method = Enumeration(ode23.NUMBER, "integration method", METHOD_ITEMS)
    rtol = Setting(0.0, "1", "relative tolerance; 0 uses the tolerance of the importer", low=0.0, below=1.0)
    atol = Setting(
        0.0,
        "1",
        "absolute tolerance in SI units; 0 uses 3 % of rtol times the largest value of a state so far, less for creep",
        low=0.0,
    )
    h_max = Setting(0.0, "s", "largest internal step; 0 uses a tenth of the run", low=0.0)
    steps = Count("accepted internal steps up to the current time")
    rejected = Count("rejected internal steps up to the current time")
    evaluations = Count("evaluations of the right-hand side up to the current time")
    h = Local("s", "size of the current internal step")
    t_next = Local("s", "end of the internal step that covers the time after the current one; computed when read")

    y: StateVector
    modes: ContactVector
    previous_modes: ContactVector

    def __init__(self, model):
        super().__init__()
        self.step = InternalStep(model)
        # start of the run; all other times of the solver are seconds since then, so that a motion does not depend on it
        self.start_time = 0.0
        self.t = self.y = 0.0
        self.modes = STUCK
        self.default_duration = 1.0  # duration of the default run (s)
        # time of the last change of values, and the counters and modes just before it
        self.t_change = nan
        self.n_rhs_before_change = self.n_events_before_change = 0
        self.previous_modes = STUCK
        self.h_next_before_change = 0.0
        self.t_event_before_change = nan

    # ---- run

    def check_method(self, model):
        """Return OK, or HYBRID_LAW_ONLY if the method does not cover the friction law."""
        if model.has_dry_friction and model.friction != HYBRID and self.method == EXACT:
            return HYBRID_LAW_ONLY
        return OK

    def start(self, model, t, y: StateVector, t_end, tolerance):
        """Start a run.

        Parameters
        ----------
        model
            Model that is integrated.
        t, t_end
            Start and stop time in s; t_end is inf if the importer does not give it.
        y
            Initial states.
        tolerance
            Relative tolerance of the importer, used if `rtol` is 0.
        """
        step = self.step
        duration = t_end - t if t_end < inf else model.stop_time
        step.tolerance = self.rtol if self.rtol > 0.0 else tolerance
        step.h_max = self.h_max if self.h_max > 0.0 else 0.1 * duration
        step.t_end = t_end - t
        self.start_time = t
        self.default_duration = model.stop_time
        step.active_method.select(self.method)
        step.active_method.error_scale_floor = SMALLEST_FLOOR
        if model.has_dry_friction:
            step.is_hybrid = model.friction == HYBRID
        self.apply_parameters(model)
        step.begin_run(model, y)
        self.t_change = nan
        self.move_to_step_end(model)

    def restart(self, model):
        """Restart at the current time with changed values; discard the internal step beyond it.

        Several changes at one time, even with reads between them, have the effect of a single one: each restart begins
        from the counters and modes before the first change.
        """
        step = self.step
        if self.t > step.t0:
            step.start_counters.h_last = self.finite_step_end() - step.t0
            if model.has_dry_friction and step.event_at_end and self.t >= step.t1:
                step.count_event()
                self.modes = step.modes1  # a deferred event is handled now
        else:
            step.restore_counters()
        step.event_at_end = False
        counters = step.start_counters
        if self.t_change == self.t:
            step.n_rhs, counters.n_events, step.h_next = (
                self.n_rhs_before_change,
                self.n_events_before_change,
                self.h_next_before_change,
            )
            counters.t_event = self.t_event_before_change
        else:
            self.t_change = self.t
            self.n_rhs_before_change, self.n_events_before_change, self.h_next_before_change = (
                step.n_rhs,
                counters.n_events,
                step.h_next,
            )
            self.t_event_before_change, self.previous_modes = counters.t_event, self.modes
        if model.has_dry_friction or model.has_conditions:
            phase_repetition.restore_tolerance(step)
        self.apply_parameters(model)
        if step.is_hybrid and not model.is_coupled:
            for i in contact_indices:
                if self.previous_modes[i] * self.y[slip_index[i]] < 0.0:
                    self.y[slip_index[i]] = 0.0  # a velocity against the mode of a slip phase is rounding
        if model.has_prescribed_slips and step.is_hybrid:
            deviations = model.slip_deviations(self.t, self.y)
            self.y = contact_lcp.follow_inputs(model, self.t, self.y, self.previous_modes, deviations)
        step.start_empty_step(model, self.t, self.y, self.previous_modes, step_end.tie_tolerance(model, step))
        if model.has_dry_friction and any_of(step.modes1 != self.previous_modes):
            step.count_event()
        self.move_to_step_end(model)

    def apply_parameters(self, model):
        """Apply parameters: scale floor of the error norm, and constants of the closed form."""
        step = self.step
        method = step.active_method
        nominal_velocity = model.nominal_velocity()
        nominal_velocity = nominal_velocity if nominal_velocity > 0.0 else inf
        if model.has_dry_friction:
            step.event_location.feature_width = nominal_velocity
        method.floor_share, method.nominal_velocity = FLOOR_SHARE, nominal_velocity
        if self.atol > 0.0:
            size = self.atol / step.tolerance
            method.error_scale_floor = size if size > SMALLEST_FLOOR else SMALLEST_FLOOR
            method.floor_share = 0.0
        if model.is_linear:
            mass, damping, stiffness, drift = model.linear_coefficients()
            step.active_method.exact.prepare(mass, damping, stiffness, drift)
            if model.has_input_derivatives:
                step.active_method.exact.set_force_rate(model.applied_acceleration_rate(self.t))

    # ---- current time

    def advance(self, model, t):
        """Advance the current time to t, in seconds since the start.  Returns a status."""
        step = self.step
        if step.t1 < t:
            status = step_control.compute_next(model, step)
            if status == OK and step.t1 < t:
                status = self.advance_past(model, t)
            if status != OK:
                return status
        if t < step.t1:
            self.t, self.modes = t, step.modes0
            if model.has_conditions:
                conditions.select_sides(model, step.event_location, False)
            interpolant = step.interpolant
            if interpolant.is_ready:  # as in step.state_at; saves one call in most communication steps
                self.y = interpolant.evaluate(t - step.t0 - step.roundoff.t0)
                return OK
            self.y = step.state_at(model, t)
            if step.t1 == inf and not sum_of(magnitude(self.y)) < OVERFLOW_LIMIT:
                return DIVERGED  # a step without end was not checked for divergence
        else:
            self.move_to_step_end(model)
        return OK

    def move_to_step_end(self, model):
        """Set the current time to the end of the internal step."""
        step = self.step
        if model.has_conditions:
            conditions.select_sides(model, step.event_location, True)
        self.t, self.y, self.modes = step.t1, step.y1, step.modes1

    def advance_past(self, model, t):
        """Compute internal steps until one covers t.  Returns a status."""
        step = self.step
        limit = step.n_rhs + step.interpolant.n_event_evals + MAX_EVALUATIONS
        for _ in range(MAX_BATCHES):
            for _ in range(BATCH_STEPS):
                status = step_control.compute_next(model, step)
                if status != OK or step.t1 >= t:
                    return status
            if step.n_rhs + step.interpolant.n_event_evals > limit:
                break
        return TOO_MANY_STEPS

    def update_t_next(self, model):
        """Set `t_next` to the end of the internal step after the current time; NaN if that step fails."""
        step = self.step
        for _ in range(BATCH_STEPS):  # at most the last of them has a length
            if not (self.t >= step.t1 and step.t1 < step.t_end):
                break
            status = step_control.compute_next(model, step)
            if status != OK:
                if not step.t1 <= self.t:  # discard the failed step, so that a communication step fails there again
                    step.t1, step.y1, step.f1, step.modes1 = step.t0, step.y0, step.f0, step.modes0
                self.t_next = nan
                return
        now = self.start_time + self.t
        self.t_next = self.start_time + self.finite_step_end()
        if self.t < step.t1 and self.t_next <= now:
            # the step is shorter than the resolution of the time: lead beyond what counts as its end
            self.t_next = now + 2.0 * STEP_END_TOLERANCE * fabs(now)

    def finite_step_end(self):
        """Return the end of the internal step; if it has none, a default run after the current time."""
        end = self.step.t1
        return end if end < inf else self.t + self.default_duration

    def report(self, events):
        """Update the declared counts to the current time."""
        step = self.step
        counters = step.start_counters
        # an event at the current time counts unless it is deferred
        at_event = step.event_at_end and self.t >= step.t1 and all_of(self.modes == step.modes1)
        events.count = counters.n_events + 1 if at_event else counters.n_events
        events.t_last = self.start_time + (step.t1 if at_event else counters.t_event)
        if self.t > step.t0:
            self.steps, self.rejected, self.evaluations = step.n_accepted, step.n_rejected, step.n_rhs
            self.h = self.finite_step_end() - step.t0
        else:
            self.steps, self.rejected, self.evaluations = (
                counters.n_accepted,
                counters.n_rejected,
                counters.n_rhs,
            )
            self.h = counters.h_last
