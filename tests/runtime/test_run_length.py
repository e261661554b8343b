"""The length of the run decides nothing: `solver.h_max`, a tenth of the run by default, limits steps and no more."""

import numpy as np
import pytest
from internal_steps import compute_step, prepared_run, start
from models import DOP853, ODE23, ODE45, RODAS
from variants import slow_after

from fmus.compiler.lowering import lowered_model

PUSHED_OSCILLATOR = '''
from fmus import Contact, Mode, Model, Output, Parameter, State, cos


class PushedOscillator(Model):
    """Oscillator with friction, drive and integral of its position; a force B pushes it from rest for a moment."""

    m = Parameter(1.0, "kg", "mass", above=0.0)
    k = Parameter(100.0, "N/m", "stiffness", low=0.0)
    f = Parameter(0.5, "N", "friction", low=0.0)
    c = Parameter(0.5, "N.s/m", "damping", low=0.0)
    A = Parameter(1.0, "N", "drive")
    B = Parameter(0.0, "N", "push")
    tau = Parameter(1e-3, "s", "decay of the push", above=0.0)
    Om = Parameter(5.0, "rad/s", "frequency")
    x = State("m", "position")
    v = State("m/s", "speed", rate_of=x)
    E = State("m.s", "integral")
    p = State("N", "push", start=B)
    phase = State("rad", "phase", rate=Om)
    mode = Mode()
    dE = Output("m", "rate of the integral", x, rate_of=E)
    dp = Output("N/s", "rate of the push", -p / tau, rate_of=p)
    F = Contact("N", "friction", mode=mode, slip=v, slide=f)
    a = Output("m/s2", "acceleration", (A * cos(phase) + p - k * x - c * v - F) / m, rate_of=v)
'''
HUNTING = '''
from fmus import Contact, Mode, Model, Output, Parameter, State


class Hunting(Model):
    """Axis with constant friction under integral control."""

    m = Parameter(2.0, "kg", "mass", above=0.0)
    r = Parameter(0.01, "m", "set point")
    K_p = Parameter(5e3, "N/m", "proportional gain", low=0.0)
    K_i = Parameter(2e4, "N/(m.s)", "integral gain", low=0.0)
    K_d = Parameter(50.0, "N.s/m", "derivative gain", low=0.0)
    F_s = Parameter(13.015, "N", "friction", low=0.0)
    x = State("m", "position")
    v = State("m/s", "speed", rate_of=x)
    E = State("m.s", "integral")
    mode = Mode()
    e = Output("m", "error", r - x, rate_of=E)
    F = Output("N", "controller", K_p * e - K_d * v + K_i * E)
    F_f = Contact("N", "friction", mode=mode, slip=v, slide=F_s)
    a = Output("m/s2", "acceleration", (F - F_f) / m, rate_of=v)
'''
CRATE = '''
from fmus import Contact, Mode, Model, Output, Parameter, State, choose


class Crate(Model):
    """Crate on a sled on a belt, with a soft stop for the crate; it starts from rest, without a size of its motion."""

    m1 = Parameter(3.0, "kg", "mass of the sled", above=0.0)
    m2 = Parameter(1.0, "kg", "mass of the crate", above=0.0)
    k = Parameter(300.0, "N/m", "spring of the sled", low=0.0)
    u = Parameter(0.02, "m/s", "speed of the belt")
    f1 = Parameter(4.0, "N", "friction on the belt", low=0.0)
    f2 = Parameter(1.0, "N", "friction of the crate", low=0.0)
    k2 = Parameter(900.0, "N/m", "stop", low=0.0)
    x1 = State("m", "position of the sled")
    v1 = State("m/s", "speed of the sled", rate_of=x1)
    x2 = State("m", "position of the crate")
    v2 = State("m/s", "speed of the crate", rate_of=x2)
    belt_mode = Mode()
    crate_mode = Mode()
    F_belt = Contact("N", "belt", mode=belt_mode, slip=v1 - u, slide=0.5 * f1, hold=f1)
    F_crate = Contact("N", "crate", mode=crate_mode, slip=v2 - v1, slide=f2)
    stop = choose(x2 < x1, k2 * (x1 - x2), 0.0)
    a1 = Output("m/s2", "acceleration", (-k * x1 - F_belt + F_crate - stop) / m1, rate_of=v1)
    a2 = Output("m/s2", "acceleration", (stop - F_crate) / m2, rate_of=v2)
'''


@pytest.fixture(scope="module")
def model(tmp_path_factory):
    folder = tmp_path_factory.mktemp("models")

    def lower(text):
        path = folder / (text.split("class ")[1].split("(")[0].lower() + ".py")
        path.write_text(text)
        return lowered_model(path)

    return lower


def follow(cls, values, h_max, duration):
    """Return states after a duration, as bits, with events, steps and evaluations."""
    model = cls()
    run = prepared_run(model, {**values, "solver.h_max": h_max})
    start(model, run, model.initial_state(0.0), 1e9)
    step = run.solver.step
    while step.t1 < duration:
        assert compute_step(model, run) == 0
    counters = step.start_counters
    return (*step.state_at(model, duration), counters.n_events, step.n_accepted, step.n_rejected, step.n_rhs)


@pytest.mark.parametrize(
    ("push", "method"),
    slow_after(1, [({}, ODE23), ({"B": 1000.0, "tau": 1e-4}, DOP853), ({"B": 50.0}, ODE45), ({}, RODAS)]),
    ids=str,
)
def test_a_motion_from_rest_has_the_same_bits_in_runs_of_any_length(model, method, push):
    values = {**push, "solver.method": method, "solver.rtol": 1e-5}
    first, *others = [follow(model(PUSHED_OSCILLATOR), values, h_max, 3.0) for h_max in (1e2, 1e4, 1e7)]
    assert others == [first, first]


@pytest.mark.slow
@pytest.mark.parametrize("method", [ODE45, DOP853, RODAS])
def test_coupled_contacts_and_conditions_have_the_same_events_in_runs_of_any_length(model, method):
    """Where all contacts stick, a step may be as long as the largest, which changes the rounding of its end."""
    values = {"solver.method": method, "solver.rtol": 1e-6}
    first, *others = [follow(model(CRATE), values, h_max, 4.0) for h_max in (0.4, 1e2, 1e7)]
    assert first[-4] > 5
    for states_and_events in others:
        assert states_and_events[:-3] == pytest.approx(first[:-3], abs=1e-7)


@pytest.mark.parametrize("rtol", [1e-6, 1e-8])
def test_an_axis_that_hunts_takes_no_more_steps_in_a_long_run(model, rtol):
    values = {"solver.method": DOP853, "solver.rtol": rtol}
    short, long = (follow(model(HUNTING), values, h_max, 60.0) for h_max in (6.0, 6e6))
    assert (long[0], long[3]) == (pytest.approx(0.01, abs=1e-9), short[3])
    assert long[4] <= short[4] < 300


def test_a_push_that_decays_leaves_no_coarse_error_behind(model):
    """The first guess of the size of the speed is a thousand times what the axis does later."""
    values = {"B": 1000.0, "solver.method": ODE45, "solver.rtol": 1e-6}
    fine = follow(model(PUSHED_OSCILLATOR), {**values, "solver.method": DOP853, "solver.rtol": 1e-12}, 0.1, 5.0)
    coarse = follow(model(PUSHED_OSCILLATOR), values, 1e6, 5.0)
    assert np.array(coarse[:2]) == pytest.approx(np.array(fine[:2]), abs=1e-5)
