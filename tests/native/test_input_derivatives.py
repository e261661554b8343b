"""Native FMUs: first derivatives of inputs and outputs."""

from dataclasses import replace
from itertools import pairwise
from math import asin, atan, cos, inf, log2, nan, pi, sin, sqrt, tan
from random import Random

import fmi3_fixtures
import native_fmus
import pytest
from build_cache import build_user_model
from fmpy import read_model_description
from models import DOP853, EXACT, MODELS, ODE23, ODE45, RODAS, outputs, push
from power_series_body import Body, sample_motion
from row_comparison import assert_close, assert_identical
from scipy.integrate import solve_ivp
from worker_client import FmiError

from fmus.compiler.lowering import lowered_model, sibling_module
from fmus.compiler.model_lookup import find_model
from fmus.runtime.codes import INITIALISING, OK

DAMPING = {  # stiffness, damping
    "none": (157.9, 0.0),
    "under-critical": (157.9, 2.0),
    "nearly critical": (100.0, 20.0 - 1e-7),
    "critical": (100.0, 20.0),
    "over-critical": (100.0, 60.0),
    "weak spring": (1e-6, 30.0),
    "no spring": (0.0, 3.0),
    "no spring nor damper": (0.0, 0.0),
}
PIECES = ((0.0, 0.3, 2.0), (1.0, 2.3, -3.0), (2.5, -2.2, 1.7))  # start time, force, and its rate
HARD = ((0.0, 0.0, 80.0), (2.0, 160.0, -120.0), (5.0, -200.0, 60.0))  # enough to drag the sled
HOLDING_FORCE, SLIDING_FORCE = 0.9 * 12.5 * 9.81, 0.6 * 12.5 * 9.81
POUND, INCH = 0.45359237, 0.0254


@pytest.fixture(scope="module")
def fmus():
    return native_fmus.build_native_fmus()


def run_with_inputs(fmu, pieces, times, names):
    """Return a row of values at each of the times; the input changes in pieces."""
    rows, remaining = [], list(pieces)
    for t, end in pairwise([0.0, *times]):
        if remaining and remaining[0][0] == t:
            _, value, rate = remaining.pop(0)
            fmu.ramp("F_ext", rate)
            fmu.set({"F_ext": value})
        fmu.step(t, end - t)
        rows.append(fmu.get(*names))
    return rows


def agree(fmu, body, pieces, stop):
    times = [stop * n / 20 for n in range(1, 21)]
    names = ("x", "v", "events.t_last")
    assert_close(run_with_inputs(fmu, pieces, times, names), sample_motion(body, pieces, times), names, 1e-12)
    assert fmu.get("events.count") == len(body.events)
    return len(body.events)


@pytest.mark.parametrize("damping", DAMPING)
def test_a_ramp_is_exact_for_every_damping(launch, damping):
    k, c = DAMPING[damping]
    fmu = launch("smd", {"k": k, "c": c, "v0": 0.2}, stop=None)
    agree(fmu, Body(k=k, c=c, x=0.1, v=0.2), PIECES, 5.0)


@pytest.mark.parametrize("damping", DAMPING)
def test_a_ramp_is_exact_through_stick_and_slip_for_every_damping(launch, damping):
    k, c = DAMPING[damping]
    fmu = launch("coulomb", {"k": k, "c": c, "v0": 0.2}, stop=None)
    assert agree(fmu, Body(k=k, c=c, hold=0.5, slide=0.5, x=0.1, v=0.2), PIECES, 5.0) >= 2


@pytest.mark.parametrize(("v_driver", "k"), [(0.034, 742.5), (0.0, 742.5), (0.034, 0.0)])
def test_a_ramp_breaks_the_sled_away_on_time_with_and_without_its_driver(launch, v_driver, k):
    fmu = launch("stickslip", {"v_driver": v_driver, "k": k}, stop=None)
    assert agree(fmu, Body(m=12.5, k=k, hold=HOLDING_FORCE, slide=SLIDING_FORCE, u=v_driver), HARD, 10.0) >= 3


def random_force(source, n, h, f):
    """Return pieces of a force that varies at random around the friction force f: start time, value, rate."""
    values = [0.0]
    for _ in range(n):
        values.append(0.8 * values[-1] + f * source.uniform(-1.2, 1.2))
    return [(i * h, u, (u_next - u) / h) for i, (u, u_next) in enumerate(pairwise(values))]


def run_native(worker, path, values, pieces, h):
    """Return rows of position and speed, and the number of events."""
    fmu = worker.instantiate(path).begin(values, stop=len(pieces) * h)
    calls = []
    for t, force, rate in pieces:
        calls += [["set", [{"F_ext": force}]], ["ramp", ["F_ext", rate]], ["step", [t, h]], ["get", [("x", "v")]]]
    answers = worker.call(None, "batch", [[fmu.number, *call] for call in calls])
    count = fmu.get("events.count")
    fmu.free()
    return answers[len(calls) // len(pieces) - 1 :: len(calls) // len(pieces)], count


def run_lowered(model, values, pieces, h):
    """Return the same for the lowered Python model, whose FMU cannot accept input derivatives."""
    call_sequence, numbers = sibling_module(model, "runtime.call_sequence"), model()
    run = sibling_module(model, "runtime.run_state").RunState(numbers)
    vars(numbers).update(values)
    call_sequence.set_experiment(run, 0.0, len(pieces) * h, 0.0)
    run.phase = INITIALISING
    assert call_sequence.exit_initialization(run, numbers) == OK
    rows = []
    for t, force, rate in pieces:
        call_sequence.note_change(run, numbers)
        run.outputs_current = False
        numbers.F_ext, numbers.F_ext_polynomial.order = force, 1
        numbers.F_ext_polynomial.derivatives[1] = rate
        assert call_sequence.do_step(run, numbers, t, h) == OK
        assert call_sequence.update_outputs(run, numbers) == OK
        rows.append([numbers.x, numbers.v])
    call_sequence.update_statistics(run, numbers, False)
    return rows, run.events.count


@pytest.mark.slow
@pytest.mark.parametrize("damping_ratio", [0.0, 0.08, 1.0, 3.0])
def test_random_input_derivatives_never_stall_the_closed_form(worker, fmus, damping_ratio):
    """At a breakaway load and holding force differ by rounding errors, which may not start a slip the wrong way."""
    model, h, path = (
        lowered_model(replace(find_model("coulomb"), has_input_derivatives=True)),
        0.03,
        fmus / "coulomb.fmu",
    )
    events = 0
    for seed in range(3):
        source = Random(seed)
        m, k, f = source.uniform(0.5, 2.0), source.uniform(20.0, 200.0), source.uniform(0.1, 0.4)
        values = {"m": m, "k": k, "f": f, "c": 2.0 * damping_ratio * sqrt(k * m), "x0": 0.0}
        pieces = random_force(source, 400, h, f)
        rows, count = run_native(worker, path, values, pieces, h)
        precise = values | {"solver.method": DOP853, "solver.rtol": 1e-11}
        expected, expected_count = run_native(worker, path, precise, pieces, h)
        assert_close(rows, expected, ("x", "v"), 1e-7)
        python, python_count = run_lowered(model, values, pieces, h)
        assert_identical(python, rows, ("x", "v"))
        assert count == expected_count == python_count
        events += count
    assert events > 150


@pytest.mark.parametrize("damping_ratio", [0.08, 1.0, 3.0])
def test_a_step_with_an_input_rate_evaluates_the_closed_form_a_few_times(monkeypatch, damping_ratio):
    """Most steps need no search for a standstill, and a search converges fast."""
    model, h, calls = lowered_model(replace(find_model("coulomb"), has_input_derivatives=True)), 0.03, []
    closed_form = sibling_module(model, "runtime.linear_closed_form").LinearClosedForm
    evaluate = closed_form.evaluate
    monkeypatch.setattr(closed_form, "evaluate", lambda self, t: (calls.append(t), evaluate(self, t))[1])
    values = {"m": 1.0, "k": 100.0, "f": 0.3, "c": 20.0 * damping_ratio, "x0": 0.0}
    _, events = run_lowered(model, values, random_force(Random(0), 400, h, 0.3), h)
    assert events > 60
    assert len(calls) < 4 * 400


@pytest.mark.parametrize("h_max", [0.0, 3.0])
def test_a_load_that_varies_by_itself_hides_no_rest_from_any_method(worker, fmus, h_max):
    """With nearly no spring: a rest is no touch, and a long step that stops and starts again is searched."""
    for seed in range(25):
        source = Random(seed)
        h, f = source.choice([1.0, 2.0, 3.0]), source.uniform(0.5, 2.0)
        values = {"m": source.uniform(0.5, 3.0), "k": 10.0 ** source.uniform(-6, -3), "f": f, "c": 0.0, "x0": 0.0}
        values |= {"solver.h_max": h_max, "solver.rtol": 1e-6}
        pieces = [(i * h, source.uniform(-2.0, 2.0), source.uniform(-5.0, 5.0)) for i in range(6)]
        counts = [
            run_native(worker, fmus / "coulomb.fmu", values | {"solver.method": method}, pieces, h)[1]
            for method in (EXACT, ODE23, ODE45, DOP853, RODAS)
        ]
        assert len(set(counts)) == 1, (seed, counts)


# ---- methods with steps

STEPPING = {"ode23": 1e-8, "ode45": 1e-9, "dop853": 1e-10, "rodas": 1e-8}  # and their tolerances
NUMBERS = {"exact": EXACT, "ode23": ODE23, "ode45": ODE45, "dop853": DOP853, "rodas": RODAS}


def drag(t, y):
    """The sled on the magic formula, pushed with 50 N/s at first."""
    x, v = y
    C = 2.0 - 2.0 * asin(0.6 / 0.9) / pi
    peak = 2.0 / C
    E, z = (peak - tan(0.5 * pi / C)) / (peak - atan(peak)), peak * v / 0.01
    mu = 0.9 * sin(C * atan(z - E * (z - atan(z))))
    return v, (50.0 * t + 742.5 * (0.034 * t - x)) / 12.5 - mu * 9.81


def swing(t, y):
    """The pendulum while it turns forward, driven with 0.1 N m/s at first."""
    theta, omega = y
    m, a, J, g, arm = 0.46 * POUND, 3.7 * INCH, 1.5 * POUND * INCH**2, 386.0 * INCH, 0.1 * 0.25 * INCH
    return omega, (0.1 * t - m * g * a * sin(theta) - arm * m * g) / (J + m * a * a)


SMOOTH = {
    "pacejka": (drag, "F_ext", 50.0, {}, 2.0),
    "pendulum": (swing, "T_ext", 0.1, {"omega0": 12.0}, 0.1),
}


@pytest.mark.parametrize("method", STEPPING)
@pytest.mark.parametrize("name", SMOOTH)
def test_every_method_evaluates_a_ramp_at_the_stage_times(launch, name, method):
    rates, force, rate, values, stop = SMOOTH[name]
    fmu = launch(name, {"solver.method": NUMBERS[method], "solver.rtol": STEPPING[method], **values}, stop=None)
    start, names = fmu.get(*outputs(name)[:2]), outputs(name)[:2]
    fmu.ramp(force, rate)
    fmu.step(0.0, stop)
    right = solve_ivp(rates, (0.0, stop), start, "LSODA", rtol=1e-11, atol=1e-13).y[:, -1]
    assert_close([fmu.get(*names)], [right.tolist()], names, 1e-6)


@pytest.mark.parametrize("method", STEPPING)
@pytest.mark.parametrize("name", ["coulomb", "stickslip"])
def test_every_method_breaks_away_and_stops_under_a_ramp(launch, name, method):
    values = {"solver.method": NUMBERS[method], "solver.rtol": STEPPING[method]}
    sled, pieces = name == "stickslip", HARD if name == "stickslip" else PIECES
    fmu = launch(name, values, stop=None)
    body = (
        Body(m=12.5, k=742.5, hold=HOLDING_FORCE, slide=SLIDING_FORCE, u=0.034)
        if sled
        else Body(k=157.9, hold=0.5, slide=0.5, x=0.1)
    )
    times, names = [0.25 * n for n in range(1, 25)], ("x", "v", "events.t_last")
    assert_close(run_with_inputs(fmu, pieces, times, names), sample_motion(body, pieces, times), names, 1e-5)
    assert fmu.get("events.count") == len(body.events) >= 2


@pytest.mark.parametrize("method", NUMBERS)
def test_a_ramp_raises_the_order_of_the_error_from_one_to_two(launch, method):
    """One internal step per communication step at a loose tolerance, under the force sin(3 t) N."""

    def end_position(number, has_rate, n_steps):
        h = 1.0 / n_steps
        loose = {"solver.method": number, "solver.rtol": 0.9, "solver.atol": 1e3, "solver.h_max": h}
        fmu = launch("smd", loose | {"k": 4.0, "c": 1.0}, stop=None)
        for n in range(n_steps):
            fmu.set({"F_ext": sin(3.0 * n * h)})
            if has_rate:
                fmu.ramp("F_ext", 3.0 * cos(3.0 * n * h))
            fmu.step(n * h, h)
        return fmu.get("x")

    def rates(t, y):
        return y[1], sin(3.0 * t) - y[1] - 4.0 * y[0]

    truth = solve_ivp(rates, (0.0, 1.0), (0.1, 0.0), rtol=1e-12, atol=1e-14)
    for has_rate in False, True:
        coarse, fine = (abs(end_position(NUMBERS[method], has_rate, n) - truth.y[0, -1]) for n in (64, 128))
        assert log2(coarse / fine) == pytest.approx(1 + has_rate, abs=0.25)


# ---- a changing input is like any other


@pytest.fixture(params=MODELS)
def ramped_instance(request, launch):
    """An instance with a ramped input, the names of its input and outputs, and the rate."""
    name = request.param
    force, size = push(name)
    fmu = launch(name, stop=None)
    fmu.set({force: 0.25 * size})
    fmu.ramp(force, 0.5 * size)
    return name, fmu, force, outputs(name), size


def test_an_input_reads_as_set_and_its_rate_lasts_until_the_next_setting(ramped_instance):
    _, fmu, force, _names, size = ramped_instance
    fmu.step(0.0, 0.5)
    assert fmu.get(force) == 0.5 * size
    fmu.set({force: 0.25 * size})  # an earlier value
    assert fmu.get(force) == 0.25 * size
    fmu.step(0.5, 1.0)
    assert fmu.get(force) == 0.75 * size
    fmu.ramp(force, 0.0)
    fmu.step(1.5, 0.5)
    assert fmu.get(force) == 0.75 * size


def test_results_do_not_depend_on_the_grid_or_on_repeated_settings(launch, ramped_instance):
    name, fmu, force, names, size = ramped_instance
    other = launch(name, stop=None)
    other.ramp(force, 0.5 * size)
    other.set({force: 0.25 * size})
    for n in range(64):
        fmu.step(n / 32, 1 / 32)
        fmu.ramp(force, 0.5 * size)
        fmu.get(*names, "solver.t_next")
    other.step(0.0, 2.0)
    assert_identical([fmu.get(force, *names)], [other.get(force, *names)], [force, *names])


def test_a_ramp_is_saved_and_continues_bit_for_bit(ramped_instance):
    _, fmu, force, names, size = ramped_instance
    fmu.step(0.0, 0.3)
    state = fmu.save()
    fmu.step(0.3, 0.7)
    row = fmu.get(force, *names)
    for copy in state, fmu.deserialize(fmu.serialize(state)):
        fmu.ramp(force, -size)
        fmu.step(1.0, 0.1)
        fmu.restore(copy)
        fmu.step(0.3, 0.7)
        assert_identical([fmu.get(force, *names)], [row], [force, *names])
    fmu.reset()
    fmu.init()
    fmu.step(0.0, 0.5)
    assert fmu.get(force) == 0.0


def test_a_ramp_may_begin_before_the_run(worker, fmus):
    rows = []
    for early in True, False:
        fmu = worker.instantiate(fmus / "stickslip.fmu")
        fmu.setup(0.5, None, None)
        if early:
            fmu.ramp("F_ext", 90.0)
        fmu.init()
        if not early:
            fmu.ramp("F_ext", 90.0)
        fmu.step(0.5, 2.0)
        rows.append(fmu.get("F_ext", *outputs("stickslip")))
        fmu.free()
    assert_identical(rows[:1], rows[1:], ["F_ext", *outputs("stickslip")])
    assert rows[0][0] == 180.0


# ---- output derivatives

BUILDERS = {"FMI 2.0": native_fmus.build_native_fmus, "FMI 3.0": fmi3_fixtures.build_fmi3_fmus}


@pytest.mark.slow
@pytest.mark.parametrize("version", BUILDERS)
@pytest.mark.parametrize("name", MODELS)
def test_output_derivatives_agree_with_differences(worker, name, version):
    """Central differences of fourth order, in stick and slip; the input ramps where allowed."""
    h, (force, size), names = 1e-3, push(name), [output for output in outputs(name) if output != "mode"]
    fmu = worker.instantiate(BUILDERS[version]() / f"{name}.fmu").begin({"solver.rtol": 1e-12})
    if version == "FMI 2.0":
        fmu.ramp(force, 0.1 * size)
    t, derivatives = 0.0, []
    for middle in (0.1, 0.4, 0.6, 1.0, 2.0):
        times = [middle + n * h for n in (-2, -1, 0, 1, 2)]
        a, b, row = fmu.run([t, *times[:3]], names)[1:]
        rates = fmu.output_rates(names)
        _, d, (*e, t_last) = fmu.run(times[2:], [*names, "events.t_last"])
        t = times[-1]
        if not middle - 3 * h < t_last:  # otherwise an event lies in between
            right = [(w - 8.0 * x + 8.0 * y - z) / (12.0 * h) for w, x, y, z in zip(a, b, d, e, strict=False)]
            derivatives.append((row, rates, right))
    assert len(derivatives) >= 3
    for values, rates, right in zip(*(zip(*rows, strict=True) for rows in zip(*derivatives, strict=True)), strict=True):
        bound = 1e-5 * max(map(abs, right)) + 1e-8 * (10.0 + max(map(abs, values)))
        assert rates == pytest.approx(right, rel=0.0, abs=bound)
    fmu.free()


# ---- description and errors


@pytest.mark.parametrize("name", MODELS)
def test_the_description_declares_the_supported_orders(fmus, name):
    fmi2_description, fmi3_description = (
        read_model_description(folder / f"{name}.fmu") for folder in (fmus, fmi3_fixtures.build_fmi3_fmus())
    )
    assert fmi2_description.coSimulation.canInterpolateInputs
    assert [
        description.coSimulation.maxOutputDerivativeOrder for description in (fmi2_description, fmi3_description)
    ] == [1, 1]


def test_invalid_input_derivatives_are_refused_and_change_nothing(launch):
    fmu = launch("smd")
    fmu.step(0.0, 0.1)
    row = fmu.get(*outputs("smd"))
    wrong = [("m", 1.0, 1), ("x", 1.0, 1), ("solver.method", 1.0, 1)]
    wrong += [("F_ext", value, 1) for value in (nan, inf, -inf)] + [("F_ext", 1.0, order) for order in (0, 2, -1)]
    for arguments in wrong:
        with pytest.raises(FmiError, match="fmi2SetRealInputDerivatives returned status 3"):
            fmu.ramp(*arguments)
        ((_, _, sentence),) = fmu.messages()
        assert "an input without a range and without a declared rate accepts a finite derivative of order 1" in sentence
    for names, order in ((["x", "m"], 1), (["F_ext"], 1), (["events.count"], 1), (["x"], 0), (["v"], 2)):
        with pytest.raises(FmiError, match="fmi2GetRealOutputDerivatives returned status 3"):
            fmu.output_rates(names, order)
        ((_, _, sentence),) = fmu.messages()
        assert "outputs have derivatives of order 1" in sentence
    assert_identical([fmu.get(*outputs("smd"))], [row], outputs("smd"))
    assert fmu.get("F_ext") == 0.0
    fmu.terminate()
    assert fmu.output_rates(["x"]) == fmu.get("v", "x")[:1]
    with pytest.raises(FmiError):
        fmu.ramp("F_ext", 1.0)
    assert "the FMU is terminated" in fmu.messages()[0][2]


def test_a_model_declares_which_inputs_may_ramp(tmp_path):
    """No input with a range, and none on which the static limit depends, because breakaway would have no closed
    form. Methods with steps accept any time dependence of a stiffness."""
    text = """
from fmus import Contact, Input, Mode, Model, Output, Parameter, State


class Block(Model):
    "Block that is pressed onto a table."

    m = Parameter(1.0, "kg", "mass", above=0.0)
    l = Parameter(1.0, "m", "a length")
    F_ext = Input(0.0, "N", "force along the table")
    F_n = Input(5.0, "N", "force across it")
    F_near = Input(0.0, "N", "force of a range", low=-1.0, high=1.0)
    x = State("m", "position")
    v = State("m/s", "speed", rate_of=x)
    mode = Mode()
    F_friction = Contact("N", "friction", mode=mode, slip=v, slide=0.5 * F_n)
    a = Output("m/s2", "acceleration", (F_ext + F_near - F_friction) / m, rate_of=v)
"""
    (tmp_path / "block.py").write_text(text)
    (tmp_path / "bar.py").write_text(
        text.replace("slide=0.5 * F_n", "slide=2.0")
        .replace("F_near -", "F_near - F_n * x / l -")
        .replace("Block(", "Bar(")
    )
    for name, ramps in (("block", ["F_ext"]), ("bar", ["F_ext"])):
        analysis = replace(find_model(tmp_path / f"{name}.py"), has_input_derivatives=True).analysis
        assert [e.name for e in analysis.input_rates] == ramps
    fmu = build_user_model(tmp_path / "bar.py", "--native", "--platform", "linux64") / "native" / "bar.fmu"
    assert not read_model_description(fmu).coSimulation.canInterpolateInputs  # which covers all inputs
