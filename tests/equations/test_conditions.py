"""Conditions of choose() and limits of friction forces, against motions that are pieced together."""

from functools import partial
from itertools import pairwise
from math import inf, pi

import numpy as np
import pytest
from build_cache import build_user_model
from fmpy import read_model_description
from model_text import remove_unused
from models import DOP853, ODE23, ODE45, RODAS, scalar_class
from row_comparison import assert_identical
from scipy.integrate import solve_ivp
from variants import campaign_after, slow_after
from worker_client import FmiError, FmpyError

from fmus.compiler.model_lookup import find_model

METHODS = (ODE23, ODE45, DOP853, RODAS)
LABELS = [f"--method={label}" for label in ("ode23", "ode45", "dop853", "rodas")]
KINDS = {
    "": (),
    "native": ("--native", "--platform", "linux64"),
    "native/fmi3": ("--fmi", "3", "--platform", "linux64"),
}
EVERY_KIND = pytest.mark.parametrize(  # in CI, model exchange shows the messages of native FMUs
    "kind", ["", *(pytest.param(kind, marks=pytest.mark.campaign) for kind in ("native", "native/fmi3"))]
)
STOP, K, F, GAP, T_ON, MU = 2.0, 100.0, 5.0, 0.1, 0.3, 0.5  # SI, as in the models
MODEL = '''from fmus import (
    Contact, Fixed, Input, Mode, Model, Output, Parameter, State, choose, exp, fabs, log, sin, sqrt
)

class {name}(Model):
    """Mass on a spring under a force that depends on a condition."""

    m = Parameter(1.0, "kg", "mass", above=0.0)
    k = Parameter(100.0, "N/m", "stiffness", low=0.0)
    f = Parameter(5.0, "N", "force", low=0.0)
    f_s = Parameter(7.0, "N", "larger force", low=0.0)
    v_s = Parameter(0.1, "m/s", "speed at which friction decays", above=0.0)
    gap = Parameter(0.1, "m", "gap", above=0.0)
    t_on = Parameter(0.3, "s", "time", above=0.0)
    mu = Parameter(0.5, "1", "coefficient of friction", low=0.0)
    Omega = Parameter(20.0, "rad/s", "angular frequency", low=0.0)
    x0 = Fixed(0.2, "m", "position at the start")
    v0 = Fixed(0.0, "m/s", "speed at the start")
    F_ext = Input(0.0, "N", "external force")
    N_ext = Input(10.0, "N", "normal force")
    x = State("m", "position", start=x0)
    v = State("m/s", "speed", start=v0, rate_of=x)
    clock = State("s", "time", rate=1.0)
    angle = State("rad", "phase angle", rate=Omega)
{lines}
    F = Output("N", "force", {force})
    a = Output("m/s2", "acceleration", (F - k * x{friction}) / m, rate_of=v)
    stop_time = 2.0
'''
FORCES = {
    "relay": "choose(x > 0.0, -f, f)",
    "atzero": "choose(x >= 0.0, -f, f)",
    "jump": "choose(x > gap, -f, 0.0)",
    "endstop": "choose(x > gap, 50.0 * k * (gap - x), 0.0)",
    "backlash": "k * x + choose(x > gap, k * (gap - x), choose(x < -gap, k * (-gap - x), 0.0))",
    "nested": "choose(x > gap, choose(v > 0.0, -2.0 * f, -f), 0.0)",
    "timed": "choose(clock > t_on, f, 0.0)",
    "both": "choose(x > 0.0, f, 0.0) + choose(clock >= t_on, f, 0.0)",
    "pressing": "F_ext - choose(x > 0.0, f * x / (10.0 * gap), 0.0)",
    "jumping": "choose(F_ext > 0.2 * f, f, F_ext)",
    "ramped": "choose(F_ext > 0.2 * f, f, F_ext) - k * x * x * x / (gap * gap)",
    "notch": "choose(fabs(x - gap) < 0.01 * gap, -40.0 * f, 0.0)",
    "cusped": "2.0 * f * (1.0 - fabs(sin(angle) - mu))",
    "pulsing": "choose(sin(angle) > 1.0 - mu, f, 0.0)",
    "chattering": "choose(v > 0.0, -f, f)",
    "domain": "choose(x > 0.0, -f * sqrt(x / gap) - f * log(x / gap + 1.0) - f * x / (x + gap), 0.0)",
}
CONTACTS = {  # slide and hold
    "slidinginput": "mu * N_ext",
    "slidingposition": "f * (1.0 + x / gap)",
    "slidingangle": "f * (1.0 + 2.0 * sin(angle))",
    "holdingtime": "f, hold=f * (2.0 - clock / t_on)",
    "holdingspeed": "f, hold=f * (0.5 + fabs(v) / v_s)",
    "lifting": "mu * f * (1.0 + 2.0 * sin(angle)), hold=2.0 * mu * f * (1.0 + 2.0 * sin(angle)), lifts_off=True",
    "guided": "mu * f * fabs(sin(angle)), hold=2.0 * mu * f * fabs(sin(angle))",
    "cusped": "0.5 * f, hold=1.999 * f",
    "switched": "mu * choose(x > 0.0, 2.0 * f, f), hold=f * choose(clock > t_on, 2.0, 1.0)",
}


def model_text(name):
    """Return the text of a model file."""
    return remove_unused(full_model_text(name))


def full_model_text(name):
    """Return the text of a model file with all parameters and inputs."""
    lines = friction = ""
    if name in CONTACTS:
        lines = f'    mode = Mode()\n    F_f = Contact("N", "friction", mode=mode, slip=v, slide={CONTACTS[name]})'
        friction = " - F_f"
    force = FORCES.get(name, "F_ext")
    return MODEL.format(name=name.capitalize(), lines=lines, force=force, friction=friction)


@pytest.fixture
def build_fmu(tmp_path):
    """Return build_fmu(name, kind), the path of an FMU, which is built once per test run."""

    def build_fmu(name, kind=""):
        (tmp_path / f"{name}.py").write_text(model_text(name))
        return build_user_model(tmp_path / f"{name}.py", *KINDS[kind], *LABELS) / kind / f"{name}.fmu"

    return build_fmu


@pytest.fixture
def launch(worker, build_fmu):
    """Return launch(name, kind, values), an initialized instance."""
    instances = []

    def launch(name, kind="", **values):
        settings = {f"solver.{word}": values.pop(word) for word in ("method", "rtol", "h_max") if word in values}
        instances.append(worker.instantiate(build_fmu(name, kind)).begin(values | settings, stop=STOP))
        return instances[-1]

    yield launch
    for instance in instances:
        instance.free()


def failure(fmu, end=STOP):
    """Return the message that ends a run."""
    with pytest.raises(FmiError):
        fmu.step(0.0, end)
    (message,) = [text for status, _, text in fmu.messages() if status != 0]
    return message


# ---- accuracy

X_ABOVE_0, X_ABOVE_GAP, X_BELOW_GAP = (lambda t, x, v: x), (lambda t, x, v: x - GAP), (lambda t, x, v: -GAP - x)
PIECES = {  # event functions of the conditions; the force, given the conditions
    "relay": ([X_ABOVE_0], lambda x, s: -F if s[0] else F),
    "jump": ([X_ABOVE_GAP], lambda x, s: -F if s[0] else 0.0),
    "endstop": ([X_ABOVE_GAP], lambda x, s: 50.0 * K * (GAP - x) if s[0] else 0.0),
    "backlash": (
        [X_ABOVE_GAP, X_BELOW_GAP],
        lambda x, s: K * x + (K * (GAP - x) if s[0] else K * (-GAP - x) if s[1] else 0.0),
    ),
    "nested": ([X_ABOVE_GAP, lambda t, x, v: v], lambda x, s: (-2.0 * F if s[1] else -F) if s[0] else 0.0),
    "notch": (
        [lambda t, x, v: x - 0.99 * GAP, lambda t, x, v: 1.01 * GAP - x],
        lambda x, s: -40.0 * F if s[0] and s[1] else 0.0,
    ),
    "timed": ([lambda t, x, v: t - T_ON], lambda x, s: F if s[0] else 0.0),
    "domain": (
        [X_ABOVE_0],
        lambda x, s: -F * (np.sqrt(abs(x) / GAP) + np.log(x / GAP + 1.0) + x / (x + GAP)) if s[0] else 0.0,
    ),
}


def piecewise_solution(name):
    """Return the final state and the number of changes, by scipy with the conditions as events."""
    functions, force = PIECES[name]
    t, y, changes = 0.0, (0.2, 0.0), 0
    sides = [function(t, *y) > 0.0 for function in functions]
    while True:
        events = []
        for function, side in zip(functions, sides, strict=True):
            events.append(lambda t, y, function=function: function(t, *y))
            events[-1].terminal, events[-1].direction = True, -1 if side else 1
        rates = lambda t, y: [y[1], force(y[0], sides) - K * y[0]]  # noqa: E731
        run = solve_ivp(rates, (t, STOP), y, "DOP853", events=events, rtol=1e-13, atol=1e-15)
        t, y = run.t[-1], run.y[:, -1]
        if run.status == 0:
            return y, changes
        changes += 1
        (index,) = [i for i, times in enumerate(run.t_events) if len(times)]
        sides[index] = not sides[index]


@pytest.mark.parametrize(
    "name",
    campaign_after(1, ["nested", "domain", *(name for name in PIECES if name not in ("nested", "domain"))]),
)
def test_the_error_is_proportional_to_the_tolerance(launch, name):
    """Each method, with jumps and kinks of the force, nested conditions, and operations with a limited domain."""
    (x, _), changes = piecewise_solution(name)
    assert changes
    for method in METHODS:
        for rtol in (1e-5, 1e-9):
            fmu = launch(name, method=method, rtol=rtol)
            fmu.step(0.0, STOP)
            assert abs(fmu.get("x") - x) < 30.0 * rtol


@pytest.mark.campaign
def test_changes_are_located_to_rounding(launch):
    """Parabolas, which all methods follow exactly, at a loose tolerance: a relay with 800 changes, a force that sets in
    at a time, two conditions at the same instant."""
    for method in METHODS:
        loose = {"method": method, "rtol": 1e-3, "k": 0.0}
        v0 = 0.005  # the relay returns after 2 v0 / f = 2 ms
        fmu = launch("relay", **loose, x0=0.0, v0=v0)
        fmu.step(0.0, 1.9995)
        x, v = fmu.get("x", "v")
        assert abs(x - (-v0 * 0.0015 + 0.5 * F * 0.0015**2)) < 1e-11
        assert abs(v - (-v0 + F * 0.0015)) < 1e-8 * F
        fmu = launch("timed", **loose)
        fmu.step(0.0, STOP)
        assert abs(fmu.get("x") - (0.2 + 0.5 * F * (STOP - T_ON) ** 2)) < 1e-14
        fmu = launch("both", **loose, x0=-T_ON, v0=1.0)
        fmu.step(0.0, STOP)
        assert abs(fmu.get("x") - (STOP - T_ON + F * (STOP - T_ON) ** 2)) < 1e-13


def test_short_pulses_of_a_force_are_found(launch):
    """Pulses of 0.01 to 1e-5 of their period, while nothing else limits the steps; closed form."""
    for method in METHODS:
        for depth in (1e-3, 1e-6, 1e-9):
            for Omega in (7.0, 20.0, 45.0):
                fmu = launch("pulsing", method=method, rtol=1e-6, k=0.0, mu=depth, Omega=Omega)
                fmu.step(0.0, STOP)
                pulses, width = int((Omega * STOP / pi + 1.5) / 2.0), 2.0 * np.arccos(1.0 - depth) / Omega
                assert fmu.get("v") == pytest.approx(pulses * F * width, rel=1e-6)


def test_a_jump_of_the_force_costs_few_steps(launch):
    """No step is repeated to find the jump."""
    steps = []
    for f in (0.0, F):
        fmu = launch("jump", method=ODE45, rtol=1e-8, f=f)
        fmu.step(0.0, STOP)
        steps.append(fmu.get("solver.steps") + fmu.get("solver.rejected"))
    assert steps[1] < steps[0] + 2 * piecewise_solution("jump")[1]


@pytest.mark.parametrize("name", slow_after(2, ["jump", "relay", "backlash"]))
def test_a_change_costs_at_most_fifty_evaluations_and_no_accuracy(launch, name):
    """As the page on own models says, against the mass on its spring without a condition."""
    evaluations = []
    for model, values in (("jump", {"f": 0.0}), (name, {})):
        fmu = launch(model, method=ODE45, rtol=1e-6, **values)
        fmu.step(0.0, STOP)
        evaluations.append(fmu.get("solver.evaluations"))
    (x, _), changes = piecewise_solution(name)
    assert evaluations[1] <= evaluations[0] + 50 * changes
    assert abs(fmu.get("x") - x) < 1e-6


def test_a_condition_at_its_limit_at_the_start_changes_at_once(launch):
    """A mass at rest touches a spring, and a force presses it on: half of the motion of the free mass and spring."""
    for method in METHODS:
        fmu = launch("pressing", method=method, rtol=1e-8, x0=0.0, k=0.0, f=K)
        fmu.set({"F_ext": 1.0})
        fmu.step(0.0, 0.5)
        assert abs(fmu.get("x") - (1.0 - np.cos(5.0)) / K) < 1e-7


def test_equality_counts_as_the_comparison_says(launch):
    """At the start value exactly."""
    for name, force in ("relay", F), ("atzero", -F):
        assert launch(name, x0=0.0, v0=1.0).get("F") == force


# ---- inputs


@pytest.mark.campaign
def test_conditions_on_inputs_follow_jumps_at_communication_points(launch):
    """Closed form; python and native."""
    for kind in ("", "native"):
        fmu = launch("jumping", kind, k=0.0, x0=0.0)
        for i, value in enumerate((0.5, 1.0, 1.5, 0.0)):
            fmu.set({"F_ext": value})
            fmu.step(0.5 * i, 0.5)
            assert fmu.get("F") == (F if value > 1.0 else value)
        speeds = [0.0, 0.25, 0.75, 3.25, 3.25]
        assert abs(fmu.get("x") - sum(0.25 * (a + b) for a, b in pairwise(speeds))) < 1e-14


@pytest.mark.campaign
def test_conditions_on_inputs_with_derivatives_change_within_steps(launch):
    """F_ext = 5 N/s t exceeds 1 N at 0.2 s; then the force is constant."""
    fmu = launch("ramped", "native", k=0.0, x0=0.0, rtol=1e-4)
    fmu.ramp("F_ext", 5.0)
    fmu.step(0.0, 1.0)
    assert abs(fmu.get("x") - (5.0 * 0.2**3 / 6.0 + 0.1 * 0.8 + 0.5 * F * 0.8**2)) < 1e-14


# ---- steps, restarts, saved states


@pytest.mark.parametrize(
    "name",
    [
        "nested",
        *(pytest.param(name, marks=pytest.mark.campaign) for name in ("backlash", "switched", "lifting", "domain")),
    ],
)
def test_results_do_not_depend_on_backend_and_communication_steps(launch, name):
    """Bit for bit, with a parameter changed within a step, and a state restored in mid-step and at an event."""
    names = ["x", "v", "F", "a", "solver.steps", "solver.evaluations"]
    for method in METHODS if name == "nested" else (ODE45, RODAS):
        rows = []
        for kind, refinement in ("", 1), ("native", 1), ("native", 20):
            fine = [STOP * i / (20 * refinement) for i in range(20 * refinement + 1)]
            fmu = launch(name, kind, method=method, rtol=1e-4)
            rows.append(fmu.run_with_changes(fine, names, {1.0: {"k": 80.0}})[::refinement])
        assert_identical(rows[1], rows[0], names)
        assert_identical(rows[2], rows[0], names)
        fmu = launch(name, method=method, rtol=1e-4)
        t = 0.0
        for _ in range(6):
            ahead = fmu.get("solver.t_next")
            for end in (0.5 * (t + ahead), ahead):
                fmu.step(t, end - t)
                t, state = end, fmu.save()
                fmu.step(t, 1.0)
                first = fmu.get(*names)
                fmu.restore(state)
                fmu.step(t, 1.0)
                assert fmu.get(*names) == first
                fmu.restore(state)


@pytest.mark.slow
def test_outputs_before_a_change_use_the_old_condition(launch):
    """Inside a step that ends with the change, and beyond it."""
    for kind in ("", "native"):
        fmu = launch("timed", kind, method=DOP853, rtol=1e-3)
        for t, end, force in (0.0, T_ON - 1e-9, 0.0), (T_ON - 1e-9, T_ON + 1e-9, F):
            fmu.step(t, end - t)
            assert fmu.get("F", "a") == [force, force - K * fmu.get("x")]


# ---- chattering


@EVERY_KIND
def test_a_condition_that_the_motion_cannot_leave_is_refused(launch, kind):
    """Each method, with a message; also from the start."""
    for method in METHODS:
        message = failure(launch("chattering", kind, method=method))
        assert message.startswith("a condition of choose() changes again and again at t = ")
        assert abs(float(message.split()[11]) - 0.2 * pi) < 1e-7
    message = failure(launch("relay", kind, x0=0.0))
    assert message.startswith("a condition of choose() changes again and again at t = ")
    assert float(message.split()[11]) < 1e-12


def test_a_change_ahead_that_is_computed_again_and_again_is_no_chattering(launch):
    """A step that ends at the change is discarded 300 times, because a value changes in each communication step."""
    fmu = launch("timed", k=0.0, rtol=1e-3, h_max=1.0)
    for i in range(600):
        fmu.set({"k": 1e-300 * (i % 2)})
        fmu.step(i * 1e-3, 1e-3)
    assert abs(fmu.get("x") - (0.2 + 0.5 * F * 0.3**2)) < 1e-12


# ---- limits


NEGATIVE = "F_f: the sliding force becomes negative at t = {} s ({} N); if the contact lifts off there, declare"


@EVERY_KIND
def test_a_sliding_force_that_becomes_negative_ends_the_run(launch, kind):
    """The message names contact, time and value."""
    fmu = launch("slidinginput", kind)
    fmu.step(0.0, 1.0)
    fmu.set({"N_ext": -1.0})
    with pytest.raises(FmiError):
        fmu.step(1.0, 1.0)
    assert fmu.messages()[-1][2].startswith(NEGATIVE.format(1.0, -0.5))


@pytest.mark.campaign
@EVERY_KIND
def test_a_sliding_force_that_becomes_negative_by_the_motion_ends_the_run(launch, kind):
    """By the position and by the time."""
    assert failure(launch("slidingposition", kind, x0=-0.2)).startswith(NEGATIVE.format(0.0, -5.0))
    message = failure(launch("slidingangle", kind, rtol=1e-9))
    assert message.startswith("F_f: the sliding force becomes negative at t = ")
    assert abs(float(message.split()[9]) - 7.0 * pi / 6.0 / 20.0) < 1e-14


@EVERY_KIND
def test_a_sliding_force_above_the_holding_force_ends_the_run(launch, kind):
    """While the contact sticks, and where it comes to rest with a load that neither mode can balance."""
    sentence = "F_f: the sliding force exceeds the holding force at t = "
    for name, x0, t in ("holdingtime", 0.01, T_ON), ("holdingspeed", 0.14, pi / 10.0):
        message = failure(launch(name, kind, x0=x0))
        assert message.startswith(sentence)
        assert message.endswith("): lower slide or raise hold")
        assert abs(float(message.removeprefix(sentence).split()[0]) - t) < 1e-6


def stop_function(mode, start, t, y):
    """Speed in the direction of the mode, shortly after its start."""
    return mode * y[1] if t > start + 1e-9 else 1.0


def lift_function(t, y):
    """Load of the contact, relative to its amplitude."""
    return np.sin(20.0 * t) + 0.5


def lifting_solution(x):
    """Return the final state of the block under a load that lifts off, and the number of its events."""
    t, y, mode, events = 0.0, (x, 0.0), -1, 0

    def load(t):
        return max(F * (1.0 + 2.0 * np.sin(20.0 * t)), 0.0)

    def slide(t, y):
        return [y[1], -K * y[0] - mode * MU * load(t)]

    while t < STOP:
        if mode:
            stops = partial(stop_function, mode, t)
            lifts = partial(lift_function)  # takes the attribute below
            stops.terminal = lifts.terminal = True
            run = solve_ivp(slide, (t, STOP), y, "DOP853", events=(stops, lifts), rtol=1e-13, atol=1e-15, max_step=0.01)
            t, y = run.t[-1], run.y[:, -1]
            if run.status == 0:
                return y, events
            if len(run.t_events[0]) == 0:
                t, y = np.nextafter(t, inf), y  # the load is zero from here on, or no longer
                continue
            y, events = (y[0], 0.0), events + 1
            away = -1 if y[0] > 0.0 else 1
            mode = 0 if K * abs(y[0]) <= 2.0 * MU * load(t) else away
        else:  # the limit falls to the load of the spring
            share = (K * abs(y[0]) / (2.0 * MU * F) - 1.0) / 2.0
            turn = 20.0 * t
            falls = pi - np.arcsin(share) + 2.0 * pi * np.floor(turn / (2.0 * pi))
            t = (falls if falls > turn else falls + 2.0 * pi) / 20.0
            mode, events = (-1 if y[0] > 0.0 else 1), events + 1
    return y, events


def test_a_contact_that_lifts_off_agrees_with_an_independent_formulation(launch):
    """Stick, slip and flight."""
    (x, v), events = lifting_solution(0.2)
    assert events > 5
    fmu = launch("lifting", rtol=1e-12, method=DOP853)
    fmu.step(0.0, STOP)
    assert abs(fmu.get("x") - x) < 1e-9
    assert abs(fmu.get("v") - v) < 1e-8


def test_a_limit_that_falls_to_zero_for_a_short_time_lets_go(launch):
    """Friction of a guide, mu |N|: while it sticks, the spring never exceeds what it holds."""
    times = np.linspace(0.0, STOP, 1001)
    for method in METHODS:
        for Omega in (5.0, 9.0):
            fmu = launch("guided", method=method, x0=0.005, Omega=Omega)
            x, mode = np.array(fmu.run(times.tolist(), ["x", "mode"])).T
            is_stuck = mode == 0
            assert np.count_nonzero(is_stuck) > 500
            assert np.all(K * np.abs(x[is_stuck]) <= 2.0 * MU * F * np.abs(np.sin(Omega * times[is_stuck])) + 1e-9)


def test_a_cusp_of_the_load_breaks_a_contact_away(launch):
    """The load exceeds the holding force for a short time; closed form of the break-away."""
    for method in METHODS:
        for Omega in (0.4, 0.9, 1.7):
            fmu = launch("cusped", method=method, x0=0.0, k=0.0, Omega=Omega)
            fmu.step(0.0, STOP)
            assert fmu.get("events.count") > 0
            fmu = launch("cusped", method=method, x0=0.0, k=0.0, Omega=Omega)
            t = np.arcsin(0.5 - 0.0005) / Omega
            modes = fmu.run([0.0, t - 1e-9, t + 1e-6], ["mode"])[1:]
            assert [mode for (mode,) in modes] == [0, 1]


SLIDING_FORCES = {  # whether a limit is needed
    "f": False,
    "mu * fabs(F_ext)": False,
    "mu * fabs(F_ext - k * x)": False,
    "f + (f_s - f) * exp(-r * r)": False,
    "f * (1.0 + r * r)": False,
    "mu * choose(load > 0.0, load, 0.0)": False,
    "mu * F_ext": True,
    "f - mu * x * k": True,
}


@pytest.mark.parametrize("slide", SLIDING_FORCES)
def test_limits_exist_only_where_a_force_may_become_negative(tmp_path, slide):
    """They cost evaluations."""
    text = (
        full_model_text("slidinginput").replace("mu * N_ext", slide).replace("import Contact", "import fabs, Contact")
    )
    lines = {"r": "    r = v / v_s\n", "load": "    load = F_ext - k * x\n"}
    helper_lines = "".join(line for name, line in lines.items() if f"{name} " in slide)
    text = text.replace("    F_f", f"{helper_lines}    F_f")
    (tmp_path / "limited.py").write_text(text)
    assert bool(find_model(tmp_path / "limited.py").analysis.limits) is SLIDING_FORCES[slide]


@pytest.mark.parametrize(
    ("force", "keeps_domain"),
    [
        ("choose(x > 0.0, f * sqrt(x / gap), 0.0)", True),
        ("choose(x > 0.0, choose(clock > t_on, f * gap / x, f), 0.0)", True),
        ("choose(clock > t_on, f * v_s / (v_s + fabs(v)), 0.0)", False),
        ("choose(x > gap, f * sqrt(1.0 + v / v_s), 0.0)", False),
    ],
)
def test_only_a_condition_on_the_operand_of_an_operation_keeps_it_in_its_domain(tmp_path, force, keeps_domain):
    """Such a condition is evaluated at the present state, so that a jump at its change takes many steps."""
    text = full_model_text("slidinginput").replace("F_ext)", f"{force})")
    (tmp_path / "domain.py").write_text(remove_unused(text))
    outermost = find_model(tmp_path / "domain.py").analysis.switches[0]
    assert outermost.is_frozen is not keeps_domain


# ---- model exchange


@pytest.mark.parametrize(
    ("condition", "unit"),
    [("x / gap > 1.0", "1"), ("angle > 1.0", "rad"), ("2.0 * angle / mu > 1.0", "1"), ("2.0 * v * clock > gap", "m")],
)
def test_the_indicator_of_a_condition_has_its_unit(tmp_path, condition, unit):
    """Not that of another dimensionless variable."""
    text = full_model_text("slidinginput").replace("F_ext)", f"choose({condition}, F_ext, -F_ext))")
    (tmp_path / "unit.py").write_text(remove_unused(text))
    assert scalar_class(tmp_path / "unit.py").condition_units == (unit, "N")


@pytest.mark.campaign
@pytest.mark.parametrize(
    ("name", "kind"), [("relay", "native"), ("backlash", "native"), ("backlash", "native/fmi3"), ("timed", "native")]
)
def test_the_solver_of_an_importer_locates_the_changes(worker, build_fmu, name, kind):
    """CVode; its error is about a hundred tolerances."""
    fmu, conditions = build_fmu(name, kind), len(PIECES[name][0])
    description = read_model_description(fmu)
    assert description.numberOfEventIndicators == conditions
    indicators = [v.name for v in description.modelVariables if v.name.startswith("events.condition_")]
    assert indicators == [f"events.condition_{i + 1}" for i in range(conditions)]
    (x, _), _ = piecewise_solution(name)
    for rtol in (1e-6, 1e-9):
        columns, _ = exchange(worker, fmu, rtol)
        assert abs(columns["x"][-1] - x) < 100.0 * rtol


@pytest.mark.campaign
@pytest.mark.parametrize("kind", ["native", pytest.param("native/fmi3", marks=pytest.mark.campaign)])
def test_model_exchange_refuses_what_co_simulation_refuses(worker, build_fmu, kind):
    """Chattering, negative sliding forces, and sliding forces above the holding force at rest."""
    for name, x0, text in (
        ("chattering", 0.2, "a condition of choose() changes again and again at t = 0.62831"),
        ("slidingangle", 0.2, "F_f: the sliding force becomes negative at t = 0.183259571"),
        ("holdingspeed", 0.14, "F_f: the sliding force exceeds the holding force at t = 0.31415"),
    ):
        with pytest.raises(FmpyError, match="failed with status 3"):
            exchange(worker, build_fmu(name, kind), 1e-6, x0)
        assert text in worker.read_stderr()


def exchange(worker, fmu, rtol, x0=0.2):
    """Simulate with CVode."""
    options = {"output_interval": 0.02, "relative_tolerance": rtol, "record_events": False, "output": ["x", "v"]}
    options["start_values"] = {"x0": x0}
    return worker.simulate_and_count(fmu, "ModelExchange", stop_time=STOP, **options)
