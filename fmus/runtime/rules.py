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
    FIXED,
    INSTANTIATED,
    MODEL_EXCHANGE,
    OK,
    OUT_OF_RANGE,
    RULES,
    RUNNING,
)
from .vectors import contacts


class Run:
    """What makes the run of an instance, but for the numbers of its model."""

    def __init__(self, tolerance):
        self.phase, self.interface = INSTANTIATED, CO_SIMULATION
        self.start_time, self.stop_time, self.tolerance = 0.0, inf, tolerance
        self.refused = 0  # how many values were set that cannot be used
        self.changed = False  # values were set that are not yet in force
        self.renewed = False  # and such that came into force since the last event
        self.observed = False  # the outputs are those of the present point
        self.failed = False


def is_sound(run, model, exchanges):
    """Whether an instance, for model exchange or not, can be in this state; the motion of one that cannot may have no
    end."""
    if not (INSTANTIATED <= run.phase <= CONTINUOUS and 0.0 < run.tolerance < 1.0):
        return False
    if run.interface != (MODEL_EXCHANGE if exchanges else CO_SIMULATION):
        return False
    if run.phase == (RUNNING if exchanges else CONTINUOUS):
        return False
    if run.phase < RUNNING or run.failed or exchanges:
        return True
    march = model.solver
    step = march.step
    sound = step.t0 <= march.t <= step.t1 <= step.t_end and step.methods.chosen == march.method
    for i in contacts:
        sound = sound and -1 <= march.modes[i] <= 1 and -1 <= step.modes0[i] <= 1 and -1 <= step.modes1[i] <= 1
    return sound


# ---- values


def within(value, low, high, above, below):
    """Whether a value is in a range; NaN and infinities never are."""
    return isfinite(value) and low <= value <= high and above < value < below


def reason(run, calculated, fixed, allowed):
    """Why a variable cannot be set to a value."""
    if calculated:
        return CALCULATED
    if fixed and run.phase >= RUNNING:
        return FIXED
    return OK if allowed else OUT_OF_RANGE


def change(run, model):
    """A value is about to change: what has been integrated in closed form ends at the present point."""
    if not run.changed and run.phase >= RUNNING:
        model.rebase(model.solver.t)
    run.changed = True


def setup(run, start, stop, tolerance):
    """The experiment; inf and 0 where no stop time and no tolerance is given."""
    run.start_time, run.stop_time = start, stop
    if 0.0 < tolerance < 1.0:
        run.tolerance = tolerance
    run.changed, run.observed = True, False


def objection(run, model):
    """Status of the values as they stand."""
    if run.refused > 0:
        return BAD_VALUE
    if not isfinite(run.start_time):
        return BAD_START
    if not run.stop_time > run.start_time:
        return BAD_STOP
    rule = model.prepare()
    if rule == model.own_solver and run.interface != CO_SIMULATION:
        return OK  # another solver solves
    return RULES + rule if rule > 0 else OK


# ---- the run


def renew(run, model, beginning):
    """Take over what was set: the motion begins, or goes on from the present point.  Status."""
    status = objection(run, model)
    if status == OK:
        march = model.solver
        if beginning:
            y = model.initial(run.start_time)
            march.start(model, run.start_time, y, run.stop_time, run.tolerance)
        elif run.interface != MODEL_EXCHANGE:  # where nothing starts anew: the mode follows at the next event
            march.restart(model)
        run.changed = run.observed = False
        run.renewed = not beginning
    return status


def begin(run, model):
    """Initialisation ends.  Status."""
    beginning = run.phase < RUNNING  # an importer may end it twice
    run.phase = RUNNING
    if run.failed:
        return FAILED
    return renew(run, model, beginning)


def ready(run, model):
    """Status of a run that shall go on; values that were set are judged first."""
    if run.failed:
        return FAILED
    if run.phase < RUNNING:
        return begin(run, model)
    if run.changed or run.refused > 0:
        return renew(run, model, False)
    return OK


def step(run, model, t, h):
    """A communication step of h from t.  Status."""
    if not (run.observed and run.phase >= RUNNING):  # something was set since the last point was read
        status = ready(run, model)
        if status != OK:
            return status
    march = model.solver
    end = end_of_step(run, march, t, h)
    if not end >= march.t:
        return BAD_STEP
    if end == march.t:
        return OK
    run.observed = False
    return march.advance(model, end)


def end_of_step(run, march, t, h):
    """Where a communication step of h from t ends, NaN where it is refused.

    It begins at the present point and ends by the stop time.  An importer's times are sums at the size of the start, so
    that near zero they may be off by more than the last place of the time itself.
    """
    step = march.step
    start, now, stop, end = run.start_time, march.t, step.t_end, t + h
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


def observe(run, model):
    """Bring the outputs to the present point.  Status: DIVERGED, or that of values which cannot be used yet."""
    if run.changed or run.refused > 0 or run.phase < RUNNING:
        status = renew(run, model, run.phase < RUNNING)
        if status != OK:
            return status
    show(run, model)
    return OK if run.observed else DIVERGED


def show(run, model):
    """Set the outputs."""
    march = model.solver
    run.observed = model.observe(march.t, march.y, march.modes)


def report(model, ahead):
    """Bring what is told of solver and events to the present point; `ahead`: also where the next step ends."""
    model.solver.report(model.events)
    if ahead:
        model.solver.look_ahead(model)
