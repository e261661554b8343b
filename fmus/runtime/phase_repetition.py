"""Repetition of the motion since the last event with a tighter tolerance.

It decides whether an event function reaches zero where the error of the method leaves that in doubt.
"""

from math import inf

from .step_limits import limit_first_step
from .vectors import contact_indices

REFINEMENT, SMALLEST_TOLERANCE = 1e-3, 1e-13  # factor of the tolerance where an event is in doubt; lower limit
WORTHWHILE_REFINEMENT = 0.3


def begin_phase(model, step):
    """Note the start of a motion: its state, and the step size to try."""
    if model.is_coupled or model.has_conditions:
        limit_first_step(model, step)
    location = step.event_location
    location.phase_t, location.phase_y, location.phase_f = step.t1, step.y1, step.f1
    location.phase_roundoff, location.phase_h = step.roundoff.t1, step.h_next
    restore_tolerance(step)
    location.in_doubt = location.must_repeat = False
    step.largest_slip = 0.0
    if model.has_dry_friction and model.has_input_derivatives and not model.is_coupled:
        location.must_search = model.has_moving_inputs()
        if location.must_search:
            step.largest_slip = inf  # every step is examined
            for i in contact_indices:
                location.peaks[i] = 0.0
    if model.is_coupled or model.has_conditions:
        for j in range(model.n_event_functions):
            location.peaks[j] = 0.0


def restore_tolerance(step):
    """Return to the tolerance of the run."""
    location = step.event_location
    if location.tolerance_factor < 1.0:
        step.tolerance, location.tolerance_factor = location.tolerance, 1.0


def decide_repetition(step):
    """Decide whether the motion since the last event must be repeated with a tighter tolerance."""
    location = step.event_location
    if location.in_doubt and location.tolerance_factor == 1.0:
        least = SMALLEST_TOLERANCE / step.tolerance
        factor = REFINEMENT if REFINEMENT > least else least
        if factor < WORTHWHILE_REFINEMENT:
            location.tolerance_factor, location.must_repeat, location.t_doubt = factor, True, step.t1
            location.tolerance = step.tolerance
            step.tolerance *= factor
            step.largest_slip = inf  # every step is examined


def repeat_phase(step):
    """Go back to the start of the motion, to repeat it with the tighter tolerance."""
    location = step.event_location
    location.must_repeat = False
    step.t1, step.roundoff.t1 = location.phase_t, location.phase_roundoff
    step.y1, step.f1, step.modes1 = location.phase_y, location.phase_f, step.modes0
    step.h_next = location.phase_h * location.tolerance_factor**step.active_method.power


def end_phase_in_doubt(model, step):
    """Return to the usual tolerance after a step without doubt."""
    location = step.event_location
    if location.tolerance_factor < 1.0 and step.t1 >= location.t_doubt and not location.in_doubt:
        step.h_next *= location.tolerance_factor**-step.active_method.power
        begin_phase(model, step)
