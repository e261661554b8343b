"""Model exchange: what an importer's solver asks of an oscillator, and what happens at an event.

Continuous states are those of the model and, where there is one, the position of the driver: so nothing depends on the
time as such.  The modes of friction are discrete states.  They change in `update` only, so that the motion is smooth
between events, and stands exactly still where friction holds it.  An importer finds an event where an indicator of a
contact falls to zero, or at the time that it was told:

    to_rest          mode v while sliding, 1 while stuck
    to_break_away    limit - |load| while stuck, 1 while sliding

At an event that has been handled neither is zero, for solvers take a root there for one that stays: both fall to zero
just beyond the event.
"""

from math import fabs, inf, nan

from . import call_sequence
from .codes import DIVERGED, MODEL_EXCHANGE, OK, RUNNING, STUCK
from .integrator import DEFAULT_NOMINAL
from .rounding import EPSILON, ROUNDOFF_MARGIN
from .step_control import OVERFLOW_LIMIT, TIE_FACTOR
from .vectors import (
    ContactVector,
    all_of,
    any_of,
    contact_indices,
    contact_vector,
    magnitude,
    min_of,
    slip_index,
    state_indices,
    state_vector,
    sum_of,
    velocity_indices,
)

OVERSHOOT_TOLERANCE = 0.1  # share of a slip and what it is made of, by which an importer may find its end too late
INDICATOR_OFFSET, TINY = 4.0 * EPSILON, 1e-300  # of the limit; of a speed and a force
DEFAULT_TOLERANCE = 1e-4  # taken for the importer's, where it tells none


class ModelExchange:
    """What is read of it, as last asked for: rows over the continuous states and over the event indicators, all to rest
    before all to break away; the indicators one by one, and the rate of the driver; what an event has changed."""

    to_rest: ContactVector
    to_break_away: ContactVector

    def __init__(self, model):
        y, modes = state_vector(), contact_vector()
        for i in state_indices:
            y[i] = 0.0
        for i in contact_indices:
            modes[i] = 1.0
        self.states = [*y, 0.0] if model.has_driver else [*y]
        self.rates = [*y, 0.0] if model.has_driver else [*y]
        self.nominals = [*y, 0.0] if model.has_driver else [*y]
        self.indicators = [*modes, *modes, 1.0]  # the last is nobody's: C has no empty rows
        self.to_rest = self.to_break_away = 1.0
        self.driver_rate = self.nominal_velocity = 0.0
        self.states_changed = self.nominals_changed = False
        self.t_next_event = inf  # when a contact will break away, as far as can be known
        # a communication step in leaps: where it ends, whether a leap ended at an event, and what they may cost
        self.step_end = 0.0
        self.event_reached = False
        self.n_internal_steps = self.max_evals = 0


class ModelExchangeMixin:
    """A base before that of a model, which then owns an Exchange."""

    def __init__(self):
        super().__init__()
        self.model_exchange = ModelExchange(self)


def enable(run):
    """The instance is for model exchange."""
    run.interface, run.tolerance = MODEL_EXCHANGE, DEFAULT_TOLERANCE


def begin(model):
    """From here on the importer's solver steps: no internal step is in force, and none has been counted."""
    solver = model.solver
    step = solver.step
    start_counters = step.start_counters
    start_counters.n_accepted = start_counters.n_rejected = start_counters.n_rhs = 0
    step.t0, step.t1 = solver.t, nan
    update_nominals(model)


def prepare(run, model):
    """Whether the values can be used.  Status."""
    if run.phase >= RUNNING or run.has_failed:
        return call_sequence.prepare_to_step(run, model)
    if run.outputs_current:
        return OK
    return call_sequence.update_outputs(run, model)


def set_time(run, model, t):
    """The present time is t, the states stay."""
    run.outputs_current = False
    solver = model.solver
    solver.t = solver.step.t0 = t
    if model.has_driver:
        model.t_base = t


def set_continuous_states(run, model):
    """Take over the continuous states, which stand in their row; the driver's is at the present time, as it stays."""
    run.outputs_current = False
    exchange = model.model_exchange
    solver = model.solver
    for i in state_indices:
        solver.y[i] = exchange.states[i]
    if model.has_driver:
        model.x_base = exchange.states[len(solver.y)]


def update_states(model):
    """The continuous states."""
    exchange = model.model_exchange
    solver = model.solver
    for i in state_indices:
        exchange.states[i] = solver.y[i]
    if model.has_driver:
        exchange.states[len(solver.y)] = model.x_base


def update_nominals(model):
    """The sizes of the states below which a tolerance is absolute: those of our own solver where nobody sets them."""
    exchange = model.model_exchange
    solver = model.solver
    exchange.nominal_velocity = model.nominal_velocity()
    for i in state_indices:
        exchange.nominals[i] = DEFAULT_NOMINAL
    for i in velocity_indices:
        exchange.nominals[i] = (
            exchange.nominal_velocity if exchange.nominal_velocity < DEFAULT_NOMINAL else DEFAULT_NOMINAL
        )
    if model.has_driver:
        exchange.nominals[len(solver.y)] = DEFAULT_NOMINAL


def update_rates(model):
    """The derivatives of the continuous states."""
    exchange = model.model_exchange
    solver = model.solver
    y = solver.y
    if model.rests_when_stuck and solver.step.is_hybrid and all_of(solver.modes == STUCK):
        for i in state_indices:
            exchange.rates[i] = 0.0
    else:
        f = model.rates(solver.t, y, solver.modes)
        for i in state_indices:
            exchange.rates[i] = f[i]
    if model.has_driver:
        exchange.rates[len(y)] = model.driver_velocity()


def update_input_rates(model):
    """Set the rates of the inputs that have any."""
    if model.has_input_derivatives:
        model.set_input_rates(model.solver.t)


def update_indicators(model):
    """The event indicators; where the law of friction knows no modes, they are 1."""
    exchange = model.model_exchange
    solver = model.solver
    to_rest, to_break_away = contact_vector(), contact_vector()
    for i in contact_indices:
        to_rest[i] = to_break_away[i] = 1.0
    if model.has_dry_friction and solver.step.is_hybrid:
        if model.is_coupled:
            slips = model.slip_velocities(solver.t, solver.y)
            force, most, terms = model.contact_forces(solver.t, solver.y, solver.modes)
            for i in contact_indices:
                if solver.modes[i] != STUCK:
                    to_rest[i] = solver.modes[i] * slips[i] + TINY
                else:
                    slack = ROUNDOFF_MARGIN * (terms[i] + most[i])
                    to_break_away[i] = most[i] + slack + INDICATOR_OFFSET * most[i] + TINY - fabs(force[i])
        else:
            for i in contact_indices:
                if solver.modes[i] != STUCK:
                    to_rest[i] = solver.modes[i] * solver.y[slip_index[i]] + TINY
                else:
                    load, _, limit, slack = model.stick_balance(solver.t, solver.y, i)
                    to_break_away[i] = limit + slack + INDICATOR_OFFSET * limit + TINY - fabs(load)
    for i in contact_indices:
        exchange.indicators[i] = to_rest[i]
        exchange.indicators[len(solver.modes) + i] = to_break_away[i]


def update_variables(model):
    """Set what is read like a variable."""
    exchange = model.model_exchange
    solver = model.solver
    if model.has_dry_friction:
        update_indicators(model)
        for i in contact_indices:
            exchange.to_rest[i], exchange.to_break_away[i] = (
                exchange.indicators[i],
                exchange.indicators[len(solver.modes) + i],
            )
    if model.has_driver:
        exchange.driver_rate = model.driver_velocity()


def handle_event(run, model):
    """An event is handled: `jumped` and `rescaled` tell the importer what is new, `due` when the next is.  Status.

    What was set makes another motion, as a new mode does: some importers restart their solver only where a state is
    said to have jumped, and an input that jumps ends their run.
    """
    exchange = model.model_exchange
    solver = model.solver
    exchange.states_changed = exchange.nominals_changed = run.outputs_current = False
    status = call_sequence.prepare_to_step(run, model)
    if status != OK or run.interface != MODEL_EXCHANGE:  # co-simulation goes on with what was set
        return status
    if not sum_of(magnitude(solver.y)) < OVERFLOW_LIMIT:
        return DIVERGED
    nominal_velocity = exchange.nominal_velocity
    update_nominals(model)
    exchange.nominals_changed = exchange.nominal_velocity != nominal_velocity
    exchange.states_changed, run.values_changed = run.values_changed, False
    if model.has_dry_friction and solver.step.is_hybrid:
        if update_modes(model, solver):
            exchange.states_changed = True
        exchange.t_next_event = next_breakaway(model, solver)
    return OK if sum_of(magnitude(solver.y)) < OVERFLOW_LIMIT else DIVERGED


def update_modes(model, solver):
    """Let the modes follow the present point; whether the motion is another from here on, as solvers must know.

    The speed is set to zero where a slide has ended.  Without a reason for an event nothing changes, nor does it the
    second time.
    """
    tie_tolerance = TIE_FACTOR * solver.step.tolerance
    another = changed = False
    fits = True
    if model.is_coupled:
        y, modes, fits = model.resolve_at_start(solver.t, solver.y, solver.modes, tie_tolerance, OVERSHOOT_TOLERANCE)
        another, changed = any_of(y != solver.y), any_of(modes != solver.modes)
        solver.y, solver.modes = y, modes
    else:
        for i in contact_indices:
            mode = solver.modes[i]
            if not mode * solver.y[slip_index[i]] > 0.0:
                if mode != STUCK and solver.y[slip_index[i]] != 0.0:
                    solver.y[slip_index[i]] = 0.0
                    another = True
                if not model.is_grazing(solver.t, solver.y, solver.modes, 0.0, i):
                    solver.modes[i] = model.resolve_mode(solver.t, solver.y, tie_tolerance, i)
                if solver.modes[i] == STUCK and solver.t >= model.model_exchange.t_next_event:
                    load, rate, limit = model.stick_load(solver.t, solver.y, i)  # due, but for rounding
                    if load * rate > 0.0 and limit - fabs(load) <= tie_tolerance * limit:
                        solver.modes[i] = 1 if rate > 0.0 else -1
                if solver.modes[i] != mode:
                    changed = True
                    if solver.modes[i] != STUCK and solver.y[slip_index[i]] == 0.0:
                        fits = fits and model.is_consistent(solver.t, solver.y, solver.modes, i)
    if not fits:
        for i in state_indices:
            solver.y[i] = nan  # no motion obeys the equations
    if changed:
        solver.step.start_counters.n_events += 1
        solver.step.start_counters.t_event = solver.t
    return another or changed


def next_breakaway(model, solver):
    """When a contact breaks away if nothing but the driver moves; inf if it never does."""
    if not (model.rests_when_stuck and all_of(solver.modes == STUCK)):
        return inf
    ends, ways = contact_vector(), contact_vector()
    for i in contact_indices:
        ends[i], ways[i] = model.breakaway_time(solver.t, solver.y, i)
    return min_of(ends)
