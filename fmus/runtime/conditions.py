"""Conditions of the equations: which of them hold in a step, and how they change at events.

A condition keeps its value during a step, so that the equations are smooth there; its change is an event.  So does the
piece of a table, a number that two conditions have as their side: they hold above its lower and below its upper edge.
Limits are conditions that must hold during the whole run.
"""

from math import inf

from .codes import CHATTERING, EPSILON, OK
from .vectors import ContactVector, StateVector

CONDITION_MARGIN, TINY = 4.0 * EPSILON, 1e-300  # margins of conditions: relative and absolute
# share of the largest step; number of such short times in succession, below the limit of steps that stall
SHORTEST_DWELL, MAX_CHATTER = 1e-9, 50


def update_margins(model, location, t, y: StateVector, modes: ContactVector):
    """Store the margins of all conditions."""
    location.margins[:], location.margin_scales[:] = model.condition_margins(t, y, modes)


def update_sides(model, location, t, y: StateVector, modes: ContactVector):
    """Determine which conditions hold; a condition may depend on others."""
    for _ in range(model.n_event_functions + 1):
        update_margins(model, location, t, y, modes)
        if model.has_pieces:
            model.update_pieces(t, y, modes)
        changed = False
        for j in range(model.n_switches):
            side = 1.0 if location.margins[j] > 0.0 else -1.0
            if model.has_pieces and model.condition_pieces[j] >= 0.0:
                side = model.condition_pieces[j]
            if side != model.condition_sides[j]:
                model.condition_sides[j], changed = side, True
        if not changed:
            break
    for j in range(model.n_switches):
        location.sides_after[j] = model.condition_sides[j]


def check_limits(model, location, t, y: StateVector, modes: ContactVector):
    """Note the first limit that does not hold."""
    location.violated = -1
    update_margins(model, location, t, y, modes)
    for j in range(model.n_event_functions - model.first_condition - model.n_switches):
        k = model.n_switches + j
        if location.violated < 0 and location.margins[k] + CONDITION_MARGIN * location.margin_scales[k] + TINY <= 0.0:
            location.violated = k
            model.violation_time, model.violation_value = t, location.margins[k]


def initialize(model, location, t, y: StateVector, modes: ContactVector):
    """Determine the conditions where a run starts or restarts with changed values."""
    location.t_condition = -inf  # changes that were computed beyond t have not occurred
    update_sides(model, location, t, y, modes)
    begin_step(model, location)


def begin_step(model, location):
    """Begin a step with the conditions after the previous one."""
    for j in range(model.n_switches):
        model.condition_sides[j] = location.sides_before[j] = location.sides_after[j]


def update_at_event(model, location, t, y: StateVector, modes: ContactVector, h_max):
    """Determine the conditions after an event.

    Returns
    -------
    int
        Status: OK, or CHATTERING if a condition keeps changing.
    """
    for j in range(model.n_switches):
        location.sides_before[j] = model.condition_sides[j]
    update_sides(model, location, t, y, modes)
    if have_changed(model, location):
        is_quick = t - location.t_condition <= SHORTEST_DWELL * h_max
        location.n_chatter = location.n_chatter + 1 if is_quick else 0
        location.t_condition = t
    return CHATTERING if location.n_chatter > MAX_CHATTER else OK


def violation_status(model, location):
    """Return OK, or the status of the rule for a condition that must hold but does not."""
    return model.first_limit_rule + location.violated - model.n_switches if location.violated >= 0 else OK


def select_sides(model, location, after_event):
    """Select the conditions before or after the event at the end of the step."""
    for j in range(model.n_switches):
        model.condition_sides[j] = location.sides_after[j] if after_event else location.sides_before[j]


def have_changed(model, location):
    """Return whether a condition changes at the end of the step."""
    changed = False
    for j in range(model.n_switches):
        changed = changed or location.sides_after[j] != location.sides_before[j]
    return changed
