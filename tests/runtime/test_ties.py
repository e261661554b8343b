"""Ties are decided by physics: friction that just holds, a speed that only touches zero, a motion that nothing stops.

The values are small integers times powers of two, so that a load that should equal the limit does so exactly, in the
FMU and in the independent solution.
"""

import random
from itertools import pairwise
from operator import methodcaller

import independent_solution
import pytest
from independent_solution import ClosedFormMotion
from models import DOP853, EXACT, ODE23, ODE45, RODAS
from native_fmus import build_native_fmus
from variants import slow_after

from tests.runtime.test_exact_method import EVENTS, PLACES


def number(draw, low, high):
    """Return a random number with few significant bits."""
    return draw.choice([1, 3, 5, 7]) * 2.0 ** draw.randint(low, high)


def sled(draw):
    """Return values of the sled with at least one tie."""
    k, weight = 2.0 ** draw.randint(4, 9), 10.0
    mu_s = number(draw, -4, -2)
    mu_d = draw.choice([mu_s, mu_s, 0.0, 0.0, 0.5 * mu_s])
    if draw.random() < 0.2:
        mu_s = mu_d = 0.0
    values = {"m": 2.0, "k": k, "mu_s": mu_s, "mu_d": mu_d, "g": 0.5 * weight}
    values["v_driver"] = u = draw.choice([-1, 1]) * number(draw, -7, -3)
    hold = mu_s * weight
    values["F_ext"] = draw.choice([0.0, 0.0, hold, -hold, 3.0])
    values["x0"] = draw.choice([0.0, 0.0, hold, -hold, 2.0 * hold, values["F_ext"]]) / k
    values["v0"] = draw.choice([0.0, 0.0, 0.0, u, -u, 3.0 * u])
    return values


def mass(draw):
    """Return values of the mass with Coulomb friction whose last turning point is exactly at the limit of stiction."""
    k, f = 2.0 ** draw.randint(4, 9), number(draw, -3, 1)
    push = draw.choice([0.0, 2.0, -f])
    rest = (push + draw.choice([-1, 1]) * (2 * draw.randint(0, 9) + 1) * f) / k
    return {"m": number(draw, -2, 2), "k": k, "c": 0.0, "f": f, "F_ext": push, "x0": rest, "v0": 0.0}


def case(name, seed):
    draw = random.Random(seed)
    values = (sled if name == "stickslip" else mass)(draw)
    start = draw.choice([0.0, -3.0, 0.1, 1000.7])
    return values, start, start + (12.0 if name == "stickslip" else 5.0)


@pytest.fixture
def pair(worker, fmus):
    """The process that runs the FMUs, and the folder of each backend."""
    return [(worker, fmus), (worker, build_native_fmus())]


def answers(pair, name, values, start, stop, read):
    """Return the results of both backends, which must agree bit for bit."""
    results = []
    for worker, folder in pair:
        fmu = worker.instantiate(folder / f"{name}.fmu")
        results.append(read(fmu.begin(values, start=start, stop=stop)))
        fmu.free()
    assert results[0] == results[1]
    return results[0]


def events(fmu, start, stop):
    """Return time and new mode of each change."""
    _, rows = fmu.follow(start, stop, ["events.count", "events.t_last", "mode"])
    changes = [(t, mode) for (before, *_), (after, t, mode) in pairwise(rows) if after > before]
    assert rows[-1][0] == len(changes)
    return changes


@pytest.mark.parametrize(
    ("name", "seed"), slow_after(8, [(name, seed) for seed in range(16) for name in ("coulomb", "stickslip")])
)
def test_every_tie_ends_as_in_the_closed_form(pair, name, seed):
    values, start, stop = case(name, seed)
    parameters = {key: value for key, value in values.items() if key not in ("x0", "v0")}
    motion = ClosedFormMotion(
        [(start, getattr(independent_solution, name)(**parameters))], values["x0"], values["v0"], stop
    )
    changes = answers(pair, name, values, start, stop, lambda fmu: events(fmu, start, stop))
    assert [mode for _, mode in changes] == [mode for _, mode in motion.events]
    for (t, _), (true, _) in zip(changes, motion.events, strict=True):
        assert abs(t - true) <= EVENTS * max(abs(true), abs(start))
    times = [start + (stop - start) * i / 20 for i in range(21)]
    rows = answers(pair, name, values, start, stop, lambda fmu: fmu.run(times, ["x", "v"]))
    truth = [motion.at(t) for t in times]
    for i in range(2):
        scale = (max(abs(row[i]) for row in truth) or 1) * max(1.0, 0.03 * abs(start))  # the times have fewer digits
        assert max(abs(row[i] - true[i]) for row, true in zip(rows, truth, strict=True)) < PLACES * scale


METHODS = (EXACT, ODE23, ODE45, DOP853, RODAS)
FRICTIONLESS = ({"g": 0.0}, {"mu_s": 0.0, "mu_d": 0.0}, {"mu_s": 0.6}, {"mu_d": 0.9})


STARTS = (0.0, -77.7, 1e5)
TOUCHES = [  # covers every pair of method, values and start
    (method, values, STARTS[(i + j) % 3]) for i, method in enumerate(METHODS) for j, values in enumerate(FRICTIONLESS)
]


@pytest.mark.parametrize(
    ("method", "values", "start"), slow_after(8, TOUCHES[::3] + TOUCHES[1::3] + TOUCHES[2::3]), ids=str
)
def test_a_speed_that_only_touches_zero_is_no_rest_and_no_event(pair, method, values, start):
    stop = start + 30.0
    values = {**values, "solver.method": method, "solver.rtol": 1e-5}
    changes = answers(pair, "stickslip", values, start, stop, lambda fmu: events(fmu, start, stop))
    assert [mode for _, mode in changes] == ([] if values.get("g") == 0.0 or values.get("mu_s") == 0.0 else [1])


def random_sled(draw):
    """Return values without friction or with equal friction while sliding, a start time, and the end of twenty
    touches."""
    mu, friction = draw.uniform(0.05, 2.0), draw.choice(("none", "weightless", "equal"))
    values = {"m": 10.0 ** draw.uniform(-2.0, 3.0), "k": 10.0 ** draw.uniform(-1.0, 5.0), "g": draw.uniform(1.0, 30.0)}
    values |= dict.fromkeys(("mu_s", "mu_d"), 0.0 if friction == "none" else mu)
    values["v_driver"] = draw.choice([-1, 1]) * 10.0 ** draw.uniform(-3.0, 0.0)
    if friction == "weightless":
        values["g"] = 0.0
    start = draw.choice([0.0, draw.uniform(-10.0, 100.0), 1e4, 1e6])
    stick_time = values["mu_s"] * values["m"] * values["g"] / (values["k"] * abs(values["v_driver"]))
    return values, start, start + stick_time + 20.3 * 6.283185307179586 * (values["m"] / values["k"]) ** 0.5


def test_speeds_that_touch_zero_continue_for_any_values(pair):
    draw = random.Random(1)
    for _ in range(150):
        values, start, stop = random_sled(draw)
        ends = methodcaller("run", [start, stop], ["events.count", "mode"])
        _, (count, mode) = answers(pair, "stickslip", values, start, stop, ends)
        assert count == (1 if values["mu_s"] * values["g"] else 0)
        assert mode == (1 if values["v_driver"] > 0.0 else -1)


def test_a_slide_that_touches_zero_sticks_where_static_friction_is_larger(pair):
    """v = u (1 + 0.6 cos y + 0.8 sin y) with y = w t, whether rounding puts its minimum above or below zero."""
    draw, touch = random.Random(3), 3.141592653589793 + 0.9272952180016122
    for _ in range(60):
        m, k, u = draw.uniform(0.5, 20.0), draw.uniform(50.0, 900.0), draw.uniform(0.01, 0.5)
        w = (k / m) ** 0.5
        values = {"m": m, "k": k, "mu_s": 0.9, "mu_d": 0.6, "g": draw.uniform(1.0, 10.0), "v_driver": u, "v0": 1.6 * u}
        values["x0"] = -(0.6 * m * values["g"] + 0.8 * u * m * w) / k
        ends = methodcaller("run", [0.0, touch / w - 1e-3 / w, touch / w + 1e-6 / w], ["mode", "events.count"])
        assert answers(pair, "stickslip", values, 0.0, 10.0 / w, ends) == [[1, 0], [1, 0], [0, 1]]


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("direction", [-1, 1])
def test_a_slip_ending_at_the_opposite_limit_sticks_as_the_load_decreases(pair, method, direction):
    values = {"mu_d": 0.0, "v_driver": 0.034 * direction, "solver.method": method, "solver.rtol": 1e-7}
    _, rows = answers(pair, "stickslip", values, 0.0, 32.0, lambda fmu: fmu.follow(0.0, 32.0, ["x", "events.count"]))
    motion = ClosedFormMotion(
        [(0.0, independent_solution.stickslip(mu_d=0.0, v_driver=0.034 * direction))], 0.0, 0.0, 32.0
    )
    assert rows[-1][1] == len(motion.events) == 7
    assert rows[-1][0] == pytest.approx(float(motion.at(32.0)[0]), rel=1e-12 if method == EXACT else 1e-5)


@pytest.mark.parametrize("method", METHODS)
def test_a_start_beyond_the_limit_slides_at_any_tolerance(pair, method):
    """A given start value has no error; a slip that arrives there would have one."""
    values = {"x0": 1.001 * 0.9 * 12.5 * 9.81 / 742.5, "solver.method": method, "solver.rtol": 1e-3}
    assert answers(pair, "stickslip", values, 0.0, 1.0, methodcaller("get", "mode")) == -1


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("seed", range(3))
def test_a_mass_slowed_only_by_a_damper_never_stops(pair, method, seed):
    draw = random.Random(seed)
    m, c = 10.0 ** draw.uniform(-2.0, 2.0), 10.0 ** draw.uniform(-2.0, 2.0)
    values = {"m": m, "c": c, "k": 0.0, "f": 0.0, "x0": 0.0, "v0": draw.choice([-3.0, 2.0]), "solver.method": method}
    stop = 60.0 * m / c
    rows = answers(pair, "coulomb", values, 0.0, stop, lambda fmu: fmu.run([0.0, stop], ["x", "mode", "events.count"]))
    assert rows[-1][1:] == [1 if values["v0"] > 0.0 else -1, 0]
    assert rows[-1][0] == pytest.approx(m * values["v0"] / c, rel=1e-13 if method == EXACT else 1e-5)


@pytest.mark.parametrize("values", FRICTIONLESS, ids=str)
def test_values_set_again_at_a_touch_cause_no_event(pair, values):
    """Communication points fall near and on the touches; each sets an input to another value and back."""
    parameters = {"mu_s": 0.9, "g": 9.81, **values}
    first, period = (
        parameters["mu_s"] * 12.5 * parameters["g"] / (742.5 * 0.034),
        6.283185307179586 * (12.5 / 742.5) ** 0.5,
    )

    def read(fmu):
        t, counts = 0.0, []
        for touch in range(1, 9):
            for shift in (-1e-9, 0.0, 1e-9):
                end = first + touch * period + shift
                fmu.step(t, end - t)
                t = end
                fmu.set({"F_ext": 1.0})
                fmu.set({"F_ext": 0.0})
                counts.append(fmu.get("events.count"))
        return counts

    counts = answers(pair, "stickslip", values, 0.0, 60.0, read)
    assert set(counts) == {0 if 0.0 in values.values() else 1}
