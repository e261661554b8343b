"""Native FMUs: input derivatives up to order 8, and output derivatives."""

from dataclasses import replace
from itertools import pairwise
from math import asin, atan, inf, log2, nan, pi, sin, sqrt, tan
from random import Random

import fmi3_fixtures
import native_fmus
import pytest
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
POLYNOMIAL_PIECES = (
    (0.0, 0.3, 2.1, -9.0, 12.5),
    (1.0, 2.3, -3.0, 8.0),
    (2.5, -2.2, 1.7, 0.0, 30.0, -400.0),
)  # and its derivatives
DRAGGED = ((0.0, 0.0, 20.0, 60.0, -30.0), (3.0, 60.0, -400.0, 250.0), (6.0, -150.0, 0.0, 0.0, 90.0))
HELD, SLID = 0.9 * 12.5 * 9.81, 0.6 * 12.5 * 9.81
POUND, INCH = 0.45359237, 0.0254


@pytest.fixture(scope="module")
def fmus():
    return native_fmus.build_native_fmus()


def run_with_inputs(fmu, pieces, times, names):
    """Return a row of values at each of the times; the input changes in pieces."""
    rows, remaining = [], list(pieces)
    for t, end in pairwise([0.0, *times]):
        if remaining and remaining[0][0] == t:
            _, value, *rates = remaining.pop(0)
            for order in range(len(rates), 0, -1):
                fmu.ramp("F_ext", rates[order - 1], order)
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
    assert agree(fmu, Body(m=12.5, k=k, hold=HELD, slide=SLID, u=v_driver), HARD, 10.0) >= 3


@pytest.mark.parametrize("damping", DAMPING)
def test_a_polynomial_force_is_exact_through_stick_and_slip_for_every_damping(launch, damping):
    """Derivatives that are not set again continue: orders 3 and 4 of the second piece are those of the first."""
    k, c = DAMPING[damping]
    for name, friction in ("smd", 0.0), ("coulomb", 0.5):
        fmu = launch(name, {"k": k, "c": c, "v0": 0.2}, stop=None)
        body = Body(k=k, c=c, hold=friction, slide=friction, x=0.1, v=0.2)
        assert agree(fmu, body, POLYNOMIAL_PIECES, 5.0) >= 2 * friction


@pytest.mark.parametrize(("v_driver", "k"), [(0.034, 742.5), (0.0, 742.5), (0.034, 0.0)])
def test_a_polynomial_force_breaks_the_sled_away_on_time(launch, v_driver, k):
    fmu = launch("stickslip", {"v_driver": v_driver, "k": k}, stop=None)
    assert agree(fmu, Body(m=12.5, k=k, hold=HELD, slide=SLID, u=v_driver), DRAGGED, 10.0) >= 3


def random_force(source, n, h, f, order):
    """Return pieces of a force that varies at random around the friction force f: start time, value, derivatives."""
    values = [0.0]
    for _ in range(n):
        values.append(0.8 * values[-1] + f * source.uniform(-1.2, 1.2))
    return [
        (i * h, u, (u_next - u) / h, *(f * source.uniform(-1.0, 1.0) / h**k for k in range(2, order + 1)))
        for i, (u, u_next) in enumerate(pairwise(values))
    ]


def run_native(worker, path, values, pieces, h):
    """Return rows of position and speed, and the number of events."""
    fmu = worker.instantiate(path).begin(values, stop=len(pieces) * h)
    calls = []
    for t, force, *derivatives in pieces:
        calls.append(["set", [{"F_ext": force}]])
        calls += [["ramp", ["F_ext", value, order]] for order, value in enumerate(derivatives, 1)]
        calls += [["step", [t, h]], ["get", [("x", "v")]]]
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
    for t, force, *derivatives in pieces:
        call_sequence.note_change(run, numbers)
        run.outputs_current = False
        numbers.F_ext, numbers.F_ext_polynomial.order = force, len(derivatives)
        numbers.F_ext_polynomial.derivatives[1 : 1 + len(derivatives)] = derivatives
        assert call_sequence.do_step(run, numbers, t, h) == OK
        assert call_sequence.update_outputs(run, numbers) == OK
        rows.append([numbers.x, numbers.v])
    call_sequence.update_statistics(run, numbers, False)
    return rows, run.events.count


@pytest.mark.slow
@pytest.mark.parametrize("order", [1, 3])
@pytest.mark.parametrize("damping_ratio", [0.0, 0.08, 1.0, 3.0])
def test_random_input_derivatives_never_stall_the_closed_form(worker, fmus, damping_ratio, order):
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
        pieces = random_force(source, 400, h, f, order)
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
    _, events = run_lowered(model, values, random_force(Random(0), 400, h, 0.3, 1), h)
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
        pieces = [(i * h, source.uniform(-2.0, 2.0), *(source.uniform(-5.0, 5.0) for _ in range(3))) for i in range(6)]
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
    return v, (50.0 * t - 30.0 * t * t + 12.0 * t**3 + 742.5 * (0.034 * t - x)) / 12.5 - mu * 9.81


def swing(t, y):
    """The pendulum while it turns forward, driven with 0.1 N m/s at first."""
    theta, omega = y
    m, a, J, g, arm = 0.46 * POUND, 3.7 * INCH, 1.5 * POUND * INCH**2, 386.0 * INCH, 0.1 * 0.25 * INCH
    return omega, (0.1 * t + 4.0 * t * t - 20.0 * t**3 - m * g * a * sin(theta) - arm * m * g) / (J + m * a * a)


SMOOTH = {
    "pacejka": (drag, "F_ext", (50.0, -60.0, 72.0), {}, 2.0),
    "pendulum": (swing, "T_ext", (0.1, 8.0, -120.0), {"omega0": 12.0}, 0.1),
}


@pytest.mark.parametrize("method", STEPPING)
@pytest.mark.parametrize("name", SMOOTH)
def test_every_method_evaluates_a_polynomial_force_at_the_stage_times(launch, name, method):
    rates, force, derivatives, values, stop = SMOOTH[name]
    fmu = launch(name, {"solver.method": NUMBERS[method], "solver.rtol": STEPPING[method], **values}, stop=None)
    start, names = fmu.get(*outputs(name)[:2]), outputs(name)[:2]
    for order, value in enumerate(derivatives, 1):
        fmu.ramp(force, value, order)
    fmu.step(0.0, stop)
    right = solve_ivp(rates, (0.0, stop), start, "LSODA", rtol=1e-11, atol=1e-13).y[:, -1]
    assert_close([fmu.get(*names)], [right.tolist()], names, 1e-6)


@pytest.mark.parametrize("method", STEPPING)
@pytest.mark.parametrize("name", ["coulomb", "stickslip"])
def test_every_method_breaks_away_and_stops_under_a_polynomial_force(launch, name, method):
    values = {"solver.method": NUMBERS[method], "solver.rtol": STEPPING[method]}
    sled, pieces = name == "stickslip", DRAGGED if name == "stickslip" else POLYNOMIAL_PIECES
    fmu = launch(name, values, stop=None)
    body = Body(m=12.5, k=742.5, hold=HELD, slide=SLID, u=0.034) if sled else Body(k=157.9, hold=0.5, slide=0.5, x=0.1)
    times, names = [0.25 * n for n in range(1, 25)], ("x", "v", "events.t_last")
    assert_close(run_with_inputs(fmu, pieces, times, names), sample_motion(body, pieces, times), names, 1e-5)
    assert fmu.get("events.count") == len(body.events) >= 2


LIMITS = {
    "coulomb": ({"x0": 0.0}, 0.5),
    "stickslip": ({"v_driver": 0.0}, HELD),
    "pendulum": ({"theta0": 0.0}, 0.1 * 0.25 * INCH * 0.46 * POUND * 386.0 * INCH),
}  # at rest without a load, and the static limit


@pytest.mark.parametrize("name", LIMITS)
def test_a_load_peaking_just_below_the_limit_sticks_and_breaks_away_at_the_opposite_limit(launch, name):
    """The load is 3 t - 4 t^3 of the limit, but for 1e-9: at most 1 at 0.5 s, and -1 at 1 s."""
    values, limit = LIMITS[name]
    fmu = launch(name, values, stop=None)
    for order, value in (3, -24.0), (1, 3.0):
        fmu.ramp(push(name)[0], value * limit * (1.0 - 1e-9), order)
    fmu.step(0.0, 1.05)
    assert fmu.get("mode", "events.count") == [-1, 1]
    assert fmu.get("events.t_last") == pytest.approx(1.0 + 1e-9 / 9.0, rel=0.0, abs=1e-12)


@pytest.mark.parametrize("name", LIMITS)
def test_a_load_that_falls_from_one_limit_breaks_away_at_the_other(launch, name):
    """The load is 1 - 4 t + 1.5 t^2 of the limit: -1 at 2/3 s, and 1 again at 8/3 s."""
    values, limit = LIMITS[name]
    fmu = launch(name, values | {"solver.h_max": 4.0}, stop=None)
    fmu.set({push(name)[0]: limit})
    for order, value in (2, 3.0), (1, -4.0):
        fmu.ramp(push(name)[0], value * limit, order)
    fmu.step(0.0, 0.7)
    assert fmu.get("mode", "events.count") == [-1, 1]
    assert fmu.get("events.t_last") == pytest.approx(2.0 / 3.0, rel=0.0, abs=1e-12)


@pytest.mark.parametrize("name", LIMITS)
def test_a_load_equal_to_the_limit_follows_its_first_nonzero_derivative(launch, name):
    values, limit = LIMITS[name]
    for order, value in (2, 1.0), (3, -1.0), (4, -1.0), (5, 1.0):
        fmu = launch(name, values, stop=None)
        fmu.set({push(name)[0]: limit})
        fmu.ramp(push(name)[0], value * limit, order)
        fmu.step(0.0, 0.2)
        assert fmu.get("mode") == (value > 0.0)
        assert fmu.get("events.t_last") == 0.0


@pytest.mark.parametrize("name", LIMITS)
def test_derivatives_growing_with_their_order_cost_no_extra_steps(launch, name):
    """A load oscillates at 50 Hz, below and above the limit, with derivatives set every millisecond."""
    values, limit = LIMITS[name]
    for size in 0.9 * limit, 2.0 * limit:
        fmu = launch(name, values, stop=None)
        for n in range(60):
            fmu.set({push(name)[0]: size * sin(0.1 * pi * n)})
            for k in range(1, 9):
                fmu.ramp(push(name)[0], size * (100.0 * pi) ** k * sin(0.1 * pi * n + 0.5 * pi * k), k)
            fmu.step(n * 1e-3, 1e-3)
        assert fmu.get("solver.steps") < 60 * 6
        assert (fmu.get("events.count") > 0) == (size > limit)


ORDERS = {"ode23": 3, "ode45": 5, "dop853": 8, "rodas": 4, "exact": 6}  # the last one is arbitrary


@pytest.mark.parametrize("method", ORDERS)
def test_a_method_keeps_its_order_when_input_derivatives_are_set(launch, method):
    """Without input derivatives the order is 1, with the first derivative 2: one internal step per communication
    step, at a loose tolerance, under the force sin(3 t) N. The reference uses the exact method with all derivatives."""

    def end_position(number, order, n_steps):
        h = 1.0 / n_steps
        loose = {"solver.method": number, "solver.rtol": 0.9, "solver.atol": 1e3, "solver.h_max": h}
        fmu = launch("smd", loose | {"k": 4.0, "c": 1.0}, stop=None)
        for n in range(n_steps):
            fmu.set({"F_ext": sin(3.0 * n * h)})
            for k in range(1, order):
                fmu.ramp("F_ext", 3.0**k * sin(3.0 * n * h + 0.5 * pi * k), k)
            fmu.step(n * h, h)
        return fmu.get("x")

    truth, n_steps = end_position(EXACT, 9, 64), 32 if method == "ode23" else 8
    for order in sorted({1, 2, ORDERS[method]}):
        coarse, fine = (abs(end_position(NUMBERS[method], order, n) - truth) for n in (n_steps, 2 * n_steps))
        assert log2(coarse / fine) == pytest.approx(order, abs=0.25)


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
    fmu.ramp(force, -2.0 * size, 3)
    other.ramp(force, -2.0 * size, 3)
    other.ramp(force, 0.5 * size)
    other.set({force: 0.25 * size})
    for n in range(64):
        fmu.step(n / 32, 1 / 32)
        fmu.ramp(force, -2.0 * size, 3)
        fmu.get(*names, "solver.t_next")
    other.step(0.0, 2.0)
    assert_identical([fmu.get(force, *names)], [other.get(force, *names)], [force, *names])


def test_a_ramp_is_saved_and_continues_bit_for_bit(ramped_instance):
    _, fmu, force, names, size = ramped_instance
    fmu.ramp(force, 9.0 * size, 4)
    fmu.step(0.0, 0.3)
    state = fmu.save()
    fmu.step(0.3, 0.7)
    row = fmu.get(force, *names)
    for copy in state, fmu.deserialize(fmu.serialize(state)):
        fmu.ramp(force, -size, 2)
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

BUILT = {"FMI 2.0": native_fmus.build_native_fmus, "FMI 3.0": fmi3_fixtures.build_fmi3_fmus}


@pytest.mark.slow
@pytest.mark.parametrize("version", BUILT)
@pytest.mark.parametrize("name", MODELS)
def test_output_derivatives_agree_with_differences(worker, name, version):
    """Central differences of fourth order, in stick and slip; the input ramps where allowed."""
    h, (force, size), names = 1e-3, push(name), [one for one in outputs(name) if one != "mode"]
    fmu = worker.instantiate(BUILT[version]() / f"{name}.fmu").begin({"solver.rtol": 1e-12})
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
    two, three = (read_model_description(folder / f"{name}.fmu") for folder in (fmus, fmi3_fixtures.build_fmi3_fmus()))
    assert two.coSimulation.canInterpolateInputs
    assert [one.coSimulation.maxOutputDerivativeOrder for one in (two, three)] == [1, 1]


def test_invalid_input_derivatives_are_refused_and_change_nothing(launch):
    fmu = launch("smd")
    fmu.step(0.0, 0.1)
    row = fmu.get(*outputs("smd"))
    wrong = [("m", 1.0, 1), ("x", 1.0, 1), ("solver.method", 1.0, 1)]
    wrong += [("F_ext", value, 1) for value in (nan, inf, -inf)] + [("F_ext", 1.0, order) for order in (0, 9, -1)]
    for arguments in wrong:
        with pytest.raises(FmiError, match="fmi2SetRealInputDerivatives returned status 3"):
            fmu.ramp(*arguments)
        ((_, _, sentence),) = fmu.messages()
        assert "an input without a range accepts finite derivatives of orders 1 to 8" in sentence
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
