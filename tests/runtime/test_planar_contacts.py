"""Friction in a plane opposes the velocity, holds up to a circle, and brings a body to rest as the closed form says."""

import re
from math import atan2, cos, hypot, pi, radians, sin
from shutil import rmtree

import commands
import fmpy
import numpy as np
import pytest
from build_cache import build_once, build_user_model
from fmpy import extract, read_model_description
from fmpy.fmi2 import FMU2Slave
from native_fmus import require_compiler
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from variants import slow_after

import harness
from benchmarks.campaigns.planar_contacts import constant, errors_at_rest, random_scenes
from fmus.compiler.lowering import select_features
from fmus.compiler.lowering.lowered_modules import lowered_texts
from fmus.compiler.model_lookup import find_model

NATIVE = ("--native", "--platform", "linux64")
PUCK = '''from fmus import Contact, cos, Fixed, Input, Mode, Model, Output, Parameter, PlanarContact, State

class {name}(Model):
    """Body on a plane, on springs."""

    m = Parameter(1.0, "kg", "mass", above=0.0)
    f = Parameter(2.0, "N", "sliding friction", low=0.0)
    f_s = Parameter(2.0, "N", "holding friction", low=0.0)
    k = Parameter(0.0, "N/m", "stiffness", low=0.0)
    x0 = Fixed(0.0, "m", "initial position along x")
    v_x0 = Fixed(0.0, "m/s", "initial speed along x")
    v_y0 = Fixed(0.0, "m/s", "initial speed along y")
    F_x = Input(0.0, "N", "force along x")
    F_y = Input(0.0, "N", "force along y")
    x = State("m", "position along x", start=x0)
    y = State("m", "position along y")
    v_x = State("m/s", "speed along x", start=v_x0, rate_of=x)
    v_y = State("m/s", "speed along y", start=v_y0, rate_of=y)
    mode = Mode("0 stuck, 1 sliding")
{belt}    R = PlanarContact("N", "friction", mode=mode, slip={slip}, slide=f, hold=f_s)
    a_x = Output("m/s2", "acceleration along x", ({load_x} - R.x) / m, rate_of=v_x)
    a_y = Output("m/s2", "acceleration along y", ({load_y} - R.y) / {mass}, rate_of=v_y)
    speed = Output("m/s", "speed of the slip", R.speed)
    e_x = Output("1", "direction of the slip along x", R.direction[0])
    e_y = Output("1", "direction of the slip along y", R.direction[1])
{more}    stop_time, step_size, method = 2.0, 0.01, "radau9"
'''
# force, direction of the motion from that of the force; friction 2 N, mass 1 kg, speed 1 m/s
SCENES = [(1.0, pi / 2), (0.1, 2.0), (1.9, 3.1), (1.999, 1.0), (1.0, pi - 1e-6), (1.9, pi / 2)]
BLOCK = """    k_b = Parameter(100.0, "N/m", "stiffness of the spring of a block")
    z = State("m", "position of a block", start=0.1)
    w = State("m/s", "speed of a block", rate_of=z)
    block_mode = Mode()
    B = Contact("N", "friction of the block", mode=block_mode, slip=w, slide=f, hold=f_s)
    b = Output("m/s2", "acceleration of the block", (-k_b * z - B) / m, rate_of=w)
"""

SPIN = {
    "slip": "(v_x - arm * spin, v_y)",
    "belt": """    arm = Parameter(0.1, "m", "radius")
    spin = State("rad/s", "spin")
""",
    "more": """    turn = Output("rad/s2", "its rate", R.x / (arm * m), rate_of=spin)
""",
}
# a second body in a plane, which only a spring connects with the first
SECOND = """    k_2 = Parameter(50.0, "N/m", "stiffness of the spring between the bodies")
    z_x = State("m", "position of the second body along x", start=0.2)
    z_y = State("m", "position of the second body along y")
    w_x = State("m/s", "its speed along x", rate_of=z_x)
    w_y = State("m/s", "its speed along y", rate_of=z_y)
    second_mode = Mode()
    S = PlanarContact("N", "friction of the second body", mode=second_mode, slip=(w_x, w_y), slide=f, hold=f_s)
    b_x = Output("m/s2", "acceleration of the second body along x", (-k_2 * (z_x - x) - S.x) / m, rate_of=w_x)
    b_y = Output("m/s2", "acceleration of the second body along y", (-k_2 * (z_y - y) - S.y) / m, rate_of=w_y)
"""


def puck_text(name="Puck", **parts):
    usual = {"slip": "(v_x, v_y)", "mass": "m", "belt": "", "more": ""}
    return PUCK.format(name=name, **(usual | {"load_x": "F_x - k * x", "load_y": "F_y - k * y"} | parts))


@pytest.fixture(scope="module")
def build(tmp_path_factory):
    def build_puck(name, *words, **parts):
        file = tmp_path_factory.mktemp("models") / f"{name}.py"
        file.write_text(puck_text(name.title(), **parts))
        folder = build_user_model(file, *words)
        return str(next(folder.rglob(f"{name}.fmu")))

    return build_puck


@pytest.fixture(scope="module")
def puck(build):
    require_compiler()
    return build("puck", *NATIVE)


@pytest.fixture(scope="module")
def native_puck():
    require_compiler()
    return build_once("puck", *NATIVE) / "puck.fmu"


@pytest.mark.parametrize(("F", "phi"), slow_after(3, SCENES))
def test_body_comes_to_rest_as_the_closed_form_says(native_puck, F, phi):
    assert max(errors_at_rest(native_puck, 1.0, F, 2.0, 1.0, phi)) < 1e-10


@pytest.mark.campaign
def test_random_motions_come_to_rest_as_the_closed_form_says(native_puck):
    for scene in random_scenes(40):
        assert max(errors_at_rest(native_puck, *scene)) < 1e-9, scene


@pytest.mark.parametrize("degrees", [0, 30, 77, 200])
def test_limit_is_a_circle(puck, degrees):
    angle = radians(degrees)
    for force in (2.0 - 1e-7, 2.0 + 1e-7):
        run = harness.simulate(puck, stop=1.0, inputs=constant(force * cos(angle), force * sin(angle), 1.0), rtol=1e-10)
        distance, direction = hypot(run["x"][-1], run["y"][-1]), atan2(run["y"][-1], run["x"][-1])
        assert distance == pytest.approx(max(0.0, 0.5 * (force - 2.0)), rel=1e-7)
        assert distance == 0.0 or cos(direction - angle) == pytest.approx(1.0, abs=1e-15)


@pytest.mark.parametrize("offset", slow_after(2, (0.0, 1e-6, 1e-12, 1e-9, 1e-3)))
def test_body_passes_zero_speed_nearly_head_on(puck, offset):
    run = harness.simulate(
        puck, {"v_x0": cos(offset), "v_y0": sin(offset)}, stop=1.2, inputs=constant(-3.0, 0.0, 1.2), rtol=1e-10
    )
    # along x to second order in the offset, and across as far as the first 0.2 s lead; both by the closed form
    assert run["x"][-1] == pytest.approx(-0.4, abs=1e-10 + 0.4 * offset**2)
    assert run["y"][-1] == pytest.approx(offset / 7.0, rel=1e-4, abs=1e-12)


def test_speed_and_direction_are_those_of_the_slip_and_at_rest_of_the_load(puck):
    run = harness.simulate(puck, {"v_x0": 0.6, "v_y0": -0.8}, stop=1.0, inputs=constant(0.3, 0.4, 1.0))
    assert run["mode"][-1] == 0
    moves = run["mode"] == 1
    assert run["speed"] == pytest.approx(np.hypot(run["v_x"], run["v_y"]))
    assert run["e_x"][moves] == pytest.approx(run["v_x"][moves] / run["speed"][moves])
    assert (run["e_x"][-1], run["e_y"][-1]) == pytest.approx((0.6, 0.8))
    assert [harness.simulate(puck, stop=0.1)[name][-1] for name in ("speed", "e_x", "e_y")] == [0.0, 0.0, 0.0]


def quarter_turns(puck, method):
    """Return the runs of a motion and of the same one after a quarter turn of the plane."""
    scenes = (1.0, 0.3, (5.0, -2.0)), (-0.3, 1.0, (2.0, 5.0))
    return [
        harness.simulate(
            puck, {"k": 40.0, "v_x0": v_x, "v_y0": v_y}, stop=3.0, inputs=constant(*force, 3.0), method=method
        )
        for v_x, v_y, force in scenes
    ]


@pytest.mark.parametrize("method", slow_after(2, ("dop853", "radau9", "rodas", "ode23", "ode45")))
def test_quarter_turn_of_the_plane_changes_no_bit(puck, method):
    run, turned_run = quarter_turns(puck, method)
    assert run.events.t.tolist() == turned_run.events.t.tolist()
    assert len(run.events.t) > 1
    assert run["x"].tolist() == turned_run["y"].tolist()
    assert run["y"].tolist() == (-turned_run["x"]).tolist()


@pytest.mark.parametrize("v_belt", [0.171, 3.3, 1000.0])
def test_body_rests_on_a_belt_as_on_a_plate(native_puck, v_belt):
    plate = harness.simulate(native_puck, rtol=1e-8)
    belt = harness.simulate(native_puck, {"v_belt": v_belt, "v_x0": 2.0 + v_belt}, rtol=1e-8)
    assert belt.events.t == pytest.approx(plate.events.t, abs=1e-7)
    assert belt["x"][-1] - 2.5 * v_belt == pytest.approx(plate["x"][-1], abs=1e-7)
    assert (belt["v_x"][-1], belt["v_y"][-1]) == (v_belt, 0.0)


@pytest.mark.campaign
def test_body_on_a_belt_moves_as_on_a_table_that_stands_still(puck, build):
    belt = '    v_b = Input(0.0, "m/s", "speed of the belt", rate=0.0)\n'
    moving = build("carried", *NATIVE, slip="(v_x - v_b, v_y)", belt=belt, more=BLOCK)
    still, force = {"v_x0": -0.5, "v_y0": 1.0}, constant(0.5, 0.3, 2.0)
    on_table = harness.simulate(puck, still, stop=2.0, inputs=force, rtol=1e-10)
    run = harness.simulate(moving, still | {"v_x0": 0.2}, stop=2.0, inputs=force | {"v_b": [0.7, 0.7]}, rtol=1e-10)
    assert run["x"][-1] - 0.7 * 2.0 == pytest.approx(on_table["x"][-1], abs=1e-9)
    assert run["y"][-1] == pytest.approx(on_table["y"][-1], abs=1e-9)
    assert run["v_x"][-1] == 0.7
    assert on_table.events.t[-1] == pytest.approx(run.events.t[np.array(run.events.modes["R"]) == 0][0], abs=1e-9)


@pytest.mark.campaign
def test_two_bodies_in_a_plane_and_a_block_move_as_they_do_alone(puck, build):
    """Without the spring between them they are independent; with it, CVode is the second route."""
    fmu = build("several", *NATIVE, more=SECOND + BLOCK)
    start, force = {"v_x0": 0.5, "v_y0": 1.0}, constant(0.5, 0.3, 2.0)
    single_run = harness.simulate(puck, start, stop=2.0, inputs=force, rtol=1e-10)
    run = harness.simulate(fmu, start | {"k_2": 0.0}, stop=2.0, inputs=force, rtol=1e-10)
    assert (run["x"][-1], run["y"][-1]) == pytest.approx((single_run["x"][-1], single_run["y"][-1]), abs=1e-9)
    assert run["mode"][-1] == single_run["mode"][-1] == 0
    assert (run["z_x"][-1], run["z_y"][-1], run["second_mode"][-1]) == (0.2, 0.0, 0)
    start |= {"k_2": 50.0}
    run = harness.simulate(fmu, start, stop=2.0, inputs=force, rtol=1e-10)
    inputs = np.array(list(zip(*force.values(), strict=True)), [(name, float) for name in force])
    names = ["x", "y", "z_x", "z_y", "z", "mode", "second_mode", "block_mode", "events.count"]
    other = fmpy.simulate_fmu(
        fmu,
        fmi_type="ModelExchange",
        start_values=start,
        input=inputs,
        stop_time=2.0,
        relative_tolerance=1e-9,
        output_interval=0.01,
        output=names,
    )[-1]
    assert run["mode"][-1] == run["second_mode"][-1] == 0
    for name in names[:8]:
        assert run[name][-1] == pytest.approx(other[name], abs=1e-7), name
    assert len(run.events.t[run.events.t > 0.0]) == other["events.count"] > 3


@pytest.mark.campaign
def test_python_and_native_fmus_have_the_same_bits(puck, build):
    python = build("puck")
    start, force = {"k": 90.0, "f_s": 2.5, "v_y0": 1.0}, constant(4.0, 1.0, 3.0)
    runs = [harness.simulate(fmu, start, stop=3.0, inputs=force) for fmu in (puck, python)]
    for name in ("x", "y", "v_x", "v_y", "R", "R.x", "R.y", "mode"):
        assert runs[0][name].tolist() == runs[1][name].tolist(), name


def solve_pulled(m, k, f, hold, r, speed, stop):
    """Return the events of a body at rest that a spring pulls along x and y = r (1 - cos), by scipy."""

    def load(t, y):
        return np.array([k * (speed * t - y[0]), k * (r * (1.0 - cos(5.0 * t)) - y[1])])

    def rates(t, y):
        v = hypot(y[2], y[3])
        return [y[2], y[3], *((load(t, y) - f * y[2:] / v) / m)]

    def slow(t, y):
        return hypot(y[2], y[3]) - 1e-9

    slow.terminal, slow.direction = True, -1.0
    t, y, events = 0.0, np.zeros(4), []
    while True:
        grid = np.linspace(t, stop, 2000)
        later = next((i for i, s in enumerate(grid) if hypot(*load(s, y)) > hold), None)
        if later is None:
            return events, y
        t = brentq(lambda s, y=y: hypot(*load(s, y)) - hold, grid[later - 1], grid[later], xtol=1e-15)
        events.append(t)
        e = load(t, y) / hypot(*load(t, y))
        y = y + np.array([0.0, 0.0, *(1e-9 * (hold - f) / m * e)])
        part = solve_ivp(rates, (t + 1e-9, stop), y, "Radau", rtol=1e-11, atol=1e-13, events=slow)
        t, y = part.t[-1], part.y[:, -1].copy()
        if part.status != 1:
            return events, y
        force = load(t, y)
        t += m * (f * hypot(y[2], y[3]) + force @ y[2:]) / (f * f - force @ force)
        y[2:] = 0.0
        events.append(t)


@pytest.mark.campaign
def test_pulled_body_sticks_and_slips_as_scipy_says(build):
    require_compiler()
    driver = """    pull = Parameter(0.1, "m/s", "speed of the driver")
    r = Parameter(0.05, "m", "amplitude of the driver")
    Omega = Parameter(5.0, "rad/s", "angular speed")
    s = State("m", "position of the driver", rate=pull)
    angle = State("rad", "angle of the driver", rate=Omega)
"""
    loads = {"load_x": "k * (s - x) + F_x", "load_y": "k * (r - r * cos(angle) - y) + F_y"}
    fmu = build("pulled", *NATIVE, belt=driver, **loads)
    events, y = solve_pulled(1.0, 100.0, 2.0, 3.0, 0.05, 0.1, 4.0)
    run = harness.simulate(fmu, {"k": 100.0, "f_s": 3.0}, stop=4.0, rtol=1e-10)
    times = run.events.t[run.events.t > 0.0]
    assert len(times) == len(events) > 4
    assert times == pytest.approx(np.array(events), abs=1e-8)
    assert (run["x"][-1], run["y"][-1]) == pytest.approx((y[0], y[1]), abs=1e-8)


@pytest.mark.parametrize(
    ("parts", "message"),
    [
        ({"mass": "(2.0 * m)"}, "R.x and R.y do not accelerate their slips alike"),
        ({"slip": "(v_x * x, v_y)"}, "slip of R must be sums of speeds"),
        ({"slip": "v_x"}, "slip of a PlanarContact must be a pair of speeds"),
        ({"slip": "(v_x, v_y, v_x)"}, "slip of a PlanarContact must be a pair of speeds"),
        (SPIN, "R.x and R.y do not accelerate their slips alike"),
        ({"more": SECOND.replace("slip=(w_x, w_y)", "slip=(w_x - v_x, w_y - v_y)")}, "R and S act on the same motion"),
        ({"more": BLOCK.replace("slip=w", "slip=w - v_x")}, "R and B act on the same motion"),
    ],
)
def test_unsupported_contact_is_refused_by_name(tmp_path, parts, message):
    (tmp_path / "puck.py").write_text(puck_text(**parts))
    result = commands.build("puck.py", folder=tmp_path)
    assert result.returncode == 1
    assert re.match(rf"Error: puck.py, line \d+: {message}", result.stderr), result.stderr


def test_directional_derivatives_are_those_of_the_formulas(puck):
    description = read_model_description(puck)
    references = {v.name: v.valueReference for v in description.modelVariables}
    unknowns = [references[name] for name in ("a_x", "a_y", "R.x", "R.y")]
    folder = extract(puck)
    for speed, is_stuck in ((0.5, False), (0.0, True)):
        fmu = FMU2Slave(
            guid=description.guid, unzipDirectory=folder, modelIdentifier="puck", instanceName="derivatives"
        )
        fmu.instantiate()
        fmu.setReal([references[name] for name in ("v_x0", "v_y0")], [0.6 * speed, -0.8 * speed])
        fmu.setupExperiment(startTime=0.0)
        fmu.enterInitializationMode()
        fmu.exitInitializationMode()
        by_force, by_speed = (
            fmu.getDirectionalDerivative(unknowns, [references[variable]], [1.0]) for variable in ("F_x", "v_x")
        )
        turn = 0.0 if is_stuck else 2.0 / speed  # friction over speed
        assert by_force == pytest.approx([0.0, 0.0, 1.0, 0.0] if is_stuck else [1.0, 0.0, 0.0, 0.0])
        assert by_speed == pytest.approx([-0.64 * turn, -0.48 * turn, 0.64 * turn, 0.48 * turn])
        fmu.terminate()
        fmu.freeInstance()
    rmtree(folder)


def test_models_without_contacts_in_a_plane_carry_no_line_of_them():
    source = find_model("sleds")
    texts = lowered_texts(source, select_features(source))
    assert not [path for path, text in texts.items() if "planar" in text or "end_at_rest" in text]
