"""What the FMI layer asks of a model: translated like the numerics, and called by these names in fmi2.c."""

from math import inf

from .kinds import FLOAT


def prepare(model):
    """0, or the number of the broken rule."""
    return model.prepare()


def start(model, t, t_end, tolerance):
    x, v = model.initial(t)
    model.solver.start(model, t, x, v, t_end, tolerance)


def restart(model):
    model.solver.restart(model)


def rebase(model):
    model.rebase(model.solver.t)


def advance(model, t):
    """0, or what keeps the motion from reaching t."""
    return model.solver.advance(model, t)


def look_ahead(model):
    model.solver.look_ahead(model)


def observe(model):
    """Whether the outputs are numbers: the energy has squares and products of the others, and overflows first."""
    march = model.solver
    model.observe(march.t, march.x, march.v, march.mode)
    return model.energy < inf


def report(model):
    model.solver.report(model.events)


def holds_together(model):
    """Whether a run that goes on can be in this state; what is not, may have no end."""
    march = model.solver
    step = march.step
    within = step.t0 <= march.t <= step.t1 <= step.t_end
    modes = -1 <= march.mode <= 1 and -1 <= step.mode0 <= 1 and -1 <= step.mode1 <= 1
    return within and modes and step.methods.chosen == march.method


# Every entry, with the numbers that it takes.
ENTRIES: dict = {
    prepare: [],
    start: [FLOAT, FLOAT, FLOAT],
    restart: [],
    rebase: [],
    advance: [FLOAT],
    look_ahead: [],
    observe: [],
    report: [],
    holds_together: [],
}
