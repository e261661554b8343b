"""Model exchange with importer solvers (CVode and Euler of fmpy, scipy) against certified references.

The error bound follows from the tolerance. SUNDIALS keeps the root mean square error of a step, over two or three
states, within rtol of each state, so that no state is off by more than sqrt(3) < 2 times that. An oscillator propagates
errors without growth, and each step takes at least one evaluation of the derivatives. Hence

    error, relative to the largest value of its column  <=  2 N rtol,    N the number of evaluations.

On the sled an error of position delays the next breakaway by that error over the speed of the driver, and all that
follows: the error of the speed is the acceleration times the delay, which GROWTH accounts for.
"""

from itertools import pairwise
from math import isclose, sqrt

import independent_solution
import numpy as np
import pytest
from build_cache import ROOT
from independent_solution import ClosedFormMotion, spans
from models import MODELS, SIGN, declarations_of, model_class, outputs
from variants import slow_after
from worker_client import FmpyError

from fmus.runtime.codes import OUT_OF_RANGE
from fmus.runtime.messages import value_message
from harness.references.certified_reference import POINTS, event_time_error, load_reference, relative_errors
from harness.references.models import CASES

TOLERANCES = (1e-4, 1e-6, 1e-8, 1e-10)
CERTIFIED_MODELS = [name for name in MODELS if (ROOT / "fmus" / f"{name}.csv").is_file()]
TRUTHS = {name: load_reference(name) for name in CERTIFIED_MODELS}
PEAK, FASTEST, DRIVER = 2.9546, 0.41736, 0.034  # acceleration, speed, driver speed of the slipping sled, SI
GROWTH = dict.fromkeys(CERTIFIED_MODELS, 1.0) | dict.fromkeys(("stickslip", "pacejka"), PEAK / DRIVER * 0.544 / FASTEST)
EVENTS = ("events.count", "events.t_last")


def exchange(worker, path, name, **options):
    """Simulate the default experiment with fmpy; return its columns and the number of derivative evaluations."""
    stop = model_class(name).stop_time
    options = {
        "output_interval": stop / (POINTS - 1),
        "record_events": False,
        "output": [*outputs(name), *(v for v in EVENTS if v in declarations_of(name))],
        **options,
    }
    return worker.simulate_and_count(path, "ModelExchange", **options)


def motion(name, columns):
    return np.array([columns[v] for v in outputs(name)[:2]]).T


def events(columns):
    """Return time and new mode of every event, which shows in the next recorded points."""
    rows = zip(*(columns[v] for v in (*EVENTS, "mode")), strict=True)
    return sorted({(t, mode) for count, t, mode in rows if count})


def bound(name, evaluations, rtol):
    return 2.0 * evaluations * rtol * GROWTH[name]


# ---- accuracy


@pytest.fixture(scope="module", params=CERTIFIED_MODELS)
def runs(request, fmus, _workers):
    """The name of a model, and its default experiment by CVode as (tolerance, columns, evaluations)."""
    path = fmus / f"{request.param}.fmu"
    runs = [(rtol, *exchange(_workers[-1], path, request.param, relative_tolerance=rtol)) for rtol in TOLERANCES]
    return request.param, runs


def test_the_error_under_cvode_is_within_its_tolerance_bound(runs):
    name, table = runs
    for rtol, columns, evaluations in table:
        assert columns["time"] == TRUTHS[name].times.tolist()
        assert relative_errors(motion(name, columns), TRUTHS[name].states).max() <= bound(name, evaluations, rtol)


def test_the_error_under_cvode_falls_with_its_tolerance(runs):
    """With order q it falls with the power q/(q + 1): at least (q = 1) by a factor of 1e3 for a factor of 1e6."""
    name, table = runs
    errors = [relative_errors(motion(name, columns), TRUTHS[name].states).max() for _, columns, _ in table]
    assert errors == sorted(errors, reverse=True)
    assert errors[-1] < 1e-3 * errors[0]


def test_events_under_cvode_are_in_order_and_on_time(runs):
    """A delay is the error of position over the speed of approach. The mass with Coulomb friction comes to rest 0.2
    ms after the end: a run with a loose tolerance may include that."""
    name, table = runs
    for rtol, columns, evaluations in table:
        if "mode" not in columns:
            assert "events.count" not in columns or set(columns["events.count"]) == {0}
            continue
        actual, true = events(columns), TRUTHS[name].events
        if rtol < 1e-5 or name != "coulomb":
            assert columns["events.count"][-1] == len(true)
        assert event_time_error(actual[: len(true)], true) <= 2.0 * evaluations * rtol * model_class(name).stop_time


def test_a_stuck_mass_does_not_move_under_cvode(runs):
    """Speed exactly zero, position constant to the last bit. The mass with Coulomb friction rests at the end only."""
    name, table = runs
    if "mode" not in outputs(name):
        pytest.skip(f"{name} has no dry friction")
    for _, columns, _ in table:
        rows = zip(*(columns[v] for v in (*outputs(name)[:2], "mode", "events.count")), strict=True)
        stuck_rows = [(count, x, v) for x, v, mode, count in rows if mode == 0]
        assert len(stuck_rows) > 10 or name == "coulomb"
        assert all(v == 0.0 for _, _, v in stuck_rows)
        assert len({x for _, x, _ in stuck_rows}) == len({count for count, _, _ in stuck_rows})


def test_every_output_agrees_with_co_simulation(runs, worker, fmus):
    """Errors of forces and accelerations are those of position and speed times the rates of the motion, about ten in
    SI units."""
    name, table = runs
    rtol, columns, evaluations = table[-1]
    interval = model_class(name).stop_time / (POINTS - 1)
    co_simulation_columns = worker.simulate(fmus / f"{name}.fmu", "CoSimulation", output_interval=interval)
    for variable in outputs(name):
        if declarations_of(name)[variable].type == "Real":
            actual, expected = (np.array(table[variable])[:, None] for table in (columns, co_simulation_columns))
            assert relative_errors(actual, expected).max() <= 20.0 * bound(name, evaluations, rtol) + 1e-6, variable
        else:
            assert columns[variable] == co_simulation_columns[variable]


@pytest.mark.parametrize("name", slow_after(1, ["stickslip", "pacejka"]))
def test_a_second_solver_agrees(worker, fmus, name):
    """scipy's DOP853, or Radau on stiff models, which also takes at least one evaluation per step."""
    truth, fmu = TRUTHS[name], worker.exchange(fmus / f"{name}.fmu").begin()
    fmu.update_discrete_states()
    fmu.enter_continuous_time()
    method, rtol = ("Radau", 1e-8) if name == "pacejka" else ("DOP853", 1e-11)
    rows, evaluations = fmu.solve(truth.times.tolist(), outputs(name)[:2], method, rtol, {})
    assert relative_errors(np.array(rows), truth.states).max() <= bound(name, evaluations, rtol)
    if "mode" in outputs(name):
        assert fmu.get("events.count") == len(truth.events)
    fmu.free()


@pytest.mark.parametrize("name", ["stickslip", "pendulum"])
def test_a_later_start_time_only_shifts_the_motion(runs_at, name):
    """The FMU does not use the start time, because the position of the driver is a state."""
    (early, n), (late_, m) = runs_at(name, 0.0), runs_at(name, 5.0)
    assert late_["time"][0] == 5.0
    assert relative_errors(motion(name, late_), motion(name, early)).max() <= bound(name, n + m, 1e-8)
    if "x_driver" in early:
        assert late_["x_driver"][0] == 0.0
        assert late_["x_driver"][-1] == pytest.approx(0.034 * 16.0, rel=1e-6)
    if "mode" in early:
        assert late_["mode"] == early["mode"]


@pytest.fixture
def runs_at(worker, fmus):
    """Return runs_at(name, start): the default experiment, shifted in time."""

    def run(name, start):
        times = {"start_time": start, "stop_time": start + model_class(name).stop_time}
        return exchange(worker, fmus / f"{name}.fmu", name, relative_tolerance=1e-8, **times)

    return run


# ---- Euler


def euler(h):
    return {"solver": "Euler", "step_size": h, "output_interval": h}


def test_euler_steps_agree_with_an_explicit_computation(worker, fmus):
    h = 1e-3
    columns, _ = exchange(worker, fmus / "smd.fmu", "smd", **euler(1e-3), output=["x", "v"])
    x, v = 0.1, 0.0
    for point in zip(columns["x"], columns["v"], strict=True):
        assert point == pytest.approx((x, v), abs=1e-12)
        x, v = x + h * v, v + h * (-157.9 * x - 2.0 * v)
    assert len(columns["x"]) == 4001


def test_the_error_under_euler_halves_with_the_step(worker, fmus):
    """Events of the mass with Coulomb friction are noticed at the end of a step, which does not reduce the order."""
    truth, errors = ClosedFormMotion([(0.0, independent_solution.coulomb())], 0.1, 0.0, 1.0), []
    for h in (4e-4, 2e-4, 1e-4):
        columns, _ = exchange(worker, fmus / "coulomb.fmu", "coulomb", stop_time=1.0, **euler(h))
        assert columns["events.count"][-1] == len(truth.events)
        errors.append(max(abs(columns["x"][round(t / h)] - float(truth.at(t)[0])) for t in (0.2, 0.5, 0.8, 1.0)))
    assert [a / b for a, b in pairwise(errors)] == pytest.approx([2.0, 2.0], rel=0.15)


def test_the_sled_sticks_and_slips_under_euler(worker, fmus):
    columns, _ = exchange(worker, fmus / "stickslip.fmu", "stickslip", **euler(2e-3))
    assert columns["events.count"][-1] == len(TRUTHS["stickslip"].events)
    assert {v for v, mode in zip(columns["v"], columns["mode"], strict=True) if mode == 0} == {0.0}


# ---- inputs and parameters that change


def test_a_force_ramp_acts_like_a_faster_driver(worker, fmus):
    """F_ext + k (x_driver - x) grows at the rate R + k v_driver either way."""
    k, faster = 742.5, 0.016
    fmu = worker.exchange(fmus / "stickslip.fmu").begin()
    fmu.update_discrete_states()
    fmu.enter_continuous_time()
    times, truth = (
        [0.04 * i for i in range(401)],
        ClosedFormMotion([(0.0, independent_solution.stickslip(v_driver=DRIVER + faster))], 0.0, 0.0, 17.0),
    )
    rows, evaluations = fmu.solve(times, ["x", "v"], "DOP853", 1e-10, {"F_ext": [0.0, faster * k]})
    off = relative_errors(np.array(rows), np.array([[float(y) for y in truth.at(t)] for t in times]))
    assert off.max() <= bound("stickslip", evaluations, 1e-10)
    assert fmu.get("events.count") == len([t for t, _ in truth.events if t < times[-1]])
    fmu.free()


CHANGES = {
    "driver back in mid-slip": ("v_driver", DRIVER, 4.5, -0.2),
    "hold lowered to a break-away": ("mu_s", 0.9, 3.0, 0.605),
    "rough in mid-slip": ("mu_d", 0.6, 4.5, 0.85),
    "on the moon": ("g", 9.81, 7.0, 1.62),
}


@pytest.mark.parametrize("change", slow_after(2, CHANGES))
def test_a_tunable_changed_in_event_mode_acts_from_then_on(worker, fmus, change):
    variable, before, t, after = CHANGES[change]
    truth = ClosedFormMotion(spans(independent_solution.stickslip, {}, {t: {variable: after}}), 0.0, 0.0, 16.0)
    signal = [[variable], [[0.0, before], [t, after], [16.0, after]]]
    columns, evaluations = exchange(worker, fmus / "stickslip.fmu", "stickslip", relative_tolerance=1e-9, input=signal)
    true = np.array([[float(y) for y in truth.at(time)] for time in columns["time"]])
    scale = np.abs(true).max(axis=0)
    growth = GROWTH["stickslip"] * max(1.0, scale[1] / FASTEST)
    assert relative_errors(motion("stickslip", columns), true).max() <= 2.0 * evaluations * 1e-9 * growth
    assert columns["events.count"][-1] == len(truth.events)


def test_a_force_step_acts_from_then_on(worker, fmus):
    """In stick and in slip. The force is constant in between, because CVode of fmpy does not sample inputs within a
    step."""
    pushes = {2.0: 90.0, 2.1: -50.0, 9.0: 0.0}
    times = [0.0, *pushes, 16.0]
    forces = [0.0, *pushes.values()]
    signal = [[t, force] for force, span in zip(forces, pairwise(times), strict=True) for t in span]
    options = {"relative_tolerance": 1e-8, "input": [["F_ext"], signal]}
    columns, evaluations = exchange(worker, fmus / "stickslip.fmu", "stickslip", **options)
    changes = {t: {"F_ext": force} for t, force in pushes.items()}
    truth = ClosedFormMotion(spans(independent_solution.stickslip, {}, changes), 0.0, 0.0, 16.0)
    true = np.array([[float(y) for y in truth.at(t)] for t in columns["time"]])
    assert relative_errors(motion("stickslip", columns), true).max() <= bound("stickslip", evaluations, 1e-8)
    assert columns["events.count"][-1] == len(truth.events)


# ---- the other laws; solver.method stays at exact, which does not support them but is not used here


@pytest.mark.parametrize("case", [case for case in CASES if case.run.values], ids=lambda case: case.name)
def test_every_other_law_agrees_with_its_reference(worker, fmus, case):
    """The solver crosses the jumps of these laws with small steps, and a step that has passed one ends with an event.
    Nothing sticks before the end under the sign law, so the result is that of the hybrid law; only the start, at
    rest, is another event."""
    columns, evaluations = exchange(
        worker, fmus / f"{case.model}.fmu", case.model, start_values=case.run.values, relative_tolerance=1e-7
    )
    truth = load_reference(case.reference_source)
    assert columns["time"] == truth.times.tolist()
    assert relative_errors(motion(case.model, columns), truth.states).max() <= bound(case.model, evaluations, 1e-7)
    if "events.count" in columns:
        starts_to_slide = case.run.values.get("friction") == SIGN
        assert columns["events.count"][-1] == len(truth.events) + starts_to_slide


def test_the_fmu_survives_a_solver_that_gives_up_on_the_sign_law(worker, fmus):
    """At rest, friction should hold: the solver chatters until it reaches its step limit."""
    with pytest.raises(FmpyError, match="mxstep steps taken"):
        exchange(worker, fmus / "pendulum.fmu", "pendulum", start_values={"friction": SIGN})
    (line,) = worker.read_stderr().splitlines()
    assert "[CVode]" in line
    assert exchange(worker, fmus / "pendulum.fmu", "pendulum")[0]["time"][-1] == 5.0


TIES = [
    ("stickslip", {"mu_d": 0.0}, 32.0),  # the slip ends at the opposite limit
    ("stickslip", {"mu_s": 0.6}, 16.0),  # the speed touches zero, here and below
    ("stickslip", {"mu_s": 0.0, "mu_d": 0.0}, 16.0),
    ("stickslip", {"g": 0.0}, 16.0),
    ("coulomb", {"k": 0.0, "f": 0.0, "c": 1.0}, 60.0),  # nothing stops it
]


@pytest.mark.parametrize("rtol", [TOLERANCES[0], TOLERANCES[-1]])
@pytest.mark.parametrize(("name", "values", "stop"), TIES)
def test_ties_under_cvode_are_decided_by_physics(worker, fmus, name, values, stop, rtol):
    start = {"v0": 1.0} if name == "coulomb" else {}
    options = {"start_values": {**values, **start}, "stop_time": stop, "output_interval": stop / 20}
    columns, _ = exchange(worker, fmus / f"{name}.fmu", name, relative_tolerance=rtol, **options)
    truth = ClosedFormMotion(
        [(0.0, getattr(independent_solution, name)(**values))], 0.1 * (name == "coulomb"), start.get("v0", 0.0), stop
    )
    assert columns["events.count"][-1] == len(truth.events)
    assert columns["x"][-1] == pytest.approx(float(truth.at(stop)[0]), rel=2000.0 * rtol)


# ---- errors as reported by fmpy


def test_an_invalid_parameter_ends_the_run_before_it_begins(worker, fmus):
    for name in CERTIFIED_MODELS:
        with pytest.raises(FmpyError, match="fmi3SetFloat64 failed with status 3"):
            exchange(worker, fmus / f"{name}.fmu", name, start_values={"m": -1.0})
        (line,) = worker.read_stderr().splitlines()
        assert value_message(OUT_OF_RANGE, "m", declarations_of(name)["m"], -1.0) in line


def test_a_successful_run_logs_nothing(worker, fmus):
    for name in CERTIFIED_MODELS:
        exchange(worker, fmus / f"{name}.fmu", name)
    assert worker.read_stderr() == ""


def test_the_natural_frequency_is_that_of_the_spring():
    """The values for the sled above, from its parameters."""
    omega, slack = sqrt(742.5 / 12.5), 0.3 * 12.5 * 9.81 / 742.5
    amplitude = sqrt(slack**2 + (DRIVER / omega) ** 2)
    assert isclose(omega**2 * amplitude, PEAK, rel_tol=1e-4)
    assert isclose(DRIVER + omega * amplitude, FASTEST, rel_tol=1e-4)
