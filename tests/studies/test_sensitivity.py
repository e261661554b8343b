"""Derivatives through stick and slip, of built FMUs against closed forms with 40 digits and differences of runs."""

from functools import partial
from itertools import pairwise, product
from math import inf

import mpmath
import numpy as np
import pytest
from build_cache import ROOT, build_user_model
from external_fmus import build_external_fmus, edited_copy
from fmi3_fixtures import build_fmi3_fmus
from models import MODELS
from native_fmus import build_native_fmus
from variants import campaign_after, slow_after

import harness
from benchmarks.campaigns.random_models import STOP, random_structure, random_values, write_model

DOP853 = 4
PAIR = '''"""Two blocks under one force."""
from fmus import Contact, Fixed, Mode, Model, Output, Parameter, State, choose, sin

class Pair(Model):
    """Two blocks under one force."""

    m = Parameter(1.0, "kg", "mass of each block")
    k = Parameter(50.0, "N/m", "stiffness of each spring")
    f1 = Parameter(3.0, "N", "sliding friction of block 1")
    f2 = Parameter(100.0, "N", "sliding friction of block 2")
    ratio = Parameter(1.0, "1", "static friction over sliding friction")
    P = Parameter(6.0, "N", "amplitude of the force")
    Omega = Parameter(2.0, "rad/s", "frequency of the force")
    stop = Parameter(100.0, "m", "position of a second spring")
    phase = Fixed(0.0, "rad", "phase at the start")
    x1 = State("m", "position 1")
    v1 = State("m/s", "speed 1", rate_of=x1)
    x2 = State("m", "position 2")
    v2 = State("m/s", "speed 2", rate_of=x2)
    travel = State("rad", "phase since the start", rate=Omega)
    mode_1, mode_2 = Mode(), Mode()
    F = Output("N", "force", P * sin(phase + travel))
    S = Output("N", "force of the second spring", choose(x1 > stop, -4.0 * k * (x1 - stop) - 0.2 * f1, 0.0))
    F_1 = Contact("N", "friction 1", mode=mode_1, slip=v1, slide=f1, hold=ratio * f1)
    F_2 = Contact("N", "friction 2", mode=mode_2, slip=v2, slide=f2, hold=ratio * f2)
    a1 = Output("m/s2", "acceleration 1", (F + S - k * x1 - F_1) / m, rate_of=v1)
    a2 = Output("m/s2", "acceleration 2", (F - k * x2 - F_2) / m, rate_of=v2)
    stop_time, step_size, method = 3.0, 0.003, "dop853"
'''


@pytest.fixture(scope="module")
def pair(tmp_path_factory):
    """The native FMU of two blocks under one force."""
    path = tmp_path_factory.mktemp("pair") / "pair.py"
    path.write_text(PAIR)
    return build_user_model(path, "--native", "--platform", "linux64") / "native" / "pair.fmu"


def smd(t, m, k, c, x0, v0):
    """Return position and speed of a damped oscillator."""
    decay = c / (2 * m)
    w = mpmath.sqrt(k / m - decay**2)
    b = (v0 + decay * x0) / w
    shrink, cos, sin = mpmath.exp(-decay * t), mpmath.cos(w * t), mpmath.sin(w * t)
    return shrink * (x0 * cos + b * sin), shrink * ((b * w - decay * x0) * cos - (x0 * w + decay * b) * sin)


def coulomb(t, m, k, f, x0):
    """Return position and speed of a mass with dry friction, released at rest, before it stops."""
    w = mpmath.sqrt(k / m)
    n = int(mpmath.floor(t * w / mpmath.pi))
    amplitude, phase = x0 - (2 * n + 1) * f / k, w * t - n * mpmath.pi
    return (-1) ** n * (amplitude * mpmath.cos(phase) + f / k), -((-1) ** n) * amplitude * w * mpmath.sin(phase)


def stickslip(t, m, k, mu_s, mu_d, g, v_driver):
    """Return position and speed of the sled."""
    w, d, x = mpmath.sqrt(k / m), (mu_s - mu_d) * m * g / k, mpmath.mpf(0)
    slip = 2 * (mpmath.pi - mpmath.atan2(d * w, v_driver)) / w
    while True:
        begin = (mu_s * m * g / k + x) / v_driver
        s = min(t - begin, slip)
        if s < 0:
            return x, mpmath.mpf(0)
        sin, cos = mpmath.sin(w * s), mpmath.cos(w * s)
        x += d + v_driver * s - d * cos - v_driver / w * sin
        if s < slip:
            return x, v_driver + d * w * sin - v_driver * cos


def ball(t, h, v, e, g):
    """Return height and speed of a bouncing ball."""
    while True:
        fall = (v + mpmath.sqrt(v * v + 2 * g * h)) / g
        if t < fall:
            return h + v * t - g * t * t / 2, v - g * t
        t, h, v = t - fall, mpmath.mpf(0), -e * (v - g * fall)


SLED = {"m": 12.5, "k": 742.5, "mu_s": 0.9, "mu_d": 0.6, "g": 9.81, "v_driver": 0.034}
CLOSED_FORMS = {  # values of all parameters, times, and the number of events
    smd: ({"m": 1.0, "k": 157.9, "c": 2.0, "x0": 0.1, "v0": -0.3}, (0.4, 2.0, 4.0), 0),
    coulomb: ({"m": 1.0, "k": 157.9, "f": 0.15, "x0": 0.1}, (0.1, 1.6, 12.4), 49),
    stickslip: (SLED, (3.0, 4.6, 8.0, 14.6, 16.0, 85.2), 50),
    ball: ({"h": 1.0, "v": 0.0, "e": 0.7, "g": 9.81}, (0.3, 1.0, 1.9), 4),
}


@pytest.mark.parametrize("closed_form", CLOSED_FORMS, ids=lambda function: function.__name__)
def test_derivatives_are_those_of_the_closed_form(closed_form):
    values, times, n_events = CLOSED_FORMS[closed_form]
    name = closed_form.__name__
    fmu = build_external_fmus() / "Bouncing.fmu" if closed_form is ball else build_native_fmus() / f"{name}.fmu"
    outputs = ["h", "v"] if closed_form is ball else ["x", "v"]
    s = harness.sensitivity(fmu, list(values), values, times=times, outputs=outputs, rtol=1e-12)
    assert (len(s.events), s.remarks) == (n_events, ())
    with mpmath.workdps(40):
        numbers = {name: mpmath.mpf(value) for name, value in values.items()}
        for (parameter, value), (j, output) in product(numbers.items(), enumerate(outputs)):

            def at(number, t, parameter=parameter, j=j):
                return closed_form(mpmath.mpf(t), **{**numbers, parameter: number})[j]

            expected = [float(mpmath.diff(partial(at, t=t), value)) for t in times]
            assert s[output] == pytest.approx([float(at(value, t)) for t in times], rel=1e-10, abs=1e-13)
            largest = np.abs(expected).max()
            assert s[output, parameter] == pytest.approx(expected, rel=1e-9, abs=1e-11 * largest), (parameter, output)


def differences(fmu, parameter, value, values, times, outputs, share=1e-4):
    """Return the derivatives (times, outputs) by a parameter, by differences of five runs of co-simulation."""
    h, solver = share * (abs(value) or 1.0), {"solver.method": DOP853, "solver.rtol": 1e-13}

    def run(change):
        trajectory = harness.simulate(fmu, values | solver | {parameter: value + change}, times=times, outputs=outputs)
        return np.column_stack([trajectory[name] for name in outputs])

    return (8 * (run(h) - run(-h)) - (run(2 * h) - run(-2 * h))) / (12 * h)


PENDULUM = ["m", "mu", "a", "J_G", "r", "g", "theta0"]
OTHERS = [
    ("pendulum", PENDULUM, {}, ["theta", "omega", "alpha", "energy"]),
    ("pendulum", PENDULUM, {"pin_load": "reaction"}, ["theta", "omega", "T_friction"]),
    ("coulomb", ["m", "k", "f", "c", "x0", "v0"], {"c": 0.1, "v0": -0.2}, ["x", "v", "F_friction", "energy"]),
    ("stickslip", ["F_ext", "x0", "v0", "k"], {"F_ext": 5.0, "x0": 0.02, "v0": 0.1}, ["x", "v", "F_spring"]),
    ("pacejka", ["k", "mu_d", "x_m"], {}, ["x", "v"]),
]


@pytest.mark.parametrize(("name", "parameters", "values", "outputs"), campaign_after(2, OTHERS))
def test_derivatives_are_those_of_differences(name, parameters, values, outputs):
    times = [2.0, 4.6, 5.1, 8.0] if name in ("stickslip", "pacejka") else [0.8, 1.7, 2.5, 3.3]
    fmu = build_native_fmus() / f"{name}.fmu"
    s = harness.sensitivity(fmu, parameters, values, times=times, outputs=outputs, rtol=1e-12)
    assert s.remarks == ()
    for i, (parameter, value) in enumerate(s.parameters.items()):
        expected = differences(fmu, parameter, value, values, times, outputs)
        sizes = np.abs(expected).max(axis=0) + 1e-2 * np.abs(s.values).max(axis=0) / (abs(value) or 1.0)
        assert (np.abs(s.left[:, i] - expected).max(axis=0) / sizes).max() < 1e-9, parameter


def test_conditions_and_parameters_that_are_fixed_have_derivatives(pair):
    """A second spring begins to act at `stop`, with a jump of the force; `phase` moves every break-away."""
    values, times = {"stop": 0.02, "ratio": 1.2, "phase": 0.4}, [1.0, 2.0, 3.0]
    parameters, outputs = ["m", "k", "f1", "P", "Omega", "stop", "ratio", "phase"], ["x1", "v1"]
    s = harness.sensitivity(pair, parameters, values, times=times, outputs=outputs, rtol=1e-12)
    assert {event.contact for event in s.events} == {"F_1", "condition 1"}
    for i, (parameter, value) in enumerate(s.parameters.items()):
        expected = differences(pair, parameter, value, values, times, outputs)
        assert s.left[:, i] == pytest.approx(expected, rel=1e-9, abs=1e-10 * np.abs(expected).max()), parameter


@pytest.mark.parametrize("name", slow_after(2, MODELS))
def test_fmi_3_has_the_same_derivatives(name):
    by = {"pendulum": ["mu", "theta0"], "smd": ["c", "x0"], "coulomb": ["f", "x0"]}.get(name, ["mu_s", "k"])
    times = [0.5, 1.0, 5.0] if name != "coulomb" else [0.5, 1.0, 3.0]
    fmi2_result, fmi3_result = (
        harness.sensitivity(folder / f"{name}.fmu", by, times=times)
        for folder in (build_native_fmus(), build_fmi3_fmus())
    )
    np.testing.assert_allclose(
        fmi2_result.left, fmi3_result.left, rtol=1e-13, atol=1e-13 * np.abs(fmi2_result.left).max()
    )


def test_the_factor_of_an_input_is_a_parameter():
    fmu, times = build_native_fmus() / "stickslip.fmu", [2.3, 5.1, 7.9]
    signal = {"time": [0.0, 1.0, 2.0, 4.0, 8.0], "F_ext": np.array([0.0, 10.0, -5.0, 20.0, 0.0])}

    def run(factor):
        inputs = signal | {"F_ext": factor * signal["F_ext"]}
        return harness.sensitivity(fmu, "F_ext", inputs=inputs, times=times, outputs=["x", "v"], rtol=1e-12)

    s, h = run(1.0), 1e-4
    changes = [run(1.0 + e).values for e in (h, -h, 2 * h, -2 * h)]
    expected = (8 * (changes[0] - changes[1]) - (changes[2] - changes[3])) / (12 * h)
    assert s.left[:, 0] == pytest.approx(expected, rel=1e-9, abs=1e-11)
    assert s.units["F_ext"] == ""


BREAKAWAY = 0.9 * 12.5 * 9.81 / (742.5 * 0.034)


@pytest.mark.parametrize("times", [(2.0, BREAKAWAY, 5.0), (2.0, BREAKAWAY)], ids=["recorded", "stop"])
def test_an_event_at_a_recorded_time_has_one_sided_derivatives(times):
    """A larger mu_s delays the break-away: the sled still sticks then."""
    s = harness.sensitivity(build_native_fmus() / "stickslip.fmu", ["mu_s", "k"], times=times, outputs=["x", "v", "a"])
    assert s.remarks == (f"No derivative by mu_s, k at t = {BREAKAWAY:.9g} s: an event happens then (F_friction).",)
    left, right = s.one_sided("a", "mu_s")
    assert np.isnan(s["a", "mu_s"]).tolist() == [t == BREAKAWAY for t in times]
    assert (right[1], np.isnan(left[1])) == (0.0, True)  # the acceleration jumps
    assert s.one_sided("v", "mu_s")[0][1] == pytest.approx(-0.3 * 9.81 * s.events[0].derivatives["mu_s"], rel=1e-9)
    assert np.isfinite(s["x", "mu_s"]).all()


def test_a_release_at_rest_has_a_derivative_by_the_speed_on_one_side():
    """Faster backward, the mass just goes on; forward, it turns first, against the friction."""
    fmu = build_native_fmus() / "coulomb.fmu"
    s = harness.sensitivity(fmu, ["v0", "x0"], times=[0.1, 0.2], outputs=["x", "v"])
    assert s.remarks == ("No derivative by v0 from t = 0 s: two modes are possible (F_friction).",)
    assert np.isnan(s["v", "v0"]).all()
    left, right = s.one_sided("v", "v0")
    assert left == pytest.approx(np.cos(np.sqrt(157.9) * s.t), rel=1e-9)
    assert np.isnan(right).all()
    assert np.isfinite(s["v", "x0"]).all()


@pytest.mark.parametrize(
    ("values", "parameters", "at", "reason"),
    [
        ({"P": 3.0}, ["P", "f1"], np.pi / 4, "a limit is touched, but not passed (F_1)"),
        ({"f2": 3.0}, ["f1", "P"], np.pi / 12, "two events happen at once (F_2)"),
    ],
    ids=["touch", "tie"],
)
def test_touches_and_ties_are_reported(pair, values, parameters, at, reason):
    """Both blocks break away under the same force; the static friction of both depends on P alike, on f1 does not."""
    s = harness.sensitivity(pair, parameters, values, stop=1.0, outputs=["x1"])
    (remark,) = s.remarks
    assert remark.startswith(f"No derivative by {', '.join(parameters[: 1 + ('touched' in reason)])} from t = ")
    assert remark.endswith(f" s: {reason}.")
    assert float(remark.split()[-len(reason.split()) - 2]) == pytest.approx(at, rel=1e-6)
    assert np.isnan(s["x1", parameters[0]]).tolist() == (s.t > at).tolist()
    has_sides = [bool(np.isfinite(side).all()) for side in s.one_sided("x1", parameters[0])]
    assert has_sides == ([True, False] if "touched" in reason else [False, False])  # a smaller force adds no event


def test_a_force_that_touches_the_limit_at_its_corner_is_reported():
    """A smaller mu_s, or a larger force, releases the sled."""
    fmu, force = (
        build_native_fmus() / "stickslip.fmu",
        {"time": [0.0, 1.0, 2.0], "F_ext": [0.0, 0.9 * 12.5 * 9.81, 0.0]},
    )
    values = {"v_driver": 0.0}
    s = harness.sensitivity(fmu, ["mu_s", "F_ext"], values, inputs=force, times=[0.5, 1.5, 2.0], outputs=["x"])
    assert s.remarks == ("No derivative by mu_s, F_ext from t = 1 s: two modes are possible (F_friction).",)
    left, right = s.one_sided("x", "mu_s")
    assert np.isnan(left).tolist() == [False, True, True]
    assert right.tolist() == [0.0, 0.0, 0.0]


@pytest.mark.campaign
@pytest.mark.parametrize("seed", range(30))
def test_derivatives_of_random_models_are_those_of_differences(seed, tmp_path):
    """Up to three bodies and contacts, with belts, drivers, limited loads and falling friction.

    The least error of three differences counts; three times what two of them differ is allowed as well.
    """
    structure = random_structure(seed)
    path = tmp_path / f"{structure.name}.py"
    path.write_text(write_model(structure))
    fmu = build_user_model(path, "--native", "--platform", "linux64") / "native" / f"{structure.name}.fmu"
    variables, times = {item.name for item in harness.describe(fmu).variables}, np.linspace(0.0, STOP, 9)[1:] * 0.983
    values = {name: value for name, value in random_values(structure, 0)[0].items() if name in variables}
    slide = {f"mu{i}": max(values.get(f"mu{i}_{ending}", 0.0) for ending in "dp") for i in range(3)}
    close = [name for name, value in slide.items() if values.get(f"{name}_s", inf) < 1.003 * value]
    without_neighbours = {f"{name}_{ending}" for name in close for ending in "dps"}  # the FMU refuses one side
    parameters = [
        name for name, value in values.items() if isinstance(value, float) and value and name not in without_neighbours
    ]
    s = harness.sensitivity(fmu, parameters, values, times=times, rtol=1e-12)
    outputs = list(s.outputs)
    largest = np.abs(s.values).max(axis=0)
    for i, (parameter, value) in enumerate(s.parameters.items()):
        quotients = [differences(fmu, parameter, value, values, times, outputs, h) for h in (1e-3, 1e-4, 1e-5)]
        sizes = 1e-2 * largest / abs(value), 1e-6 * largest.max() / abs(value)  # the second one for outputs at rest
        size = np.max([np.abs(quotients[1]).max(axis=0), np.maximum(*sizes)], axis=0)
        error = np.min([np.abs(s.left[:, i] - quotient) / size for quotient in quotients], axis=0)
        bound = 1e-8 + 3 * np.min([np.abs(a - b) / size for a, b in pairwise(quotients)], axis=0)
        assert not np.any(error > bound), (parameter, error.max())  # NaN: there is no derivative


@pytest.mark.parametrize(
    ("length", "time"),
    slow_after(2, [(2.0**-40, 1.0), (2.0**30, 1.0), (1.0, 2.0**-30), (1.0, 2.0**20), (2.0**-300, 1.0)]),
)
def test_derivatives_do_not_depend_on_the_units_of_length_and_time(length, time):
    """With units in which all numbers are a power of two larger or smaller."""
    fmu = build_user_model(ROOT / "fmus/more/forced.py", "--native", "--platform", "linux64") / "native/forced.fmu"
    names = "m", "k", "f", "P", "Omega"
    base = dict(zip(names, (1.0, 100.0, 6.0, 10.0, 4.0), strict=True))
    force, s = length / time**2, [None, None]
    scales = dict(zip(names, (1.0, 1.0 / time**2, force, force, 1.0 / time), strict=True))
    for i, units in enumerate((dict.fromkeys(names, 1.0), scales)):
        span = 8.0 * (time if i else 1.0)
        values = {name: base[name] * units[name] for name in names}
        s[i] = harness.sensitivity(fmu, names, values, times=np.linspace(0.0, span, 9)[1:], stop=span)
    assert [event.text for event in s[1].events] == [event.text for event in s[0].events]
    assert len(s[0].events) > 10
    assert s[0].remarks == s[1].remarks == ()
    for name in names:
        expected = s[0]["x", name] * length / scales[name]
        assert s[1]["x", name] == pytest.approx(expected, rel=0.0, abs=1e-10 * np.abs(expected).max())


def test_parameters_without_an_effect_are_named_once(capsys):
    s = harness.sensitivity(build_native_fmus() / "stickslip.fmu", ["eps", "k", "solver.rtol"], stop=5.0, outputs="x")
    assert s.remarks == ("Nothing depends on eps, solver.rtol: all derivatives are zero.",)
    assert not s.left[:, [0, 2]].any()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"parameters": "mu"}, "unknown parameter 'mu' (nearest: 'mu_s')"),
        ({"parameters": "friction"}, "unknown parameter 'friction'"),
        ({"outputs": "mode"}, "unknown output 'mode'"),
        ({"stop": -1.0}, "stop = -1.0 s is not after start = 0.0 s"),
        ({"times": [1.0, 9.0], "stop": 4.0}, "times has 9.0 s, outside the run from 0.0 s to 4.0 s"),
        ({"values": {"mu_d": 2.0}}, "mu_d is 2.0, above mu_s = 0.9"),
        ({"values": {"friction": "threshold"}}, "friction = 'threshold': its solution chatters"),
    ],
    ids=lambda value: "" if isinstance(value, str) else str(value),
)
def test_bad_arguments_are_refused(arguments, message):
    with pytest.raises(harness.HarnessError) as error:
        harness.sensitivity(build_native_fmus() / "stickslip.fmu", **{"parameters": "k"} | arguments)
    assert str(error.value).startswith(message)


def test_an_fmu_without_directional_derivatives_is_refused():
    with pytest.raises(harness.HarnessError, match="has no directional derivatives for model exchange; native FMUs"):
        harness.sensitivity(build_external_fmus() / "ModelExchangeOnly.fmu", "k")


def test_an_fmu_whose_states_jump_must_save_its_state(tmp_path):
    changes = {"modelDescription.xml": lambda text: text.replace('canGetAndSetFMUstate="true"', "")}
    fmu = edited_copy(build_external_fmus() / "Bouncing.fmu", tmp_path / "Bouncing.fmu", changes)
    with pytest.raises(harness.HarnessError, match=r"its states jump at t = 0\.45\d+ s, and it cannot save its state"):
        harness.sensitivity(fmu, "e")
