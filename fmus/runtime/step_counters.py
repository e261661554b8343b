"""Counters at the start of an internal step, and rounding errors of its times and positions."""

from .codes import EPSILON
from .vectors import StateVector


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
