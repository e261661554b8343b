"""Three states, two contacts on separate bodies, and conditions, which the five models do not use."""

from itertools import cycle, product

import numpy as np
import pytest
from contact_references import PROBLEMS, reference_events
from internal_steps import bits, components, compute_step, list_steps, prepared_run, scalar_steps, start
from models import DOP853, LARGER_MODELS, ODE23, ODE45, RADAU9, RODAS, ROOT
from variants import slow_after

from fmus.compiler.lowering import lowered_model, select_features
from fmus.compiler.model_lookup import find_model
from harness.references.certified_reference import load_reference

MORE = ROOT / "fmus" / "more"
WITH_CONDITIONS = (ROOT / "tests" / "example_models" / "bumper.py", MORE / "elastoplastic.py")
FILES = {path.stem: path for path in (*LARGER_MODELS, *WITH_CONDITIONS)}
STOPS = {name: problem.stop for name, problem in PROBLEMS.items()}
STOPS |= {"lugre": 4.0, "bumper": 3.0, "elastoplastic": 3.0}
RTOL = {ODE23: 1e-6, ODE45: 1e-9, DOP853: 1e-11, RODAS: 1e-8, RADAU9: 1e-9}
EVERY_METHOD = pytest.mark.parametrize("method", RTOL)
STEPS = 200


def complete_model(file):
    """Return the lowered class of a model with all methods that can solve it."""
    source = find_model(file)
    return lowered_model(source, select_features(source, source.analysis.available_methods))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "method"), [*product(("sleds", "bumper"), RTOL), *zip(STOPS, cycle(RTOL), strict=False)]
)
def test_lists_and_scalars_give_the_same_bits_at_every_step(name, method):
    file, stop = FILES[name], STOPS[name]
    values = {"solver.method": method, "solver.rtol": 1e-5}
    scalars = scalar_steps(complete_model(file)(), values, stop, STEPS)
    assert scalars == list_steps(find_model(file), values, stop, STEPS)
    assert len(scalars) > 10


def integrate(name, method):
    """Run the lowered model; return the state at the stop, and time and modes of every event."""
    model, stop = complete_model(FILES[name])(), STOPS[name]
    run = prepared_run(
        model, {"solver.method": method, "solver.rtol": RTOL[method], "solver.atol": 1e-3 * RTOL[method]}
    )
    start(model, run, model.initial_state(0.0), stop)
    step, events = run.solver.step, []
    while step.t1 < stop:
        assert compute_step(model, run) == 0
        if step.event_at_end:
            events.append((step.t1, *components(step, "modes1", model.contacts)))
    return components(step, "y1", model.states), events


@EVERY_METHOD
def test_bristles_agree_with_an_independent_solver(method):
    reference = load_reference("lugre", MORE)
    truth = reference.states[reference.times.tolist().index(STOPS["lugre"])]
    final, _ = integrate("lugre", method)
    assert np.abs(np.array(final) - truth).max() < max(2e3 * RTOL[method] * np.abs(truth).max(), 1e-10)


@pytest.mark.parametrize(  # two methods for each model, in turn
    ("name", "method"), slow_after(2, zip(2 * [*PROBLEMS], cycle(RTOL), strict=False))
)
def test_contacts_stick_and_slip_as_in_an_independent_solver(name, method):
    events, end = reference_events(name)
    final, observed_events = integrate(name, method)
    assert [modes for _, *modes in observed_events] == [modes for _, *modes in events]
    assert observed_events
    tolerance = max(2e3 * RTOL[method], 1e-10)
    assert [t for t, *_ in observed_events] == pytest.approx([t for t, *_ in events], abs=tolerance)
    assert np.abs(np.array(final) - end).max() < tolerance


def test_a_stuck_sled_keeps_zero_speed_while_the_other_moves():
    model = lowered_model(FILES["sleds"])()
    run = prepared_run(model, {"solver.method": DOP853, "solver.rtol": 1e-9})
    start(model, run, model.initial_state(0.0), 16.0)
    step, n_stuck = run.solver.step, 0
    while step.t1 < 16.0:
        assert compute_step(model, run) == 0
        for mode, speed in ("mode_1", "v_1"), ("mode_2", "v_2"):
            if components(step, "modes0", [mode]) == [0]:
                speeds = components(step, "y0", [speed]) + components(step, "y1", [speed])
                assert bits(speeds) == bits([0.0, 0.0])
                n_stuck += 1
    assert n_stuck > 10
