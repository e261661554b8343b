"""A motion that returns to the edge of a condition from both sides ends the run; other small motions do not."""

import pytest
from internal_steps import compute_step, prepared_run, start
from models import DOP853, ODE23, ODE45, RODAS
from variants import slow_after

from fmus.compiler.lowering import lowered_model, sibling_module

BELTS = '''
from fmus import Contact, Fixed, Mode, Model, Output, Parameter, State, choose


class Belts(Model):
    """Block between two belts that push it to their common edge at x = 0, with losses."""

    m = Parameter(1.0, "kg", "mass", above=0.0)
    f = Parameter(5.0, "N", "friction", low=0.0)
    c = Parameter(1.0, "N.s/m", "damping", low=0.0)
    u = Parameter(1.0, "m/s", "speed of the belts")
    x0 = Fixed(-0.3, "m", "start")
    x = State("m", "position", start=x0)
    v = State("m/s", "speed", rate_of=x)
    mode = Mode()
    belt = choose(x > 0.0, -u, u)
    F = Contact("N", "friction", mode=mode, slip=v - belt, slide=f)
    a = Output("m/s2", "acceleration", (-F - c * v) / m, rate_of=v)
'''
RINGING = '''
from fmus import Model, Output, Parameter, State, choose


class Ringing(Model):
    """Decaying oscillator, with the time that it is above zero."""

    w = Parameter(20.0, "rad/s", "frequency")
    z = Parameter(1.0, "1/s", "decay")
    x = State("m", "position", start=1.0)
    v = State("m/s", "speed", rate_of=x)
    above = State("s", "time above zero")
    rate = Output("1", "rate of that time", choose(x > 0.0, 1.0, 0.0), rate_of=above)
    a = Output("m/s2", "acceleration", choose(x > 0.0, -4.0 * w * w * x, -w * w * x) - 2.0 * z * v, rate_of=v)
'''
METHODS = [ODE23, ODE45, DOP853, RODAS]


@pytest.fixture(scope="module")
def build(tmp_path_factory):
    folder = tmp_path_factory.mktemp("models")

    def build(name, text):
        (folder / f"{name}.py").write_text(text)
        return lowered_model(folder / f"{name}.py")

    return build


def follow(cls, values, duration, max_steps):
    """Return the status, the time and the number of steps at the end of a run."""
    model = cls()
    run = prepared_run(model, values)
    start(model, run, model.initial_state(0.0), duration)
    step, status = run.solver.step, 0
    while step.t1 < duration and status == 0 and step.n_accepted < max_steps:
        status = compute_step(model, run)
    return status, step.t1, step.n_accepted


@pytest.mark.campaign
@pytest.mark.parametrize("method", slow_after(2, METHODS))
def test_a_block_that_two_belts_push_to_their_edge_ends_the_run(build, method):
    """Its swings shrink, and their number grows without limit."""
    cls = build("belts", BELTS)
    status, t, _steps = follow(cls, {"solver.method": method}, 60.0, 40_000)
    assert status == sibling_module(cls, "runtime.codes").CHATTERING
    assert 5.0 < t < 30.0


@pytest.mark.parametrize("method", METHODS)
def test_a_block_that_swings_between_belts_without_losses_is_no_chattering(build, method):
    assert follow(build("belts", BELTS), {"solver.method": method, "c": 0.0}, 30.0, 40_000)[:2] == (0, 30.0)


@pytest.mark.parametrize("method", METHODS)
def test_an_oscillation_that_decays_below_the_tolerance_is_no_chattering(build, method):
    """More than 200 changes at amplitudes below 1e-8 of the first one, each after half a period."""
    cls = build("ringing", RINGING)
    assert follow(cls, {"solver.method": method, "solver.rtol": 1e-4}, 40.0, 100_000)[:2] == (0, 40.0)
