"""Motions that start from rest, where states and rates have no size but that of rounding errors."""

from dataclasses import replace

import numpy as np
import pytest
from build_cache import build_user_model
from models import DOP853, ODE23, ODE45, RADAU9, RODAS
from scipy.linalg import expm

from benchmarks.campaigns.independent_contacts import solve
from benchmarks.campaigns.random_models import random_structure, random_values, to_system, write_model

METHODS = [f"--method={label}" for label in ("ode23", "ode45", "dop853", "rodas", "radau9")]
K, P, STOP = 128.0, 2.0, 1.0
CHAIN = '''from fmus import Model, Output, Parameter, State


class Chain(Model):
    """Four bodies in a row between springs, at rest; a force pushes the last one."""

    m = Parameter(1.0, "kg", "mass", above=0.0)
    k = Parameter(128.0, "N/m", "stiffness", low=0.0)
    p = Parameter(2.0, "N", "force")
    x0 = State("m", "position")
    v0 = State("m/s", "speed", rate_of=x0)
    x1 = State("m", "position")
    v1 = State("m/s", "speed", rate_of=x1)
    x2 = State("m", "position")
    v2 = State("m/s", "speed", rate_of=x2)
    x3 = State("m", "position")
    v3 = State("m/s", "speed", rate_of=x3)
    a0 = Output("m/s2", "acceleration", k * (x1 - 2.0 * x0) / m, rate_of=v0)
    a1 = Output("m/s2", "acceleration", k * (x0 - 2.0 * x1 + x2) / m, rate_of=v1)
    a2 = Output("m/s2", "acceleration", k * (x1 - 2.0 * x2 + x3) / m, rate_of=v2)
    a3 = Output("m/s2", "acceleration", (k * (x2 - x3) + p) / m, rate_of=v3)
    stop_time = 1.0
'''


def test_a_pushed_chain_starts_with_every_method(worker, tmp_path):
    (file := tmp_path / "chain.py").write_text(CHAIN)
    path = build_user_model(file, *METHODS) / "chain.fmu"
    stiffness = K * (2.0 * np.eye(4) - np.eye(4, k=1) - np.eye(4, k=-1))
    stiffness[3, 3] = K
    rates = np.zeros((9, 9))
    rates[:4, 4:8], rates[4:8, :4], rates[7, 8] = np.eye(4), -stiffness, P
    expected = expm(STOP * rates)[:4, 8]
    for method in (ODE23, ODE45, DOP853, RODAS, RADAU9):
        fmu = worker.instantiate(path).begin({"solver.method": method, "solver.rtol": 1e-4}, stop=STOP)
        fmu.step(0.0, STOP)
        assert np.abs(np.array(fmu.get("x0", "x1", "x2", "x3")) - expected).max() < 2e-3 * expected.max()
        fmu.free()


@pytest.mark.parametrize("rtol", [1e-6, pytest.param(1e-11, marks=pytest.mark.slow)])
def test_radau9_waits_while_all_contacts_stick(worker, tmp_path, rtol):
    structure = random_structure(13)
    values, _ = random_values(structure, 21)
    reference = solve(replace(to_system(structure, values), stop=0.4))
    assert reference.first_modes == (0, 0, 0)
    (file := tmp_path / "waiting.py").write_text(write_model(structure))
    path = build_user_model(file, "--method=radau9") / "waiting.fmu"
    fmu = worker.instantiate(path).begin({**values, "solver.rtol": rtol}, stop=4.0)
    fmu.step(0.0, 0.4)
    assert fmu.get("events.count") == len(reference.events) > 0
    assert abs(fmu.get("events.t_last") - reference.events[-1][0]) < 100.0 * rtol
    fmu.free()
