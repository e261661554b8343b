"""Models of more states or contacts, from files as users write them: right by physics written a second time."""

import subprocess
import sys
from functools import cache

import numpy as np
import pytest
from builds import ROOT
from compare import identical
from models import LARGER
from scipy.integrate import solve_ivp

STOP, DOP853 = 8.0, 4


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    """built(name, kind): the FMU of one of the files, in a folder outside the project."""

    @cache
    def build(name, kind):
        folder = tmp_path_factory.mktemp(name)
        (file,) = (file for file in LARGER if file.stem == name)
        options = ["--native", "--platform", "linux64"] if kind == "native" else []
        call = [sys.executable, str(ROOT / "build_fmus.py"), str(file), "--out", str(folder), *options]
        run = subprocess.run(call, cwd=folder, capture_output=True, text=True, timeout=300)
        assert (run.returncode, run.stderr) == (0, "")
        return folder / f"{name}.fmu"

    return build


def lugre(t, y):
    """The bristles by hand."""
    x, v, z = y
    u = v - 1e4 * abs(v) * z / (73.56 + (110.34 - 73.56) * np.exp(-((v / 0.01) ** 2)))
    return [v, (742.5 * (0.034 * t - x) - (1e4 * z + 300.0 * u + 0.4 * v)) / 12.5, u]


def sleds(stop):
    """The two sleds by hand: states and modes, piece by piece, each ended by scipy's events."""
    m, slide, hold = (12.5, 8.0), (73.575, 40.0), (110.3625, 66.0)
    y, t, modes, events = np.zeros(4), 0.0, [0, 0], []

    def load(t, y, i):
        link = 1100.0 * (y[0] - y[2])
        return 742.5 * (0.034 * t - y[0]) - link if i == 0 else link

    def rates(t, y):
        a = [(load(t, y, i) - modes[i] * slide[i]) / m[i] if modes[i] else 0.0 for i in (0, 1)]
        return [y[1] * bool(modes[0]), a[0], y[3] * bool(modes[1]), a[1]]

    def ending(i):
        def left(t, y):
            return modes[i] * y[2 * i + 1] if modes[i] else hold[i] - abs(load(t, y, i))

        left.terminal, left.direction = True, -1
        return left

    while True:
        run = solve_ivp(rates, (t, stop), y, "DOP853", events=[ending(0), ending(1)], rtol=1e-12, atol=1e-13)
        t, y = run.t[-1], run.y[:, -1].copy()
        if run.status != 1:
            return y, events
        i = 0 if len(run.t_events[0]) else 1
        y[2 * i + 1] = 0.0
        modes[i] = 0 if modes[i] and abs(load(t, y, i)) <= hold[i] else int(np.sign(load(t, y, i)))
        events.append(t)


def test_three_states_are_those_of_the_equations_written_by_hand(built, worker):
    """LuGre: position, speed and bristles, within 1e-9 of their sizes."""
    true = solve_ivp(lugre, (0.0, STOP), (0.0, 0.0, 0.0), "Radau", rtol=1e-11, atol=1e-14).y[:, -1]
    fmu = worker.instantiate(built("lugre", "")).begin({"solver.rtol": 1e-11}, stop=STOP)
    (found,) = fmu.run([0.0, STOP], ["x", "v", "z"])[-1:]
    fmu.free()
    assert np.abs(np.array(found) - true).max() < 1e-9


def test_two_contacts_stick_and_slip_each_when_the_equations_say(built, worker):
    """Two sleds: every event, and where they are at the end; a sled that is stuck has no speed."""
    end, events = sleds(STOP)
    fmu = worker.instantiate(built("sleds", "")).begin({"solver.rtol": 1e-11, "solver.method": DOP853}, stop=STOP)
    t, found = 0.0, []
    while t < STOP:
        ahead = fmu.get("solver.t_next")
        fmu.step(t, ahead - t)
        t = ahead
        count, last, *state = fmu.get("events.count", "events.t_last", "x1", "v1", "x2", "v2", "mode1", "mode2")
        if count > len(found):
            found.append(last)
        assert all(mode or speed == 0.0 for mode, speed in zip(state[4:], state[1:4:2], strict=True))
    fmu.free()
    assert len(found) == len(events) >= 4
    assert np.abs(np.array(found) - events).max() < 1e-9
    assert np.abs(np.array(state[:4]) - end).max() < 1e-9


@pytest.mark.parametrize("name", ["lugre", "sleds"])
def test_python_and_native_have_the_same_bits(built, worker, name):
    wanted = ["x", "v", "z", "a"] if name == "lugre" else ["x1", "v1", "x2", "v2", "F1", "F2", "mode1", "mode2"]
    wanted += ["solver.steps", "solver.evaluations", "events.count"]
    rows = []
    for kind in ("", "native"):
        fmu = worker.instantiate(built(name, kind)).begin({"solver.rtol": 1e-8}, stop=STOP)
        rows.append(fmu.run([STOP * i / 80 for i in range(81)], wanted))
        fmu.free()
    identical(*rows, wanted)
