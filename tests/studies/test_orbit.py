"""Periodic motions of built FMUs, against closed forms, a transcendental equation and a solver of scipy."""

import re
import shutil
from functools import cache
from math import atan, pi, sqrt
from pathlib import Path
from tempfile import TemporaryDirectory

import commands
import mpmath
import numpy as np
import pytest
from build_cache import build_user_model
from external_fmus import edited_copy
from native_fmus import require_compiler
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from scipy.optimize import brentq, minimize_scalar
from variants import slow_after

import harness

STEADY, STICK_SLIP, SLIDING = "steady sliding", "stick-slip", "sliding orbit"


@cache
def native(name):
    """Return the native FMU of a model."""
    require_compiler()
    (file,) = (commands.ROOT / "fmus").glob(f"**/{name}.py")
    return build_user_model(file, "--native", "--platform", "linux64") / "native" / f"{name}.fmu"


def build_text(name, text):
    """Return the native FMU of a model file with a text."""
    require_compiler()
    with TemporaryDirectory() as folder:
        file = Path(folder, f"{name}.py")
        file.write_text(text, encoding="utf-8")
        return build_user_model(file, "--native", "--platform", "linux64") / "native" / f"{name}.fmu"


def motion(result, kind):
    """Return the only motion of a kind."""
    (found,) = [item for item in result.motions if item.kind == kind]
    return found


def edge_of_stick_slip(c, k=1.0, static=1.0, sliding=0.7):
    """Return the belt speed at which a block with constant sliding friction just touches the belt again.

    After it leaves the belt at v = v_belt and k x + c v = static, its next largest speed is v_belt.
    """
    with mpmath.workdps(30):
        c, k, static, sliding = map(mpmath.mpf, (c, k, static, sliding))
        w = mpmath.sqrt(k - c * c / 4)

        def excess(speed):
            x = (static - c * speed - sliding) / k
            a, b = speed, -(k * x + c * speed / 2) / w  # v = exp(-c t/2) (a cos w t + b sin w t)
            angle = mpmath.atan2(b * w - a * c / 2, a * w + b * c / 2)  # where the speed is extreme
            angles = [angle + n * mpmath.pi for n in range(4) if angle + n * mpmath.pi > 0]
            speeds = [mpmath.exp(-c * q / w / 2) * (a * mpmath.cos(q) + b * mpmath.sin(q)) for q in angles]
            return next(v for v in speeds if v > 0) - speed

        return float(mpmath.findroot(excess, (mpmath.mpf("0.05"), mpmath.mpf(3)), solver="anderson", tol=1e-25))


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


@pytest.mark.slow
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


@pytest.mark.slow
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


def test_limits_without_a_spring_or_a_fall_of_friction_are_no_errors():
    """Without a spring the body rides along; with constant friction it leaves the belt without a jump of its rate."""
    kinds = [item.kind for item in harness.orbit(native("belt"), {"k": 0.0, "v_belt": 1.0}).motions]
    assert kinds == [STEADY, "rest"]
    result = harness.orbit(native("belt"), {"delta": 0.0, "v_belt": 1.0})
    assert {item.stability for item in result.motions} == {"neutral"}
    assert "orbits of all amplitudes" in result.remarks[0]


C, STATIC, DELTA = 0.1, 1.0, 3.0  # of the belt of Leine and others, with a damper


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


CLOCKED = '''
from fmus import Contact, Fixed, Mode, Model, Output, Parameter, State, cos


class Clocked(Model):
    """The forced mass, with a force of a clock or of an angle that always start at zero."""

    m = Parameter(1.0, "kg", "mass")
    k = Parameter(100.0, "N/m", "stiffness")
    f = Parameter(6.0, "N", "friction")
    P = Parameter(10.0, "N", "amplitude of the force")
    Omega = Parameter(7.0, "rad/s", "angular frequency of the force")
    x0 = Fixed(0.0, "m", "initial position")
    v0 = Fixed(0.0, "m/s", "initial speed")
    x = State("m", "position", start=x0)
    v = State("m/s", "speed", start=v0, rate_of=x)
    clock = State(UNIT, "time, or phase angle", rate=RATE)
    mode = Mode()
    F = Contact("N", "friction", mode=mode, slip=v, slide=f)
    a = Output("m/s2", "acceleration", (P * cos(ANGLE) - k * x - F) / m, rate_of=v)
'''


@pytest.mark.slow
@pytest.mark.parametrize(
    ("unit", "rate", "angle", "options"),
    [
        ("s", "1.0", "Omega * clock", {"period": 2 * pi / 7.0}),
        ("rad", "Omega", "clock", {}),
    ],
)
def test_a_force_by_a_clock_has_the_amplitude_of_den_hartog(unit, rate, angle, options):
    fmu = build_text("clocked", CLOCKED.replace("UNIT", repr(unit)).replace("RATE", rate).replace("ANGLE", angle))
    (orbit,) = harness.orbit(fmu, **options).motions
    assert orbit.amplitude == pytest.approx(hartog(7.0), rel=1e-10)
    (twin,) = harness.orbit(native("forced"), {"Omega": 7.0}).motions
    np.testing.assert_allclose(np.sort(np.abs(orbit.multipliers)), np.sort(np.abs(twin.multipliers)), rtol=1e-6)
    (stops,) = harness.orbit(fmu, {"f": 8.5}, **options).motions
    (twin,) = harness.orbit(native("forced"), {"Omega": 7.0, "f": 8.5}).motions
    assert (stops.n_sticks, stops.stick_time) == (twin.n_sticks, pytest.approx(twin.stick_time, rel=1e-7))
    if options:
        with pytest.raises(harness.HarnessError, match="depend on the time clock: give their period in s"):
            harness.orbit(fmu)


def test_an_oscillator_with_a_square_force_has_the_orbit_of_its_closed_form():
    """It repeats if half a period turns its states around."""
    c, k, period, force = 2.0, 157.9, 0.8, 10.0
    inputs = {"time": [0.0, 0.5 * period, 0.5 * period, period], "F_ext": [force, force, -force, -force]}
    (orbit,) = harness.orbit(native("smd"), {"c": c, "k": k}, inputs=inputs, period=period).motions
    half = expm(0.5 * period * np.array([[0.0, 1.0], [-k, -c]]))
    exact = -np.linalg.solve(np.eye(2) + half, (np.eye(2) - half) @ (force / k, 0.0))
    np.testing.assert_allclose(orbit.y, exact, rtol=1e-10)
    np.testing.assert_allclose(np.prod(orbit.multipliers), np.linalg.det(half) ** 2, rtol=1e-9)


@pytest.mark.slow
def test_an_orbit_with_a_triangular_force_is_the_end_of_a_long_run():
    period, values = 0.9, {"f": 4.0}
    inputs = {"time": period * np.array([0.0, 0.25, 0.75, 1.0]), "F_ext": [0.0, 9.0, -9.0, 0.0]}
    (orbit,) = harness.orbit(native("coulomb"), values, inputs=inputs, period=period).motions
    long = {
        "time": np.append((period * np.arange(60)[:, None] + inputs["time"][:-1]).ravel(), 60 * period),
        "F_ext": np.append(np.tile(inputs["F_ext"][:-1], 60), 0.0),
    }
    settings = values | {"solver.method": "dop853", "solver.rtol": 1e-12}
    run = harness.simulate(native("coulomb"), settings, inputs=long, times=long["time"][1:])
    assert orbit.n_sticks == 2
    np.testing.assert_allclose(orbit.y, [run["x"][-1], run["v"][-1]], rtol=1e-8)
    stuck = harness.orbit(native("coulomb"), over={"f": [5.0, 6.5, 8.0]}, inputs=inputs, period=period)
    assert [(item.n_sticks, item.stability) for item in stuck.motions] == [(2, "stable"), (2, "stable"), (2, "")]
    over = {"f": [3.0, 4.0, 5.0]}
    labels = harness.map_motions(native("coulomb"), over, inputs=inputs, period=period).labels
    assert labels[1] == "2 sticks in a period"
    with pytest.raises(harness.SceneError, match="give the table of one period"):
        harness.orbit(native("coulomb"), inputs=inputs)


def hartog(frequency, m=1.0, k=100.0, force=10.0, friction=6.0):
    """Return the amplitude without stops of Den Hartog's oscillator."""
    r = frequency / sqrt(k / m)
    u = np.sin(pi / r) / (r * (1 + np.cos(pi / r)))
    return force / k * sqrt(1 / (1 - r * r) ** 2 - (friction / force * u) ** 2)


def test_a_forced_oscillator_without_stops_has_the_amplitude_of_den_hartog():
    result = harness.orbit(native("forced"), over={"Omega": [5.0, 7.0, 9.0, 13.0]})
    stops, *others = result.motions
    assert (stops.kind, stops.n_sticks) == (STICK_SLIP, 2)
    for orbit in others:
        assert (orbit.kind, orbit.stability) == (SLIDING, "stable")
        assert orbit.amplitude == pytest.approx(hartog(orbit.value), rel=1e-10)
        assert orbit.period == pytest.approx(2 * pi / orbit.value, rel=1e-14)
    (point,) = result.points
    assert point.kind == "2 sticks in a period become 0 sticks in a period"
    assert 5.0 < point.value < 7.0


def multipliers_without_stops(frequency, m=1.0, k=100.0, force=10.0, friction=6.0):
    """Return the multipliers of Den Hartog's oscillator, from the closed form of its motion between turning points.

    Where it turns, a small difference of speeds is multiplied by the ratio of the accelerations after and before.
    """
    w, largest, half = sqrt(k / m), hartog(frequency, m, k, force, friction), pi / frequency
    c, s = np.cos(w * half), np.sin(w * half)
    # x = p cos(frequency t) - q sin(frequency t) + friction/k + a cos(w t) + b sin(w t) from the maximum to the minimum
    rows = [1, 0, 1, 0], [0, -frequency, 0, w], [-1, 0, c, s], [0, frequency, -w * s, w * c]
    p, *_ = np.linalg.solve(rows, [largest - friction / k, 0, -largest - friction / k, 0])
    load = p * (k - m * frequency**2) - k * largest  # force and spring at the maximum
    jump = np.diag([1.0, (load + friction) / (load - friction)])
    return np.linalg.eigvals(np.linalg.matrix_power([[c, s / w], [-w * s, c]] @ jump, 2))


@pytest.mark.parametrize("frequency", slow_after(1, (7.0, 9.0, 13.0)))
def test_the_multipliers_without_stops_are_those_of_the_closed_form(frequency):
    """As S. W. Shaw found: all motions without stops and with damping are stable."""
    (orbit,) = harness.orbit(native("forced"), {"Omega": frequency}).motions
    np.testing.assert_allclose(orbit.multipliers, multipliers_without_stops(frequency), rtol=1e-8)
    assert orbit.stability == "stable"


@pytest.mark.slow
def test_at_half_the_natural_frequency_the_multiplier_is_1_and_the_slow_motion_is_named():
    """G. Csernak, G. Stepan, S. W. Shaw: marginally stable motions at 1/2n of it."""
    assert multipliers_without_stops(5.0, friction=2.0).max() == pytest.approx(1.0, abs=1e-14)
    result = harness.orbit(native("forced"), {"Omega": 5.0, "f": 2.0})
    assert not result.motions
    assert "slow to settle" in result.remarks[0]


STOPS = {
    0: (7, 2),
    2: (3, 2),
    4: (0.7, 1),
    6: (0.7, 3),
    8: (0.7, 5),
    10: (0.4, 3),
    12: (0.4, 4),
    14: (0.25, 3),
}


@pytest.mark.slow
def test_a_forced_mass_has_the_counts_of_stops_of_hong_and_liu():
    """H.-K. Hong, C.-S. Liu, Journal of Sound and Vibration 229 (2000) 1171-1192, name these counts, and 1."""
    for stops, (frequency, friction) in STOPS.items():
        result = harness.orbit(native("forced"), {"Omega": frequency, "f": friction})
        assert [(orbit.n_sticks, orbit.stability) for orbit in result.motions] == [(stops, "stable")]


@pytest.mark.slow
def test_an_edge_between_counts_of_stops_is_one_point():
    """Near it the count is a matter of rounding errors."""
    result = harness.map_motions(native("forced"), {"Omega": [0.6, 0.68]}, {"f": 2.0})
    (edge,) = result.edges
    assert (edge.below, edge.above) == ("6 sticks in a period", "4 sticks in a period")


def test_a_motion_that_does_not_repeat_is_named_and_not_drawn():
    """A force on a spring without friction: two frequencies that never meet."""
    result = harness.orbit(native("forced"), {"f": 0.0, "Omega": 3.1})
    assert not result.motions
    assert "has not repeated" in result.remarks[0]
    with pytest.raises(harness.HarnessError, match="nothing to plot"):
        result.plot()


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


@pytest.mark.slow
@pytest.mark.parametrize("section", [None, "x1", "mode1"])
def test_an_orbit_of_two_blocks_is_found_by_each_section_and_repeats_in_scipy(section):
    result = harness.orbit(pair(), {"v_b": 0.8}, section=section)
    orbit = motion(result, STICK_SLIP)
    assert (orbit.n_sticks, orbit.stability) == (2, "stable")
    assert orbit.period == pytest.approx(3.5388039025118, rel=1e-11)
    if section:
        np.testing.assert_allclose(follow_pair(orbit.y, 0.8, orbit.period), orbit.y, atol=1e-10)
    marked = result.paths[-1][result.paths[-1][:, 3] > 0.0]
    assert len(marked) == (2 if section is None else 1)
    if section == "x1":
        assert abs(marked[0, 1]) < 1e-12


@pytest.mark.slow
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


@pytest.mark.slow
def test_of_a_python_fmu_its_native_twin_is_run(tmp_path):
    require_compiler()
    folder = build_user_model(commands.ROOT / "fmus" / "more" / "belt.py")
    file = shutil.copy(folder / "belt.fmu", tmp_path)
    values = {"c": 0.1, "v_belt": 2.0}
    found, expected = (harness.orbit(source, values).motions for source in (file, native("belt")))
    assert [(item.kind, item.period) for item in found] == [(item.kind, item.period) for item in expected]


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
        pytest.param("sleds", "no parameter sets v_1 at the start", marks=pytest.mark.slow),
        pytest.param("clutch", "no force that depends on a position or a speed", marks=pytest.mark.slow),
    ],
)
def test_models_without_starts_or_oscillations_are_refused(name, message):
    with pytest.raises(harness.HarnessError, match=message):
        harness.orbit(native(name))


def test_the_command_saves_what_the_function_returns(tmp_path):
    result = commands.harness(tmp_path, "orbit", native("belt"), "--set", "c=0.1", "--over", "v_belt=1:2:3", "--json")
    loaded = harness.load_result(tmp_path / "results" / "orbit" / "belt-v_belt")
    assert f'"value": {loaded.points[0].value!r}' in result.stdout
    for span in ("2:1", "1:2:2", "1:2:x", "1"):
        refused = commands.harness(tmp_path, "orbit", native("belt"), "--over", f"v_belt={span}")
        assert (refused.returncode, "for 3 values or more, v_belt=0.1:3:60" in refused.stderr) == (2, True)


def test_the_map_of_the_belt_has_the_edges_of_closed_forms():
    """Also in worker processes; constant friction leaves steady sliding stable, and both motions possible."""
    over = {"c": [0.05, 0.1, 0.2], "v_belt": [0.1, 0.12, 1.5]}
    result = harness.map_motions(native("belt"), over, {"law": "coulomb"})
    both, steady = "steady sliding or stick-slip", "steady sliding"
    assert result.labels == (both,) * 6 + (steady,) * 3
    assert {(edge.below, edge.above) for edge in result.edges} == {(both, steady)}
    for edge, c in zip(result.edges, over["c"], strict=True):
        assert edge.point == pytest.approx((c, edge_of_stick_slip(c)), rel=1e-11)
    shared = harness.map_motions(native("belt"), over, {"law": "coulomb"}, workers=2)
    assert shared.edges == result.edges


@pytest.mark.slow
def test_a_map_of_an_fmu_of_another_tool_counts_returns_by_its_saved_states(tmp_path):
    """Without the variables that expose its steps, the belt is such an FMU."""
    rename = {"modelDescription.xml": lambda text: text.replace("solver.t_next", "solver.next")}
    fmu = edited_copy(native("belt"), tmp_path / "other.fmu", rename)
    over, values = {"v_belt": [0.1, 0.3]}, {"law": "coulomb", "c": 0.2, "solver.rtol": 1e-12}
    result = harness.map_motions(fmu, {"v_belt": [0.1, 0.2, 0.3]}, values, section="v")
    (edge,) = result.edges
    assert (edge.below, edge.above) == ("1 return in a period", "no return")
    assert edge.point[0] == pytest.approx(edge_of_stick_slip(0.2), rel=1e-10)
    with pytest.raises(harness.SceneError, match="name a section, one of its outputs, or a measure"):
        harness.map_motions(fmu, over, values)
    with pytest.raises(harness.SceneError, match="returns are counted without inputs"):
        harness.map_motions(fmu, over, values, section="v", inputs={"time": [0.0, 1.0], "F_ext": [0.0, 1.0]})
    with pytest.raises(harness.SceneError, match="unknown section 'speed'"):
        harness.map_motions(fmu, over, values, section="speed")
    without = {"modelDescription.xml": lambda text: re.sub(r'can\w+FMUstate="true"', "", text)}
    other = edited_copy(fmu, tmp_path / "none.fmu", without)
    with pytest.raises(harness.HarnessError, match="does not save its states"):
        harness.map_motions(other, over, values, section="v")


def test_a_map_of_the_number_of_slips_has_the_edges_of_the_closed_form():
    m, k, mu_s, g, speed, stop = 12.5, 742.5, 0.9, 9.81, 0.034, 16.0
    frequency = sqrt(k / m)

    def start_of_slip(mu_d, number):
        fall = (mu_s - mu_d) * m * g / k
        period = 2 * fall / speed + 2 / frequency * (pi - atan(fall * frequency / speed))
        return mu_s * m * g / (k * speed) + (number - 1) * period

    result = harness.map_motions(native("stickslip"), {"mu_d": [0.3, 0.5, 0.7]}, measure="slips")
    assert result.labels == ("slips 2", "slips 3", "slips 5")
    for edge, number in zip(result.edges, (3, 4, 5), strict=True):
        exact = brentq(lambda mu_d, n=number: start_of_slip(mu_d, n) - stop, 0.3, 0.8, xtol=1e-15)
        assert edge.point[0] == pytest.approx(exact, rel=1e-11)
    for options, message in (
        ({"levels": [1.0]}, "`levels` has no effect without `measure`"),
        ({"measure": "slips", "section": "v"}, "`section` has no effect with `measure`"),
        ({"measure": "speed"}, "unknown measure of stickslip 'speed'"),
    ):
        with pytest.raises(harness.SceneError, match=message):
            harness.map_motions(native("stickslip"), {"mu_d": [0.3, 0.7]}, **options)
    with pytest.raises(harness.SceneError, match="is not a whole number: give the levels"):
        harness.map_motions(native("stickslip"), {"mu_d": [0.3, 0.7]}, measure="peak_speed")
    levels = harness.map_motions(
        native("stickslip"), {"mu_d": [0.3, 0.5, 0.7]}, measure="peak_speed", levels=[0.3, 0.5]
    )
    assert levels.labels == ("0.5 <= peak_speed", "0.5 <= peak_speed", "peak_speed < 0.3")
    for edge, level in zip(levels.edges, (0.5, 0.3), strict=True):  # in closed form
        assert speed + sqrt((frequency * (mu_s - edge.point[0]) * m * g / k) ** 2 + speed**2) == pytest.approx(
            level, rel=1e-4
        )


@pytest.mark.slow
def test_a_map_by_a_cluster_is_the_same():
    distributed = pytest.importorskip("distributed")
    source, over, values = native("belt"), {"c": [0.05, 0.1], "v_belt": [0.1, 0.12, 1.5]}, {"law": "coulomb"}
    options = {"processes": False, "n_workers": 2, "threads_per_worker": 2, "dashboard_address": None}
    with distributed.LocalCluster("127.0.0.1", protocol="tcp://", **options) as cluster:
        result = harness.map_motions(source, over, values, scheduler=cluster.scheduler_address)
    assert result.edges == harness.map_motions(source, over, values).edges
    with pytest.raises(harness.SceneError, match="workers has no effect with scheduler"):
        harness.map_motions(source, over, values, workers=2, scheduler="tcp://127.0.0.1:1")


@pytest.mark.slow
def test_the_map_of_a_forced_mass_counts_its_stops():
    result = harness.map_motions(native("forced"), {"Omega": [5.0, 6.0, 7.0]})
    assert result.labels == (*["2 sticks in a period"] * 2, "0 sticks in a period")
    value = result.edges[-1].point[0]
    assert value == pytest.approx(
        harness.orbit(native("forced"), over={"Omega": [6.0, 6.5, 7.0]}).points[0].value, rel=1e-9
    )


def test_the_command_map_saves_what_the_function_returns(tmp_path):
    arguments = ("--over", "v_belt=0.4:6:3", "--over", "c=0.1:0.2:3", "--workers", "1", "--json")
    result = commands.harness(tmp_path, "map", native("belt"), *arguments)
    loaded = harness.load_result(tmp_path / "results" / "map" / "belt-v_belt-c")
    stable = [edge.point for edge in loaded.edges if edge.below == "stick-slip"]
    assert stable[0][0] == pytest.approx((sqrt(DELTA * STATIC / C) - 1) / DELTA, rel=1e-11)
    assert result.returncode == 0
