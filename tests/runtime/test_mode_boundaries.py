"""Limits between modes: a load equal to the limit, a breakaway without a jump, a reversal shorter than a step."""

import random
from math import acos, cos, pi, sin, sqrt

import pytest
from models import CASES, HYBRID, label, outputs
from worker_client import FmiError

DRY = [case for case in CASES if case[1].get("friction") == HYBRID]
SLED = [case for case in DRY if case[0] == "stickslip"]
EVEN = {  # binary fractions, so that load and limit are equal
    "coulomb": ({"f": 0.5, "k": 64.0}, "F_ext", 0.5),
    "stickslip": ({"mu_s": 0.5, "mu_d": 0.25, "m": 2.0, "g": 8.0, "v_driver": 0.0}, "F_ext", 8.0),
    "pendulum": ({"mu": 0.5, "r": 0.25, "m": 2.0, "g": 8.0, "J_G": 1.0}, "T_ext", 2.0),
}


@pytest.mark.parametrize("case", DRY, ids=label)
def test_a_constant_load_sticks_at_the_limit_and_slips_beyond_it(launch, case):
    name, choices, stop = case
    values, force, limit = EVEN[name]
    position, speed = outputs(name)[:2]
    for sign in (1.0, -1.0):
        steady = {**choices, **values, f"{position}0": 0.0}
        fmu = launch(name, {**steady, force: sign * limit}, stop=stop)
        rows = fmu.run([0.0, 1e-6, stop / 3, stop], [position, speed, "mode", "events.count"])
        assert rows == [[0.0, 0.0, 0, 0]] * 4
        fmu = launch(name, {**steady, force: sign * limit * (1.0 + 1e-9)}, stop=stop)
        assert fmu.run([0.0, 1e-6], ["mode"])[-1] == [sign]


@pytest.mark.parametrize("case", SLED, ids=label)
def test_a_breakaway_without_a_force_jump_is_one_event_in_its_direction(launch, case):
    """mu_s = mu_d: v = v_driver (1 - cos(omega t)) from breakaway on, which rounding must not reverse."""
    name, choices, _ = case
    draw = random.Random(3).uniform
    for _ in range(20):
        m, k, mu, g, v_driver = draw(0.5, 50.0), draw(50.0, 5000.0), draw(0.1, 1.2), draw(1.0, 12.0), draw(0.01, 0.5)
        values = {**choices, "m": m, "k": k, "mu_s": mu, "mu_d": mu, "g": g, "v_driver": v_driver}
        omega, away = sqrt(k / m), mu * m * g / (k * v_driver)
        stop = away + pi / omega
        fmu = launch(name, values, stop=away + 2.0 * pi / omega)
        t = [away + share * (stop - away) for share in (1e-3, 0.1, 0.5, 1.0)]
        rows = fmu.run([0.0, *t], ["v", "mode", "events.count", "events.t_last"])[1:]
        fmu.free()
        for s, (v, mode, count, last) in zip(t, rows, strict=True):
            assert (mode, count) == (1, 1)
            assert last == pytest.approx(away, rel=1e-12)
            assert v == pytest.approx(v_driver * (1.0 - cos(omega * (s - away))), abs=1e-4 * v_driver)


@pytest.mark.parametrize("case", SLED, ids=label)
def test_a_reversal_shorter_than_a_step_is_located_at_its_start(launch, case):
    """A slip whose speed oscillates about the driver's by slightly more than it drops below zero, and sticks there."""
    name, choices, _ = case
    m, k, g, mu_d, v_driver = 4.0, 100.0, 10.0, 0.3, 0.1
    omega, draw = sqrt(k / m), random.Random(5)
    for _ in range(20):
        swing = v_driver * (1.0 + 10.0 ** draw.uniform(-4.0, -1.0))
        phase = draw.uniform(0.0, 0.9 * pi)  # start of the run: v = v_driver + swing cos(phase + omega t)
        values = {"m": m, "k": k, "g": g, "mu_s": 0.9, "mu_d": mu_d, "v_driver": v_driver, "solver.rtol": 1e-8}
        x0, v0 = swing / omega * sin(phase) - mu_d * m * g / k, v_driver + swing * cos(phase)
        end = (acos(-v_driver / swing) - phase) / omega
        if end <= 0.0:
            continue
        fmu = launch(name, {**choices, **values, "x0": x0, "v0": v0}, stop=end + 0.2)
        ((count, last, mode),) = fmu.run([0.0, end + 0.1], ["events.count", "events.t_last", "mode"])[1:]
        fmu.free()
        assert (count, mode) == (1, 0)
        assert last == pytest.approx(end, abs=1e-4)


def test_a_pin_that_could_stop_the_pendulum_instantly_is_refused(launch):
    """mu r m a = J_G + m a^2 to the bit, and the next smaller number."""
    values = {"m": 1.0, "a": 1.0, "J_G": 0.0, "r": 1.0, "pin_load": 2, "theta0": 0.5}
    fmu = launch("pendulum", {**values, "mu": 1.0})
    with pytest.raises(FmiError):
        fmu.step(0.0, 0.1)
    assert "the friction torque would outgrow the inertia" in fmu.messages()[-1][2]
    fmu.worker.read_stderr()
    assert launch("pendulum", {**values, "mu": 0.999}).run([0.0, 0.1], ["omega"])
