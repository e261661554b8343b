"""Record internal steps in Python: of the emitted scalar code of a model, and of the vector sources on lists."""

import struct
from importlib import import_module

import list_vectors

from fmus.compiler.lowering import component_name
from harness.simulation.embedded_model import create_run

COUNTS = ("n_accepted", "n_rejected", "n_rhs")


def prepared_run(model, values, run=None):
    """Return a run of a model, by default a new one, with these values of both set and the model prepared."""
    run = run or create_run(model)
    for variable, value in values.items():
        owner = run.solver if "." in variable else model
        setattr(owner, variable.split(".")[-1], value)
    assert model.prepare() == 0
    return run


def start(model, run, y, stop):
    run.solver.start(model, 0.0, *y, stop, run.tolerance)


def bits(numbers):
    """Return the bit patterns of numbers of any type; all NaNs are equal."""
    return [struct.pack("<d", float(value)) if value == value else b"NaN" for value in numbers]


def components(step, vector, names):
    """Return the components of a vector by their names."""
    return [getattr(step, component_name(vector, name)) for name in names]


def scalar_steps(model, values, stop, most):
    """Return for each internal step its end, states, rates, modes, next step size, counters, and the state in its
    middle."""
    run = prepared_run(model, values)
    start(model, run, model.initial_state(0.0), stop)
    dynamic = [state for state, rate in model.states.items() if rate not in model.states]

    def row(step):
        numbers = components(step, "y1", model.states) + components(step, "f1", dynamic)
        numbers += components(step, "modes1", model.contacts)
        return [step.t1, *numbers, step.h_next, *counts(step), *step.state_at(model, 0.5 * (step.t0 + step.t1))]

    return list(steps(model, run, row, stop, most))


def list_steps(source, values, stop, most):
    """Return the same for the vector sources, of a model file."""
    model = list_vectors.load_vector_model(source)
    run = prepared_run(model, values)
    start(model, run, [model.initial_state(0.0)], stop)

    def row(step):
        middle = step.state_at(model, 0.5 * (step.t0 + step.t1))
        rates = [step.f1[i] for i in list_vectors.computed_states()]
        return [step.t1, *step.y1, *rates, *step.modes1, step.h_next, *counts(step), *middle]

    return list(steps(model, run, row, stop, most))


def compute_step(model, run):
    """Compute the next internal step of a model, as the integrator does. Returns a status."""
    step = run.solver.step
    step_control = import_module(type(step).__module__.replace("internal_step", "step_control"))
    return step_control.compute_next(model, step)


def counts(step):
    return [*(getattr(step, name, 0) for name in COUNTS), getattr(step.interpolant, "n_event_evals", 0)]


def steps(model, run, row, stop, most):
    step = run.solver.step
    while step.t1 < stop and most:
        assert compute_step(model, run) == 0
        yield bits(row(step))
        most -= 1
