"""Periodic motions of built FMUs, against closed forms, a transcendental equation and a solver of scipy."""

import json
import shutil
from functools import cache
from math import atan, pi, sqrt

import commands
import numpy as np
import pytest
from build_cache import build_user_model
from native_fmus import require_compiler
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, minimize_scalar
from variants import slow_after

import harness
from tests.studies.oscillators import DELTA, STATIC, C, build_text, edge_of_stick_slip, native

STEADY, STICK_SLIP, SLIDING = "steady sliding", "stick-slip", "sliding orbit"


def motion(result, kind):
    """Return the only motion of a kind."""
    (only_motion,) = [item for item in result.motions if item.kind == kind]
    return only_motion


@pytest.mark.parametrize("c", [0.05, 0.2])
def test_stick_slip_ends_where_the_transcendental_equation_says(c):
    exact = edge_of_stick_slip(c)
    result = harness.orbit(
        native("belt"), {"law": "coulomb", "c": c}, over={"v_belt": [0.7 * exact, 1.5 * exact, 2.0 * exact]}
    )
    (point,) = result.points
    assert point.kind == "stick-slip ends"
    assert point.value == pytest.approx(exact, rel=1e-11)


REVERSING = '''
from fmus import Contact, Fixed, Mode, Model, Output, Parameter, State


class Reversing(Model):
    """Body on a hardening spring, on a belt, with friction that falls with the speed, and no damping."""

    v_b = Parameter(0.35, "m/s", "speed of the belt")
    x0 = Fixed(0.2, "m", "initial position")
    v0 = Fixed(0.0, "m/s", "initial speed")
    m = Parameter(0.7, "kg", "mass")
    k = Parameter(31.0, "N/m", "stiffness")
    k3 = Parameter(90.0, "N/m3", "hardening")
    f = Parameter(0.6, "N", "friction at rest")
    g = Parameter(1.5, "s/m", "fall of friction")
    x = State("m", "position", start=x0)
    v = State("m/s", "speed", start=v0, rate_of=x)
    mode = Mode()
    F = Contact("N", "friction", mode=mode, slip=v - v_b, slide=f / (1 + g * abs(v - v_b)), hold=f)
    a = Output("m/s2", "acceleration", (-k * x - k3 * x * x * x - F) / m, rate_of=v)
'''


def spring(x):
    """Return the force of the spring of Reversing."""
    return 31.0 * x + 90.0 * x**3


def return_to_belt(v_belt, x):
    """Return position and time of Reversing when it has twice had the speed of the belt since it left it at x."""
    duration = 0.0
    for sign in (-1, 1):

        def rates(t, y, sign=sign):
            return y[1], (-spring(y[0]) - sign * 0.6 / (1 + 1.5 * abs(y[1] - v_belt))) / 0.7

        def has_speed_of_belt(t, y, sign=sign):
            return sign * (v_belt - y[1]) if t > 1e-3 else -1.0

        has_speed_of_belt.terminal, has_speed_of_belt.direction = True, 1
        options = {"rtol": 1e-13, "atol": 1e-15, "max_step": 0.01, "events": has_speed_of_belt}
        run = solve_ivp(rates, (0.0, 5.0), (x, v_belt), "DOP853", **options)
        x, duration = run.y[0, -1], duration + run.t[-1]
    return x, duration


@pytest.mark.campaign
def test_a_reversal_of_the_slip_is_no_stick():
    result = harness.orbit(build_text("reversing", REVERSING), over={"v_b": [0.7, 0.95, 1.2]})
    (point,) = result.points
    kinds = [(item.value, item.kind) for item in result.motions if item.kind != STEADY]
    assert (point.kind, kinds) == ("stick-slip ends", [(0.7, STICK_SLIP), (0.95, SLIDING), (1.2, SLIDING)])
    leaves = brentq(lambda x: spring(x) - 0.6, 0.0, 1.0)
    exact = brentq(lambda v: abs(spring(return_to_belt(v, leaves)[0])) - 0.6, 0.78, 0.9, xtol=1e-13)
    assert point.value == pytest.approx(exact, rel=5e-11)
    x = brentq(lambda x: return_to_belt(0.95, x)[0] - x, leaves, 4 * leaves, xtol=1e-13)
    orbit = next(item for item in result.motions if (item.value, item.kind) == (0.95, SLIDING))
    assert orbit.period == pytest.approx(return_to_belt(0.95, x)[1], rel=1e-11)
    assert orbit.stability == "stable"


MEETING = '''
from fmus import Contact, Fixed, Mode, Model, Output, Parameter, State


class Meeting(Model):
    """Body on a belt with constant friction, and a damping that depends on its position."""

    v_b = Parameter(1.5, "m/s", "speed of the belt")
    x0 = Fixed(0.2, "m", "initial position")
    v0 = Fixed(0.0, "m/s", "initial speed")
    c0 = Parameter(-0.01, "N.s/m", "negative damping in the middle")
    c2 = Parameter(0.1, "N.s/m3", "its increase")
    c4 = Parameter(0.1, "N.s/m5", "its decrease")
    m = Parameter(1.0, "kg", "mass")
    k = Parameter(1.0, "N/m", "stiffness")
    f = Parameter(0.1, "N", "friction")
    x = State("m", "position", start=x0)
    v = State("m/s", "speed", start=v0, rate_of=x)
    mode = Mode()
    F = Contact("N", "friction", mode=mode, slip=v - v_b, slide=f)
    a = Output("m/s2", "acceleration", (-k * x + (c0 + c2 * x * x - c4 * x * x * x * x) * v - F) / m, rate_of=v)
'''


def growth_of_amplitude(c0, start, c2=0.1, c4=0.1):
    """Return by how much a turning point of Meeting has moved outwards after a turn from x = 0.1 + start."""

    def rates(t, y):
        return y[1], 0.1 - y[0] + (c0 + c2 * y[0] ** 2 - c4 * y[0] ** 4) * y[1]

    def turns(t, y):
        return y[1]

    turns.direction, turns.terminal = -1, 2  # the start counts
    run = solve_ivp(rates, (0, 30), (0.1 + start, 0.0), "DOP853", rtol=1e-13, atol=1e-15, events=turns)
    return run.y[0, -1] - 0.1 - start


@pytest.mark.campaign
def test_two_orbits_meet_in_a_fold():
    """Also where they lie between two of the amplitudes that are scanned."""
    result = harness.orbit(build_text("meeting", MEETING), over={"c0": [-0.02, -0.012, -0.01]})
    (point,) = result.points
    orbits = [(item.value, item.stability) for item in result.motions if item.kind == SLIDING]
    assert orbits == [(value, stability) for value in (-0.012, -0.01) for stability in ("unstable", "stable")]
    assert point.kind == "fold: two orbits meet"

    def largest(c0):
        options = {"xatol": 1e-8}
        return minimize_scalar(lambda a: -growth_of_amplitude(c0, a), bounds=(0.8, 1.1), options=options).fun

    assert point.value == pytest.approx(brentq(largest, -0.0125, -0.0115, xtol=1e-13), abs=1e-10)


@pytest.mark.slow
def test_an_orbit_is_found_where_large_amplitudes_are_overdamped():
    """A motion that starts with a large amplitude does not turn there, and needs many steps."""
    result = harness.orbit(build_text("meeting", MEETING), {"v_b": 3.0, "c2": 1.0, "c4": 1.0})
    assert not result.remarks
    for orbit in result.motions[1:]:
        amplitude = orbit.largest - 0.1
        assert abs(growth_of_amplitude(-0.01, amplitude, 1.0, 1.0)) < 1e-9
    assert [item.stability for item in result.motions] == ["stable", "unstable", "stable"]


@pytest.mark.parametrize(
    ("name", "values", "largest"), [("belt", {"law": "coulomb", "v_belt": 1.5}, 1.5), ("stickslip", {}, 0.0044)]
)
def test_orbits_of_all_amplitudes_are_named_and_not_drawn(name, values, largest):
    """Without damping, all of them that do not reach the speed of the belt."""
    result = harness.orbit(native(name), values)
    assert [(item.kind, item.stability) for item in result.motions] == [(STEADY, "neutral"), (STICK_SLIP, "stable")]
    assert 0.7 * largest < float(result.remarks[0].split("at least ")[1].split()[0]) < largest


@pytest.mark.parametrize(
    ("length", "time"), slow_after(1, [(2.0**-40, 1.0), (2.0**40, 1.0), (1.0, 2.0**-30), (1.0, 2.0**20)])
)
def test_motions_do_not_depend_on_the_units_of_length_and_time(length, time):
    speed, force = length / time, length / time**2
    values = {"c": 0.1 / time, "k": 1.0 / time**2, "F_s": force, "F_c": 0.7 * force, "delta": 3.0 / speed}
    values |= {"v_belt": 1.7 * speed, "x0": 1.067 * length}
    result, expected = harness.orbit(native("belt"), values), harness.orbit(native("belt"), {"c": 0.1, "v_belt": 1.7})
    assert (result.remarks, len(expected.motions)) == (expected.remarks, 3)
    for scaled_motion, expected_motion in zip(result.motions, expected.motions, strict=True):
        assert (scaled_motion.kind, scaled_motion.stability) == (expected_motion.kind, expected_motion.stability)
        unscaled_values = scaled_motion.period / time, scaled_motion.largest / length, scaled_motion.smallest / length
        assert unscaled_values == pytest.approx(
            (expected_motion.period, expected_motion.largest, expected_motion.smallest), rel=1e-12
        )
        np.testing.assert_allclose(scaled_motion.multipliers, expected_motion.multipliers, rtol=1e-9, atol=1e-9)


def test_limits_without_a_spring_or_a_fall_of_friction_are_no_errors():
    """Without a spring the body rides along; with constant friction it leaves the belt without a jump of its rate."""
    kinds = [item.kind for item in harness.orbit(native("belt"), {"k": 0.0, "v_belt": 1.0}).motions]
    assert kinds == ["rest"]
    result = harness.orbit(native("belt"), {"delta": 0.0, "v_belt": 1.0})
    assert {item.stability for item in result.motions} == {"neutral"}
    assert "orbits of all amplitudes" in result.remarks[0]


def slide(x, speed):
    """Return position, time and multiplier of the next turning point of a block that slides from the one at x.

    The multiplier is that of Liouville: exp of the integral of the trace of the Jacobian.
    """

    def rates(t, y):
        slip = speed - y[1]
        force = STATIC / (1 + DELTA * slip)
        return [y[1], -y[0] - C * y[1] + force, -C + STATIC * DELTA / (1 + DELTA * slip) ** 2]

    t, y = 0.0, np.array([x, 0.0, 0.0])
    for direction in (1, -1):

        def turns(t, y):
            return y[1]

        turns.direction, turns.terminal = direction, True
        part = solve_ivp(rates, (0, 30), y, method="DOP853", rtol=1e-13, atol=1e-15, events=turns)
        t, y = t + part.t[-1], part.y[:, -1]
    return y[0], t, np.exp(y[2])


@pytest.mark.parametrize("speed", [1.7, pytest.param(2.4, marks=pytest.mark.slow)])
def test_the_unstable_orbit_of_the_belt_is_that_of_scipy(speed):
    orbit = motion(harness.orbit(native("belt"), {"c": C, "v_belt": speed}), SLIDING)
    x = brentq(lambda x: slide(x, speed)[0] - x, orbit.largest - 0.1, orbit.largest + 0.1, xtol=1e-13)
    _, period, multiplier = slide(x, speed)
    assert orbit.stability == "unstable"
    assert orbit.largest == pytest.approx(x, abs=1e-10)
    assert orbit.period == pytest.approx(period, rel=1e-11)
    np.testing.assert_allclose(orbit.multipliers, [multiplier], rtol=1e-9)


def test_the_belt_changes_where_it_should_as_the_speed_grows():
    """Steady sliding turns stable where the falling friction equals the damping; stick-slip ends later."""
    result = harness.orbit(native("belt"), {"c": C}, over={"v_belt": np.linspace(0.6, 3.1, 6)})
    stable, ends = result.points
    assert (stable.kind, ends.kind) == ("steady sliding turns stable", "stick-slip ends")
    assert stable.value == pytest.approx((sqrt(DELTA * STATIC / C) - 1) / DELTA, rel=1e-12)
    assert ends.value == pytest.approx(2.892345819178, abs=1e-11)  # by bisection on runs of an earlier program
    kinds = {item.kind for item in result.motions if stable.value < item.value < ends.value}
    assert kinds == {STEADY, SLIDING, STICK_SLIP}
    assert {item.kind for item in result.motions if item.value > ends.value} == {STEADY}


def test_the_stick_slip_of_the_belt_is_near_the_start_of_leines_program():
    """R. I. Leine, run_simulations_block_on_belt.m of a keynote at ENOC 2024, starts it at 1.135 m."""
    orbit = motion(harness.orbit(native("belt")), STICK_SLIP)
    assert orbit.largest == pytest.approx(1.13394, abs=5e-6)
    assert orbit.largest == pytest.approx(1.135, abs=2e-3)


def test_a_sled_without_damping_has_the_closed_form_of_stick_slip():
    m, k, mu_s, mu_d, g, speed = 12.5, 742.5, 0.9, 0.6, 9.81, 0.034
    orbit = motion(harness.orbit(native("stickslip")), STICK_SLIP)
    fall, frequency = (mu_s - mu_d) * m * g / k, sqrt(k / m)
    stick = 2 * fall / speed
    slip = 2 / frequency * (pi - atan(fall * frequency / speed))
    assert orbit.period == pytest.approx(stick + slip, rel=1e-11)
    assert orbit.stick_time == pytest.approx(stick, rel=1e-11)
    assert orbit.amplitude == pytest.approx(sqrt(fall**2 + (speed / frequency) ** 2), rel=1e-10)
    assert np.abs(orbit.multipliers).max() < 1e-9


PAIR = '''
from fmus import Contact, Fixed, Mode, Model, Output, Parameter, State


class Pair(Model):
    """Two blocks on a belt, joined by a spring; friction falls with the slip."""

    v_b = Parameter(1.2, "m/s", "speed of the belt")
    c = Parameter(0.2, "N.s/m", "damping of each block")
    x1_0 = Fixed(1.0, "m", "initial position")
    v1_0 = Fixed(0.0, "m/s", "initial speed")
    x2_0 = Fixed(0.8, "m", "initial position")
    v2_0 = Fixed(0.0, "m/s", "initial speed")
    m = Parameter(1.0, "kg", "mass of each block")
    k = Parameter(1.0, "N/m", "stiffness to the wall")
    k12 = Parameter(1.2, "N/m", "stiffness between the blocks")
    f1 = Parameter(1.0, "N", "friction at rest")
    f2 = Parameter(1.3, "N", "friction at rest")
    g = Parameter(3.0, "s/m", "fall of friction")
    x1 = State("m", "position", start=x1_0)
    v1 = State("m/s", "speed", start=v1_0, rate_of=x1)
    x2 = State("m", "position", start=x2_0)
    v2 = State("m/s", "speed", start=v2_0, rate_of=x2)
    mode1 = Mode()
    mode2 = Mode()
    F1 = Contact("N", "friction", mode=mode1, slip=v1 - v_b, slide=f1 / (1 + g * abs(v1 - v_b)), hold=f1)
    F2 = Contact("N", "friction", mode=mode2, slip=v2 - v_b, slide=f2 / (1 + g * abs(v2 - v_b)), hold=f2)
    a1 = Output("m/s2", "acceleration", (-k * x1 + k12 * (x2 - x1) - c * v1 - F1) / m, rate_of=v1)
    a2 = Output("m/s2", "acceleration", (-k * x2 - k12 * (x2 - x1) - c * v2 - F2) / m, rate_of=v2)
'''


@cache
def pair():
    """Return the native FMU of Pair."""
    return build_text("pair", PAIR)


def follow_pair(y, v_b, stop):
    """Return the states of Pair after a time in s, by scipy with located events."""
    k, k12, c, static = 1.0, 1.2, 0.2, np.array([1.0, 1.3])
    y, t, modes = np.array(y), 0.0, [-1, -1]  # signs of the slips; 0 sticks

    def loads(y):
        x, v = y[[0, 2]], y[[1, 3]]
        return -k * x + k12 * (x[::-1] - x) - c * v

    def rates(t, y):
        slip = y[[1, 3]] - v_b
        a = np.where(modes, loads(y) - np.sign(modes) * static / (1 + 3.0 * np.abs(slip)), 0.0)
        return np.array([y[1], a[0], y[3], a[1]])

    def leaves(i):
        def event(t, y):
            return np.abs(loads(y))[i] - static[i] if modes[i] == 0 else -modes[i] * (y[2 * i + 1] - v_b)

        event.terminal, event.direction = True, 1
        return event

    while t < stop:
        options = {"rtol": 1e-13, "atol": 1e-15, "max_step": 0.05, "events": (leaves(0), leaves(1))}
        part = solve_ivp(rates, (t, stop), y, "DOP853", **options)
        t, y = part.t[-1], part.y[:, -1]
        for i in range(2):
            if len(part.t_events[i]):
                modes[i] = int(np.sign(loads(y)[i])) if modes[i] == 0 else 0
                y[2 * i + 1] = v_b
    return y


@pytest.mark.campaign
@pytest.mark.parametrize("section", [None, "x1", "mode1"])
def test_an_orbit_of_two_blocks_is_found_by_each_section_and_repeats_in_scipy(section, tmp_path):
    result = harness.orbit(pair(), {"v_b": 0.8}, section=section)
    result.save(tmp_path / "orbit")
    origin = json.loads((tmp_path / "orbit" / "provenance.json").read_text())
    assert origin["scene"] == ({"section": section} if section else {})
    orbit = motion(result, STICK_SLIP)
    assert (orbit.n_sticks, orbit.stability) == (2, "stable")
    assert orbit.period == pytest.approx(3.5388039025118, rel=1e-11)
    if section:
        np.testing.assert_allclose(follow_pair(orbit.y, 0.8, orbit.period), orbit.y, atol=1e-10)
    section_points = result.paths[-1][result.paths[-1][:, 3] > 0.0]
    assert len(section_points) == (2 if section is None else 1)
    if section == "x1":
        assert abs(section_points[0, 1]) < 1e-12


@pytest.mark.campaign
def test_of_several_blocks_both_motions_are_followed_from_either_side():
    """Steady sliding turns stable where an eigenvalue crosses zero; stick-slip goes on from the speed below."""
    start = {"x1_0": 0.86, "v1_0": 0.25, "x2_0": -0.13, "v2_0": -0.26}
    result = harness.orbit(pair(), start, over={"v_b": [0.8, 1.2, 1.6]})

    def growth(v):
        fall = 3.0 / (1 + 3.0 * v) ** 2
        rows = [0, 1, 0, 0], [-2.2, fall - 0.2, 1.2, 0], [0, 0, 0, 1], [1.2, 0, -2.2, 1.3 * fall - 0.2]
        return np.linalg.eigvals(np.array(rows)).real.max()

    (point,) = result.points
    assert point.kind == "steady sliding turns stable"
    assert point.value == pytest.approx(brentq(growth, 0.9, 1.2, xtol=1e-14), rel=1e-11)
    kinds = [(item.value, item.kind, item.stability) for item in result.motions]
    assert kinds[2:] == [(v, kind, "stable") for v in (1.2, 1.6) for kind in (STEADY, STICK_SLIP)]


@pytest.mark.campaign
def test_of_a_python_fmu_its_native_twin_is_run(tmp_path):
    require_compiler()
    folder = build_user_model(commands.ROOT / "fmus" / "more" / "belt.py")
    file = shutil.copy(folder / "belt.fmu", tmp_path)
    values = {"c": 0.1, "v_belt": 2.0}
    motions, expected = (harness.orbit(source, values).motions for source in (file, native("belt")))
    assert [(item.kind, item.period) for item in motions] == [(item.kind, item.period) for item in expected]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"over": {"v_belt": [1.0]}}, "one value"),
        ({"over": {"v_belt": [1.0, 2.0], "c": [0.0, 1.0]}}, "give one"),
        ({"over": {"speed": [1.0, 2.0]}}, "unknown parameter 'speed'"),
        ({"values": {"v_belt": 1.0}, "over": {"v_belt": [1.0, 2.0]}}, "both varied and set"),
        ({"section": "speed"}, "unknown section 'speed'"),
    ],
)
def test_arguments_are_refused_in_one_sentence(arguments, message):
    with pytest.raises(harness.SceneError, match=message):
        harness.orbit(native("belt"), **arguments)


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("servo", "no parameter sets v at the start"),
        pytest.param("sleds", "no parameter sets v_1 at the start", marks=pytest.mark.campaign),
        pytest.param("clutch", "no force that depends on a position or a speed", marks=pytest.mark.campaign),
    ],
)
def test_models_without_starts_or_oscillations_are_refused(name, message):
    with pytest.raises(harness.HarnessError, match=message):
        harness.orbit(native(name))


def test_the_command_saves_what_the_function_returns(tmp_path):
    result = commands.harness(tmp_path, "orbit", native("belt"), "--set", "c=0.1", "--over", "v_belt=1:2:3", "--json")
    loaded_result = harness.load_result(tmp_path / "results" / "orbit" / "belt-v_belt")
    assert f'"value": {loaded_result.points[0].value!r}' in result.stdout
    for span in ("2:1", "1:2:2", "1:2:x", "1"):
        process = commands.harness(tmp_path, "orbit", native("belt"), "--over", f"v_belt={span}")
        assert (process.returncode, "for 3 values or more, v_belt=0.1:3:60" in process.stderr) == (2, True)
