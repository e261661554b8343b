"""Loads that depend on the direction of sliding, as in a self-energising brake, of contacts that lift off."""

from math import copysign

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from variants import slow_after

import harness
from fmus.compiler import BuildError
from fmus.packaging.archive import build

MODEL = '''
from fmus import Contact, Mode, Model, Output, Parameter, State, sin


class Shoe(Model):
    """Block on a spring under a shoe whose load depends on the direction: m a = -k x - F_friction."""

    m = Parameter(1.0, "kg", "mass", above=0)
    k = Parameter(100.0, "N/m", "stiffness", low=0)
    mu_s = Parameter(0.8, "1", "coefficient of static friction", low=0)
    mu_d = Parameter(0.3, "1", "coefficient of sliding friction", low=0)
    P_0 = Parameter(6.0, "N", "mean force on the shoe", low=0)
    P_1 = Parameter({P_1}, "N", "amplitude of the force", low=0)
    gain = Parameter(0.4, "1", "how strongly the shoe energises itself")
    S = Parameter({S}, "N", "load that changes its sign with the direction")
    Omega = Parameter(7.0, "rad/s", "angular frequency of the force")
    x = State("m", "position", start=0.4)
    v = State("m/s", "speed", rate_of=x)
    angle = State("rad", "phase angle of the force", rate=Omega)
    mode = Mode()
    P = Output("N", "force on the shoe", P_0 + P_1 * sin(angle))
    N = Output("N", "load", P / (1.0 - gain * mu_d * mode) + S * mode)
    F_friction = Contact("N", "friction force", mode=mode, slip=v, slide=mu_d * N, hold=mu_s * P, lifts_off=True)
    a = Output("m/s2", "acceleration", (-k * x - F_friction) / m, rate_of=v)
    stop_time = 4.0
'''
STOP = 2.0
CASES = {  # amplitude of the force, load that changes its sign: both directions lift off, or only one
    "liftoff in both directions": (9.0, 0.0),
    "no liftoff": (2.0, 0.0),
    "liftoff in one direction": (0.5, 7.5),
    "liftoff at different times": (2.0, 6.0),
}


def solve(P_1, S):
    """Return the times of changes of mode, the modes after them and the final state, by event location of scipy."""

    def force(t):
        return 6.0 + P_1 * np.sin(7.0 * t)

    def load(t, mode):
        return force(t) / (1.0 - 0.4 * 0.3 * mode) + S * mode

    def holds(t):
        return max(0.8 * force(t), 0.0)

    t, y, mode, changes = 0.0, np.array([0.4, 0.0]), -1, []
    while t < STOP:
        if mode:
            touches = load(t + 1e-9, mode) > 0.0
            is_active = touches or holds(t + 1e-9) > 0.0
            if is_active and mode * y[1] < 0.0:  # it reversed in flight
                mode = -mode
                changes.append((t, mode))
                continue

            def rates(t, y, mode=mode, touches=touches):
                return [y[1], -100.0 * y[0] - (mode * 0.3 * load(t, mode) if touches else 0.0)]

            def stops(t, y, mode=mode, start=t, is_active=is_active):
                return mode * y[1] if is_active and t > start + 1e-7 else 1.0

            def lifts(t, y, mode=mode, start=t, touches=touches):
                return load(t, mode) if t > start + 1e-9 else copysign(1.0, touches - 0.5)

            is_held = holds(t + 1e-9) > 0.0

            def releases(t, y, start=t, is_held=is_held):
                return force(t) if t > start + 1e-9 else copysign(1.0, is_held - 0.5)

            stops.terminal = lifts.terminal = releases.terminal = True
            events = stops, lifts, releases
            run = solve_ivp(rates, (t, STOP), y, "DOP853", events=events, rtol=1e-13, atol=1e-14, max_step=5e-3)
            t, y = run.t[-1], run.y[:, -1]
            if run.status == 0:
                return changes, y
            if len(run.t_events[0]):
                y = np.array([y[0], 0.0])
                pull = -100.0 * y[0]
                mode = 0 if abs(pull) <= holds(t) else int(np.sign(pull))
                changes.append((t, mode))
        else:
            pull = -100.0 * y[0]
            times = np.linspace(t, STOP, 400_001)
            release_indices = np.flatnonzero(abs(pull) > np.maximum(0.8 * force(times), 0.0))
            if len(release_indices) == 0:
                return changes, y
            low, high = times[release_indices[0] - 1], times[release_indices[0]]
            for _ in range(60):
                middle = 0.5 * (low + high)
                low, high = (low, middle) if abs(pull) > holds(middle) else (middle, high)
            t, mode = high, int(np.sign(pull))
            changes.append((t, mode))
    return changes, y


@pytest.fixture(scope="module", params=slow_after(1, CASES))
def case(request, tmp_path_factory):
    folder = tmp_path_factory.mktemp("shoes")
    P_1, S = CASES[request.param]
    path = folder / "shoe.py"
    path.write_text(MODEL.format(P_1=P_1, S=S), encoding="utf-8")
    return build(path, folder), *solve(P_1, S)


def test_a_contact_under_a_load_with_a_direction_agrees_with_scipy(case):
    fmu, changes, (x, v) = case
    run = harness.simulate(str(fmu), {"solver.method": "ode45", "solver.rtol": 1e-11}, stop=STOP)
    table = run.to_pandas()
    assert len(changes) > 2
    times, modes = run.events.t, [int(table["mode"].asof(t + 1e-7)) for t in run.events.t]
    assert modes[-len(changes) :] == [mode for _, mode in changes]
    assert times[-len(changes) :] == pytest.approx([t for t, _ in changes], abs=1e-8)
    assert table[["x", "v"]].iloc[-1].tolist() == pytest.approx([x, v], abs=1e-7)


def test_a_holding_force_with_a_direction_is_refused_with_the_remedy(tmp_path):
    path = tmp_path / "shoe.py"
    text = MODEL.format(P_1=9.0, S=0.0)
    path.write_text(text.replace("hold=mu_s * P", "hold=mu_s * N"), encoding="utf-8")
    with pytest.raises(BuildError, match="depends on its direction: write a hold= that does not"):
        build(path, tmp_path)
    path.write_text(text.replace(", hold=mu_s * P", ""), encoding="utf-8")
    with pytest.raises(BuildError, match="depends on its direction: pass hold="):
        build(path, tmp_path)


GEAR = '''
from fmus import Contact, Input, Mode, Model, Output, Parameter, State, choose, fabs


class Gear(Model):
    """Inertia behind a gear that loses another share of the torque in each direction."""

    J = Parameter(0.01, "kg.m2", "moment of inertia", above=0.0)
    T_0 = Parameter(1.0, "N.m", "friction without load", low=0.0)
    forward = Parameter(0.1, "1", "share of the torque that is lost forward", low=0.0)
    backward = Parameter(0.4, "1", "share of the torque that is lost backward", low=0.0)
    slope = Parameter(10.0, "N.m/s", "rate of the torque")
    angle = State("rad", "angle")
    omega = State("rad/s", "speed", rate_of=angle)
    T = State("N.m", "torque of the motor", rate=slope)
    mode = Mode()
    up = T_0 + forward * fabs(T)
    down = T_0 + backward * fabs(T)
    {law}
    alpha = Output("rad/s2", "angular acceleration", (T - T_friction) / J, rate_of=omega)
    stop_time = 0.5
'''
BY_DIRECTION = """R = Contact("N.m", "friction", mode=mode, slip=omega, slide=choose(omega > 0.0, up, down))
    T_friction = Output("N.m", "friction", R)"""
BY_MEAN = """R = Contact("N.m", "mean friction", mode=mode, slip=omega, slide=0.5 * (up + down))
    T_friction = Output("N.m", "friction", R + 0.5 * (up - down))"""


@pytest.mark.parametrize("slope", slow_after(1, [10.0, -10.0]))
def test_a_gear_with_the_split_that_its_refusal_advises_breaks_away_at_the_force_of_its_direction(tmp_path, slope):
    path = tmp_path / "gear.py"
    path.write_text(GEAR.format(law=BY_DIRECTION), encoding="utf-8")
    with pytest.raises(
        BuildError, match="slide the mean of the forces of both directions, and add half their difference"
    ):
        build(path, tmp_path)
    path.write_text(GEAR.format(law=BY_MEAN), encoding="utf-8")
    build(path, tmp_path)
    run = harness.simulate(str(tmp_path / "gear.fmu"), {"slope": slope})
    share = 0.1 if slope > 0.0 else 0.4  # T = T_0 + share T
    breakaway = 1.0 / (1.0 - share) / abs(slope)
    assert run.events.t.tolist() == [0.0, pytest.approx(breakaway, rel=1e-9)]  # stuck at the start, then free
    torque, J = 10.0 * (1.0 - share), 0.01
    expected = np.sign(slope) * torque * (0.5 - breakaway) ** 2 / (2.0 * J)
    assert run.columns["omega"][-1] == pytest.approx(expected, rel=1e-6)
