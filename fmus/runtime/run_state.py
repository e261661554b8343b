"""State of a run: the solver of a model, statistics of events, and what the importer has done.

This is the place that puts a model and its solver together.  Neither holds the other: who calls the solver passes the
model to it.
"""

from math import inf

from .codes import CO_SIMULATION, INSTANTIATED
from .variable_declarations import Count, Local, VariableOwner


class Events(VariableOwner):
    """Statistics of mode changes up to the current time."""

    count = Count("changes of mode up to the current time")
    t_last = Local("s", "time of the last change of mode; the start time if there is none")


class RunState:
    """State of a run, besides the numbers of its model."""

    def __init__(self, model):
        self.events = Events()
        self.solver = model.solver_class(model)
        self.phase, self.interface = INSTANTIATED, CO_SIMULATION
        self.start_time, self.stop_time, self.tolerance = 0.0, inf, model.tolerance
        self.n_invalid_values = 0  # variables whose last value was rejected
        self.has_pending_changes = False  # values were set but not applied yet
        self.values_changed = False  # values were applied since the last event
        self.outputs_current = False  # the outputs belong to the current time
        self.has_failed = False
