"""Friction over velocity is identified from points and from records over time."""

import numpy as np
import pytest
from scipy.optimize import curve_fit

import harness
from harness import HarnessError, SceneError

SPEEDS = np.geomspace(1e-3, 0.3, 12)
V = np.concatenate([SPEEDS, -SPEEDS])
TRUTH = {"F_c": 10.0, "F_s": 16.0, "v_s": 0.02, "F_v": 20.0, "bias": 0.3}


def stribeck(v, F_c, F_s, v_s, F_v, bias):
    return np.sign(v) * (F_c + (F_s - F_c) * np.exp(-((v / v_s) ** 2))) + F_v * v + bias


def noisy_points(seed, sigma=0.2):
    return stribeck(V, **TRUTH) + sigma * np.random.default_rng(seed).standard_normal(len(V))


def ramps_and_plateaus(mass):
    """Times, velocity, position and driving force of nine speeds in both directions."""
    step = 0.002
    parts = [
        np.concatenate([np.linspace(0, v, 100), np.full(700, v), np.linspace(v, 0, 100), np.zeros(50)])
        for speed in np.geomspace(2e-3, 0.3, 9)
        for v in (speed, -speed)
    ]
    v = np.concatenate(parts)
    force = mass * np.gradient(v, step) + np.where(v == 0, 0.0, stribeck(v, **TRUTH))
    return np.arange(len(v)) * step, v, np.cumsum(v) * step, force


def assert_covers_truth(curve, margin=1.0):
    """Check the interval of each constant, widened by a factor about its value."""
    assert curve.best.name == "stribeck"
    for name, value in TRUTH.items():
        estimate = curve[name]
        assert estimate.value + margin * (estimate.low - estimate.value) <= value
        assert value <= estimate.value + margin * (estimate.high - estimate.value)


def test_constants_and_standard_errors_equal_those_of_scipy():
    force = noisy_points(1)
    curve = harness.identify_curve((V, force))
    values, covariance = curve_fit(stribeck, V, force, [*TRUTH.values()])
    estimates = [curve[name] for name in TRUTH]
    np.testing.assert_allclose([item.value for item in estimates], values, rtol=1e-5)
    np.testing.assert_allclose([item.error for item in estimates], np.sqrt(np.diag(covariance)), rtol=1e-3)
    rss = float(((force - stribeck(V, *values)) ** 2).sum())
    assert curve.best.bic == pytest.approx(len(V) * np.log(rss / len(V)) + 5 * np.log(len(V)))


@pytest.mark.parametrize("law", ["coulomb", "viscous", "tustin", "stribeck", "asymmetric-viscous"])
def test_the_law_of_the_points_is_found(law):
    ratio = np.abs(V) / 0.02
    fall = {"tustin": np.exp(-ratio), "stribeck": np.exp(-(ratio**2))}.get(law, 0.0 * V)
    force = np.sign(V) * (10 + 6 * fall) + (0 if law == "coulomb" else 20.0) * V
    force = np.where((V > 0) & law.startswith("asymmetric"), 1.5 * force, force)
    force += 0.05 * np.random.default_rng(3).standard_normal(len(V))
    assert harness.identify_curve((V, force)).best.name == law


def test_points_that_do_not_fit_are_named_and_left_out():
    force = noisy_points(2, sigma=0.05)
    force[[4, 15, 20]] += [2.0, -1.5, 1.0]
    curve = harness.identify_curve((V, force))
    assert np.flatnonzero(~curve.used).tolist() == [4, 15, 20]
    assert "3 of 24 points do not fit" in curve.remarks[0]
    assert f"row 5 ({V[4]:.4g} m/s, {force[4]:.4g} N" in curve.remarks[0]
    assert_covers_truth(curve, 1.5)


@pytest.mark.parametrize("signal", ["v [m/s]", "x [m]", "v [mm/s]"])
def test_plateaus_of_a_record_become_points_without_inertia(signal):
    t, v, x, force = ramps_and_plateaus(mass=3.0)
    rng = np.random.default_rng(1)
    motion = np.round(x / 1e-6) * 1e-6 if signal == "x [m]" else v + 1e-4 * rng.standard_normal(len(v))
    motion = 1e3 * motion if "mm" in signal else motion
    force = force + 0.05 * rng.standard_normal(len(v))
    curve = harness.identify_curve({"t [s]": t, signal: motion, "F [N]": force}, mass=3.0)
    assert "18 plateaus of constant velocity are used" in curve.points.notes[-1]
    assert_covers_truth(curve, 1.5)


def test_a_sweep_without_plateaus_gives_points_without_inertia():
    t = np.arange(20000) * 0.002
    v = 0.2 * np.sin(2 * np.pi * t / 20)
    force = stribeck(v, **TRUTH) + 5.0 * 0.2 * 2 * np.pi / 20 * np.cos(2 * np.pi * t / 20)
    force += 0.05 * np.random.default_rng(1).standard_normal(len(v))
    curve = harness.identify_curve({"t [s]": t, "v [m/s]": v, "F [N]": force}, mass=5.0)
    assert "no plateaus" in curve.points.notes[-1]
    for name, value in TRUTH.items():
        assert curve[name].value == pytest.approx(value, rel=0.03)


@pytest.mark.parametrize("backlash", [4e-3, 0.0])
def test_the_region_of_the_backlash_is_left_out(backlash):
    """Without load in the first 4 mm after a reversal, the force there is not the friction; long plateaus show it."""
    t, v, x, force = ramps_and_plateaus(mass=0.0)
    reversal = np.zeros(len(v))
    direction, start = 0.0, 0.0
    for i in np.flatnonzero(v):
        if np.sign(v[i]) != direction:
            direction, start = np.sign(v[i]), x[i]
        reversal[i] = abs(x[i] - start)
    free = reversal < 4e-3
    free[x < x[np.flatnonzero(v < 0)[0]]] &= True
    force = np.where(free & (np.abs(v) > 0.02), 0.0, force)
    record = {"t [s]": t, "v [m/s]": v, "F [N]": force + 0.02 * np.random.default_rng(4).standard_normal(len(v))}
    curve = harness.identify_curve(record, backlash=backlash)
    fast = np.abs(curve.points.v) > 0.02
    np.testing.assert_allclose(curve.points.force[fast], stribeck(curve.points.v[fast], **TRUTH), atol=0.05)


def test_a_current_becomes_a_torque_by_the_constant_of_the_motor():
    record = {"speed [rpm]": V * 60 / (2 * np.pi), "i [mA]": 1e3 * noisy_points(1) / 0.5}
    curve = harness.identify_curve(record, current="i", constant="0.5 N.m/A")
    direct = harness.identify_curve({"speed [rad/s]": V, "torque [N.m]": noisy_points(1)})
    assert [item.unit for item in curve.estimates] == ["N.m", "N.m", "rad/s", "N.m.s/rad", "N.m"]
    np.testing.assert_allclose([item.value for item in curve.estimates], [item.value for item in direct.estimates])


@pytest.mark.parametrize(
    ("headings", "note"),
    [
        (
            "v [m/s],F [N],G [N]",
            "Of F [N], G [N], F [N] is used, because it is named friction, or is the first force; ",
        ),
        ("v [m/s],w [m/s],F [N]", "Of v [m/s], w [m/s], v [m/s] is used, because it comes first; `velocity` selects"),
    ],
)
def test_a_choice_of_several_columns_names_the_others(tmp_path, headings, note):
    v = np.outer([1, -1], np.geomspace(0.02, 0.5, 8)).ravel()
    force = 2 * np.sign(v) + 0.8 * v
    columns = [v, force, 2 * force] if "G" in headings else [v, 2 * v, force]
    np.savetxt(tmp_path / "c.csv", np.column_stack(columns), delimiter=",", header=headings, comments="")
    curve = harness.identify_curve(tmp_path / "c.csv")
    assert any(text.startswith(note) for text in curve.points.notes)
    assert curve["F_v"].value == pytest.approx(0.8)


def test_a_force_against_the_motion_is_reversed():
    forward, backward = (harness.identify_curve((V, sign * noisy_points(1))) for sign in (1, -1))
    assert backward["F_c"].value == pytest.approx(forward["F_c"].value)
    assert "opposes the velocity" in backward.points.notes[-1]


def test_one_direction_needs_a_known_bias():
    force = stribeck(SPEEDS, **TRUTH)
    with pytest.raises(SceneError, match=r"only forward motion, .* as in bias=0"):
        harness.identify_curve((SPEEDS, force))
    for sign in (1, -1):
        curve = harness.identify_curve((SPEEDS, sign * force), bias=sign * 0.3)
        assert curve["F_s"].value == pytest.approx(16.0, rel=1e-6)
    with pytest.raises(HarnessError, match="friction would drive the motion in one direction"):
        harness.identify_curve((V, noisy_points(1)), bias=30.0)


REFUSED_RECORDS = [
    ({"v [m/s]": V, "F [kg]": V}, {"force": "F"}, "F is in kg, and the velocity is in m/s: give a force"),
    ({"v [m/s]": V, "T [N.m]": V}, {}, "T is in N.m, and the velocity is in m/s"),
    ({"v [m]": V, "F [N]": V}, {"velocity": "v"}, "v is in m, which is not the unit of a velocity"),
    ({"v [m/s]": V[:5], "F [N]": V[:5]}, {}, "has 5 points with velocity; at least 6"),
    ({"v [m/s]": np.sign(V), "F [N]": V}, {}, "all points have the speed 1 m/s; measure at several"),
    ({"v [m/s]": V, "F [N]": V * np.nan}, {}, "24 of 24 rows have no number for v or F"),
    ({"v [m/s]": V, "F [N]": V}, {"force": "G"}, r"unknown column 'G'; allowed: F \[N\], v \[m/s\]"),
    ({"v [m/s]": V, "G": V}, {}, r"no column of forces \(it has v \[m/s\], G\): name it"),
    ({"w": V, "F [N]": V}, {}, r"no column of velocities \(it has w, F \[N\]\): name it"),
    ({"v [m/s]": V, "i [A]": V}, {"current": "i"}, "a current needs the constant of the motor"),
    ({"v [m/s]": V, "i [A]": V}, {"current": "i", "constant": "2 N.m/A"}, "give it in N/A"),
    ({"v [m/s]": V, "i [A]": V}, {"current": "i", "constant": "two"}, "give a number other than 0 and a unit"),
    ({"v [m/s]": V, "F [N]": V}, {"constant": "2 N/A"}, "constant has no effect, because F .* is no current"),
    ({"v [m/s]": V, "F [N]": V}, {"begin": 0.0}, "no effect on points without times"),
    ({"v [m/s]": V, "F [N]": V}, {"backlash": 0.1}, "no effect on points without times"),
    ({"x [m]": V, "F [N]": V}, {"position": "x"}, "has no column of times"),
    ({"t [s]": np.arange(24.0), "v [m/s]": 0 * V, "F [N]": V}, {}, "too little motion"),
]


@pytest.mark.parametrize(("record", "options", "message"), REFUSED_RECORDS)
def test_points_without_a_curve_are_refused_in_a_sentence(record, options, message):
    with pytest.raises(HarnessError, match=message) as refusal:
        harness.identify_curve(record, **options)
    assert "\n" not in str(refusal.value)
