"""The method `exact` of the built FMUs against the closed forms of independent_solution.py."""

import csv
import random
import subprocess
import sys
from itertools import pairwise

import independent_solution
import pytest
from independent_solution import ClosedFormMotion
from models import EXACT
from variants import slow_after

PLACES, EVENTS = (
    1e-13,
    1e-14,
)  # relative to the largest value of the run; relative to the time of the event or of the start


def compare(launch, name, values, x0=0.0, v0=0.0, start=0.0, run=4.0, points=100):
    """Compare motion and mode changes of the FMU with the independent solution."""
    stop = start + run
    motion = ClosedFormMotion([(start, getattr(independent_solution, name)(**values))], x0, v0, stop)
    fmu = launch(name, {"solver.method": EXACT, **values, "x0": x0, "v0": v0}, start=start, stop=stop)
    times = [start + run * i / points for i in range(points + 1)]
    rows = fmu.run(times, ["x", "v"])
    truth = [motion.at(t) for t in times]
    for i, variable in enumerate("xv"):
        scale = max(abs(row[i]) for row in truth) or 1
        worst = max(abs(row[i] - true[i]) for row, true in zip(rows, truth, strict=True)) / scale
        assert worst < PLACES, f"{variable} is off by {float(worst):.1e} of its largest value"
    if name != "smd":
        fmu = launch(name, {"solver.method": EXACT, **values, "x0": x0, "v0": v0}, start=start, stop=stop)
        same_events(fmu, motion.events, start, stop)


def same_events(fmu, events, start, stop):
    times, rows = fmu.follow(start, stop, ["events.count", "events.t_last", "mode"])
    changes = [(t, mode) for (before, *_), (after, t, mode) in pairwise(rows) if after > before]
    assert rows[-1][0] == len(events)
    assert [mode for _, mode in changes] == [mode for _, mode in events]
    for (t, _), (true, _) in zip(changes, events, strict=True):
        assert abs(t - true) <= EVENTS * max(abs(true), abs(start))
        assert t in times


@pytest.mark.parametrize(("k", "f"), [(0.0, 1e-3), (0.0, 1e-9), (0.0, 1e-17), (1e-9, 1e-6), (3.0, 1e-6)])
def test_a_small_friction_force_stops_a_strongly_damped_body_on_time(launch, k, f):
    """The event time has all digits although the fast part of the motion has decayed by up to 18 powers of ten."""
    compare(launch, "coulomb", {"k": k, "c": 10.0, "f": f}, v0=1.0, run=10.0)


DAMPING = [0.0, 1e-9, 0.08, 0.5, 1 - 1e-6, 1 - 1e-12, 1.0, 1 + 1e-12, 1 + 1e-6, 3.0, 1e3]


@pytest.mark.parametrize("zeta", DAMPING)
def test_the_free_oscillator_agrees_with_the_closed_form_for_every_damping(launch, zeta):
    compare(launch, "smd", {"k": 144.0, "c": 24.0 * zeta, "F_ext": 3.0}, x0=0.1, v0=-2.0)


@pytest.mark.parametrize(
    ("k", "c"), [(0.0, 0.0), (0.0, 3.0), (0.0, 1e-9), (1e-12, 2.0), (1e-9, 0.0), (1e6, 2.0), (1e-3, 500.0)]
)
def test_the_free_oscillator_agrees_almost_without_spring_or_damper(launch, k, c):
    for push in (0.0, -7.0):
        compare(launch, "smd", {"k": k, "c": c, "F_ext": push}, x0=0.1, v0=0.5)


@pytest.mark.parametrize("c", slow_after(1, [2.0, 0.0, 24.0, 24.0 * (1 + 1e-12), 60.0]))
def test_the_coulomb_oscillator_agrees_for_every_damping(launch, c):
    compare(launch, "coulomb", {"k": 144.0, "c": c, "f": 0.7}, x0=0.1, run=5.0)
    compare(launch, "coulomb", {"k": 144.0, "c": c, "f": 0.7, "F_ext": -3.0}, x0=0.01, v0=2.0, run=5.0)


def test_the_coulomb_mass_agrees_with_defaults_and_without_spring(launch):
    compare(launch, "coulomb", {}, x0=0.1, run=5.0)
    compare(launch, "coulomb", {"k": 0.0}, v0=1.0)
    compare(launch, "coulomb", {"k": 0.0, "c": 0.3}, v0=-1.0)
    compare(launch, "coulomb", {"f": 0.0}, x0=0.1)


def test_the_sled_agrees_when_pulled_either_way_from_any_start(launch):
    compare(launch, "stickslip", {}, run=16.0, points=400)
    compare(launch, "stickslip", {"v_driver": -0.034}, run=16.0)
    compare(launch, "stickslip", {"v_driver": 0.0}, x0=0.5, run=16.0)
    compare(launch, "stickslip", {}, x0=-0.3, v0=0.4, start=7.3, run=16.0)
    compare(launch, "stickslip", {"v_driver": 0.5}, v0=-0.7, start=-2.5, run=16.0)


def test_the_sled_agrees_when_static_and_sliding_friction_are_equal(launch):
    """It breaks away without a jump and then only touches zero speed, which is no stop."""
    compare(launch, "stickslip", {"mu_s": 0.6}, run=16.0)


@pytest.mark.parametrize("seed", slow_after(2, range(4)))
def test_the_sled_agrees_for_random_values(launch, seed):
    draw = random.Random(seed).uniform
    mu_s = draw(0.1, 1.2)
    values = {"m": draw(0.5, 50.0), "k": draw(50.0, 5000.0), "mu_s": mu_s, "mu_d": mu_s * draw(0.3, 0.95)}
    values |= {"g": draw(1.0, 12.0), "v_driver": draw(-0.5, 0.5), "F_ext": draw(-20.0, 20.0)}
    compare(launch, "stickslip", values, draw(-0.1, 0.1), draw(-0.5, 0.5), start=draw(-9.0, 9.0), run=16.0)


def test_each_coulomb_cycle_loses_4_f_over_k_of_amplitude(launch):
    fmu = launch("coulomb", {"solver.method": EXACT}, stop=4.5)
    _, rows = fmu.follow(0.0, 4.5, ["x", "events.count"])
    turns = [rows[0][0]] + [x for (_, before), (x, n) in pairwise(rows) if n > before]
    assert len(turns) == 17
    assert all(
        a - b == pytest.approx(4 * 0.5 / 157.9, rel=1e-12) for a, b in zip(turns[0:16:2], turns[2:17:2], strict=True)
    )
    assert rows[-1][0] == pytest.approx(turns[-1], abs=0.0)


@pytest.mark.parametrize(
    ("name", "values"),
    [("coulomb", {"x0": 0.003}), ("stickslip", {"v_driver": 0.0, "x0": 0.1}), ("pendulum", {"theta0": 0.006})],
)
def test_a_stuck_mass_does_not_move_in_a_million_seconds(launch, name, values):
    fmu = launch(name, values, stop=1e6)
    position, speed = ("theta", "omega") if name == "pendulum" else ("x", "v")
    rows = fmu.run([0.0, 1e-3, 1.0, 31557.6, 1e6], [position, speed, "mode", "events.count"])
    rest = values["theta0" if name == "pendulum" else "x0"]
    assert rows == [[rest, 0.0, 0, 0]] * 5


def test_a_run_with_any_grid_agrees_with_the_closed_form_at_all_points(fmus, tmp_path):
    out = tmp_path / "out.csv"
    command = [sys.executable, "-m", "fmpy", "simulate", str(fmus / "stickslip.fmu"), "--output-file", str(out)]
    subprocess.run(command, check=True, timeout=120, cwd=tmp_path, capture_output=True)
    with out.open(newline="") as file:
        rows = [{name: float(value) for name, value in row.items()} for row in csv.DictReader(file)]
    assert rows[-1]["time"] == pytest.approx(16.0, rel=1e-12)
    motion = ClosedFormMotion([(0.0, independent_solution.stickslip())], 0.0, 0.0, 17.0)
    for row in rows:
        x, v = motion.at(row["time"])
        assert abs(row["x"] - x) < 1e-12
        assert abs(row["v"] - v) < 1e-12
