"""ode23 in the built FMUs: the published step counts and peaks, and its errors against the closed form."""

import itertools

import independent_pendulum
import independent_solution
import pytest
from independent_solution import ClosedFormMotion
from models import EXACT, HYBRID, ODE23, SIGN, THRESHOLD
from variants import campaign_after

MATLAB = {"solver.method": ODE23, "solver.rtol": 1e-3, "solver.atol": 1e-6}


def follow(launch, name, values, stop, names=("x",)):
    fmu = launch(name, {**MATLAB, **values}, stop=stop)
    times, rows = fmu.follow(0.0, stop, list(names))
    assert fmu.get("solver.steps") == len(times) - 1
    return times, rows


def mean_step(times):
    """Return the mean step as published: the last difference counts twice."""
    steps = [b - a for a, b in itertools.pairwise(times)]
    return (sum(steps) + steps[-1]) / (len(steps) + 1)


def highs(rows):
    """Return the local maxima of the first column."""
    x = [row[0] for row in rows]
    return [b for a, b, c in zip(x, x[1:], x[2:], strict=False) if a < b >= c]


def test_smd_takes_235_points_of_17_ms_and_shows_the_published_peaks(launch):
    times, rows = follow(launch, "smd", {}, 4.0)
    assert len(times) == pytest.approx(235, abs=1)
    assert mean_step(times) == pytest.approx(17.06e-3, abs=0.01e-3)
    peaks = highs(rows)
    assert (peaks[0], peaks[3]) == pytest.approx((0.06031, 0.01323), abs=0.6e-5)


def test_coulomb_with_the_sign_law_takes_422_points(launch):
    times, rows = follow(launch, "coulomb", {"friction": SIGN}, 4.0)
    assert len(times) == pytest.approx(422, abs=2)
    peaks = highs(rows)
    assert (peaks[0], peaks[3]) == pytest.approx(
        (0.08703, 0.04837), abs=1e-5
    )  # 0.048379: the published value is truncated, not rounded


def test_pacejka_takes_6666_points_and_ten_times_as_many_at_a_tenth_of_x_m(launch):
    times, _ = follow(launch, "pacejka", {"x_m": 0.01}, 16.0)
    assert len(times) == pytest.approx(6666, abs=3)
    fmu = launch("pacejka", {**MATLAB, "x_m": 0.001}, stop=16.0)
    fmu.step(0.0, 16.0)
    assert fmu.get("solver.steps") + 1 == pytest.approx(68107, rel=1e-3)


def test_the_threshold_law_chatters_and_shows_the_published_slips(launch):
    times, rows = follow(launch, "stickslip", {"friction": THRESHOLD}, 16.0, ("v", "a"))
    assert 5000 < len(times) < 20000  # depends on rounding; 10972 published
    assert max(v for v, _ in rows) == pytest.approx(0.42, abs=0.005)
    assert max(a for v, a in rows if v > 0.01) == pytest.approx(2.95, abs=0.02)


@pytest.mark.campaign
def test_the_steps_of_the_threshold_law_depend_on_the_last_digits_of_a_parameter(launch):
    """This is why they differ from the published 10972, as the scene says."""
    counts = []
    for ulps in (0, 1, 2, 10, 3e4):
        choice = {"friction": THRESHOLD, "k": 742.5 * (1.0 + ulps * 2.0**-52)}
        times, _ = follow(launch, "stickslip", choice, 16.0, ("v",))
        counts.append(len(times))
    assert min(counts) == pytest.approx(7900, rel=0.05)
    assert max(counts) == pytest.approx(11500, rel=0.05)


@pytest.mark.parametrize(("name", "values"), [("smd", {}), ("coulomb", {}), ("coulomb", {"c": 2.0}), ("stickslip", {})])
def test_a_tighter_tolerance_comes_closer_to_the_closed_form(launch, name, values):
    """Event location keeps the order of the method: the error falls with the tolerance and is of its size."""
    stop, x0 = (16.0, 0.0) if name == "stickslip" else (4.0, 0.1)
    motion = ClosedFormMotion([(0.0, getattr(independent_solution, name)(**values))], x0, 0.0, stop)
    times = [stop * i / 40 for i in range(41)]
    truth = [motion.at(t) for t in times]
    errors = []
    for rtol in (1e-4, 1e-6, 1e-8):
        choice = {"solver.method": ODE23, "solver.rtol": rtol, **values}
        fmu = launch(name, choice, stop=stop)
        rows = fmu.run(times, ["x", "v"])
        errors.append(max(abs(x - a) + abs(v - b) for (x, v), (a, b) in zip(rows, truth, strict=True)))
        if name != "smd":
            assert fmu.get("events.count") == len(motion.events)
    assert errors[1] < errors[0] / 20
    assert errors[2] < errors[1] / 20
    assert errors[2] < 1e-6


def test_counters_count_the_work_done(launch):
    """Three right-hand sides per step, accepted or rejected (first same as last); two more at the start, one at each
    event."""
    for name, law in (("smd", {}), ("coulomb", {"friction": SIGN}), ("pacejka", {})):
        fmu = launch(name, {**MATLAB, **law}, stop=4.0)
        fmu.run([0.0, 4.0], [])
        steps, rejected_steps, evaluations = fmu.get("solver.steps", "solver.rejected", "solver.evaluations")
        assert 0 <= evaluations - 3 * (steps + rejected_steps) <= 2


@pytest.mark.parametrize("load", campaign_after(1, [2, 1]), ids=["reaction", "weight"])
def test_the_pendulum_agrees_with_its_independent_solution(launch, load):
    cases = [
        ({}, independent_pendulum.THETA0, 0.0, 1e-7),
        ({"mu": 0.3, "T_ext": 0.03}, -1.0, 2.0, 1e-6),
        ({"mu": 0.02, "a": 0.05, "g": 9.81}, 3.0, 4.0, 1e-5),  # over the top, where it almost stops
    ]
    for values, theta0, omega0, bound in cases:
        swing = independent_pendulum.PendulumMotion(
            [(0.0, independent_pendulum.Pendulum(load == 2, **values))], theta0, omega0, 5.0
        )
        choice = {**values, "theta0": theta0, "omega0": omega0, "pin_load": load, "friction": HYBRID}
        fmu = launch("pendulum", {**choice, "solver.method": ODE23, "solver.rtol": 1e-10}, stop=5.0)
        times = [0.05 * i for i in range(101)]
        for t, (theta, omega) in zip(times, fmu.run(times, ["theta", "omega"]), strict=True):
            assert (theta, omega) == pytest.approx(swing.at(t), rel=bound, abs=bound)
        assert fmu.get("events.count") == len(swing.events)
        if swing.events:
            assert fmu.get("events.t_last") == pytest.approx(swing.events[-1][0], abs=bound)


def test_tolerance_comes_from_rtol_then_the_importer_then_the_default(launch):
    def steps(values, tolerance):
        fmu = launch("smd", {"solver.method": ODE23, **values}, stop=4.0, tolerance=tolerance)
        fmu.run([0.0, 4.0], [])
        return fmu.get("solver.steps")

    assert steps({"solver.rtol": 1e-4}, None) == steps({}, 1e-4) == steps({"solver.rtol": 1e-4}, 1e-8)
    assert steps({}, 1e-8) > steps({}, 1e-4)
    assert steps({"solver.rtol": 1e-4, "solver.atol": 1.0}, None) < steps({"solver.rtol": 1e-4}, None)
    assert steps({"solver.rtol": 1e-2, "solver.h_max": 1e-3}, None) >= 4000


def test_exact_takes_one_step_for_a_free_run(launch):
    fmu = launch("smd", {"solver.method": EXACT}, stop=4.0)
    assert fmu.get("solver.t_next") == 4.0
