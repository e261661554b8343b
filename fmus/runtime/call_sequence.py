"""What an importer may ask for when, and which refusal is told first: the slaves ask here, and so does the C.

Status of a function: OK, or the code of what is wrong; sentences.py has the words.
"""

from math import fabs, inf, isfinite, nan

from .codes import (
    BAD_START,
    BAD_STEP,
    BAD_STOP,
    BAD_VALUE,
    CALCULATED,
    CO_SIMULATION,
    CONTINUOUS,
    DIVERGED,
    FAILED,
    FIRST_RULE,
    FIXED,
    INSTANTIATED,
    MODEL_EXCHANGE,
    OK,
    OUT_OF_RANGE,
    RUNNING,
)
from .vectors import contact_indices


class RunState:
    """What makes the run of an instance, but for the numbers of its model."""

    def __init__(self, tolerance):
        self.phase, self.interface = INSTANTIATED, CO_SIMULATION
        self.start_time, self.stop_time, self.tolerance = 0.0, inf, tolerance
        self.n_invalid_values = 0  # how many values were set that cannot be used
        self.has_pending_changes = False  # values were set that are not yet in force
        self.values_changed = False  # and such that came into force since the last event
        self.outputs_current = False  # the outputs are those of the present point
        self.has_failed = False


def is_valid_state(run, model, exchanges):
    """Whether an instance, for model exchange or not, can be in this state; the motion of one that cannot may have no
    end."""
    if not (INSTANTIATED <= run.phase <= CONTINUOUS and 0.0 < run.tolerance < 1.0):
        return False
    if run.interface != (MODEL_EXCHANGE if exchanges else CO_SIMULATION):
        return False
    if run.phase == (RUNNING if exchanges else CONTINUOUS):
        return False
    if run.phase < RUNNING or run.has_failed or exchanges:
        return True
    solver = model.solver
    step = solver.step
    sound = step.t0 <= solver.t <= step.t1 <= step.t_end and step.active_method.method_number == solver.method
    for i in contact_indices:
        sound = sound and -1 <= solver.modes[i] <= 1 and -1 <= step.modes0[i] <= 1 and -1 <= step.modes1[i] <= 1
    return sound


# ---- values


def is_in_range(value, low, high, above, below):
    """Whether a value is in a range; NaN and infinities never are."""
    return isfinite(value) and low <= value <= high and above < value < below


def rejection_reason(run, calculated, fixed, allowed):
    """Why a variable cannot be set to a value."""
    if calculated:
        return CALCULATED
    if fixed and run.phase >= RUNNING:
        return FIXED
    return OK if allowed else OUT_OF_RANGE


def note_change(run, model):
    """A value is about to change: what has been integrated in closed form ends at the present point."""
    if not run.has_pending_changes and run.phase >= RUNNING:
        model.rebase(model.solver.t)
    run.has_pending_changes = True


def set_experiment(run, start, stop, tolerance):
    """The experiment; inf and 0 where no stop time and no tolerance is given."""
    run.start_time, run.stop_time = start, stop
    if 0.0 < tolerance < 1.0:
        run.tolerance = tolerance
    run.has_pending_changes, run.outputs_current = True, False


def check_values(run, model):
    """Status of the values as they stand."""
    if run.n_invalid_values > 0:
        return BAD_VALUE
    if not isfinite(run.start_time):
        return BAD_START
    if not run.stop_time > run.start_time:
        return BAD_STOP
    rule = model.prepare()
    if rule == model.own_solver_rule and run.interface != CO_SIMULATION:
        return OK  # another solver solves
    return FIRST_RULE + rule if rule > 0 else OK


# ---- the run


def apply_changes(run, model, beginning):
    """Take over what was set: the motion begins, or goes on from the present point.  Status."""
    status = check_values(run, model)
    if status == OK:
        solver = model.solver
        if beginning:
            y = model.initial_state(run.start_time)
            solver.start(model, run.start_time, y, run.stop_time, run.tolerance)
        elif run.interface != MODEL_EXCHANGE:  # where nothing starts anew: the mode follows at the next event
            solver.restart(model)
        run.has_pending_changes = run.outputs_current = False
        run.values_changed = not beginning
    return status


def exit_initialization(run, model):
    """Initialisation ends.  Status."""
    beginning = run.phase < RUNNING  # an importer may end it twice
    run.phase = RUNNING
    if run.has_failed:
        return FAILED
    return apply_changes(run, model, beginning)


def prepare_to_step(run, model):
    """Status of a run that shall go on; values that were set are judged first."""
    if run.has_failed:
        return FAILED
    if run.phase < RUNNING:
        return exit_initialization(run, model)
    if run.has_pending_changes or run.n_invalid_values > 0:
        return apply_changes(run, model, False)
    return OK


def do_step(run, model, t, h):
    """A communication step of h from t.  Status."""
    if not (run.outputs_current and run.phase >= RUNNING):  # something was set since the last point was read
        status = prepare_to_step(run, model)
        if status != OK:
            return status
    solver = model.solver
    end = communication_step_end(run, solver, t, h)
    if not end >= solver.t:
        return BAD_STEP
    if end == solver.t:
        return OK
    run.outputs_current = False
    return solver.advance(model, end)


def communication_step_end(run, solver, t, h):
    """Where a communication step of h from t ends, NaN where it is refused.

    It begins at the present point and ends by the stop time.  An importer's times are sums at the size of the start, so
    that near zero they may be off by more than the last place of the time itself.
    """
    step = solver.step
    start, now, stop, end = run.start_time, solver.t, step.t_end, t + h
    if 0.0 <= start <= t == now < end < stop and not (1.0 - 1e-14) * step.t1 <= end <= (1.0 + 1e-14) * step.t1:
        return end  # as what follows would have it: nearly every step
    size = fabs(start) if fabs(start) > fabs(now) else fabs(now)
    if fabs(end) > size:
        size = fabs(end)
    if fabs(end - step.t1) <= 1e-15 * size < inf:
        end = step.t1  # the end of an internal step, but for the rounding of the sum
    elif stop < end < inf and end <= stop + 1e-6 * h + 1e-11 * size:
        end = stop  # a million steps that were added up end as far beyond it
    begins_here = fabs(t - now) <= 1e-6 * h + 4e-15 * size
    return end if h > 0.0 and begins_here and now <= end <= stop and end < inf else nan


# ---- outputs


def update_outputs(run, model):
    """Bring the outputs to the present point.  Status: DIVERGED, or that of values which cannot be used yet."""
    if run.has_pending_changes or run.n_invalid_values > 0 or run.phase < RUNNING:
        status = apply_changes(run, model, run.phase < RUNNING)
        if status != OK:
            return status
    set_outputs(run, model)
    return OK if run.outputs_current else DIVERGED


def set_outputs(run, model):
    """Set the outputs."""
    solver = model.solver
    run.outputs_current = model.compute_outputs(solver.t, solver.y, solver.modes)


def update_statistics(model, ahead):
    """Bring what is told of solver and events to the present point; `ahead`: also where the next step ends."""
    model.solver.report(model.events)
    if ahead:
        model.solver.update_t_next(model)
