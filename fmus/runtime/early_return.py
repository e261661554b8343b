"""A communication step in leaps, for an importer that handles events itself or looks inside: each goes to the end of an
internal step, so that none passes an event.

An event at the end of a leap may wait to be handled: until then the outputs are those before it.
"""

from . import call_sequence
from .codes import BAD_STEP, OK, TOO_MANY_STEPS
from .integrator import MAX_EVALUATIONS, MAX_STEPS


def begin_step(run, model, t, h):
    """Begin a communication step of h from t.  Status."""
    status = call_sequence.prepare_to_step(run, model)
    if status != OK:
        return status
    exchange = model.model_exchange
    solver = model.solver
    step = solver.step
    exchange.step_end = call_sequence.communication_step_end(run, solver, t, h)
    if not exchange.step_end >= solver.t:
        return BAD_STEP
    exchange.n_internal_steps = 0
    exchange.max_evals = step.n_rhs + step.interpolant.n_event_evals + MAX_EVALUATIONS
    exchange.event_reached = run.outputs_current = False
    if solver.t >= step.t1:
        solver.move_to_step_end()
    return OK


def next_internal_step(run, model, defer_events):
    """Go on to the end of an internal step, or to that of the communication step; whether an event there waits to be
    handled.  Status."""
    exchange = model.model_exchange
    solver = model.solver
    step = solver.step
    run.outputs_current = False
    status = call_sequence.prepare_to_step(run, model)  # an input may have been set here
    if status == OK and solver.t >= step.t1:
        status = step.compute_next(model)
    if status != OK:
        return status
    exchange.n_internal_steps += 1
    if exchange.n_internal_steps > MAX_STEPS or step.n_rhs + step.interpolant.n_event_evals > exchange.max_evals:
        return TOO_MANY_STEPS
    status = solver.advance(model, exchange.step_end if exchange.step_end < step.t1 else step.t1)
    if model.has_dry_friction:
        exchange.event_reached = step.event_at_end and solver.t >= step.t1
        if defer_events and exchange.event_reached:
            solver.modes = step.modes0
    return status


def complete_event(run, model):
    """The event at the present point takes place."""
    solver = model.solver
    run.outputs_current = False
    if solver.t >= solver.step.t1:
        solver.move_to_step_end()
