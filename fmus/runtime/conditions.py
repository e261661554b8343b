"""Conditions of the equations: which of them hold in a step, and how they change at events.

A condition keeps its value during a step, so that the equations are smooth there; its change is an event.  So does the
piece of a table, a number that two conditions have as their side: they hold above its lower and below its upper edge.
Limits are conditions that must hold during the whole run.
"""

from math import fabs, inf

from .codes import CHATTERING, EPSILON, OK
from .vectors import ContactVector, StateVector

CONDITION_MARGIN, TINY = 4.0 * EPSILON, 1e-300  # margins of conditions: relative and absolute
# A condition chatters if it changes again within a share of the time in which the smooth motion changes, or, in model
# exchange, of the time since the start.  So many such changes in succession are an error; steps would stall after more.
BRIEF_SHARE, SHORTEST_DWELL, MAX_CHATTER = 0.01, 1e-9, 50
RESOLUTION = 1e-12  # share of a step; rounding errors decide changes that follow each other faster


def update_margins(model, location, t, y: StateVector, modes: ContactVector):
    """Store the margins of all conditions."""
    location.margins[:], location.margin_scales[:] = model.condition_margins(t, y, modes)


def update_sides(model, location, t, y: StateVector, modes: ContactVector):
    """Determine which conditions hold; a condition may depend on others."""
    for _ in range(model.n_event_functions + 1):
        update_margins(model, location, t, y, modes)
        if model.has_pieces:
            model.update_pieces(t, y, modes)
        has_changed = False
        for j in range(model.n_switches):
            side = 1.0 if location.margins[j] > 0.0 else -1.0
            if model.has_pieces and model.condition_pieces[j] >= 0.0:
                side = model.condition_pieces[j]
            if side != model.condition_sides[j]:
                model.condition_sides[j], has_changed = side, True
        if not has_changed:
            break
    for j in range(model.n_switches):
        location.sides_after[j] = model.condition_sides[j]


def check_limits(model, location, t, y: StateVector, modes: ContactVector):
    """Note the first limit that does not hold."""
    location.violated_limit = -1
    update_margins(model, location, t, y, modes)
    for j in range(model.n_event_functions - model.first_condition - model.n_switches):
        k = model.n_switches + j
        if (
            location.violated_limit < 0
            and location.margins[k] + CONDITION_MARGIN * location.margin_scales[k] + TINY <= 0.0
        ):
            location.violated_limit = k
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


def update_at_event(model, location, t, y: StateVector, modes: ContactVector):
    """Determine the conditions after an event."""
    for j in range(model.n_switches):
        location.sides_before[j] = model.condition_sides[j]
    update_sides(model, location, t, y, modes)


def note_distance(location, j, distance):
    """Note how far a condition is from its edge."""
    distance = fabs(distance)
    location.distances[j] = distance if distance > location.distances[j] else location.distances[j]
    location.largest_distances[j] = (
        distance if distance > location.largest_distances[j] else location.largest_distances[j]
    )


def has_stayed_at_edge(model, location, tolerance):
    """Return whether a condition that changes has not left its edge by more than the tolerance since it changed."""
    has_stayed = False
    for j in range(model.n_switches):
        if location.sides_after[j] != location.sides_before[j]:
            is_near = location.distances[j] <= tolerance * location.largest_distances[j]
            # the pieces of a table are continuous at their edge
            has_stayed = has_stayed or (is_near and not (model.has_pieces and model.condition_pieces[j] >= 0.0))
            location.distances[j] = 0.0
    return has_stayed


def count_changes(location, t, is_brief):
    """Count changes of conditions in brief succession.  Returns a status: OK, or CHATTERING after too many."""
    location.n_chatter = location.n_chatter + 1 if is_brief else 0
    location.t_condition = t
    return CHATTERING if location.n_chatter > MAX_CHATTER else OK


def violation_status(model, location):
    """Return OK, or the status of the rule for a condition that must hold but does not."""
    return model.first_limit_rule + location.violated_limit - model.n_switches if location.violated_limit >= 0 else OK


def select_sides(model, location, after_event):
    """Select the conditions before or after the event at the end of the step."""
    for j in range(model.n_switches):
        model.condition_sides[j] = location.sides_after[j] if after_event else location.sides_before[j]


def have_changed(model, location):
    """Return whether a condition changes at the end of the step."""
    has_changed = False
    for j in range(model.n_switches):
        has_changed = has_changed or location.sides_after[j] != location.sides_before[j]
    return has_changed
