"""Short dips and pulses of periodic functions, which no error of a state shows, are found at rest."""

import numpy as np
import pytest
from internal_steps import prepared_run, start
from models import DOP853, ODE23, ODE45, RODAS

from fmus.compiler.lowering import lowered_model

HELD = '''
from fmus import Contact, Mode, Model, Output, Parameter, State, cos, exp


class Held(Model):
    """Block on an incline whose holding limit dips in short periodic pulses."""

    m = Parameter(1.0, "kg", "mass", above=0.0)
    F0 = Parameter(3.0, "N", "load")
    N = Parameter(10.0, "N", "normal force", low=0.0)
    D = Parameter(8.0, "N", "depth of a dip", low=0.0)
    p = Parameter(200.0, "1", "sharpness", low=0.0)
    mu = Parameter(0.5, "1", "coefficient of friction", low=0.0)
    Om = Parameter(2.0, "rad/s", "frequency")
    x = State("m", "position")
    v = State("m/s", "speed", rate_of=x)
    phase = State("rad", "phase", rate=Om)
    mode = Mode()
    dip = {dip}
    F = Contact("N", "friction", mode=mode, slip=v, slide=mu * (N - D * dip))
    a = Output("m/s2", "acceleration", (F0 - F) / m, rate_of=v)
    stop_time = 40.0
'''
DIPS = {
    "gaussian": "exp(-p * (1.0 - cos(phase)))",
    "lorentzian": "1.0 / (1.0 + p * (1.0 - cos(phase)) * (1.0 - cos(phase)))",
    "hyperbolic": "1.0 - tanh(p * (1.0 - cos(phase)))",
}


@pytest.fixture(scope="module", params=DIPS)
def held(request, tmp_path_factory):
    path = tmp_path_factory.mktemp("models") / f"held_{request.param}.py"
    path.write_text(HELD.format(dip=DIPS[request.param]).replace("cos, exp", "cos, exp, tanh"))
    return request.param, lowered_model(path)


def count_dips(cls, values):
    """Return how often the block slides."""
    model = cls()
    run = prepared_run(model, values)
    start(model, run, model.initial_state(0.0), 40.0)
    step, slides = run.solver.step, 1
    while step.t1 < 40.0:
        assert step.compute_next(model) == 0
        slides += int(step.event_at_end and step.modes0_mode == 0 and step.modes1_mode != 0)
    return slides


@pytest.mark.parametrize("rtol", [1e-4, 1e-6, 1e-9])
@pytest.mark.parametrize("method", [ODE23, ODE45, DOP853, RODAS])
@pytest.mark.parametrize("p", [50.0, 200.0, 1000.0])
def test_no_dip_of_a_limit_is_missed(held, method, rtol, p):
    """The block starts in a dip, and there are 12 more in 40 s, each shorter than 10 % of the period."""
    _name, cls = held
    for h_max in (0.0, 1e4):
        assert count_dips(cls, {"solver.method": method, "solver.rtol": rtol, "solver.h_max": h_max, "p": p}) == 13


def test_rest_far_from_a_dip_costs_few_steps(held):
    """Steps approach a dip geometrically."""
    _, cls = held
    model = cls()
    run = prepared_run(model, {"solver.method": DOP853, "p": 1000.0, "D": 1.0})
    start(model, run, model.initial_state(0.0), 40.0)
    step = run.solver.step
    while step.t1 < 40.0:
        assert step.compute_next(model) == 0
    assert step.start_counters.n_events == 0
    assert step.n_accepted < 13 * 80
    assert np.isfinite(step.y1_x)
