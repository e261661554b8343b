"""Model exchange: derivatives, event indicators and event handling for the solver of an importer.

The continuous states are those of the model and the position of the driver, if there is one; nothing depends on time
explicitly.  The modes of friction are discrete states, which change in `update_modes` only.  So the motion is smooth
between events, and exactly at rest while it sticks.  An event occurs at `t_next_event`, or where an indicator of a
contact falls to zero:

    to_rest          mode * v while sliding, 1 while stuck
    to_break_away    limit - |load| while stuck, 1 while sliding

or of a condition of the equations falls to zero.  All indicators fall to zero slightly beyond the event, because some
solvers report a zero at the current time as another event.
"""

from math import fabs, inf, nan

from . import call_sequence, conditions, contact_lcp, event_location, planar_contact, stick_slip
from .codes import DIVERGED, EPSILON, EVENT, MODEL_EXCHANGE, NO_CONSISTENT_MODES, OK, ROUNDOFF_MARGIN, RUNNING, STUCK
from .conditions import SHORTEST_DWELL
from .run_state import RunState
from .step_end import OVERFLOW_LIMIT, TIE_FACTOR
from .vectors import (
    ContactVector,
    StateVector,
    all_of,
    any_of,
    contact_indices,
    contact_vector,
    is_planar,
    magnitude,
    min_of,
    planar_indices,
    slip_index,
    state_indices,
    state_vector,
    sum_of,
    velocity_indices,
)

OVERSHOOT_TOLERANCE = 0.1  # slip velocities of the wrong sign up to this share of their terms are overshoot
UNLIMITED_TOLERANCE = 1e300  # the same for slips of which the importer has seen that they are overshoot
INDICATOR_OFFSET = 4.0 * EPSILON  # relative to the limit, or to the terms of a slip
TINY = 1e-300  # absolute offset of velocities and forces
DEFAULT_NOMINAL = 1e-3  # nominal position (m, rad) and velocity (m/s, rad/s) by default
DEFAULT_TOLERANCE = 1e-4  # relative tolerance if the importer gives none


class ExchangeBuffers:
    """Buffers of the model-exchange interface.

    `states`, `rates` and `nominals` run over the continuous states, `indicators` over the event indicators: first
    `to_rest` of all contacts, then `to_break_away`, then the conditions of the equations.
    """

    to_rest: ContactVector
    to_break_away: ContactVector
    slip_errors: ContactVector

    def __init__(self, model):
        y, modes = state_vector(), contact_vector()
        for i in state_indices:
            y[i] = 0.0
        for i in contact_indices:
            modes[i] = 1.0
        self.states = [*y, 0.0] if model.has_driver else [*y]
        self.rates = [*y, 0.0] if model.has_driver else [*y]
        self.nominals = [*y, 0.0] if model.has_driver else [*y]
        self.indicators = [1.0] * (model.n_event_functions + 1)  # the last one is unused: C has no empty arrays
        self.to_rest = self.to_break_away = 1.0
        self.slip_errors = 0.0  # slips against the modes before an event, which are errors of the importer's solver
        self.conditions = [1.0] * (model.n_event_functions - model.first_condition + 1)  # indicators of conditions
        self.driver_rate = self.nominal_velocity = 0.0
        self.states_changed = self.nominals_changed = False
        self.time = 0.0  # as the importer counts it
        self.t_next_event = inf  # the same of the next break-away, as far as it is known
        # communication step with early return: end, event reached, internal steps and limit of evaluations
        self.step_end = 0.0
        self.event_reached = False
        self.n_internal_steps = self.max_evals = 0


class ModelExchangeRun(RunState):
    """State of a run, with the buffers of the model-exchange interface."""

    def __init__(self, model):
        super().__init__(model)
        self.model_exchange = ExchangeBuffers(model)


def enable(run):
    """Configure an instance for model exchange."""
    run.interface, run.tolerance = MODEL_EXCHANGE, DEFAULT_TOLERANCE


def begin(run, model):
    """Hand over to the solver of the importer: there is no internal step, and its counters are zero."""
    solver = run.solver
    step = solver.step
    start_counters = step.start_counters
    start_counters.n_accepted = start_counters.n_rejected = start_counters.n_rhs = 0
    step.t0, step.t1 = solver.t, nan
    step.h_next = 0.0
    run.model_exchange.time = solver.start_time + solver.t
    step.active_method.error_scale_floor = DEFAULT_NOMINAL  # the importer's solver works with nominal values
    update_nominals(run, model)


def prepare(run, model):
    """Apply pending changes before the model is evaluated.  Returns a status."""
    if run.phase >= RUNNING or run.has_failed:
        for i in planar_indices:
            solver = run.solver
            solver.modes[i] = planar_contact.trial_mode(model, solver.t, solver.y, solver.modes, i)
        return call_sequence.prepare_to_step(run, model)
    if run.outputs_current:
        return OK
    return call_sequence.update_outputs(run, model)


def set_time(run, model, t):
    """Set the time; the states stay."""
    run.outputs_current = False
    run.model_exchange.time = t
    solver = run.solver
    solver.t = solver.step.t0 = t - solver.start_time
    if model.has_driver or model.has_input_derivatives:
        model.t_base = solver.t


def set_continuous_states(run, model):
    """Copy the continuous states from their buffer into the model, at the current time."""
    run.outputs_current = False
    exchange = run.model_exchange
    solver = run.solver
    for i in state_indices:
        solver.y[i] = exchange.states[i]
    if model.has_driver:
        model.x_base = exchange.states[len(solver.y)]


def update_states(run, model):
    """Update the buffer of the continuous states."""
    exchange = run.model_exchange
    solver = run.solver
    for i in state_indices:
        exchange.states[i] = solver.y[i]
    if model.has_driver:
        exchange.states[len(solver.y)] = model.x_base


def update_nominals(run, model):
    """Update the nominal values of the continuous states, with the defaults of the internal solver."""
    exchange = run.model_exchange
    solver = run.solver
    exchange.nominal_velocity = model.nominal_velocity()
    for i in state_indices:
        exchange.nominals[i] = DEFAULT_NOMINAL
    for i in velocity_indices:
        exchange.nominals[i] = (
            exchange.nominal_velocity if exchange.nominal_velocity < DEFAULT_NOMINAL else DEFAULT_NOMINAL
        )
    if model.has_driver:
        exchange.nominals[len(solver.y)] = DEFAULT_NOMINAL


def update_rates(run, model):
    """Update the derivatives of the continuous states."""
    exchange = run.model_exchange
    solver = run.solver
    y = solver.y
    if model.rests_when_stuck and solver.step.is_hybrid and all_of(solver.modes == STUCK):
        for i in state_indices:
            exchange.rates[i] = 0.0
    else:
        modes = solver.modes
        if model.has_other_laws and not solver.step.is_hybrid:
            modes = STUCK * modes
        f = model.rates(solver.t, y, modes)
        for i in planar_indices:
            planar_contact.note_trial(model, solver.t, y, i)
        for i in state_indices:
            exchange.rates[i] = f[i]
    if model.has_driver:
        exchange.rates[len(y)] = model.driver_velocity()


def update_input_rates(run, model):
    """Update the rates of inputs that have derivatives."""
    if model.has_input_derivatives:
        model.set_input_rates(run.solver.t)


def update_indicators(run, model):
    """Update the event indicators; they are 1 if the friction law has no modes."""
    exchange = run.model_exchange
    solver = run.solver
    to_rest, to_break_away = contact_vector(), contact_vector()
    for i in contact_indices:
        to_rest[i] = to_break_away[i] = 1.0
    if solver.step.is_hybrid:
        if model.is_coupled:
            slips = model.slip_velocities(solver.t, solver.y)
            sizes = model.slip_magnitudes(solver.t, solver.y)
            force, limit, _sizes, terms = model.contact_forces(solver.t, solver.y, solver.modes)
            if run.phase != EVENT:
                for i in contact_indices:
                    is_monitored = solver.modes[i] == STUCK or not (force[i] == 0.0 and limit[i] == 0.0)
                    is_error = is_monitored and solver.modes[i] * slips[i] <= 0.0
                    exchange.slip_errors[i] = fabs(slips[i]) if is_error else 0.0
            for i in contact_indices:
                if solver.modes[i] != STUCK:
                    if not (force[i] == 0.0 and limit[i] == 0.0):  # without friction, a reversal is no event
                        # after an event the slip is zero but for rounding errors, of either sign
                        to_rest[i] = solver.modes[i] * slips[i] + INDICATOR_OFFSET * sizes[i] + TINY
                        if is_planar[i]:
                            to_rest[i] = planar_contact.progress(model, solver.t, solver.y, i) - model.approach[i]
                            to_rest[i] = (to_rest[i] + INDICATOR_OFFSET * sizes[i] + TINY) / model.unit_slip[i]
                            to_break_away[i] = planar_contact.growth_left(model, solver.t, solver.y, i)
                else:
                    slack = ROUNDOFF_MARGIN * terms[i]
                    to_break_away[i] = limit[i] + slack + INDICATOR_OFFSET * limit[i] + TINY - fabs(force[i])
        else:
            for i in contact_indices:
                if solver.modes[i] != STUCK:
                    to_rest[i] = solver.modes[i] * solver.y[slip_index[i]] + TINY
                else:
                    load, _, limit, slack = stick_slip.stick_balance(model, solver.t, solver.y, i)
                    to_break_away[i] = limit + slack + INDICATOR_OFFSET * limit + TINY - fabs(load)
    for i in contact_indices:
        exchange.indicators[i] = to_rest[i]
        exchange.indicators[len(solver.modes) + i] = to_break_away[i]
    if model.has_conditions:
        location = solver.step.event_location
        event_location.update_event_functions(model, location, solver.t, solver.y, solver.modes)
        for j in range(model.n_event_functions - model.first_condition):
            k = model.first_condition + j
            exchange.indicators[k] = location.values[k]


def update_variables(run, model):
    """Update the buffers that are read as variables: time, indicators and rate of the driver."""
    exchange = run.model_exchange
    solver = run.solver
    if run.interface != MODEL_EXCHANGE:
        exchange.time = solver.start_time + solver.t
    if model.has_dry_friction or model.has_conditions:
        update_indicators(run, model)
        for i in contact_indices:
            exchange.to_rest[i], exchange.to_break_away[i] = (
                exchange.indicators[i],
                exchange.indicators[len(solver.modes) + i],
            )
    if model.has_conditions:
        for j in range(model.n_event_functions - model.first_condition):
            exchange.conditions[j] = exchange.indicators[model.first_condition + j]
    if model.has_driver:
        exchange.driver_rate = model.driver_velocity()


def handle_event(run, model):
    """Handle an event; set `states_changed`, `nominals_changed` and `t_next_event`.  Returns a status.

    Changed parameters and inputs also report `states_changed`: some importers restart their solver only then, and fail
    at an input with a jump otherwise.
    """
    exchange = run.model_exchange
    solver = run.solver
    exchange.states_changed = exchange.nominals_changed = run.outputs_current = False
    status = call_sequence.prepare_to_step(run, model)
    if status != OK or run.interface != MODEL_EXCHANGE:  # co-simulation continues with the new values
        return status
    if not sum_of(magnitude(solver.y)) < OVERFLOW_LIMIT:
        return DIVERGED
    nominal_velocity = exchange.nominal_velocity
    update_nominals(run, model)
    exchange.nominals_changed = exchange.nominal_velocity != nominal_velocity
    exchange.states_changed, run.values_changed = run.values_changed, False
    if model.has_conditions:
        location = solver.step.event_location
        conditions.update_at_event(model, location, solver.t, solver.y, solver.modes)
        if conditions.have_changed(model, location):
            exchange.states_changed = True
            is_brief = solver.t - location.t_condition <= SHORTEST_DWELL * solver.t
            status = conditions.count_changes(location, solver.t, is_brief)
            if status != OK:
                return status
    if model.has_dry_friction:
        solver.step.event_location.has_consistent_modes = True
    if solver.step.is_hybrid:
        if update_modes(run, model):
            exchange.states_changed = True
        elapsed = next_breakaway(model, solver)
        exchange.t_next_event = solver.start_time + elapsed
    if model.has_other_laws and has_other_modes(run, model):
        solver.modes = model.law_modes(solver.t, solver.y)
        solver.step.start_counters.n_events += 1
        solver.step.start_counters.t_event = solver.t
    if model.has_conditions:
        conditions.check_limits(model, solver.step.event_location, solver.t, solver.y, solver.modes)
        status = conditions.violation_status(model, solver.step.event_location)
        if status != OK:
            return status
    if model.has_dry_friction and not solver.step.event_location.has_consistent_modes:
        return NO_CONSISTENT_MODES
    return OK if sum_of(magnitude(solver.y)) < OVERFLOW_LIMIT else DIVERGED


def complete_step(run, model):
    """Check the current point, which the importer's solver has accepted.  Returns a status.

    Trial points without finite results are none of its solution; an accepted one is a run that diverges.
    """
    status = prepare(run, model)
    if status != OK:
        return status
    if not sum_of(magnitude(run.solver.y)) < OVERFLOW_LIMIT:
        return DIVERGED
    for i in planar_indices:
        solver = run.solver
        planar_contact.complete_step(model, solver.t, solver.y, solver.modes, i)
    return call_sequence.update_outputs(run, model)


def has_step_event(run, model):
    """Return whether an event is due after a step of the importer's solver.

    A law without stick and slip has no event indicators: where it chatters, a solver would find a zero of them in every
    step.  The last phase of a slip in a plane follows an event so closely that some solvers do not find its end.
    """
    solver = run.solver
    is_due = model.has_other_laws and has_other_modes(run, model)
    for i in planar_indices:
        is_due = is_due or planar_contact.ends_last_phase(model, solver.t, solver.y, solver.modes, i)
    return is_due


def has_other_modes(run, model):
    """Return whether a mode differs from that of a law without stick and slip."""
    solver = run.solver
    if model.has_other_laws and not solver.step.is_hybrid:
        modes = model.law_modes(solver.t, solver.y)
        return any_of(modes != solver.modes)
    return False


def update_modes(run, model):
    """Update the modes at the current time; return whether the solver must restart.

    The slip velocity is set to zero where slip ends.  Without a cause nothing changes, so a second call has no effect.
    """
    solver = run.solver
    exchange = run.model_exchange
    tie_tolerance = TIE_FACTOR * solver.step.tolerance
    needs_restart = has_changed = False
    step = solver.step
    if model.is_coupled:
        y = contact_lcp.follow_inputs(model, solver.t, solver.y, solver.modes, exchange.slip_errors)
        for i in planar_indices:
            if solver.modes[i] != STUCK:
                y = planar_contact.stop_passing(model, step, solver.t, y, solver.modes, i)
                solver.modes[i] = 1
        y, modes, step.event_location.has_consistent_modes = contact_lcp.resolve_at_start(
            model, step, solver.t, y, solver.modes, tie_tolerance, overshoot_share(run, model, y)
        )
        needs_restart, has_changed = any_of(y != solver.y), any_of(modes != solver.modes)
        solver.y, solver.modes = y, modes
        for i in planar_indices:
            if planar_contact.begin_phase(model, step, solver.t, y, modes, i):
                needs_restart = True
    else:
        for i in contact_indices:
            last_mode = solver.modes[i]
            if not last_mode * solver.y[slip_index[i]] > 0.0:
                if last_mode != STUCK and solver.y[slip_index[i]] != 0.0:
                    solver.y[slip_index[i]] = 0.0
                    needs_restart = True
                if not stick_slip.is_grazing(model, step.event_location, solver.t, solver.y, solver.modes, 0.0, i):
                    solver.modes[i] = stick_slip.resolve_mode(model, solver.t, solver.y, tie_tolerance, i)
                if solver.modes[i] == STUCK and run.model_exchange.time >= run.model_exchange.t_next_event:
                    # the load is at the limit, except for rounding errors
                    load, rate, limit = model.stick_load(solver.t, solver.y, i)
                    if load * rate > 0.0 and limit - fabs(load) <= tie_tolerance * limit:
                        solver.modes[i] = 1 if rate > 0.0 else -1
                if solver.modes[i] != last_mode:
                    has_changed = True
                    if solver.modes[i] != STUCK and solver.y[slip_index[i]] == 0.0:
                        step.event_location.has_consistent_modes = stick_slip.is_consistent(
                            model, solver.t, solver.y, solver.modes, i
                        )
    if has_changed:
        solver.step.start_counters.n_events += 1
        solver.step.start_counters.t_event = solver.t
    return needs_restart or has_changed


def overshoot_share(run, model, y: StateVector):
    """Return up to which share of its terms a slip against its mode is overshoot of the importer's solver.

    What the last indicators showed is overshoot, however large after a fixed step. A larger slip is due to changed
    values, or to friction that sets in.
    """
    slips = model.slip_velocities(run.solver.t, y)
    for i in contact_indices:
        is_against = run.solver.modes[i] * slips[i] < 0.0
        if is_against and (is_planar[i] or fabs(slips[i]) > run.model_exchange.slip_errors[i]):
            return OVERSHOOT_TOLERANCE
    return UNLIMITED_TOLERANCE


def next_breakaway(model, solver):
    """Return after how many seconds of the run a contact breaks away if only the driver moves; inf if never."""
    if not (model.rests_when_stuck and all_of(solver.modes == STUCK)):
        return inf
    ends, directions = contact_vector(), contact_vector()
    for i in contact_indices:
        ends[i], directions[i] = stick_slip.breakaway_time(model, solver.t, solver.y, i)
    return min_of(ends)
