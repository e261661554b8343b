"""Contacts whose slip contains an input: the stuck body follows the prescribed motion, by every interface."""

from functools import cache
from itertools import pairwise
from pathlib import Path
from tempfile import mkdtemp

import build_cache
import numpy as np
import pytest
from fmpy import read_model_description
from fmpy.validation import validate_fmu
from native_fmus import require_compiler
from prescribed_motion import BLOCK, belt_rising, belt_shaking, solve_block
from variants import campaign_after, slow_after

import harness
from fmus.compiler import BuildError
from fmus.compiler.model_lookup import find_model
from harness.scenes.run_spec import RunSpec
from harness.simulation.whole_run import open_simulator

RISING = {"k": 60.0, "f_s": 10.0, "f_d": 6.0}  # parameters with several phases of stick and slip
SHAKING = {"k": 30.0, "f_s": 12.0, "f_d": 8.0}
PRECISE = {"solver.rtol": 1e-11, "solver.method": 4}  # dop853
BACKENDS = {
    "python": (),
    "native": ("--native", "--platform", "linux64"),
    "native/fmi3": ("--fmi", "3", "--platform", "linux64"),
}
INPUTS = ("x_belt", "v_belt", "a_belt")
WARNING = 1


@cache
def build(text, backend="python", name="block", method="dop853"):
    """Return the FMU of a model, given by its text; a native one has one method."""
    if backend != "python":
        require_compiler()
    path = Path(mkdtemp(dir=build_cache.shared_folder)) / f"{name}.py"
    path.write_text(text)
    options = (*BACKENDS[backend], "--method", method) if backend != "python" else ()
    folder = build_cache.build_user_model(path, *options)
    return folder / ("" if backend == "python" else backend) / f"{name}.fmu"


def run(fmu, belt, step, stop, names):
    """Return times and rows of values; the inputs are set at each step."""
    times = [n * step for n in range(round(stop / step) + 1)]
    rows = []
    for t, end in pairwise(times):
        fmu.set(dict(zip(INPUTS, belt(t), strict=False)))
        rows.append(fmu.get(*names))
        fmu.step(t, end - t)
    fmu.set(dict(zip(INPUTS, belt(times[-1]), strict=False)))
    rows.append(fmu.get(*names))
    return times, np.array(rows)


def available(backend, values):
    """Return the values without the method for a native FMU, which has only this one."""
    return {name: value for name, value in values.items() if backend == "python" or name != "solver.method"}


def launch(worker, backend, values, stop, belt=belt_rising):
    """Return an instance that starts at the motion of the belt."""
    start = {"v0": belt(0.0)[1]} | dict(zip(INPUTS, belt(0.0), strict=False))
    return worker.instantiate(build(BLOCK, backend)).begin(available(backend, values | start), stop=stop)


@pytest.mark.parametrize("backend", slow_after(1, BACKENDS))
def test_a_linear_speed_is_followed_exactly_at_any_communication_step(worker, backend):
    """Stick, slip and stick again on a belt that speeds up; the rate of the speed is set, but never changes."""
    events, motion = solve_block(belt_rising, 5.0, k=60.0, hold=10.0, slide=6.0)
    assert [mode for _, mode in events] == [-1, 0, -1, 0, -1, 0, -1]
    for step in (0.5, 0.05):
        fmu = launch(worker, backend, RISING | PRECISE, 5.0)
        times, rows = run(fmu, belt_rising, step, 5.0, ("x", "v", "mode", "a", "F_friction"))
        expected = np.array([motion(t) for t in times])
        assert np.abs(rows[:, :2] - expected).max() < 1e-9
        assert fmu.get("events.count") == len(events)
        assert fmu.get("events.t_last") == pytest.approx(events[-1][0], abs=1e-9)
        stuck_rows = rows[:, 2] == 0
        assert stuck_rows.sum() >= 3
        x, v, _, a, force = rows[stuck_rows].T
        assert np.array_equal(v, [belt_rising(t)[1] for t, is_stuck in zip(times, stuck_rows, strict=True) if is_stuck])
        assert np.abs(a - 0.1).max() < 1e-14
        assert np.abs(force + 60.0 * x + 2.0 * 0.1).max() < 1e-13
        fmu.free()


@pytest.mark.parametrize("backend", slow_after(2, BACKENDS))
def test_a_belt_that_goes_to_and_fro_is_followed(worker, backend):
    """The acceleration is a staircase between communication points; friction sticks all the same."""
    events, motion = solve_block(belt_shaking, 3.0, k=30.0, hold=12.0, slide=8.0)
    assert [mode for _, mode in events] == [-1, 0, 1, 0]
    errors = []
    for step in (0.02, 0.01, 0.005):
        fmu = launch(worker, backend, SHAKING | PRECISE, 3.0, belt_shaking)
        times, rows = run(fmu, belt_shaking, step, 3.0, ("x", "v"))
        errors.append(np.abs(rows[:, 0] - [motion(t)[0] for t in times]).max())
        assert fmu.get("events.count") == len(events)
        assert not [message for message in fmu.messages() if message[0]]
        fmu.free()
    assert errors[0] < 2e-3
    assert errors[2] < errors[0] / 2.0


def test_a_stuck_block_follows_the_belt_with_second_order(worker):
    errors = []
    for step in (0.04, 0.02, 0.01):
        fmu = launch(worker, "python", {"k": 0.0}, 3.0, belt_shaking)
        times, rows = run(fmu, belt_shaking, step, 3.0, ("x", "v", "a", "F_friction"))
        x, v, a, force = np.array([[*belt_shaking(t)[:3], -2.0 * belt_shaking(t)[2]] for t in times]).T
        assert np.abs(rows[:, 1:] - np.column_stack([v, a, force])).max() < 1e-12
        errors.append(np.abs(rows[:, 0] - x).max())
        assert fmu.get("events.count") == 0
        fmu.free()
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.05)
    assert errors[1] / errors[2] == pytest.approx(4.0, rel=0.05)


def test_an_importer_that_sets_the_acceleration_only_gets_the_speed_by_integration(worker):
    """The value read back is the continued one, and setting an earlier value again is a jump."""
    for backend in ("python", "native"):
        fmu = launch(worker, backend, RISING | {"k": 0.0}, 4.0, lambda t: (0.0, 0.2, 0.1))
        fmu.step(0.0, 1.0)
        fmu.step(1.0, 1.0)
        assert fmu.get("v_belt", "x_belt", "v", "x") == pytest.approx([0.4, 0.6, 0.4, 0.6], abs=1e-14)
        assert fmu.get("mode", "events.count") == [0, 0]
        fmu.set({"v_belt": 0.2})  # as at the start
        assert fmu.get("v_belt", "v", "mode", "events.count") == [0.2, pytest.approx(0.4), 1, 1]
        fmu.free()


@pytest.mark.parametrize("backend", BACKENDS)
def test_a_jump_of_the_speed_is_an_event_after_which_the_contact_slips(worker, backend):
    """The speed jumps by 1 m/s at t = 1 s: friction of 4 N brings 2 kg to the new speed within 0.5 s."""
    fmu = launch(worker, backend, {"k": 0.0}, 3.0, lambda t: (0.0, 0.0, 0.0))
    fmu.step(0.0, 1.0)
    assert fmu.get("mode", "events.count", "v") == [0, 0, 0.0]
    fmu.set({"v_belt": 1.0})
    assert fmu.get("mode", "events.count", "v", "F_friction") == [-1, 1, 0.0, -4.0]
    fmu.step(1.0, 0.25)
    assert fmu.get("mode", "v") == [-1, pytest.approx(0.5, abs=1e-12)]
    fmu.step(1.25, 1.75)
    assert fmu.get("mode", "events.count", "v", "F_friction") == [0, 2, 1.0, 0.0]
    assert fmu.get("events.t_last", "x") == pytest.approx([1.5, 0.25 + 1.5], abs=1e-9)
    assert not fmu.messages()
    fmu.free()


@pytest.mark.parametrize("backend", BACKENDS)
def test_a_speed_that_rises_against_its_rate_is_warned_of_once_by_name(worker, backend):
    fmu = launch(worker, backend, {"k": 0.0}, 4.0, lambda t: (0.0, 0.0, 0.0))
    for n in range(40):
        fmu.set({"v_belt": 0.02 * n})
        fmu.step(0.1 * n, 0.1)
    ((status, category, text),) = [message for message in fmu.messages() if message[0]]
    assert (status, category) == (WARNING, "logStatusWarning")
    assert text.startswith(
        "v_belt jumps at one communication point after another, now at t = 0.4 s, and its rate a_belt "
    )
    assert worker.read_stderr() == ""
    fmu.free()


def test_rare_jumps_are_not_warned_of(worker):
    """A staircase whose steps last several communication steps is a motion with jumps."""
    fmu = launch(worker, "python", {"k": 0.0}, 4.0, lambda t: (0.0, 0.0, 0.0))
    for n in range(40):
        fmu.set({"v_belt": 0.5 * (n // 4)})
        fmu.step(0.1 * n, 0.1)
    assert not [message for message in fmu.messages() if message[0]]
    fmu.free()


@pytest.mark.parametrize("backend", slow_after(1, ["python", "native"]))
def test_a_speed_with_the_rate_zero_is_constant_between_jumps(worker, backend):
    """A staircase whose steps are too high for friction, without a warning."""
    text = BLOCK.replace("rate=a_belt", "rate=0.0").replace(
        '    a_belt = Input(0.0, "m/s2", "acceleration of the belt")\n', ""
    )
    fmu = worker.instantiate(build(text, backend)).begin({"k": 0.0}, stop=4.0)
    for n in range(4):
        fmu.set({"v_belt": 4.0 * (n + 1)})
        assert fmu.get("mode", "F_friction") == [-1, -4.0]
        fmu.step(0.5 * n, 0.5)
        assert fmu.get("v", "x_belt") == pytest.approx([n + 1.0, (n + 1.0) * (n + 2.0)], abs=1e-12)
    assert not [message for message in fmu.messages() if message[0]]
    fmu.free()


TABLE = {"time": (times := np.linspace(0.0, 5.0, 11))} | dict(
    zip(INPUTS, np.array([belt_rising(t)[:3] for t in times]).T, strict=True)
)


@pytest.mark.parametrize("interface", ["CoSimulation", "ModelExchange", "whole runs of a fit"])
@pytest.mark.parametrize("backend", campaign_after(1, BACKENDS))
def test_a_table_with_the_rates_drives_the_block_as_the_belt_does(backend, interface):
    """The inputs are continued from the start of a step: set to their means, the belt would jump at each step."""
    if (backend, interface) == ("python", "ModelExchange"):
        return  # it has none
    _, motion = solve_block(belt_rising, 5.0, k=60.0, hold=10.0, slide=6.0)
    fmu, values = build(BLOCK, backend), RISING | {"v0": belt_rising(0.0)[1]}
    if interface in ("CoSimulation", "ModelExchange"):
        run = harness.simulate(fmu, values, inputs=TABLE, interval=0.5, stop=5.0, interface=interface, rtol=1e-5)
        time, states = run.time, np.stack([run["x"], run["v"]], axis=1)
    else:
        time = np.linspace(0.0, 5.0, 501)
        spec = RunSpec(fmu, ("x", "v"), values=values, inputs=TABLE, times=time, follow=False)
        with open_simulator(spec) as simulator:
            states = simulator.prepare(spec)({"k": 60.0})
    expected = np.array([motion(t) for t in time])
    assert np.abs(states - expected).max() < 1e-4


@pytest.mark.parametrize("at_kink", slow_after(1, [0.0, 0.05, 0.1]))
def test_a_kink_with_one_row_is_an_event_as_one_with_two_rows(at_kink):
    """Between rows the rate is interpolated; at one row it cannot have the values before and after the kink."""
    t = np.round(np.arange(0.0, 4.05, 0.1), 1)
    late = np.maximum(t - 1.0, 0.0)
    table = {"time": t, "x_belt": 0.2 * t + 0.05 * late**2, "v_belt": 0.2 + 0.1 * late, "a_belt": 0.1 * (t > 1.0)}
    two_rows = {name: np.insert(column, 10, column[10]) for name, column in table.items()}
    two_rows["a_belt"][11] = 0.1
    one_row = table | {"a_belt": np.where(t == 1.0, at_kink, table["a_belt"])}
    fmu = build(BLOCK, "native", method="ode45")
    expected, run = (harness.simulate(fmu, inputs=inputs, stop=4.0, rtol=1e-9) for inputs in (two_rows, one_row))
    assert expected.note == ""
    assert run.note.startswith("v_belt and its rate a_belt disagree in ")
    assert run["x"][-1] == pytest.approx(expected["x"][-1], abs=1e-9)
    assert run.events.t == pytest.approx(expected.events.t, abs=1e-9)
    assert run.statistics.evaluations < 1.05 * expected.statistics.evaluations


@pytest.mark.campaign
@pytest.mark.parametrize(("count", "noise"), [(1000, 1e-3), (5, 0.0), (40, 0.1)])
def test_a_smooth_or_noisy_table_has_no_kinks(count, noise):
    t = np.linspace(0.0, 4.0, count)
    random = np.random.default_rng(count)
    columns = zip(INPUTS, belt_shaking(t)[:3], strict=True)
    inputs = {"time": t} | {name: column + noise * random.standard_normal(count) for name, column in columns}
    assert harness.simulate(build(BLOCK, "native", method="ode45"), inputs=inputs, stop=4.0).note == ""


@pytest.mark.parametrize("backend", slow_after(1, BACKENDS))
def test_a_table_without_the_rate_of_an_input_that_varies_is_refused(backend):
    table = {name: column for name, column in TABLE.items() if name in ("time", "v_belt")}
    with pytest.raises(harness.SceneError, match="v_belt varies, but a_belt is missing"):
        harness.simulate(build(BLOCK, backend), inputs=table)
    harness.simulate(build(BLOCK, backend), {"a_belt": 0.1}, inputs=table, stop=0.1)
    harness.simulate(build(BLOCK, backend), inputs={"time": [0.0, 1.0, 1.0], "v_belt": [0.0, 0.0, 1.0]}, stop=0.1)


@pytest.mark.parametrize("method", ["RK45", "Radau"])
def test_model_exchange_follows_a_prescribed_motion(worker, method):
    """scipy as importer; the speed rises linearly and the inputs are set in each evaluation."""
    events, motion = solve_block(belt_rising, 5.0, k=60.0, hold=10.0, slide=6.0)
    fmu = worker.exchange(build(BLOCK, "native/fmi3")).begin(RISING | {"v0": 0.2, "v_belt": 0.2, "a_belt": 0.1})
    fmu.update_discrete_states()
    fmu.enter_continuous_time()
    times = [0.1 * n for n in range(51)]
    names = ("x", "v", "mode", "F_friction", "a", "events.count")
    ramp = {"x_belt": [0.0, 0.2, 0.05], "v_belt": [0.2, 0.1], "a_belt": [0.1]}
    rows, _ = fmu.solve(times, names, method, 1e-9, ramp)
    x, v, mode, force, a, count = np.array(rows).T
    expected = np.array([motion(t) for t in times])
    assert np.abs(np.array([x, v]).T - expected).max() < 1e-8
    assert count[-1] == len(events)
    stuck_rows = mode == 0
    assert np.abs(a[stuck_rows] - 0.1).max() < 1e-14
    assert np.abs(force[stuck_rows] + 60.0 * x[stuck_rows] + 0.2).max() < 1e-12


@pytest.mark.parametrize("kind", ["native", "native/fmi3"])
def test_fmpy_runs_model_exchange_with_a_rising_speed(worker, kind):
    """Also after an input event in which the speed jumps, while the acceleration stays."""
    rows = [(0.0, 0.0, 0.2, 0.1), (2.0, 0.6, 0.4, 0.1), (2.0, 0.6, 1.4, 0.1), (4.0, 3.6, 1.6, 0.1)]
    columns = worker.simulate(
        build(BLOCK, kind),
        "ModelExchange",
        input=[list(INPUTS), rows],
        start_values={"k": 0.0, "v0": 0.2, "v_belt": 0.2, "a_belt": 0.1},
        output=["x", "v", "mode", "F_friction", "events.count"],
        stop_time=4.0,
        output_interval=0.1,
        relative_tolerance=1e-9,
    )
    t, v, mode = (np.array(columns[name]) for name in ("time", "v", "mode"))
    rest = 2.0 + 1.0 / (4.0 / 2.0 - 0.1)  # sliding friction closes the gap of 1 m/s
    before, after = t < 1.99, t > rest + 0.01
    assert np.all(mode[before | after] == 0)
    assert np.all(mode[(t > 2.01) & (t < rest - 0.01)] == -1)
    assert np.abs(v[before] - 0.2 - 0.1 * t[before]).max() < 1e-6
    assert np.abs(v[after] - 1.2 - 0.1 * t[after]).max() < 1e-6
    assert np.abs(np.array(columns["F_friction"])[before | after] + 0.2).max() < 1e-9
    assert columns["events.count"][-1] == 2


@pytest.mark.campaign
def test_errors_of_the_importers_solver_are_no_jump(worker):
    """An event of another contact leaves a stuck contact alone, although the state has drifted from the belt."""
    fmu = worker.exchange(build(TWO, "native/fmi3", "two")).begin({"v_belt": 1.0})
    fmu.update_discrete_states()
    fmu.enter_continuous_time()
    x1, _, x2, _ = fmu.get_states()
    fmu.set_point(0.5, [x1, 1.0, x2, 1.0])  # both blocks ride along
    assert fmu.get("mode_1", "mode_2") == [-1, 0]
    fmu.enter_event_mode()
    fmu.update_discrete_states()
    fmu.enter_continuous_time()
    assert fmu.get("mode_1", "mode_2") == [0, 0]
    fmu.set_point(1.0, [x1, 1.0 + 1e-2, x2, 1.0])  # drift of the first block
    fmu.indicators()
    fmu.enter_event_mode()
    assert "states" in fmu.update_discrete_states()
    assert fmu.get("mode_1", "mode_2") == [0, 0]
    assert fmu.get_states()[1] == 1.0
    fmu.set({"v_belt": 1.5})  # a jump
    fmu.update_discrete_states()
    assert fmu.get("mode_1", "mode_2") == [-1, 0]


TWO = '''\
from fmus import Contact, Input, Mode, Model, Output, Parameter, State


class Two(Model):
    """A block on a belt, and a second block upon the first: the belt is prescribed."""

    m = Parameter(1.0, "kg", "mass of each block", above=0.0)
    k = Parameter(20.0, "N/m", "stiffness of the spring at the upper block", low=0.0)
    f_1 = Parameter(8.0, "N", "friction at the belt", low=0.0)
    f_2 = Parameter(5.0, "N", "friction between the blocks", low=0.0)
    a_belt = Input(0.0, "m/s2", "acceleration of the belt")
    v_belt = Input(0.0, "m/s", "speed of the belt", rate=a_belt)

    x_1 = State("m", "position of the lower block")
    v_1 = State("m/s", "speed of the lower block", rate_of=x_1)
    x_2 = State("m", "position of the upper block")
    v_2 = State("m/s", "speed of the upper block", rate_of=x_2)
    mode_1 = Mode()
    mode_2 = Mode()
    F_1 = Contact("N", "friction at the belt", mode=mode_1, slip=v_1 - v_belt, slide=0.8 * f_1, hold=f_1)
    F_2 = Contact("N", "friction between the blocks", mode=mode_2, slip=v_2 - v_1, slide=0.7 * f_2, hold=f_2)
    a_1 = Output("m/s2", "acceleration of the lower block", (F_2 - F_1) / m, rate_of=v_1)
    a_2 = Output("m/s2", "acceleration of the upper block", (-k * x_2 - F_2) / m, rate_of=v_2)
'''
TWO_WITH_BELT = (
    TWO.replace('v_belt = Input(0.0, "m/s", "speed of the belt", rate=a_belt)', "").replace(
        "    x_1 = State", '    v_belt = State("m/s", "speed of the belt")\n    x_1 = State', 1
    )
    + '    belt_rate = Output("m/s2", "rate of the speed", a_belt, rate_of=v_belt)\n'
)
SPEEDS = ((0.0, 4.0), (0.5, -6.0), (1.5, 6.0), (2.5, -4.0))  # time and acceleration of the belt from then on


@pytest.mark.campaign
@pytest.mark.parametrize("backend", slow_after(1, ["python", "native"]))
def test_two_contacts_agree_with_the_belt_as_a_state_of_the_same_model(worker, backend):
    """Only the acceleration is set, four times; both FMUs then have the same motion between communication points."""
    rows = []
    for text in (TWO, TWO_WITH_BELT):
        fmu = worker.instantiate(build(text, backend, "two")).begin(available(backend, PRECISE), stop=4.0)
        t, result = 0.0, []
        for end in np.arange(0.1, 4.05, 0.1):
            fmu.set({"a_belt": next(a for start, a in reversed(SPEEDS) if start <= t + 1e-9)})
            fmu.step(t, end - t)
            t = end
            result.append(fmu.get("x_1", "v_1", "x_2", "v_2", "F_1", "F_2", "mode_1", "mode_2", "events.count"))
        rows.append(np.array(result))
        fmu.free()
    assert np.abs(rows[0] - rows[1]).max() < 1e-8
    assert rows[0][-1][-1] >= 8


CRANK = '''\
from fmus import Contact, Input, Mode, Model, Output, Parameter, State, cos


class Crank(Model):
    """A block on a slide that a crank moves: the slip contains the angle and the speed of the crank."""

    m = Parameter(2.0, "kg", "mass", above=0.0)
    r = Parameter(0.3, "m", "radius of the crank", above=0.0)
    gear = Parameter(0.5, "1", "gear ratio from the motor to the crank", above=0.0)
    f_s = Parameter(6.0, "N", "static friction", low=0.0)
    f_d = Parameter(4.0, "N", "sliding friction", low=0.0)
    motor = Input(0.0, "rad/s2", "angular acceleration of the motor")
    omega = Input(0.0, "rad/s", "angular velocity of the crank", rate=gear * motor)
    phi = Input(0.0, "rad", "angle of the crank", rate=omega)

    x = State("m", "position")
    v = State("m/s", "speed", rate_of=x)
    mode = Mode()
    v_slide = r * omega * cos(phi)
    F_friction = Contact("N", "friction force", mode=mode, slip=v - v_slide, slide=f_d, hold=f_s)
    a = Output("m/s2", "acceleration", -F_friction / m, rate_of=v)
'''


@pytest.mark.campaign
def test_positions_in_a_slip_and_rates_that_are_expressions_are_continued(worker):
    """The crank speeds up; the inputs are set once, at the start. The second solution is scipy with events."""
    motor, r, gear = 2.0, 0.3, 0.5

    def slide(t):
        omega, phi = gear * motor * t, 0.5 * gear * motor * t * t
        return 0.3 * np.sin(phi), r * omega * np.cos(phi), r * (gear * motor * np.cos(phi) - omega**2 * np.sin(phi))

    events, motion = solve_block(slide, 6.0, k=0.0)
    assert len(events) >= 3
    for backend in ("python", "native"):
        fmu = worker.instantiate(build(CRANK, backend, "crank")).begin(
            available(backend, PRECISE | {"motor": motor}), stop=6.0
        )
        for n in range(12):
            fmu.step(0.5 * n, 0.5)
            assert fmu.get("x", "v") == pytest.approx(motion(0.5 * (n + 1)), abs=1e-8)
        assert fmu.get("events.count") == len(events)
        fmu.free()


PULLED_BLOCK = '''\
from fmus import Contact, Input, Mode, Model, Output, Parameter, State


class PulledBlock(Model):
    """A block on the floor, pulled by a spring whose other end moves as prescribed."""

    m = Parameter(1.0, "kg", "mass", above=0.0)
    k = Parameter(100.0, "N/m", "stiffness of the spring", low=0.0)
    f_s = Parameter(5.0, "N", "static friction", low=0.0)
    f_d = Parameter(4.0, "N", "sliding friction", low=0.0)
    a_end = Input(0.0, "m/s2", "acceleration of the end of the spring")
    v_end = Input(0.0, "m/s", "speed of the end of the spring", rate=a_end)
    x_end = Input(0.0, "m", "position of the end of the spring", rate=v_end)

    x = State("m", "position")
    v = State("m/s", "speed", rate_of=x)
    mode = Mode()
    F_friction = Contact("N", "friction force", mode=mode, slip=v, slide=f_d, hold=f_s)
    a = Output("m/s2", "acceleration", (k * (x_end - x) - F_friction) / m, rate_of=v)
'''


@pytest.mark.parametrize("backend", slow_after(1, ["python", "native"]))
def test_a_load_follows_a_position_with_its_speed_and_acceleration(worker, backend):
    """The end of the spring moves as 0.01 t + 0.02 t^2 m; all inputs are set once."""
    fmu = worker.instantiate(build(PULLED_BLOCK, backend, "pulled"))
    fmu.begin(available(backend, PRECISE | {"a_end": 0.04, "v_end": 0.01}), stop=3.0)
    fmu.step(0.0, 1.0)
    assert fmu.get("x", "v", "x_end", "events.count") == [0.0, 0.0, pytest.approx(0.03, abs=1e-15), 0]
    fmu.step(1.0, 0.4)
    breakaway = (-0.01 + np.sqrt(0.0001 + 4.0 * 0.02 * 0.05)) / 0.04  # 0.05 m of stretch hold 5 N
    assert fmu.get("events.t_last") == pytest.approx(breakaway, abs=1e-10)
    t = 1.4 - breakaway  # m x'' + k x = k x_end - f_d
    end, speed = 0.05, 0.01 + 0.04 * breakaway
    w, shift = 10.0, end - 0.04 - 0.04 / 100.0  # particular solution: shift + speed t + 0.02 t^2
    x = shift + speed * t + 0.02 * t * t - shift * np.cos(w * t) - speed / w * np.sin(w * t)
    assert fmu.get("x") == pytest.approx(x, abs=1e-10)
    fmu.free()


@pytest.mark.parametrize("backend", campaign_after(1, ["python", "native"]))
def test_the_closed_form_continues_a_load_by_its_rate(worker, backend):
    """The end of the spring moves as 0.05 t m; methods with steps agree with the closed form."""
    a_end = '    a_end = Input(0.0, "m/s2", "acceleration of the end of the spring")\n'
    text, rows = PULLED_BLOCK.replace(a_end, "").replace(", rate=a_end", ""), []
    for method in ("exact", "dop853"):
        fmu = worker.instantiate(build(text, backend, "pulled", method))
        number = {"exact": 1, "dop853": 4}[method]
        fmu.begin(available(backend, {"v_end": 0.05, "solver.method": number, "solver.rtol": 1e-11}), stop=3.0)
        fmu.step(0.0, 1.4)
        assert fmu.get("mode", "events.count") == [1, 1]
        rows.append(fmu.get("x", "v", "events.t_last"))
        fmu.free()
    assert rows[0] == pytest.approx(rows[1], abs=1e-10)
    assert rows[0][2] == pytest.approx(1.0, abs=1e-15)


def test_a_saved_state_continues_to_the_same_bits(worker):
    for backend in ("python", "native"):
        fmu = launch(worker, backend, SHAKING, 3.0, belt_shaking)
        fmu.step(0.0, 0.1)
        fmu.set(dict(zip(INPUTS, belt_shaking(0.1), strict=False)))
        state = fmu.save()
        rows = []
        for _ in range(2):
            fmu.step(0.1, 0.3)
            fmu.set(dict(zip(INPUTS, belt_shaking(0.4), strict=False)))
            fmu.step(0.4, 0.5)
            rows.append(fmu.get("x", "v", "F_friction", "v_belt", "events.count", "solver.steps"))
            fmu.restore(state)
        assert rows[0] == rows[1]
        fmu.free()


def test_output_derivatives_follow_the_rates_of_the_inputs(worker):
    """While the block sticks, the derivative of the friction force contains the jerk of the belt."""
    a_belt = '    a_belt = Input(0.0, "m/s2", "acceleration of the belt"'
    text = BLOCK.replace(a_belt, f'    j_belt = Input(0.0, "m/s3", "jerk of the belt")\n{a_belt}, rate=j_belt')
    fmu = worker.instantiate(build(text, "native"))
    fmu.begin(RISING | {"v0": 0.2, "v_belt": 0.2, "a_belt": 0.1, "j_belt": 0.5}, stop=5.0)
    fmu.step(0.0, 0.2)
    assert fmu.get("mode") == 0
    v, a = 0.2 + 0.1 * 0.2 + 0.25 * 0.2**2, 0.1 + 0.5 * 0.2
    assert fmu.get("v", "a") == pytest.approx([v, a], abs=1e-12)
    assert fmu.output_rates(["x", "v", "a", "F_friction", "lag"]) == pytest.approx(
        [v, a, 0.5, -60.0 * v - 2.0 * 0.5, 0.0], abs=1e-11
    )
    fmu.free()


def test_results_do_not_depend_on_communication_points_without_changes(worker):
    """Inputs that nothing changes are continued over any grid."""
    rows = []
    for step in (2.0, 0.1):
        fmu = launch(worker, "python", RISING, 4.0)
        for n in range(round(4.0 / step)):
            fmu.step(n * step, step)
        rows.append(fmu.get("x", "v", "F_friction", "events.count", "events.t_last", "solver.steps"))
        fmu.free()
    assert rows[0] == pytest.approx(rows[1], rel=1e-12)


def test_the_motion_does_not_depend_on_the_start_time(worker):
    rows = []
    for start in (0.0, 2.0**20):
        fmu = worker.instantiate(build(BLOCK)).begin(
            SHAKING | {"v0": 1.02} | dict(zip(INPUTS, belt_shaking(0.0), strict=False)), start=start, stop=start + 3.0
        )
        for n in range(24):
            fmu.set(dict(zip(INPUTS, belt_shaking(0.125 * n), strict=False)))
            fmu.step(start + 0.125 * n, 0.125)
        rows.append(fmu.get("x", "v", "F_friction", "mode", "events.count", "solver.steps"))
        fmu.free()
    assert rows[0] == rows[1]
    assert rows[0][4] == 4


def test_the_model_description_states_what_depends_on_the_rate():
    for backend in BACKENDS:
        fmu = build(BLOCK, backend)
        assert validate_fmu(str(fmu)) == []
        description = read_model_description(fmu)
        outputs = {unknown.variable.name: unknown.dependencies for unknown in description.outputs}
        names = {name: {dependency.name for dependency in dependencies} for name, dependencies in outputs.items()}
        assert {"a_belt", "v_belt"} <= names["F_friction"] & names["a"] & names["mode"]
        assert "x_belt" not in names["F_friction"]
        if backend != "native/fmi3":
            assert not description.coSimulation.canInterpolateInputs


REPLACEMENTS = {
    (", rate=a_belt)", ")"): "slip of F_friction contains the input v_belt, whose rate static friction needs",
    ("rate=a_belt", "rate=a_belt, low=0.0"): "v_belt has a rate and a range",
    ("rate=a_belt", "rate=x_belt_unit"): "x_belt_unit",
    ("rate=a_belt", "rate=a_belt * a_belt"): "rate of v_belt must be linear in the inputs",
    ("rate=a_belt", "rate=choose(a_belt > 0.0, a_belt, 0.0)"): "rate of v_belt must be linear in the inputs",
    ("rate=a_belt", "rate=m"): "v_belt is declared in m/s, but its rate m is in kg",
    ("rate=a_belt", 'rate="a_belt"'): "'a_belt' is neither a number nor an expression",
    ("a_belt", "v_belt_rate"): "the name v_belt_rate is reserved for the derivatives of v_belt",
}


@pytest.mark.parametrize(("change", "sentence"), REPLACEMENTS.items())
def test_an_input_that_cannot_be_continued_is_refused(tmp_path, change, sentence):
    path = tmp_path / "block.py"
    path.write_text(BLOCK.replace("State\n", "State, choose\n", 1).replace(*change))
    with pytest.raises(BuildError) as refusal:
        find_model(path).generated_source  # noqa: B018 - builds
    assert sentence in str(refusal.value)


@pytest.mark.parametrize(
    "slip",
    ["v - 2.0 * u", "v * u", "v - choose(x > 1.0, u, 0.0)", "v - m * w / m", "v - (u - v)"],
)
def test_an_input_without_a_rate_is_refused_in_every_form_of_slip(tmp_path, slip):
    """Also through a named expression; in a condition or a force it needs no rate."""
    text = BLOCK.replace("State\n", "State, choose\n", 1).replace(
        '    x = State("m", "position")',
        '    u = Input(0.0, "1", "ratio")\n    w = u + u\n    x = State("m", "position")',
    )
    path = tmp_path / "block.py"
    path.write_text(text.replace("slip=v - v_belt", f"slip={slip}"))
    with pytest.raises(BuildError, match="the input u, whose rate static friction needs"):
        find_model(path).analysis  # noqa: B018 - builds
    text = text.replace("v - v_belt", "v - choose(w > 1.0, v_belt, 0.0)")
    path.write_text(text.replace("hold=f_s", "hold=f_s * (1.0 + u * u)"))
    assert [e.name for e in find_model(path).analysis.prescribed_inputs] == ["v_belt", "x_belt"]
