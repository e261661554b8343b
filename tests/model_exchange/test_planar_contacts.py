"""Contacts in a plane in model exchange: solvers of an importer find the rest and the break-away as the closed form."""

from math import cos, hypot, pi, radians, sin
from xml.etree import ElementTree
from zipfile import ZipFile

import fmpy
import mpmath
import pytest
from build_cache import build_once, build_user_model
from native_fmus import require_compiler
from variants import campaign_after, slow_after

import harness
from benchmarks.campaigns import planar_contacts
from benchmarks.references.plane import rest

KINDS = {"FMI 3.0": ("--fmi", "3"), "FMI 2.0": ("--native",)}
PLATFORM = ("--platform", "linux64")
PAIR = '''from fmus import Fixed, Mode, Model, Output, Parameter, PlanarContact, State

class Pair(Model):
    """Two bodies on a plane, with a spring and a damper between them."""

    f = Parameter(2.0, "N", "friction", low=0.0)
    k = Parameter(30.0, "N/m", "stiffness", low=0.0)
    c = Parameter(0.3, "N.s/m", "damping", low=0.0)
    m = Parameter(1.0, "kg", "mass", above=0.0)
    v_x0 = Fixed(1.0, "m/s", "initial speed along x")
    v_y0 = Fixed(0.3, "m/s", "initial speed along y")
    x = State("m", "position along x")
    y = State("m", "position along y")
    v_x = State("m/s", "speed along x", start=v_x0, rate_of=x)
    v_y = State("m/s", "speed along y", start=v_y0, rate_of=y)
    z_x = State("m", "position of the second body along x")
    z_y = State("m", "position of the second body along y")
    w_x = State("m/s", "its speed along x", rate_of=z_x)
    w_y = State("m/s", "its speed along y", rate_of=z_y)
    mode, second_mode = Mode(), Mode()
    R = PlanarContact("N", "friction", mode=mode, slip=(v_x, v_y), slide=f, hold=f)
    S = PlanarContact("N", "friction of the second body", mode=second_mode, slip=(w_x, w_y), slide=f, hold=f)
    F_x = Output("N", "force along x", k * (z_x - x) + c * (w_x - v_x))
    F_y = Output("N", "force along y", k * (z_y - y) + c * (w_y - v_y))
    a_x = Output("m/s2", "acceleration along x", (F_x - R.x) / m, rate_of=v_x)
    a_y = Output("m/s2", "acceleration along y", (F_y - R.y) / m, rate_of=v_y)
    b_x = Output("m/s2", "acceleration of the second body along x", (-F_x - S.x) / m, rate_of=w_x)
    b_y = Output("m/s2", "acceleration of the second body along y", (-F_y - S.y) / m, rate_of=w_y)
    stop_time, step_size, method = 1.0, 0.01, "radau9"
'''
# force, direction of the motion from that of the force; friction 2 N, mass 1 kg, speed 1 m/s
SCENES = [(1.0, pi / 2), (1.9, pi - 1e-6), (0.1, 2.0), (1.999, 1.0), (1e-3, 1.0)]


def build_puck(kind):
    require_compiler()
    return build_once("puck", *KINDS[kind], *PLATFORM) / "puck.fmu"


@pytest.fixture(scope="module", params=slow_after(1, KINDS))
def puck(request):
    return build_puck(request.param)


@pytest.mark.parametrize(("F", "phi"), campaign_after(2, SCENES))
@pytest.mark.parametrize("rtol", [1e-6, 1e-10])
def test_cvode_brings_a_body_to_rest_as_the_closed_form_says(puck, F, phi, rtol):
    assert max(planar_contacts.exchange_errors(puck, 1.0, F, 2.0, 1.0, phi, rtol=rtol)) < 100.0


@pytest.mark.parametrize("h", slow_after(1, [1e-3, 1e-4, 3e-4]))
def test_a_body_rests_under_fixed_steps(puck, h):
    """Two events may be so close that fmpy's method of Euler does not find the second one."""
    truth = harness.simulate(puck, times=[1.3], stop=1.3)
    options = {"solver": "Euler", "step_size": h, "output_interval": h, "stop_time": 1.3, "output": ["x", "y", "mode"]}
    end = fmpy.simulate_fmu(puck, fmi_type="ModelExchange", **options)[-1]
    assert (end["mode"], truth["mode"][-1]) == (0, 0)
    assert (end["x"], end["y"]) == pytest.approx((truth["x"][-1], truth["y"][-1]), abs=2.0 * h)


@pytest.mark.campaign
def test_cvode_brings_random_motions_to_rest_as_the_closed_form_says(puck):
    for scene in planar_contacts.random_scenes(20):
        for rtol in (1e-4, 1e-8):
            assert max(planar_contacts.exchange_errors(puck, *scene, rtol=rtol)) < 100.0, scene


@pytest.mark.parametrize(("F", "phi"), slow_after(1, SCENES[:3]))
def test_an_explicit_solver_brings_a_body_to_rest_as_the_closed_form_says(worker, F, phi):
    fmu = worker.exchange(build_puck("FMI 3.0"))
    fmu.begin(planar_contacts.puck_values(1.0, 2.0, 1.0, phi) | {"F_x": F})
    fmu.update_discrete_states()
    fmu.enter_continuous_time()
    time, x, y = rest(1.0, F, 2.0, 1.0, phi)
    rows, _ = fmu.solve([0.0, 1.3 * time], ("x", "y", "v_x", "v_y", "mode", "events.t_last"), "DOP853", 1e-8, {})
    (x_end, y_end, *end) = rows[-1]
    assert end == [0.0, 0.0, 0, pytest.approx(time, rel=1e-6)]
    assert (x_end, y_end) == pytest.approx((x, y), abs=1e-6 * time)
    fmu.free()


@pytest.mark.parametrize("degrees", [30, 200])
def test_a_body_holds_up_to_a_circle_and_leaves_along_its_load(puck, degrees):
    angle = radians(degrees)
    for force in (2.0 - 1e-7, 2.0 + 1e-7):
        values = planar_contacts.puck_values(1.0, 2.0, 0.0, 0.0) | {
            "F_x": force * cos(angle),
            "F_y": force * sin(angle),
        }
        end = planar_contacts.exchange(puck, values, 1.0, 1e-8)[-1]
        assert hypot(end["x"], end["y"]) == pytest.approx(max(0.0, 0.5 * (force - 2.0)), abs=1e-10)
        assert (end["mode"], end["events.count"]) == ((1, 0) if force > 2.0 else (0, 0))
        assert end["x"] * cos(angle) + end["y"] * sin(angle) == pytest.approx(hypot(end["x"], end["y"]), rel=1e-9)


@pytest.mark.campaign
def test_a_body_leaves_under_a_load_that_turns_where_holding_and_sliding_friction_are_equal(tmp_path):
    """Its slip begins without acceleration."""
    require_compiler()
    (tmp_path / "driven.py").write_text(planar_contacts.MODEL)
    fmu = next(build_user_model(tmp_path / "driven.py", "--native", *PLATFORM).rglob("driven.fmu"))
    for seed in range(3):
        motion = planar_contacts.random_driven(seed)
        motion.values |= {"hold": motion.values["f"], "v_x0": 0.0, "v_y0": 0.0, "r": 0.08}
        motion.forces = motion.forces[:1]
        assert planar_contacts.compare_exchange(fmu, motion, 1e-8) == "", seed
        for method in ("dop853", "ode23", "rodas"):
            run = harness.simulate(fmu, motion.values, stop=1.0, rtol=1e-6, method=method)
            assert len(run.events.t) > 0


@pytest.mark.campaign
@pytest.mark.parametrize("rtol", [1e-5, 1e-8])
def test_cvode_follows_springs_circles_and_jumps_as_co_simulation_does(rtol, tmp_path):
    require_compiler()
    (tmp_path / "driven.py").write_text(planar_contacts.MODEL)
    fmu = next(build_user_model(tmp_path / "driven.py", "--native", *PLATFORM).rglob("driven.fmu"))
    for seed in range(8):
        assert planar_contacts.compare_exchange(fmu, planar_contacts.random_driven(seed), rtol) == "", seed


@pytest.mark.parametrize(("F_x", "F_y"), slow_after(1, [(0.3, -1.5), (1.0, 0.2), (0.05, 0.1)]))
def test_derivatives_of_the_time_of_rest_are_those_of_the_closed_form(puck, F_x, F_y):
    values = {"m": 1.3, "mu": 2.0, "v_x0": 0.3, "v_y0": 1.0, "F_x": F_x, "F_y": F_y}
    run = harness.sensitivity(puck, list(values), {"alpha": 0.0, "g": 1.0, "mu_s": 2.0} | values, stop=2.0)

    def time(**changes):
        m, mu, v_x, v_y, F_x, F_y = (values | changes).values()
        return m * (mu * m * mpmath.hypot(v_x, v_y) + F_x * v_x + F_y * v_y) / ((mu * m) ** 2 - F_x**2 - F_y**2)

    (event,) = run.events
    for name, value in values.items():
        exact = float(mpmath.diff(lambda p, name=name: time(**{name: p}), value))
        assert event.derivatives[name] == pytest.approx(exact, rel=1e-7), name
        assert run["v_x", name][-1] == 0.0


@pytest.mark.campaign
@pytest.mark.parametrize("seed", [18, 27])
def test_derivatives_through_stick_and_slip_are_those_of_differences(seed, tmp_path):
    require_compiler()
    (tmp_path / "driven.py").write_text(planar_contacts.MODEL)
    fmu = next(build_user_model(tmp_path / "driven.py", "--native", *PLATFORM).rglob("driven.fmu"))
    values = planar_contacts.random_driven(seed).values | {"r": 0.05, "pull": 0.2}
    names = ["m", "f", "hold", "k_x", "pull", "r", "Omega"]
    run = harness.sensitivity(fmu, names, values, stop=4.0, outputs=["x", "y"])
    assert len(run.events) == 5
    for name in names:
        h, ends = 1e-4 * values[name], []
        for n in (-2, -1, 1, 2):
            changed_run = harness.simulate(fmu, values | {name: values[name] + n * h}, stop=4.0, rtol=1e-11)
            ends.append((changed_run["x"][-1], changed_run["y"][-1]))
        exact = [(a - 8.0 * b + 8.0 * c - d) / (12.0 * h) for a, b, c, d in zip(*ends, strict=True)]
        actual = [run[output, name][-1] for output in ("x", "y")]
        assert actual == pytest.approx(exact, rel=1e-5, abs=1e-5 * max(map(abs, exact))), name


@pytest.fixture(scope="module")
def pair(tmp_path_factory):
    require_compiler()
    file = tmp_path_factory.mktemp("models") / "pair.py"
    file.write_text(PAIR)
    return next(build_user_model(file, "--native", *PLATFORM).rglob("pair.fmu"))


@pytest.mark.campaign
def test_derivatives_of_two_bodies_are_those_of_differences_and_turn_with_the_plane(pair):
    """The second body never leaves the line of its spring, and the first one passes zero on it, where it turns back."""
    values, outputs = {"f": 2.0, "k": 30.0, "c": 0.3, "v_x0": 1.0}, ["x", "y", "z_x", "z_y"]
    run = harness.sensitivity(pair, list(values), values, stop=1.0, outputs=outputs)
    turned_values = {"f": 2.0, "k": 30.0, "c": 0.3, "v_y0": 1.0}
    turned_run = harness.sensitivity(
        pair, list(turned_values), turned_values | {"v_x0": -0.3}, stop=1.0, outputs=outputs
    )
    for name, turned_name in zip(values, turned_values, strict=True):
        assert run["x", name].tolist() == turned_run["y", turned_name].tolist()
        assert run["z_y", name].tolist() == (-turned_run["z_x", turned_name]).tolist()
        h, ends = 1e-4 * values[name], []
        for n in (-2, -1, 1, 2):
            changed_run = harness.simulate(pair, values | {name: values[name] + n * h}, stop=1.0, rtol=1e-11)
            ends.append([*changed_run.events.t[1:], *(changed_run[output][-1] for output in outputs)])
        exact = [(a - 8.0 * b + 8.0 * c - d) / (12.0 * h) for a, b, c, d in zip(*ends, strict=True)]
        times = [event.derivatives[name] for event in run.events]
        assert [*times, *(run[output, name][-1] for output in outputs)] == pytest.approx(exact, rel=1e-5, abs=1e-6), (
            name
        )


@pytest.mark.slow
@pytest.mark.parametrize("method", ["radau9", "rodas"])
def test_a_load_that_only_just_reaches_the_limit_moves_a_body_without_a_stall(pair, method):
    critical = 0.571426306028844  # m/s: the load of the second body touches its limit
    for k in range(34, 44, 2):
        for rtol in (1e-6, 1e-8, 1e-10):
            values = {"v_x0": critical + 0.05 * 2.0 ** (-0.5 * k)}
            run = harness.simulate(pair, values, stop=0.25, rtol=rtol, method=method)
            assert run.events.t[-1] == pytest.approx(0.18908, abs=1e-5)  # the rest of the first body


def test_the_terminal_of_fmi_3_has_both_axes():
    with ZipFile(build_puck("FMI 3.0")) as archive:
        root = ElementTree.fromstring(archive.read("terminalsAndIcons/terminalsAndIcons.xml"))
    members = [(m.get("memberName"), m.get("variableName")) for m in root.iter("TerminalMemberVariable")]
    along_x = [("position_x", "x"), ("speed_x", "v_x"), ("force_x", "F_x")]
    assert members == [*along_x, ("position_y", "y"), ("speed_y", "v_y"), ("force_y", "F_y")]
