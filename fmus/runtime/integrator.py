"""The free-running march: the solver steps as it likes, whatever the communication points are, and interpolates there.

The march owns the internal step that covers the present point t, and tells the counts up to t: what was computed
beyond it, because somebody looked ahead, does not show.
"""

from math import inf, nan

from . import ode23
from .active_method import METHOD_ITEMS
from .codes import DIVERGED, HYBRID, OK, STUCK, TOO_MANY_STEPS
from .linear_closed_form import HIGHER_ORDER_INPUT
from .step_control import OVERFLOW_LIMIT, InternalStep
from .variable_declarations import Choice, Count, Fixed, Local, VariableOwner
from .vectors import (
    ContactVector,
    StateVector,
    all_of,
    any_of,
    contact_indices,
    magnitude,
    slip_index,
    sum_of,
    velocity_indices,
)

DEFAULT_NOMINAL = 1e-3  # size of a position or a speed, in SI units, where nobody sets one
# Within one communication step, so that a sentence comes after half a minute at most, on a slow machine too:
MAX_BATCHES, BATCH_STEPS = 2000, 1000  # the calls are counted after each round
MAX_STEPS = MAX_BATCHES * BATCH_STEPS  # internal steps
MAX_EVALUATIONS = 8_000_000  # right-hand sides, and looks inside a step for its events


class Integrator(VariableOwner):
    """Solver settings, counts, and the present point."""

    method = Choice(ode23.NUMBER, "integration method", METHOD_ITEMS)
    rtol = Fixed(0.0, "1", "relative tolerance; 0 takes the importer's", low=0.0, below=1.0)
    atol = Fixed(
        0.0,
        "1",
        "absolute tolerance in SI units; 0 takes 1e-3 of rtol, less where creep matters",
        low=0.0,
    )
    h_max = Fixed(0.0, "s", "largest internal step; 0 takes a tenth of the run", low=0.0)
    steps = Count("accepted internal steps up to the present point")
    rejected = Count("refused internal steps up to the present point")
    evaluations = Count("right-hand sides evaluated up to the present point")
    h = Local("s", "size of the internal step in force")
    t_next = Local("s", "end of the internal step that covers the time after the present point; computed when read")

    modes_before_change: ContactVector

    def __init__(self):
        super().__init__()
        self.step = InternalStep()
        self.t = self.y = 0.0
        self.modes = STUCK
        self.default_duration = 1.0  # length of the default run
        # what the present point was before its values were renewed
        self.t_change = nan
        self.n_rhs_before_change = self.n_events_before_change = 0
        self.modes_before_change = STUCK
        self.h_next_before_change = 0.0
        self.t_event_before_change = nan

    # ---- the run

    def start(self, model, t, y: StateVector, t_end, tolerance):
        """Begin a run at t; t_end is inf where the importer does not know it."""
        step = self.step
        run = t_end - t if t_end < inf else model.stop_time
        step.tolerance = self.rtol if self.rtol > 0.0 else tolerance
        step.h_max = self.h_max if self.h_max > 0.0 else 0.1 * run
        step.t_end = t_end
        self.default_duration = model.stop_time
        step.active_method.select(self.method)
        if model.has_dry_friction:
            step.is_hybrid = model.friction == HYBRID
        self.apply_parameters(model)
        step.begin_run(model, t, y)
        self.t_change = nan
        self.move_to_step_end()

    def restart(self, model):
        """Discard what lies beyond the present point, and go on from there with the values that now hold.

        Whoever sets two values at one point may read between them: the second time starts from where the first did.
        """
        step = self.step
        if self.t > step.t0:
            step.start_counters.h_last = self.finite_step_end() - step.t0
            if model.has_dry_friction and step.event_at_end and self.t >= step.t1:
                step.count_event()
                self.modes = step.modes1  # if the event still waited to be handled, it has been now
        else:
            step.restore_counters()
        step.event_at_end = False
        start_counters = step.start_counters
        if self.t_change == self.t:
            step.n_rhs, start_counters.n_events, step.h_next = (
                self.n_rhs_before_change,
                self.n_events_before_change,
                self.h_next_before_change,
            )
            start_counters.t_event = self.t_event_before_change
        else:
            self.t_change = self.t
            self.n_rhs_before_change, self.n_events_before_change, self.h_next_before_change = (
                step.n_rhs,
                start_counters.n_events,
                step.h_next,
            )
            self.t_event_before_change, self.modes_before_change = start_counters.t_event, self.modes
        self.apply_parameters(model)
        if model.has_dry_friction and step.is_hybrid and not model.is_coupled:
            for i in contact_indices:
                if self.modes_before_change[i] * self.y[slip_index[i]] < 0.0:
                    self.y[slip_index[i]] = 0.0  # within a slide a speed against its mode is rounding
        step.start_empty_step(model, self.t, self.y, self.modes_before_change, step.tie_tolerance(model))
        if model.has_dry_friction and any_of(step.modes1 != self.modes_before_change):
            step.count_event()
        self.move_to_step_end()

    def apply_parameters(self, model):
        """The sizes of the states below which the tolerance is absolute; and what closed forms follow from."""
        step = self.step
        size = self.atol / step.tolerance if self.atol > 0.0 else DEFAULT_NOMINAL
        size = size if size > 1e-300 else 1e-300  # a divisor
        step.error_scale_floor = size
        nominal_velocity = model.nominal_velocity()
        if self.atol == 0.0 and nominal_velocity < size:
            for i in velocity_indices:
                step.error_scale_floor[i] = nominal_velocity
        if model.is_linear:
            mass, damping, stiffness, drift = model.linear_coefficients()
            step.active_method.exact.prepare(mass, damping, stiffness, drift)
            if model.has_input_derivatives and model.has_higher_order():
                step.active_method.exact.regime = HIGHER_ORDER_INPUT
            elif model.has_input_derivatives:
                step.active_method.exact.set_force_rate(model.applied_acceleration_derivative(self.t, 1))

    # ---- the present point

    def advance(self, model, t):
        """Take the present point to t; OK or the reason why not."""
        step = self.step
        if step.t1 < t:
            status = step.compute_next(model)
            if status == OK and step.t1 < t:
                status = self.advance_past(model, t)
            if status != OK:
                return status
        if t < step.t1:
            self.t, self.modes = t, step.modes0
            inside = step.interpolant
            if inside.ready:  # as step.at has it, and one call less in most communication steps
                self.y = inside.evaluate(t - step.t0)
                return OK
            self.y = step.state_at(model, t)
            if step.t1 == inf and not sum_of(magnitude(self.y)) < OVERFLOW_LIMIT:
                return DIVERGED  # a step without end has not been judged at its end
        else:
            self.move_to_step_end()
        return OK

    def move_to_step_end(self):
        """The present point is the end of the step."""
        step = self.step
        self.t, self.y, self.modes = step.t1, step.y1, step.modes1

    def advance_past(self, model, t):
        """Take internal steps until one of them covers t."""
        step = self.step
        most = step.n_rhs + step.interpolant.n_event_evals + MAX_EVALUATIONS
        for _ in range(MAX_BATCHES):
            for _ in range(BATCH_STEPS):
                status = step.compute_next(model)
                if status != OK or step.t1 >= t:
                    return status
            if step.n_rhs + step.interpolant.n_event_evals > most:
                break
        return TOO_MANY_STEPS

    def update_t_next(self, model):
        """Where the internal step that covers the time after the present point ends; NaN if it fails.

        One without an end is told as if it ended a default run after the present point.
        """
        step = self.step
        while self.t >= step.t1 and step.t1 < step.t_end:
            if step.compute_next(model) != OK:
                self.t_next = nan
                return
        self.t_next = self.finite_step_end()

    def finite_step_end(self):
        """The end of the internal step in force, made finite."""
        end = self.step.t1
        return end if end < inf else self.t + self.default_duration

    def report(self, events):
        """The declared counts, up to the present point."""
        step = self.step
        start_counters = step.start_counters
        here = (
            step.event_at_end and self.t >= step.t1 and all_of(self.modes == step.modes1)
        )  # and does not wait to be handled
        events.count = start_counters.n_events + 1 if here else start_counters.n_events
        events.t_last = step.t1 if here else start_counters.t_event
        if self.t > step.t0:
            self.steps, self.rejected, self.evaluations = step.n_accepted, step.n_rejected, step.n_rhs
            self.h = self.finite_step_end() - step.t0
        else:
            self.steps, self.rejected, self.evaluations = (
                start_counters.n_accepted,
                start_counters.n_rejected,
                start_counters.n_rhs,
            )
            self.h = start_counters.h_last
