"""The references: certified by closed forms and independent solutions, and reproduced by the FMUs."""

from dataclasses import replace
from itertools import pairwise
from math import cos, exp
from shutil import copy

import independent_pendulum
import independent_solution
import numpy as np
import pytest
from independent_solution import ClosedFormMotion, LinearSegment
from mpmath import mpf
from PIL import Image

from benchmarks.literature.study import BeltBlock, ChatteringOscillatorSign, SmoothedBeltBlock
from benchmarks.references import event_located
from benchmarks.references.generation import CLOSED_FORMS, evaluate_closed_form
from benchmarks.references.icon import draw_missing_icon
from harness import HarnessError
from harness.references.certified_reference import (
    FOLDER,
    POINTS,
    compute_errors,
    event_time_error,
    load_reference,
    relative_errors,
)
from harness.references.models import CASES
from harness.references.reference_trajectory import motion_error

ULP = 2.0**-52
TRUTHS = {case.reference_source: case for case in CASES}
DOP853, RODAS = 4, 5


@pytest.mark.parametrize("name", ["smd", "coulomb", "stickslip"])
def test_an_exact_reference_is_the_double_nearest_to_the_closed_form(name):
    truth, problem = load_reference(name), TRUTHS[name].problem
    motion = ClosedFormMotion([(0.0, getattr(independent_solution, name)())], *problem.start, problem.stop)
    for t, (x, v) in zip(truth.times, truth.states, strict=True):
        for value, exact in zip((x, v), motion.at(float(t)), strict=True):
            assert abs(value - exact) <= 0.5 * ULP * abs(exact)
    assert [mode for _, mode in truth.events] == [mode for _, mode in motion.events]
    assert all(
        abs(t - exact) <= 0.5 * ULP * exact for (t, _), (exact, _) in zip(truth.events, motion.events, strict=True)
    )


class Glide:
    """Constant speed."""

    def __init__(self, v):
        self.v = v

    def at(self, s):
        return self.v * s, self.v


def held_below(eps, stop):
    """Return the sled of the threshold law in segments (time, mode, position, segment), joined at times found by
    bisection."""
    sled = independent_solution.stickslip()
    t, x, v, pieces = mpf(0), mpf(0), mpf(0), []

    def pull(t, x):
        return mpf(sled.k) * (mpf(sled.speed) * t - x)

    def go(mode, piece, has_ended, step):
        nonlocal t, x, v
        pieces.append((t, mode, x, piece))
        low, high, step = mpf(0), mpf(step), mpf(step)
        while not has_ended(t + high, x + piece.at(high)[0], piece.at(high)[1]):
            low, high = high, high + step
        while high - low > mpf(10) ** -35:
            middle = (low + high) / 2
            over = has_ended(t + middle, x + piece.at(middle)[0], piece.at(middle)[1])
            low, high = (low, middle) if over else (middle, high)
        y, v = piece.at(high)
        t, x = t + high, x + y

    while True:
        go(0, Glide(v), lambda t, x, v: pull(t, x) >= sled.hold, "0.1")
        if t > stop:
            return pieces
        if not pieces[1:]:  # later segments start at the speed eps
            go(0, LinearSegment(sled, pull(t, x) - sled.hold, v), lambda t, x, v: v >= eps, "1e-5")
        go(1, LinearSegment(sled, pull(t, x) - sled.slide, v), lambda t, x, v: v <= eps, "1e-3")


@pytest.mark.campaign
def test_the_threshold_reference_is_the_double_nearest_to_its_segments():
    truth = load_reference("stickslip-threshold")
    pieces = held_below(mpf(1e-7), 16)
    starts = [(t, mode) for t, mode, *_ in pieces]
    events = [after for before, after in pairwise(starts) if before[1] != after[1]]
    assert [mode for _, mode in truth.events] == [mode for _, mode in events]
    assert all(abs(t - exact) <= ULP * exact for (t, _), (exact, _) in zip(truth.events, events, strict=True))
    for t, (x, v) in zip(truth.times[::5], truth.states[::5], strict=True):
        start, _, position, piece = [item for item in pieces if item[0] <= t][-1]
        y, speed = piece.at(mpf(float(t)) - start)
        assert abs(x - position - y) <= ULP * 0.5
        assert abs(v - speed) <= ULP * 0.5


@pytest.mark.parametrize("reaction", [False, True])
def test_the_pendulum_references_agree_with_a_third_method(reaction):
    truth = load_reference("pendulum-reaction" if reaction else "pendulum")
    swing = independent_pendulum.PendulumMotion(
        [(0.0, independent_pendulum.Pendulum(reaction))], independent_pendulum.THETA0, 0.0, 5.0
    )
    other = np.array([swing.at(float(t)) for t in truth.times])
    assert relative_errors(other, truth.states).max() < 1e-11
    assert event_time_error(swing.events, truth.events) < 1e-11


@pytest.mark.parametrize(
    "case", [case for case in CASES if case.model in ("pacejka", "pendulum")], ids=lambda case: case.name
)
def test_the_built_fmu_agrees_with_the_reference(launch, case):
    truth = load_reference(case.reference_source)
    smooth = case.model == "pacejka"
    values = {
        "solver.method": RODAS if smooth else DOP853,
        "solver.rtol": 1e-10 if smooth else 1e-12,
        **case.run.values,
    }
    fmu = launch(case.model, values, stop=case.problem.stop)
    motion = np.array(fmu.run(truth.times.tolist(), ["x", "v"] if smooth else ["theta", "omega"]))
    assert relative_errors(motion, truth.states).max() < (1e-8 if smooth else 1e-11)


@pytest.mark.parametrize("name", TRUTHS)
def test_every_reference_covers_its_run_and_states_its_uncertainty(name):
    truth, problem = load_reference(name), TRUTHS[name].problem
    assert truth.times.tolist() == np.linspace(0.0, problem.stop, POINTS).tolist()
    assert truth.states.shape == (POINTS, 2)
    assert tuple(truth.states[0]) == problem.start
    assert bool(truth.modes) == problem.has_dry_friction
    assert truth.method
    assert 0.0 < truth.estimated_error < 2e-11


@pytest.mark.parametrize("name", CLOSED_FORMS)
def test_the_script_reproduces_the_stored_values(name):
    truth = load_reference(name)
    answer = evaluate_closed_form(name, truth.times)
    assert answer.states.tolist() == truth.states.tolist()
    assert answer.events == truth.events


@pytest.mark.parametrize(
    "problem",
    [*(case.problem for case in CASES), BeltBlock(), ChatteringOscillatorSign(), SmoothedBeltBlock()],
    ids=lambda p: type(p).__name__,
)
def test_a_jacobian_is_the_slope_of_the_rates(problem):
    for mode in (-1, 1):
        if problem.jacobian(mode):
            y, h = np.array([0.03, mode * 0.02]), 1e-7
            columns = [
                np.subtract(problem.rates(mode)(1.0, y + d), problem.rates(mode)(1.0, y - d)) for d in h * np.eye(2)
            ]
            slopes = np.transpose(columns) / (2 * h)
            assert np.allclose(problem.jacobian(mode)(1.0, y), slopes, rtol=1e-5, atol=1e-5)


def test_errors_are_relative_to_the_largest_value_of_each_column():
    truth = load_reference("smd")
    off = truth.states + np.array([1e-3 * np.abs(truth.states[:, 0]).max(), 0.0])
    actual = compute_errors(replace(truth, states=off, events=None), truth)
    assert [actual.final, actual.rms, actual.largest] == pytest.approx([1e-3] * 3, rel=1e-10)
    assert actual.events is None


def test_the_error_of_a_motion_is_relative_to_its_largest_position_and_speed():
    x, v = np.array([0.0, 4.0, -8.0]), np.array([1.0, -2.0, 20.0])
    truth = replace(load_reference("smd"), times=np.array([0.0, 1.0, 2.0]), states=np.column_stack([x, v]))
    assert motion_error(truth, x + 0.08, v) == pytest.approx(0.01)
    assert motion_error(truth, x, v - 0.4) == pytest.approx(0.02)
    assert np.isnan(motion_error(truth, x, v * [1.0, np.nan, 1.0]))
    slow = replace(truth, states=np.column_stack([x, 0.0 * v]))
    assert motion_error(slow, x, 0.0 * v + 0.4) == pytest.approx(0.1)  # of 8 m in 2 s
    rest = replace(truth, states=np.zeros((3, 2)))
    assert motion_error(rest, 0.0 * x + 0.03, 0.0 * v) == pytest.approx(0.03)


def test_event_times_are_compared_only_where_the_modes_agree():
    truth = [(1.0, 1), (2.0, 0)]
    assert event_time_error([(1.0, 1), (2.25, 0)], truth) == 0.25
    assert np.isnan(event_time_error([(1.0, 1)], truth))
    assert np.isnan(event_time_error([(1.0, -1), (2.0, 0)], truth))
    assert event_time_error([], []) == 0.0


class Pulses(event_located.HybridProblem):
    """Block under a constant load, whose holding limit has a short dip in each turn of a phase."""

    start, stop, first = (0.5, 0.0, 0.0), 10.0, (0,)

    def rates(self, t, y, modes):
        return [2.0, y[2], 3.0 - modes[0] * self.limit(y[0]) if modes[0] else 0.0]

    def limit(self, phase):
        return 5.0 * (1.0 - 0.8 * exp(-2e4 * (1.0 - cos(phase))))

    def contacts(self, t, y, modes):
        return [(y[2], 3.0, self.limit(y[0]))]

    def stop_slip(self, y, modes):
        if modes[0] == 0:
            y[2] = 0.0


@pytest.mark.campaign
def test_a_pulse_that_the_steps_of_scipy_pass_is_not_certified():
    """There are three pulses, with two events each."""
    problem = Pulses()
    _, events = event_located.solve(problem, [0.0, problem.stop], "DOP853", 3e-14, 1e-17)
    assert len(events) < 6
    with pytest.raises(HarnessError, match="find different changes of mode, so the result is not certified"):
        event_located.certify_problem("pulses", problem)


def test_a_model_without_an_icon_gets_the_curve_of_its_result(tmp_path):
    """And an icon that exists stays."""
    copy(FOLDER / "more" / "sleds.csv", tmp_path)
    icon = draw_missing_icon("sleds", tmp_path)
    with Image.open(icon) as picture:
        assert picture.size == (256, 256)
        assert len(picture.convert("RGB").getcolors(65536)) > 2
    assert draw_missing_icon("sleds", tmp_path) is None
