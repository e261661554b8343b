"""Three states, and two contacts on bodies of their own: numerics of more than our five need, by independent routes."""

import ctypes
import subprocess
from math import exp, fabs
from pathlib import Path

import numpy as np
import pytest
from arrays import array_steps, begun, bits, start, written_steps
from models import DOP853, LARGER, ODE23, ODE45, RODAS
from native_host import compiler
from scipy.integrate import solve_ivp

import fmus.packaging.native as native
from fmus.packaging.catalogue import load
from fmus.packaging.native.compiler import SAME_BITS, STRICT
from fmus.packaging.native.kinds import FLOAT
from fmus.packaging.native.program import Program
from fmus.packaging.written import written

FILES = {path.stem: path for path in LARGER}
STOPS = {"lugre": 4.0, "sleds": 16.0}
RTOL = {ODE23: 1e-6, ODE45: 1e-9, DOP853: 1e-11, RODAS: 1e-8}
EVERY_METHOD = pytest.mark.parametrize("method", RTOL)
STEPS = 200


@EVERY_METHOD
@pytest.mark.parametrize("name", STOPS)
def test_arrays_and_scalars_give_the_same_bits_at_every_step(name, method):
    file, stop = FILES[name], STOPS[name]
    values = {"solver.method": method, "solver.rtol": 1e-5}
    scalars = written_steps(written(file)(), values, stop, STEPS)
    assert scalars == array_steps(load(file)(), values, stop, STEPS)
    assert len(scalars) > 30


def run(name, method):
    """A run of the written-out model: the state at the stop, and time and modes of every event."""
    one, stop = written(FILES[name])(), STOPS[name]
    begun(one, {"solver.method": method, "solver.rtol": RTOL[method], "solver.atol": 1e-3 * RTOL[method]}, stop)
    start(one, one.initial(0.0), stop)
    step, events = one.solver.step, []
    while step.t1 < stop:
        assert step.take(one) == 0
        if step.event:
            events.append((step.t1, *(getattr(step, f"{mode}_1") for mode in one.contacts)))
    names = [state + ("_" if state[-1].isdigit() else "") + "1" for state in one.states]
    return [getattr(step, name) for name in names], events


@EVERY_METHOD
def test_bristles_move_as_an_independent_solver_says(method):
    def rates(t, y):
        x, v, z = y
        u = v - 1e4 * fabs(v) * z / (122.6 * (0.6 + 0.3 * exp(-((v / 1e-2) ** 2))))
        return v, (742.5 * (0.034 * t - x) - 1e4 * z - 300.0 * u - 0.4 * v) / 12.5, u

    truth = solve_ivp(rates, (0.0, 4.0), [0.0] * 3, method="Radau", rtol=1e-12, atol=1e-15).y[:, -1]
    found, _ = run("lugre", method)
    assert np.abs(np.array(found) - truth).max() < max(2e3 * RTOL[method] * np.abs(truth).max(), 1e-11)


def two_sleds():
    """Time and modes of every event, and the state at 16 s, with the physics written a second time."""

    def loads(t, y):
        link = 1100.0 * (y[0] - y[2])
        return 742.5 * (0.034 * t - y[0]) - link, link

    slide, hold, mass = (73.575, 40.0), (110.3625, 66.0), (12.5, 8.0)
    t, y, modes, events = 0.0, np.zeros(4), [0, 0], []
    while t < 16.0:

        def rates(t, y, modes=tuple(modes)):
            a, b = (
                (load - mode * f) / m if mode else 0.0
                for load, mode, f, m in zip(loads(t, y), modes, slide, mass, strict=True)
            )
            return y[1], a, y[3], b

        guards = []
        for i in range(2):

            def guard(t, y, i=i, mode=modes[i]):
                return mode * y[2 * i + 1] if mode else hold[i] - fabs(loads(t, y)[i])

            guard.terminal, guard.direction = True, -1
            guards.append(guard)
        got = solve_ivp(rates, (t, 16.0), y, method="DOP853", rtol=3e-14, atol=1e-16, events=guards, max_step=0.02)
        t, y = got.t[-1], got.y[:, -1].copy()
        if got.status != 1:
            break
        i = next(i for i in range(2) if len(got.t_events[i]))
        load = loads(t, y)[i]
        if modes[i]:
            y[2 * i + 1] = 0.0
            modes[i] = 0 if fabs(load) <= hold[i] else 1 if load > 0.0 else -1
        else:
            modes[i] = 1 if load > 0.0 else -1
        events.append((t, *modes))
    return events, y


@pytest.fixture(scope="module")
def truth():
    return two_sleds()


@EVERY_METHOD
def test_two_sleds_stick_and_slip_when_an_independent_solver_says(truth, method):
    events, end = truth
    found, seen = run("sleds", method)
    assert [modes for _, *modes in seen] == [modes for _, *modes in events]
    assert len(seen) > 10
    room = max(2e3 * RTOL[method], 1e-10)
    assert [t for t, *_ in seen] == pytest.approx([t for t, *_ in events], abs=room)
    assert np.abs(np.array(found) - end).max() < room


def test_a_stuck_sled_stands_on_its_speed_of_zero_while_the_other_moves():
    one = written(FILES["sleds"])()
    begun(one, {"solver.method": DOP853, "solver.rtol": 1e-9}, 16.0)
    start(one, one.initial(0.0), 16.0)
    step, seen = one.solver.step, 0
    while step.t1 < 16.0:
        assert step.take(one) == 0
        for mode, speed in ("mode1", "v1"), ("mode2", "v2"):
            if getattr(step, f"{mode}_0") == 0 and not step.waiting:
                assert bits([getattr(step, f"{speed}_0"), getattr(step, f"{speed}_1")]) == bits([0.0, 0.0])
                seen += 1
    assert seen > 10


def begin_lugre(model, t_end, tolerance):
    model.solver.start(model, 0.0, 0.0, 0.0, 0.0, t_end, tolerance)


def begin_sleds(model, t_end, tolerance):
    model.solver.start(model, 0.0, 0.0, 0.0, 0.0, 0.0, t_end, tolerance)


def take(model):
    return model.solver.step.take(model)


@EVERY_METHOD
@pytest.mark.parametrize("name", STOPS)
def test_c_does_what_the_scalars_do_to_the_last_bit(tmp_path, name, method):
    file, stop = FILES[name], STOPS[name]
    values = {"solver.method": method, "solver.rtol": 1e-5}
    one = begun(written(file)(), values, stop)
    program = Program(one)
    program.entry("begin", {"lugre": begin_lugre, "sleds": begin_sleds}[name], FLOAT, FLOAT)
    program.entry("take", take)
    names = [f"{state}_1" if state[-1].isdigit() else f"{state}1" for state in one.states]
    told = "".join(f"    *out++ = it.solver.step.{name};\n" for name in ("t1", *names))
    text = f"""#include "numerics.h"
{program.text()}
static struct {type(one).__name__} it = {program.layout.image(one)};
int begun(double stop) {{ bool fault = false; begin(&it, stop, 1e-6, &fault); return fault; }}
int taken(double *out)
{{
    bool fault = false;
    int64_t status = take(&it, &fault);
{told}    return fault || status;
}}
"""
    (tmp_path / "frozen.c").write_text(text)
    command = [compiler(), *STRICT, *SAME_BITS, "-Wno-unused-function", "-shared", "-fPIC"]
    command.append(f"-I{Path(native.__file__).parent}")
    subprocess.run([*command, "frozen.c", "-o", "frozen.so", "-lm"], cwd=tmp_path, check=True)
    library, out = ctypes.CDLL(str(tmp_path / "frozen.so")), (ctypes.c_double * (1 + len(names)))()
    assert library.begun(ctypes.c_double(stop)) == 0
    start(one, one.initial(0.0), stop)
    step = one.solver.step
    while step.t1 < stop:
        assert step.take(one) == 0
        assert library.taken(out) == 0
        assert bits(out) == bits([step.t1, *(getattr(step, name) for name in names)])
