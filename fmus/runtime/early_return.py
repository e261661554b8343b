"""Communication steps of FMI 3.0 with early return and intermediate updates: one internal step at a time.

No internal step passes an event.  An event may be deferred until the importer handles it; until then the outputs are
those before the event.
"""

from . import call_sequence, conditions, step_control
from .codes import BAD_STEP, FAILED, OK, TOO_MANY_STEPS
from .integrator import MAX_EVALUATIONS, MAX_STEPS


def begin_step(run, model, t, h):
    """Begin a communication step of size h at t.  Returns a status."""
    status = call_sequence.prepare_to_step(run, model)
    if status != OK:
        return status
    exchange = run.model_exchange
    solver = run.solver
    step = solver.step
    exchange.step_end = call_sequence.communication_step_end(run, solver, t, h)
    if not exchange.step_end >= solver.t:
        return BAD_STEP
    if model.counts_jumps:
        model.count_jumps()
    exchange.n_internal_steps = 0
    exchange.max_evals = step.n_rhs + step.interpolant.n_event_evals + MAX_EVALUATIONS
    exchange.event_reached = run.outputs_current = False
    if solver.t >= step.t1:
        solver.move_to_step_end(model)
    return OK


def next_internal_step(run, model, defer_events):
    """Advance to the end of the internal step or of the communication step, whichever is first.  Returns a status.

    With `defer_events`, an event there is left to the importer (`event_reached`).
    """
    exchange = run.model_exchange
    solver = run.solver
    step = solver.step
    run.outputs_current = False
    status = call_sequence.prepare_to_step(run, model)  # an input may have changed
    if status == OK and solver.t >= step.t1:
        status = step_control.compute_next(model, step)
    if status != OK:
        return status
    exchange.n_internal_steps += 1
    if exchange.n_internal_steps > MAX_STEPS or step.n_rhs + step.interpolant.n_event_evals > exchange.max_evals:
        return TOO_MANY_STEPS
    status = solver.advance(model, exchange.step_end if exchange.step_end < step.t1 else step.t1)
    if model.has_dry_friction:
        exchange.event_reached = step.event_at_end and solver.t >= step.t1
    if model.has_conditions:
        exchange.event_reached = exchange.event_reached or (
            solver.t >= step.t1 and conditions.have_changed(model, step.event_location)
        )
    if defer_events and exchange.event_reached:
        if model.has_dry_friction:
            solver.modes = step.modes0
        if model.has_conditions:
            conditions.select_sides(model, step.event_location, False)
    return status


def end_step(run, model):
    """Apply the inputs set in the last intermediate update.  Returns a status; a step without finite outputs fails."""
    if run.has_failed:
        return FAILED
    if not run.has_pending_changes:
        return OK
    return call_sequence.update_outputs(run, model)


def complete_event(run, model):
    """Complete a deferred event at the current time."""
    solver = run.solver
    run.outputs_current = False
    if solver.t >= solver.step.t1:
        solver.move_to_step_end(model)
