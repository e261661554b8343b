"""Call sequence of an FMU: which calls are valid when, and which error has precedence.

The Python and the native FMU share these functions.  Most return a status: OK or an error code (messages.py has the
texts).
"""

from math import fabs, inf, isfinite, nan

from . import planar_contact
from .codes import (
    BAD_START,
    BAD_STEP,
    BAD_STOP,
    BAD_VALUE,
    CALCULATED,
    CO_SIMULATION,
    DIVERGED,
    FAILED,
    FIRST_RULE,
    FIXED,
    MODEL_EXCHANGE,
    OK,
    OUT_OF_RANGE,
    RUNNING,
)
from .integrator import STEP_END_TOLERANCE
from .vectors import planar_indices

# ---- values


def rejection_reason(run, is_calculated, is_fixed, is_allowed):
    """Return why a value cannot be set, or OK."""
    if is_calculated:
        return CALCULATED
    if is_fixed and run.phase >= RUNNING:
        return FIXED
    return OK if is_allowed else OUT_OF_RANGE


def note_change(run, model):
    """Prepare the model for a change of value: closed-form motions are rebased to the current time."""
    if not run.has_pending_changes and run.phase >= RUNNING:
        model.rebase(run.solver.t)
    run.has_pending_changes = True


def set_experiment(run, start, stop, tolerance):
    """Set the experiment; `stop` is inf and `tolerance` 0 if not given."""
    run.start_time, run.stop_time = start, stop
    if 0.0 < tolerance < 1.0:
        run.tolerance = tolerance
    run.has_pending_changes, run.outputs_current = True, False


def check_experiment(run):
    """Check start and stop time.  Returns a status."""
    if not isfinite(run.start_time):
        return BAD_START
    return OK if run.stop_time > run.start_time else BAD_STOP


def check_values(run, model):
    """Check all values.  Returns a status."""
    if run.n_invalid_values > 0:
        return BAD_VALUE
    status = check_experiment(run)
    if status != OK:
        return status
    status = model.prepare()
    if status == OK and run.interface == CO_SIMULATION:  # in model exchange the importer uses its own solver
        return run.solver.check_method(model)
    return status


def is_refusal(run, status):
    """Return whether a status refuses the call of the importer: the instance stays as it was, and the run can go on.

    A rule can also be violated later, while the run is computed; that is a failure.
    """
    return status == BAD_STEP or status == BAD_VALUE or (status >= FIRST_RULE and run.has_pending_changes)


# ---- run


def apply_changes(run, model, beginning):
    """Apply the values that were set: start the run, or restart at the current time.  Returns a status."""
    status = check_values(run, model)
    if status == OK:
        solver = run.solver
        if beginning:
            y = model.initial_state(0.0)
            solver.start(model, run.start_time, y, run.stop_time, run.tolerance)
        elif run.interface != MODEL_EXCHANGE:  # no restart in model exchange: modes change at the next event
            solver.restart(model)
        run.has_pending_changes = run.outputs_current = False
        run.values_changed = not beginning
    return status


def exit_initialization(run, model):
    """End the initialisation, unless the values are refused.  Returns a status."""
    phase = run.phase
    run.phase = RUNNING
    if run.has_failed:
        return FAILED
    status = apply_changes(run, model, phase < RUNNING)  # an importer may call this twice
    if status != OK:
        run.phase = phase
    return status


def prepare_to_step(run, model):
    """Prepare to continue the run: check and apply values that were set.  Returns a status."""
    if run.has_failed:
        return FAILED
    if run.phase < RUNNING:
        return exit_initialization(run, model)
    if run.has_pending_changes or run.n_invalid_values > 0:
        return apply_changes(run, model, False)
    return OK


def do_step(run, model, t, h):
    """Do a communication step of size h from t.  Returns a status."""
    if not (run.outputs_current and run.phase >= RUNNING):  # a value was set since the outputs were read
        status = prepare_to_step(run, model)
        if status != OK:
            return status
    solver = run.solver
    end = communication_step_end(run, solver, t, h)
    if not end >= solver.t:
        return BAD_STEP
    if end == solver.t:
        return OK
    if model.counts_jumps:
        model.count_jumps()
    run.outputs_current = False
    return solver.advance(model, end)


def communication_step_end(run, solver, t, h):
    """Return the end of a communication step of size h from t, in seconds since the start; NaN if it is invalid.

    The step must start at the current time and end by the stop time.  Importers add up their times, so that rounding
    errors scale with the largest time of the run and may exceed one ulp of a time near zero.
    """
    step = solver.step
    start = solver.start_time
    now, stop, t1, end = start + solver.t, start + step.t_end, start + step.t1, t + h
    elapsed = end - start
    if 0.0 <= start <= t == now < end < stop and not (1.0 - 1e-14) * t1 <= end <= (1.0 + 1e-14) * t1:
        return elapsed  # shortcut for nearly every step; same result as below
    size = fabs(start) if fabs(start) > fabs(now) else fabs(now)
    if fabs(end) > size:
        size = fabs(end)
    if fabs(end - t1) <= STEP_END_TOLERANCE * size < inf:
        end, elapsed = t1, step.t1  # the end of an internal step, except for rounding
    elif stop < end < inf and end <= stop + 1e-6 * h + 1e-11 * size:
        end, elapsed = stop, step.t_end  # error of a sum of a million steps
    if elapsed < solver.t and end >= now:
        elapsed = solver.t  # the step is shorter than the resolution of the time
    starts_now = fabs(t - now) <= 1e-6 * h + 4e-15 * size
    return elapsed if h > 0.0 and starts_now and now <= end <= stop and end < inf else nan


# ---- outputs


def update_outputs(run, model):
    """Update the outputs to the current time.  Returns a status: DIVERGED, or that of invalid values."""
    if run.has_pending_changes or run.n_invalid_values > 0 or run.phase < RUNNING:
        status = apply_changes(run, model, run.phase < RUNNING)
        if status != OK:
            return status
    set_outputs(run, model)
    return OK if run.outputs_current else DIVERGED


def set_outputs(run, model):
    """Compute the outputs at the current time."""
    solver = run.solver
    for i in planar_indices:
        if run.interface == MODEL_EXCHANGE:
            solver.modes[i] = planar_contact.trial_mode(model, solver.t, solver.y, solver.modes, i)
    run.outputs_current = model.compute_outputs(solver.t, solver.y, solver.modes)


def update_statistics(run, model, ahead):
    """Update the statistics of solver and events to the current time; with `ahead` also solver.t_next."""
    run.solver.report(run.events)
    if ahead:
        run.solver.update_t_next(model)
