"""Linear motions: closed form and next standstill under a force with a rate; with negative damping or stiffness also
every method, divergence and certified results."""

import json
import random
from collections import namedtuple
from itertools import pairwise
from math import copysign, inf

import commands
import pytest
from build_cache import ROOT, build_user_model
from fmpy import simulate_fmu
from independent_solution import ClosedFormMotion, LinearSegment, System, stickslip
from models import DOP853, EXACT, EXAMPLE_MODELS, ODE23, ODE45, RODAS
from mpmath import exp, mpf
from power_series_body import Body, sample_motion
from variants import slow_after
from worker_client import FmiError

from fmus.runtime.linear_closed_form import GROWING, LinearClosedForm
from harness.studies.stability.study import grouped_cases, measure_stability

ROUNDING = 1e-13  # relative to the largest term of the solution
DIVERGES = "the solution diverges after t = "
(FILE,) = (path for path in EXAMPLE_MODELS if path.stem == "unstable_body")
METHODS = (EXACT, ODE23, ODE45, DOP853, RODAS)
NATIVE = ("--native", "--platform", "linux64")
BACKENDS = {"python": (), "native": NATIVE, "fmi3": (*NATIVE, "--fmi", "3")}
SIGNS = [(k, c) for k in (-40.0, 0.0, 40.0) for c in (-2.0, 0.0, 2.0)]
LIMITS = [  # tiny values, negative zeros, and nearly equal roots
    *[(40.0, sign * 80.0**0.5 * 2.0**0.5 * factor) for sign in (1, -1) for factor in (1 - 1e-12, 1.0, 1 + 1e-12)],
    *[(-0.0, -2.0), (-0.0, -0.0), (-40.0, -0.0), (1e-12, -2.0), (-1e-12, -2.0), (-1e-12, 2.0), (-1e-12, -0.0)],
    *[(40.0, -1e-12), (-40.0, -1e-12), (-40.0, 1e-12), (0.0, -1e-12), (-5e-324, 1e3), (-1e-20, -1e-20)],
]

Coefficients = namedtuple("Coefficients", "m c k rate")
Start = namedtuple("Start", "c k x v p q drift")


def fmu(backend):
    folder = {"python": "", "native": "native", "fmi3": "native/fmi3"}[backend]
    return build_user_model(FILE, *BACKENDS[backend]) / folder / f"{FILE.stem}.fmu"


def power_of_ten(draw, low, high):
    return 10.0 ** draw.uniform(low, high)


def draw_start(draw):
    """Return coefficients (m = 1) of a growing motion, its start, and its rate of change."""
    z = draw.choice([0.0, 1.0, -1.0, -1.0]) * power_of_ten(draw, -6, 3)
    n2 = draw.choice(
        [
            -power_of_ten(draw, -8, 6),
            power_of_ten(draw, -8, 6) if z < 0.0 else -z * z - 1.0,
            draw.uniform(-1.0, 1.0) * z * z if z < 0.0 else -1e-3 * z * z - 1e-9,
            (1.0 + draw.choice([-1.0, 0.0, 1.0]) * power_of_ten(draw, -15, -1)) * z * z if z < 0.0 else -1.0,
            0.0 if z < 0.0 else -1e-30,
        ]
    )
    rate = abs(z) + abs(z * z - n2) ** 0.5
    scales = (1.0, rate, rate * rate, rate**3)
    x, v, p, q = (
        draw.choice([0.0, 1.0, -1.0]) * power_of_ten(draw, -2, 2) * draw.choice([1.0, scale]) for scale in scales
    )
    drift = draw.choice([0.0, 1.0, -1.0]) * power_of_ten(draw, -2, 2) if z == 0.0 else 0.0
    return Start(2.0 * z, n2, x, v, p, draw.choice([0.0, q]), drift), rate


def draw_decay(draw):
    """Return the same for a motion with positive damping and with a spring of any stiffness, or none."""
    z = power_of_ten(draw, -4, 3)
    strong, near_critical = (
        power_of_ten(draw, 0.1, 6),
        1.0 + draw.choice([-1.0, 0.0, 1.0]) * power_of_ten(draw, -15, -1),
    )
    n2 = z * z * draw.choice([strong, near_critical, power_of_ten(draw, -3, 0), power_of_ten(draw, -17, -3), 0.0])
    rate = z + abs(z * z - n2) ** 0.5
    x, v, p, q = (
        draw.choice([0.0, 1.0, -1.0]) * power_of_ten(draw, -2, 2) * draw.choice([1.0, rate**n]) for n in range(4)
    )
    if q == 0.0 or draw.random() < 0.3:  # an equilibrium that moves about as fast as the body, which may touch zero
        q = n2 * v * power_of_ten(draw, -1, 1) or rate**3
    return Start(2.0 * z, n2, x, v, p, q, 0.0), rate


def begin(start):
    """Return the closed form under test and the independent one at the start of a segment."""
    closed_form = LinearClosedForm(True)
    closed_form.prepare(1.0, start.c, start.k, start.drift)
    closed_form.set_force_rate(start.q)
    net = mpf(start.p) - mpf(start.k) * mpf(start.x)
    closed_form.start_segment(start.x, start.v, float(net - mpf(start.c) * mpf(start.v)), start.p, 0.0)
    assert (closed_form.regime == GROWING) == (start.c < 0.0 or start.k < 0.0)
    coefficients = Coefficients(1, start.c, start.k, mpf(start.q) + mpf(start.k) * mpf(start.drift))
    return closed_form, LinearSegment(coefficients, net, start.v)


def largest_terms(start, s):
    """Return the sums of the magnitudes of all terms of position and speed, which scale the rounding errors."""
    parts = [
        LinearSegment(Coefficients(1, start.c, start.k, mpf(q)), net, v).at(s)
        for v, net, q in ((1, 0, 0), (0, 1, 0), (0, 0, 1))
    ]
    z = mpf(start.c) / 2
    swing = exp(-z * s) if start.k > z * z else 0  # of an oscillation, whose terms pass through zero
    weights = (abs(start.v), abs(mpf(start.p)) + abs(mpf(start.k) * start.x), abs(start.q) + abs(start.k * start.drift))
    w = mpf(abs(start.k - z * z)) ** 0.5 if swing else 1
    return (
        abs(start.x)
        + sum(n * (abs(x) + swing / w**i) for i, (n, (x, _)) in enumerate(zip(weights, parts, strict=True))),
        sum(n * (abs(v) + swing / w**i) for i, (n, (_, v)) in enumerate(zip(weights, parts, strict=True))),
    )


@pytest.mark.parametrize("seed", slow_after(1, range(5)))
@pytest.mark.parametrize("draw_motion", [draw_start, draw_decay])
def test_the_closed_form_is_right_to_rounding(draw_motion, seed):
    """At short and long times, for all signs, with a force that has a rate and an equilibrium that moves."""
    draw = random.Random(seed)
    for _ in range(24):
        start, rate = draw_motion(draw)
        closed_form, segment = begin(start)
        s = min(power_of_ten(draw, -5, 1.5) / rate, closed_form.max_duration)
        errors = [abs(value - true) for value, true in zip(closed_form.evaluate(s), segment.at(mpf(s)), strict=True)]
        errors[0] = abs(mpf(closed_form.evaluate(s)[0]) - start.x - segment.at(mpf(s))[0])
        for error, scale in zip(errors, largest_terms(start, mpf(s)), strict=True):
            assert error <= ROUNDING * scale, (start, s)


@pytest.mark.campaign
@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("draw_motion", [draw_start, draw_decay])
def test_the_next_standstill_is_right_to_rounding(draw_motion, seed):
    """There is one exactly where the independent solution has one, before the horizon."""
    draw = random.Random(seed)
    n_found = 0
    for _ in range(60):
        start, rate = draw_motion(draw)
        closed_form, segment = begin(start)
        horizon = min(closed_form.horizon, 100.0 / rate)
        mode = int(copysign(1.0, start.v or closed_form.a0 or segment.rate))
        standstill = closed_form.next_standstill(mode)
        if closed_form.horizon < horizon:  # the first segment with a new rate may end before its standstill
            end = closed_form.horizon
            standstill = closed_form.next_standstill(mode)
            assert standstill > end, (start, standstill, end)
        if start.v == closed_form.a0 == segment.rate == 0.0:
            assert standstill == inf
            continue
        true = segment.turning_point(mode, mpf(horizon), catches=False)
        assert (standstill < horizon) == (true is not None), (start, standstill, true)
        if true is not None:
            n_found += 1
            step = true * mpf(10) ** -20
            slope = abs(segment.at(true + step)[1] / step)
            assert abs(standstill - true) <= ROUNDING * (true + largest_terms(start, true)[1] / slope), (
                start,
                standstill,
                true,
            )
    assert n_found > 5


def test_a_force_that_turns_stops_a_body_that_has_hardly_started():
    """Without damping, v = 1e-31 falls at a rate that grows with time: v - 90 t^2/2 is zero."""
    closed_form = LinearClosedForm(True)
    closed_form.prepare(1.0, 0.0, 2.0, 0.0)
    closed_form.set_force_rate(-90.0)
    closed_form.start_segment(0.0, 1e-31, 0.0, 0.0, 0.0)
    assert closed_form.next_standstill(1) == pytest.approx((2e-31 / 90.0) ** 0.5, rel=ROUNDING)


def test_a_body_at_an_unstable_equilibrium_stays_there():
    """Also far from the origin, and at the speed of an equilibrium that moves."""
    for c, k, x, v, p, drift in ((-2.0, -3.0, 0.7, 0.0, -3.0 * 0.7, 0.0), (0.0, -40.0, 0.0, 0.3, 0.0, 0.3)):
        closed_form = LinearClosedForm(True)
        closed_form.prepare(1.0, c, k, drift)
        closed_form.start_segment(x, v, 0.0, p, 0.0)
        assert closed_form.horizon == inf
        assert closed_form.evaluate(1e9) == (x + v * 1e9, v)


@pytest.mark.slow
@pytest.mark.parametrize(("k", "c"), SIGNS + LIMITS)
def test_a_body_with_a_contact_agrees_for_every_sign_of_stiffness_and_damping(worker, k, c):
    """Motion and changes of mode by the method exact; a start that only slides, and one that sticks for a while."""
    for x0, v0, force in ((0.1, -0.5, 0.0), (-0.03, 0.8, 0.4), (0.3, 0.0, 0.0)):
        values = {"k": k, "c": c, "x0": x0, "v0": v0, "F_ext": force}
        motion = ClosedFormMotion([(0.0, System(1.0, k, c, 0.5, 0.8, push=force))], x0, v0, 2.0)
        body = worker.instantiate(fmu("python")).begin({"solver.method": EXACT, **values}, stop=2.0)
        times = [0.04 * i for i in range(51)]
        rows = body.run(times, ["x", "v", "events.count", "mode", "events.t_last"])
        truth = [motion.at(t) for t in times]
        for i in (0, 1):
            scale = max(abs(row[i]) for row in truth)
            assert all(abs(row[i] - true[i]) <= 1e-12 * scale for row, true in zip(rows, truth, strict=True))
        changes = [(t, mode) for (*_, n0, _, _), (*_, n1, mode, t) in pairwise(rows) if n1 > n0]
        assert rows[-1][2] == len(motion.events)
        assert all(any(abs(t - true) < 1e-12 and mode == now for true, now in motion.events) for t, mode in changes)
        body.free()


@pytest.mark.campaign
@pytest.mark.parametrize("method", METHODS)
def test_every_method_solves_every_sign_of_stiffness_and_damping(worker, method):
    for k, c in SIGNS:
        motion = ClosedFormMotion([(0.0, System(1.0, k, c, 0.5, 0.8))], 0.1, -0.5, 2.0)
        values = {"solver.method": method, "solver.rtol": 1e-9, "k": k, "c": c}
        body = worker.instantiate(fmu("native")).begin(values, stop=2.0)
        (*_, row) = body.run([0.0, 0.5, 1.0, 2.0], ["x", "v", "events.count"])
        assert row[:2] == pytest.approx([float(value) for value in motion.at(2.0)], rel=1e-5, abs=1e-8)
        assert row[2] == len(motion.events)
        body.free()


@pytest.mark.slow
@pytest.mark.parametrize(("k", "c"), [(-40.0, -0.2), (40.0, -0.2)])
def test_an_importer_solves_a_growing_motion_in_model_exchange(k, c):
    result = simulate_fmu(
        fmu("native"), fmi_type="ModelExchange", stop_time=2.0, relative_tolerance=1e-9, start_values={"k": k, "c": c}
    )
    motion = ClosedFormMotion([(0.0, System(1.0, k, c, 0.5, 0.8))], 0.1, -0.5, 2.0)
    assert result["x"][-1] == pytest.approx(float(motion.at(2.0)[0]), rel=1e-5)


def step_to(body, stop):
    for n in range(stop):
        body.step(float(n), 1.0)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("backend", "method", "stop"),
    [("fmi3", EXACT, 200.0), ("python", EXACT, None), ("native", ODE23, None), ("native", RODAS, 200.0)],
)
def test_a_motion_that_grows_without_bound_ends_with_one_sentence(worker, backend, method, stop):
    """Growth by roots of opposite sign, by two positive ones, and by a growing oscillation; up to large values."""
    for k, c in ((-400.0, 0.0), (1.0, -20.0), (400.0, -10.0)):
        body = worker.instantiate(fmu(backend)).begin({"solver.method": method, "k": k, "c": c}, stop=stop)
        with pytest.raises(FmiError):
            step_to(body, 200)
        ((_, _, message),) = body.messages()
        assert DIVERGES in message
        diverged_after = float(message.split(DIVERGES)[1].split(" s")[0])
        assert 5.0 < diverged_after < 50.0
        body.free()


@pytest.mark.slow
def test_a_force_with_derivatives_acts_on_a_growing_motion(worker):
    for k, c in ((k, c) for k, c in SIGNS if k < 0.0 or c < 0.0):
        for force in ((0.3, 2.0), (0.0, -3.0)):
            values = {"solver.method": EXACT, "k": k, "c": c, "x0": 0.01, "v0": 0.3}
            body = worker.instantiate(fmu("native")).begin(values, stop=1.5)
            body.ramp("F_ext", force[1], 1)
            body.set({"F_ext": force[0]})
            times = [0.125 * n for n in range(1, 13)]
            rows = [body.get("x", "v") for t, end in pairwise([0.0, *times]) if body.step(t, end - t) is None]
            truth = sample_motion(Body(1.0, k, c, 0.8, 0.5, 0.0, 0.01, 0.3), [(0.0, *force)], times)
            for row, true in zip(rows, truth, strict=True):
                assert row == pytest.approx([float(value) for value in true[:2]], rel=1e-10, abs=1e-12)
            body.free()


@pytest.mark.campaign
def test_a_driver_pulls_a_body_by_a_negative_stiffness(worker, tmp_path):
    """The sled of the shipped model; the driver moves its unstable equilibrium."""
    source = (ROOT / "fmus" / "stickslip.py").read_text()
    file = tmp_path / "pulled.py"
    file.write_text(source.replace('"spring stiffness", low=0.0', '"spring stiffness"'))
    folder = build_user_model(file, *NATIVE)
    for x0, v0, speed in ((0.3, 0.0, 0.034), (-0.1, 0.5, 0.4), (0.0, 0.0, -2.0)):
        motion = ClosedFormMotion([(0.0, stickslip(k=-742.5, v_driver=speed))], x0, v0, 1.5)
        values = {"solver.method": EXACT, "k": -742.5, "v_driver": speed, "x0": x0, "v0": v0}
        body = worker.instantiate(folder / "native" / "pulled.fmu").begin(values, stop=1.5)
        times = [0.05 * i for i in range(31)]
        rows, truth = body.run(times, ["x", "v", "events.count"]), [motion.at(t) for t in times]
        for i in (0, 1):
            scale = max(abs(row[i]) for row in truth)
            assert all(abs(row[i] - true[i]) <= 1e-12 * scale for row, true in zip(rows, truth, strict=True))
        assert rows[-1][2] == len(motion.events) > 0 or v0 == 0.0
        body.free()


@pytest.mark.campaign
def test_references_and_stability_accept_an_unstable_model(tmp_path):
    path = fmu("python").with_suffix(".py")
    file = tmp_path / path.name
    file.write_text(path.read_text())
    file.with_suffix(".fmu").write_bytes(fmu("python").read_bytes())
    process = commands.harness(tmp_path, "references", file, "--json")
    assert (process.returncode, process.stderr) == (0, "")
    (result,) = json.loads(process.stdout)
    assert result["difference"] < 1e-9
    cases = [[case for case in group if case.title == "as it comes"] for group in grouped_cases(models=[str(file)])]
    rows = measure_stability([group for group in cases if group], lambda *_: None).outcomes
    assert rows
    assert [row.text for row in rows if not row.has_passed] == []
