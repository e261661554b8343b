"""A holding limit that only touches the load is no event; one that falls below the load is."""

from itertools import pairwise

import numpy as np
import pytest
from build_cache import build_user_model
from models import DOP853, ODE23, ODE45, RADAU9, RODAS
from native_fmus import require_compiler
from scipy.integrate import solve_ivp
from variants import campaign_after, slow_after

METHODS = (ODE23, ODE45, DOP853, RODAS, RADAU9)
LABELS = [f"--method={label}" for label in ("ode23", "ode45", "dop853", "rodas", "radau9")]
TOLERANCES = (1e-3, 1e-6, 1e-9, 1e-11)
KINDS = {"python": ("", ()), "native": ("native", ("--native", "--platform", "linux64"))}
STOP, OMEGA, M, F, P = 2.0, 20.0, 1.0, 5.0, 2.0  # SI, as in the models
MODEL = '''from fmus import Contact, Fixed, Mode, Model, Output, Parameter, State, cos

class {name}(Model):
    """A body at rest under a force; its friction oscillates, and the limit touches p where the angle is zero."""

    m = Parameter(1.0, "kg", "mass", above=0.0)
    f = Parameter(5.0, "N", "amplitude of the limit", low=0.0)
    p = Parameter(0.0, "N", "lowest limit", low=0.0)
    push = Parameter(0.0, "N", "constant force")
    q = Parameter(0.0, "N", "amplitude of the force")
    Omega = Parameter(20.0, "rad/s", "angular frequency", low=0.0)
    angle0 = Fixed(0.0, "rad", "angle at the start")
    x = State("m", "position")
    v = State("m/s", "speed", rate_of=x)
    angle = State("rad", "phase angle", start=angle0, rate=Omega)
    mode = Mode()
    limit = p + f * (1.0 - cos(angle))
    force = push + q * (1.0 - cos(angle))
{contacts}
    stop_time = 2.0
'''
CONTACTS = {
    "touching_block": """    F_f = Contact("N", "friction", mode=mode, slip=v, slide=limit, hold=limit)
    a = Output("m/s2", "acceleration", (force - F_f) / m, rate_of=v)""",
    "touching_stack": """    x_b = State("m", "position of the lower body")
    v_b = State("m/s", "speed of the lower body", rate_of=x_b)
    mode_b = Mode()
    F_f = Contact("N", "friction", mode=mode, slip=v - v_b, slide=limit, hold=limit)
    F_b = Contact("N", "friction of the lower body", mode=mode_b, slip=v_b, slide=20.0 * f, hold=20.0 * f)
    a = Output("m/s2", "acceleration", (force - F_f) / m, rate_of=v)
    a_b = Output("m/s2", "acceleration of the lower body", (F_f - F_b) / m, rate_of=v_b)""",
    "lifting_block": """    press = f * (0.5 - cos(angle))
    F_f = Contact("N", "friction", mode=mode, slip=v, slide=press, hold=press, lifts_off=True)
    a = Output("m/s2", "acceleration", (force - F_f) / m, rate_of=v)""",
}
TOUCHES = [  # the force is constant, or zero where the limit is zero, or touches the limit from below
    {},
    {"angle0": 1.0},
    {"q": 3.0},
    {"q": -3.0, "angle0": 1.0},
    {"q": 5.0},
    {"p": P, "push": P},
    {"p": 0.01, "push": 0.01, "q": 2.0},
    {"p": 0.01, "push": -0.01, "q": -4.99, "angle0": 1.0},
]
OUTPUTS = ["x", "v", "mode", "events.count"]
POINTS = [STOP * i / 100 for i in range(101)]


@pytest.fixture
def build_fmu(tmp_path):
    """Return build_fmu(name, kind), the path of an FMU, which is built once per test run."""

    def build_fmu(name, kind):
        if kind == "native":
            require_compiler()
        folder, words = KINDS[kind]
        lines = MODEL.format(name=name.title().replace("_", ""), contacts=CONTACTS[name]).splitlines(keepends=True)
        unused_lines = ("    p =", "    limit =") if name == "lifting_block" else ()
        file = tmp_path / f"{name}.py"
        file.write_text("".join(line for line in lines if not line.startswith(unused_lines)))
        return build_user_model(file, *words, *LABELS) / folder / f"{name}.fmu"

    return build_fmu


def changes(fmu, values, method, rtol):
    """Return time and new mode of each event of a run from internal step to internal step."""
    fmu.reset()
    fmu.begin({**values, "solver.method": method, "solver.rtol": rtol}, stop=STOP)
    _times, rows = fmu.follow(0.0, STOP, ["events.count", "events.t_last", "mode"])
    return [tuple(after[1:]) for before, after in pairwise(rows) if after[0] != before[0]]


@pytest.mark.campaign
@pytest.mark.parametrize("kind", [pytest.param("python", marks=pytest.mark.campaign), "native"])
@pytest.mark.parametrize("name", ["touching_block", "touching_stack"])
def test_a_contact_at_rest_stays_stuck_where_its_limit_touches_the_load(worker, build_fmu, name, kind):
    """The exact answer: no event, no motion."""
    fmu = worker.instantiate(build_fmu(name, kind))
    for values in TOUCHES:
        for method in METHODS:
            for rtol in TOLERANCES:
                fmu.reset()
                fmu.begin({**values, "solver.method": method, "solver.rtol": rtol}, stop=STOP)
                rows = fmu.run(POINTS, OUTPUTS)
                assert {tuple(row) for row in rows} == {(0.0, 0.0, 0, 0)}, (values, method, rtol)
    fmu.free()


@pytest.mark.parametrize(("solver", "tolerances"), [("CVode", (1e-3, 1e-9)), ("Euler", (1e-3,))])
@pytest.mark.parametrize("name", slow_after(1, ["touching_stack", "touching_block"]))
def test_it_stays_stuck_in_model_exchange(worker, build_fmu, name, solver, tolerances):
    path = build_fmu(name, "native")
    for values in TOUCHES:
        for rtol in tolerances:
            options = {"solver": solver, "step_size": 1e-3, "output_interval": 2e-2, "relative_tolerance": rtol}
            columns = worker.simulate(
                path, "ModelExchange", stop_time=STOP, start_values=values, output=OUTPUTS, **options
            )
            assert {tuple(row) for row in zip(*(columns[v] for v in OUTPUTS), strict=True)} == {(0.0, 0.0, 0, 0)}


def solve_dips(push):
    """Return time and mode of each event, and the position at the stop time, by scipy with located events."""
    t, y, mode, events = 0.0, [0.0, 0.0], 0, []
    limit = lambda t: P + F * (1.0 - np.cos(np.pi + OMEGA * t))  # noqa: E731
    while True:
        if mode == 0:
            rates, event = (lambda t, y: [0.0, 0.0]), (lambda t, y: limit(t) - push)
        else:
            rates, event = (lambda t, y: [y[1], (push - limit(t)) / M]), (lambda t, y: y[1])
        event.terminal, event.direction = True, -1.0
        run = solve_ivp(rates, (t, STOP), y, "DOP853", events=event, rtol=1e-13, atol=1e-16, max_step=1e-3)
        t, y = run.t[-1], [run.y[0, -1], 0.0]
        if run.status == 0:
            return events, y[0]
        mode = 1 - mode
        events.append((t, mode))


@pytest.mark.campaign
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("depth", [0.3, pytest.param(0.01, marks=pytest.mark.campaign)])
def test_a_limit_that_falls_below_the_load_releases_the_contact(worker, build_fmu, depth, kind):
    values = {"p": P, "push": P * (1.0 + depth), "angle0": np.pi}
    expected, x = solve_dips(values["push"])
    assert len(expected) >= 10
    fmu = worker.instantiate(build_fmu("touching_block", kind))
    for method in METHODS:
        for rtol in TOLERANCES if kind == "native" else (1e-3, 1e-6):  # the bits are the same
            events = changes(fmu, values, method, rtol)
            assert [mode for _, mode in events] == [mode for _, mode in expected]
            times = np.array([t for t, _ in events]) - [t for t, _ in expected]
            assert np.abs(times).max() < max(30.0 * rtol, 1e-9) * STOP
            assert fmu.get("x") == pytest.approx(x, rel=max(100.0 * rtol, 1e-8))
    fmu.free()


@pytest.mark.parametrize("kind", campaign_after(1, KINDS))
def test_friction_that_vanishes_for_longer_ends_mode_0(worker, build_fmu, kind):
    """It vanishes while cos(angle) > 0.5: from -60 to 60 degrees of each turn."""
    fmu = worker.instantiate(build_fmu("lifting_block", kind))
    angles = np.pi * np.add.outer(2.0 * np.arange(7), [2.0 / 3.0, 4.0 / 3.0]).ravel()  # since the start
    expected = angles[angles < OMEGA * STOP] / OMEGA
    for method in METHODS:
        for rtol in TOLERANCES:
            events = changes(fmu, {"angle0": np.pi}, method, rtol)
            assert [mode for _, mode in events] == [1 - i % 2 for i in range(len(expected))]
            assert np.abs([t for t, _ in events] - expected).max() < 1e-13
    fmu.free()
