"""Periodic motions of oscillators under a periodic force, against closed forms and published counts of stops."""

from math import pi, sqrt

import numpy as np
import pytest
from scipy.linalg import expm
from variants import slow_after

import harness
from tests.studies.oscillators import build_text, native

CLOCK_MODEL = '''
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


@pytest.mark.campaign
@pytest.mark.parametrize(
    ("unit", "rate", "angle", "options"),
    [
        ("s", "1.0", "Omega * clock", {"period": 2 * pi / 7.0}),
        ("rad", "Omega", "clock", {}),
    ],
)
def test_a_force_by_a_clock_has_the_amplitude_of_den_hartog(unit, rate, angle, options):
    fmu = build_text("clocked", CLOCK_MODEL.replace("UNIT", repr(unit)).replace("RATE", rate).replace("ANGLE", angle))
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
    transition = expm(0.5 * period * np.array([[0.0, 1.0], [-k, -c]]))
    exact = -np.linalg.solve(np.eye(2) + transition, (np.eye(2) - transition) @ (force / k, 0.0))
    np.testing.assert_allclose(orbit.y, exact, rtol=1e-10)
    np.testing.assert_allclose(np.prod(orbit.multipliers), np.linalg.det(transition) ** 2, rtol=1e-9)


@pytest.mark.campaign
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
    result = harness.orbit(native("coulomb"), over={"f": [5.0, 6.5, 8.0]}, inputs=inputs, period=period)
    assert [(item.n_sticks, item.stability) for item in result.motions] == [(2, "stable"), (2, "stable"), (2, "")]
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


@pytest.mark.slow
def test_a_forced_oscillator_without_stops_has_the_amplitude_of_den_hartog():
    result = harness.orbit(native("forced"), over={"Omega": [5.0, 7.0, 13.0]})
    stops, *others = result.motions
    assert (stops.kind, stops.n_sticks) == ("stick-slip", 2)
    for orbit in others:
        assert (orbit.kind, orbit.stability) == ("sliding orbit", "stable")
        assert orbit.amplitude == pytest.approx(hartog(orbit.value), rel=1e-10)
        assert orbit.period == pytest.approx(2 * pi / orbit.value, rel=1e-14)
    (point,) = result.points
    assert point.kind == "2 sticks in a period become 0 sticks in a period"
    assert 5.0 < point.value < 7.0


def multipliers_without_stops(frequency, m=1.0, k=100.0, force=10.0, friction=6.0):
    """Return the multipliers of Den Hartog's oscillator, from the closed form of its motion between turning points.

    Where it turns, a small difference of speeds is multiplied by the ratio of the accelerations after and before.
    """
    w, largest, half_period = sqrt(k / m), hartog(frequency, m, k, force, friction), pi / frequency
    c, s = np.cos(w * half_period), np.sin(w * half_period)
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


@pytest.mark.campaign
def test_a_forced_mass_has_the_counts_of_stops_of_hong_and_liu():
    """H.-K. Hong, C.-S. Liu, Journal of Sound and Vibration 229 (2000) 1171-1192, name these counts, and 1."""
    for stops, (frequency, friction) in STOPS.items():
        result = harness.orbit(native("forced"), {"Omega": frequency, "f": friction})
        assert [(orbit.n_sticks, orbit.stability) for orbit in result.motions] == [(stops, "stable")]


@pytest.mark.campaign
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
