"""Short dips and pulses of periodic functions, which no error of a state shows, are found at rest."""

import numpy as np
import pytest
from internal_steps import compute_step, prepared_run, start
from models import DOP853, ODE23, ODE45, RODAS
from variants import campaign_after, slow_after

from fmus.compiler.lowering import lowered_model

HELD_BLOCK = '''
from fmus import Contact, Input, Mode, Model, Output, Parameter, State, Table, cos, exp, tanh


class HeldBlock(Model):
    """Block on an incline whose holding limit dips in short periodic pulses."""

    m = Parameter(1.0, "kg", "mass", above=0.0)
    F0 = Parameter(3.0, "N", "load")
    N = Parameter(10.0, "N", "normal force", low=0.0)
    D = Parameter(8.0, "N", "depth of a dip", low=0.0)
    p = Parameter(200.0, "1", "sharpness", low=0.0)
    mu = Parameter(0.5, "1", "coefficient of friction", low=0.0)
    {clock}
    x = State("m", "position")
    v = State("m/s", "speed", rate_of=x)
    mode = Mode()
    dip = {dip}
    F = Contact("N", "friction", mode=mode, slip=v, slide=mu * (N - D * dip))
    a = Output("m/s2", "acceleration", (F0 - F) / m, rate_of=v)
    stop_time = 40.0
'''
CONSTANT = """
    Om = Parameter(2.0, "rad/s", "frequency")
    phase = State("rad", "phase", rate=Om)
"""
OTHER_CLOCKS = {
    "input with a declared rate": """
    Om = Input(2.0, "rad/s", "frequency")
    phase = Input(0.0, "rad", "phase", rate=Om)
""",
    "state whose rate is an input": """
    Om = Input(2.0, "rad/s", "frequency")
    phase = State("rad", "phase", rate=Om)
""",
    "state that speeds up from rest": """
    alpha = Parameter(0.1, "rad/s2", "acceleration")
    Om = State("rad/s", "frequency", rate=alpha)
    phase = State("rad", "phase")
    phase_rate = Output("rad/s", "rate of the phase", Om, rate_of=phase)
""",
    "position that coasts": """
    T = Parameter(1e9, "s", "time constant of the brake", above=0.0)
    phase = State("rad", "phase")
    Om = State("rad/s", "frequency", start=2.0, rate_of=phase)
    Om_rate = Output("rad/s2", "deceleration", -Om / T, rate_of=Om)
""",
}
TIME = """
    clock = State("s", "time", rate=1.0)
    curve = Table({x}, {y}, "s", "1", interpolation="{interpolation}")
"""
DIPS = {
    "gaussian": "exp(-p * (1.0 - cos(phase)))",
    "lorentzian": "1.0 / (1.0 + p * (1.0 - cos(phase)) * (1.0 - cos(phase)))",
    "hyperbolic": "1.0 - tanh(p * (1.0 - cos(phase)))",
}


@pytest.fixture(scope="module", params=slow_after(1, DIPS))
def held_block(request, tmp_path_factory):
    return lower(tmp_path_factory.mktemp("models"), CONSTANT, DIPS[request.param])


def lower(folder, clock, dip):
    """Return the class of a model whose holding limit has this dip over this clock."""
    path = folder / "held_block.py"
    path.write_text(HELD_BLOCK.format(clock=clock.strip(), dip=dip))
    return lowered_model(path)


def count_dips(cls, values):
    """Return how often the block slides, from the start or after a rest."""
    model = cls()
    run = prepared_run(model, values)
    start(model, run, model.initial_state(0.0), 40.0)
    step, slides = run.solver.step, int(run.solver.step.modes1_mode != 0)
    while step.t1 < 40.0:
        assert compute_step(model, run) == 0
        slides += int(step.event_at_end and step.modes0_mode == 0 and step.modes1_mode != 0)
    return slides


@pytest.mark.parametrize(
    ("method", "rtol", "p"),
    slow_after(2, [(DOP853, 1e-9, 1000.0), (RODAS, 1e-4, 50.0), (ODE23, 1e-4, 1000.0), (ODE45, 1e-6, 200.0)]),
)
def test_no_dip_of_a_limit_is_missed(held_block, method, rtol, p):
    """The block starts in a dip, and there are 12 more in 40 s, each shorter than 10 % of the period."""
    for h_max in (0.0, 1e4):
        assert (
            count_dips(held_block, {"solver.method": method, "solver.rtol": rtol, "solver.h_max": h_max, "p": p}) == 13
        )


@pytest.mark.parametrize("clock", campaign_after(1, OTHER_CLOCKS))
def test_no_dip_over_a_clock_whose_rate_is_known_at_rest_is_missed(clock, tmp_path):
    cls = lower(tmp_path, OTHER_CLOCKS[clock], DIPS["gaussian"])
    for method in (ODE23, DOP853, RODAS):
        for h_max in (0.0, 1e4):
            assert count_dips(cls, {"solver.method": method, "solver.rtol": 1e-6, "solver.h_max": h_max}) == 13


@pytest.mark.parametrize("interpolation", slow_after(1, ["linear", "pchip"]))
def test_no_dip_of_a_table_is_missed(interpolation, tmp_path):
    """The end of each piece of a table is an event, so that a dip between three rows may be short."""
    dips = np.arange(3.0, 40.0, 3.0)
    x = np.sort(np.concatenate([[0.0, 40.0], dips - 0.01, dips, dips + 0.01]))
    clock = TIME.format(x=x.tolist(), y=np.isin(x, dips).astype(float).tolist(), interpolation=interpolation)
    cls = lower(tmp_path, clock, "curve(clock * p / 200.0)")
    for method in (ODE23, DOP853, RODAS):
        assert count_dips(cls, {"solver.method": method, "solver.h_max": 1e4}) == len(dips)


def test_rest_far_from_a_dip_costs_few_steps(held_block):
    """Steps approach a dip geometrically."""
    model = held_block()
    run = prepared_run(model, {"solver.method": DOP853, "p": 1000.0, "D": 1.0})
    start(model, run, model.initial_state(0.0), 40.0)
    step = run.solver.step
    while step.t1 < 40.0:
        assert compute_step(model, run) == 0
    assert step.start_counters.n_events == 0
    assert step.n_accepted < 13 * 80
    assert np.isfinite(step.y1_x)
