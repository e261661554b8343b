"""Whole revolutions of an angle change no motion, where the angle enters the equations by periodic functions only."""

from math import pi

import build_cache
import numpy as np
import pytest
from models import scalar_class
from native_fmus import require_compiler

import harness
from benchmarks.symmetry.builds import NATIVE, PYTHON
from benchmarks.symmetry.changes import REVOLUTIONS, REVOLUTIONS_ADDED
from benchmarks.symmetry.command import describe
from benchmarks.symmetry.study import run_model
from tests.symmetry.symmetry_models import build

HEAD = """from fmus import Contact, Fixed, Mode, Model, Output, Parameter, State, choose, cos, sin, sqrt

class Turning(Model):
    '''A machine with an angle.'''
    J = Parameter(0.05, "kg.m2", "inertia", above=0.0)
    m = Parameter(2.0, "kg", "mass of the slider", above=0.0)
    r = Parameter(0.1, "m", "crank", above=0.0)
    k = Parameter(400.0, "N/m", "spring on the slider", low=0.0)
    f = Parameter(6.0, "N", "friction force of the guide", low=0.0)
    c = Parameter(0.3, "N.m.s/rad", "damping", low=0.0)
    M = Parameter(3.5, "N.m", "amplitude of the drive")
    frequency = Parameter(1.3, "rad/s", "frequency of the drive")
    q0 = Fixed(0.4, "rad", "start angle")
    q = State("rad", "angle", start=q0)
    w = State("rad/s", "speed", rate_of=q)
    phase = State("rad", "phase of the drive", rate=frequency)
    mode = Mode()
    stop_time, step_size, method = 6.0, 0.05, "dop853"
"""
SLIDER_CRANK = """
    l = Parameter(0.3, "m", "rod", above=0.0)
    S = sqrt(l * l - r * r * sin(q) * sin(q))
    x = Output("m", "slider", r * cos(q) + S - l)
    lever = -r * sin(q) - r * r * sin(q) * cos(q) / S
    bend = (
        -r * cos(q)
        - r * r * (cos(q) * cos(q) - sin(q) * sin(q)) / S
        - r * r * r * r * sin(q) * sin(q) * cos(q) * cos(q) / (S * S * S)
    )
    F = Contact("N", "friction of the guide", mode=mode, slip=lever * w, slide=f)
    moment = M * sin(phase) - lever * (k * x + F) - m * lever * bend * w * w - c * w
    a = Output("rad/s2", "acceleration", moment / (J + m * lever * lever), rate_of=w)
"""
SCOTCH_YOKE = """
    s = Parameter(0.05, "m", "position of a stop")
    x = Output("m", "yoke", r * cos(q))
    lever = -r * sin(q)
    F = Contact("N", "friction of the guide", mode=mode, slip=lever * w, slide=f, hold=1.3 * f)
    push = k * x + choose(x > s, 4.0 * k * (x - s), 0.0) + F
    moment = M * sin(phase) - lever * push + m * lever * r * cos(q) * w * w - c * w
    a = Output("rad/s2", "acceleration", moment / (J + m * lever * lever), rate_of=w)
"""
ROTORS = """
    p = State("rad", "angle of the other rotor", start=0.4)
    u = State("rad/s", "its speed", rate_of=p)
    other = Mode()
    x = Output("m", "a point of the first rotor", r * cos(q))
    F = Contact("N.m", "friction of the first bearing", mode=mode, slip=w, slide=0.1 * r * f)
    G = Contact("N.m", "friction of a clutch", mode=other, slip=u - w, slide=0.1 * r * f, hold=0.15 * r * f)
    g = Parameter(9.81, "m/s2", "gravity", low=0.0)
    weight = m * g * r * sin(q)
    pull = k * r * r * sin(p - q)
    a = Output("rad/s2", "acceleration", (M * sin(phase) - weight + pull - c * w - F + G) / J, rate_of=w)
    b = Output("rad/s2", "acceleration of the other", (-pull - G) / J, rate_of=u)
"""
MACHINES = {"slider_crank": SLIDER_CRANK, "scotch_yoke": SCOTCH_YOKE, "rotors": ROTORS}


def write(machine):
    """Return the file of a machine."""
    folder = build_cache.cached_folder(
        f"turning-{machine}", lambda folder: (folder / f"{machine}.py").write_text(HEAD + MACHINES[machine])
    )
    return folder / f"{machine}.py"


def examine(machine, backend, methods=()):
    """Return for how many runs revolutions were added, and the first differences."""
    outcomes = run_model(write(machine), backend, build, (REVOLUTIONS,), methods)
    assert not [outcome.reason for outcome in outcomes if outcome.reason]
    return len(outcomes), [describe(outcome) for outcome in outcomes if outcome.difference]


def test_no_revolution_of_a_crank_changes_its_motion():
    assert examine("slider_crank", PYTHON, ("ode45",)) == (len(REVOLUTIONS_ADDED), [])


@pytest.mark.campaign
@pytest.mark.parametrize("backend", [NATIVE, PYTHON])
@pytest.mark.parametrize("machine", MACHINES)
def test_no_revolution_of_a_machine_changes_its_motion(machine, backend):
    """By any method."""
    if backend == NATIVE:
        require_compiler()
    methods = () if backend == NATIVE else ("dop853",)
    n_runs, differences = examine(machine, backend, methods)
    assert n_runs == len(REVOLUTIONS_ADDED) * (4 if backend == NATIVE else 1)
    assert not differences


def run(machine, turns, rtol=1e-10, **values):
    """Return positions of the slider, and the number of changes of mode, of a run with `turns` more revolutions."""
    result = harness.simulate(
        build(write(machine), NATIVE),
        {"q0": 0.4 + 2.0 * pi * turns, **values},
        method="dop853",
        rtol=rtol,
        times=np.linspace(0.0, 6.0, 121),
    )
    return result["x"], result.statistics.events


@pytest.mark.slow
@pytest.mark.parametrize("turns", [10, 100, 1000, 10_000])
@pytest.mark.parametrize("moment", [1.0, 2.0, 2.8, 3.5])
def test_a_crank_that_has_turned_often_is_as_accurate_as_one_that_has_not(moment, turns):
    """With 100 revolutions, its slider was off by 0.8 mm, or the run did not end."""
    require_compiler()
    (x, n), (x_turned, n_turned) = (run("slider_crank", turns_, M=moment) for turns_ in (0, turns))
    assert n == n_turned
    assert n > 3
    assert np.abs(x_turned - x).max() < 1e-9


@pytest.mark.slow
@pytest.mark.parametrize("turns", [0, 1000])
@pytest.mark.parametrize("moment", [0.1, 0.3])
def test_a_held_crank_stays_at_rest(moment, turns):
    """Its rates are rounding errors; where no such errors were allowed, the run stalled."""
    require_compiler()
    x, n_events = run("slider_crank", turns, M=moment, f=200.0)
    assert n_events == 0
    assert np.ptp(x) < 1e-12


def test_the_allowance_for_rounding_errors_does_not_grow_with_the_power_of_an_angle():
    """A rate with four sines of an angle has the rounding error of one."""
    model = scalar_class(write("slider_crank"))()
    model.prepare()
    at_rest = [model.rate_magnitudes(0.0, 0.4 + 2.0 * pi * n, 1.0, 1) for n in (0, 100, 1000)]
    first, hundred, thousand = (float(np.ravel(size)[0]) for size in at_rest)
    assert 8.0 < (thousand - first) / (hundred - first) < 12.0
    assert hundred < 1e3 * first


def test_the_size_of_an_angle_for_the_error_control_is_at_most_one_radian():
    """Only of angles by which nothing but periodic functions are taken."""
    assert scalar_class(write("rotors")).angles == ("q", "p")
    assert scalar_class("pendulum").angles == ("theta",)
    assert scalar_class("joint").angles == ()  # springs act on its angles
