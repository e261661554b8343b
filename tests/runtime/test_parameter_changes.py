"""Inputs and tunable parameters that change during a run, against closed forms restarted there."""

import random

import independent_pendulum
import independent_solution
import pytest
from independent_solution import ClosedFormMotion, spans
from models import EXACT, ODE23
from variants import slow_after

SCENES = {
    "smd, everything in turn": (
        "smd",
        {"k": 144.0},
        {0.3: {"m": 2.0}, 0.9: {"c": 70.0}, 1.4: {"k": 0.0}, 2.0: {"F_ext": 5.0, "c": 0.0}, 2.6: {"k": 150.0}},
    ),
    "coulomb, friction raised in mid-slip": ("coulomb", {}, {0.6: {"f": 3.0}}),
    "coulomb, pushed out of rest and back": ("coulomb", {"f": 5.0}, {2.0: {"F_ext": 20.0}, 3.0: {"F_ext": 0.0}}),
    "coulomb, let go": ("coulomb", {"f": 9.0}, {2.0: {"f": 0.1}, 3.0: {"c": 4.0}}),
    "sled, slippery in mid-slip": ("stickslip", {}, {4.5: {"mu_d": 0.2}}),
    "sled, rough in mid-slip": ("stickslip", {}, {4.5: {"mu_d": 0.85}}),
    "sled, driver faster in mid-slip": ("stickslip", {}, {4.5: {"v_driver": 0.4}}),
    "sled, driver back in mid-stick": ("stickslip", {}, {6.0: {"v_driver": -0.2}}),
    "sled, driver stops in mid-stick": ("stickslip", {}, {6.0: {"v_driver": 0.0}}),
    "sled, hold lowered to a break-away": ("stickslip", {}, {3.0: {"mu_s": 0.605}}),
    "sled, pushed in stick and in slip": (
        "stickslip",
        {},
        {2.0: {"F_ext": 90.0}, 2.1: {"F_ext": -50.0}, 9.0: {"F_ext": 0.0}},
    ),
    "sled, lighter, then on the moon": ("stickslip", {}, {3.9: {"m": 10.0}, 7.0: {"g": 1.62}, 11.0: {"k": 2000.0}}),
}


def assert_agrees_with_reference(launch, name, values, changes, solvers):
    """Compare a run with each of `solvers`, (settings, bound relative to the largest value), with the independent
    solution."""
    x0, stop = (0.0, 16.0) if name == "stickslip" else (0.1, 4.0)
    motion = ClosedFormMotion(spans(getattr(independent_solution, name), values, changes), x0, 0.0, stop)
    times = sorted({stop * i / 80 for i in range(81)} | set(changes))
    truth = [motion.at(t) for t in times]
    for settings, bound in solvers:
        fmu = launch(name, {**values, **settings}, stop=stop)
        rows = fmu.run_with_changes(times, ["x", "v"], changes)
        for i, variable in enumerate("xv"):
            scale = max(abs(row[i]) for row in truth)
            worst = max(abs(row[i] - true[i]) for row, true in zip(rows, truth, strict=True)) / scale
            assert worst < bound, f"{variable} is off by {float(worst):.1e} of its largest value"
        if motion.events:
            count, last = fmu.get("events.count", "events.t_last")
            assert count == len(motion.events)
            assert last == pytest.approx(float(motion.events[-1][0]), rel=max(bound / 10, 1e-14))


@pytest.mark.parametrize("scene", slow_after(4, SCENES))
def test_a_changed_value_acts_from_its_communication_point_on(launch, scene):
    solvers = [({"solver.method": EXACT}, 1e-13), ({"solver.method": ODE23, "solver.rtol": 1e-8}, 1e-5)]
    assert_agrees_with_reference(launch, *SCENES[scene], solvers)


@pytest.mark.parametrize("seed", slow_after(3, range(6)))
def test_a_sled_with_randomly_changing_values_agrees_with_the_closed_form(launch, seed):
    """14 changes in 16 s: each rounds its time, so that the bound is three times that of a free run."""
    draw = random.Random(seed).uniform
    ranges = {"m": (5, 30), "k": (200, 2000), "mu_s": (0.7, 1.1), "mu_d": (0.2, 0.65), "v_driver": (-0.3, 0.3)}
    ranges["F_ext"] = (-60, 60)
    changes = {draw(0.0, 16.0): {name: draw(*ranges[name])} for name in 2 * list(ranges)}
    assert_agrees_with_reference(launch, "stickslip", {}, changes, [({"solver.method": EXACT}, 3e-13)])


@pytest.mark.parametrize("load", [1, 2], ids=["weight", "reaction"])
def test_a_pendulum_twisted_in_motion_and_at_rest_agrees_with_the_reference(launch, load):
    changes = {0.9: {"T_ext": 0.05}, 2.0: {"T_ext": 0.0, "mu": 0.5}, 3.5: {"T_ext": -0.04}, 4.0: {"r": 0.001}}

    def make(**values):
        return independent_pendulum.Pendulum(load == 2, **values)

    swing = independent_pendulum.PendulumMotion(spans(make, {}, changes), independent_pendulum.THETA0, 0.0, 5.0)
    fmu = launch("pendulum", {"pin_load": load, "solver.method": ODE23, "solver.rtol": 1e-10}, stop=5.0)
    times = sorted({0.02 * i for i in range(250)} | {*changes, 5.0})
    for t, row in zip(times, fmu.run_with_changes(times, ["theta", "omega"], changes), strict=True):
        assert row == pytest.approx(swing.at(t), abs=1e-7)
    assert fmu.get("events.count") == len(swing.events)
