"""Chains of bodies at rest whose last one is pushed: the position of the n-th from there grows as t^(2n)."""

import numpy as np
import pytest
from build_cache import ROOT, build_user_model
from models import DOP853, ODE23, ODE45, RADAU9, RODAS
from scipy.linalg import expm
from variants import campaign_after

METHODS = [f"--method={label}" for label in ("ode23", "ode45", "dop853", "rodas", "radau9")]
K, P, STOP = 128.0, 2.0, 1.0
BODY = """
    x{i} = State("m", "position")
    v{i} = State("m/s", "speed", rate_of=x{i})
"""
OUTPUT = '    a{i} = Output("m/s2", "acceleration", ({force}) / m, rate_of=v{i})\n'
HEAD = '''from fmus import Model, Output, Parameter, State


class Chain(Model):
    """Bodies in a row between springs, at rest; a force pushes the last one."""

    m = Parameter(1.0, "kg", "mass", above=0.0)
    k = Parameter(128.0, "N/m", "stiffness", low=0.0)
    p = Parameter(2.0, "N", "force")
    stop_time = 1.0
'''


def chain(n):
    """Return the text of a model of n bodies, the first of which is tied to the ground."""
    inner = [f"k * ({f'x{i - 1}' if i else 0.0} - 2.0 * x{i} + x{i + 1})" for i in range(n - 1)]
    forces = [*inner, f"k * (x{n - 2} - x{n - 1}) + p"]
    bodies = [BODY.format(i=i) for i in range(n)]
    return HEAD + "".join(bodies + [OUTPUT.format(i=i, force=force) for i, force in enumerate(forces)])


def exact_positions(n, t):
    """Return the positions of a chain by the exponential of its matrix."""
    stiffness = K * (2.0 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1))
    stiffness[-1, -1] = K
    rates = np.zeros((2 * n + 1, 2 * n + 1))
    rates[:n, n : 2 * n], rates[n : 2 * n, :n], rates[2 * n - 1, 2 * n] = np.eye(n), -stiffness, P
    return expm(t * rates)[:n, 2 * n]


@pytest.mark.parametrize("method", [ODE23, ODE45, DOP853, RODAS, RADAU9])
@pytest.mark.parametrize("n", campaign_after(1, [4, 2, 8]))
def test_a_pushed_chain_starts_with_every_method(worker, tmp_path, n, method):
    (file := tmp_path / "chain.py").write_text(chain(n))
    path = build_user_model(file, *METHODS) / "chain.fmu"
    fmu = worker.instantiate(path).begin({"solver.method": method, "solver.rtol": 1e-4}, stop=STOP)
    names, t = [f"x{i}" for i in range(n)], 0.0
    for end in (0.1, STOP):
        fmu.step(t, end - t)
        t, expected = end, exact_positions(n, end)
        assert np.abs(np.array(fmu.get(*names)) - expected).max() < 2e-3 * expected.max()
    assert fmu.get("solver.rejected") < 50
    fmu.free()


@pytest.mark.slow  # the campaign of symmetries does the same with all models
def test_a_first_step_past_the_end_of_a_slip_decides_nothing(worker):
    """Sled 1 breaks away with v of order t^2; the step to try is that at rest, sixteen times as long as its slip."""
    path = build_user_model(ROOT / "fmus" / "more" / "sleds.py", "--method=dop853") / "sleds.fmu"
    speeds = []
    for h_max in (0.0, 1.6e4):
        fmu = worker.instantiate(path).begin({"solver.h_max": h_max}, stop=16.0)
        fmu.step(0.0, 4.5)
        speeds.append(fmu.get("v_1"))
        fmu.free()
    assert abs(speeds[1] - speeds[0]) < 1e-5 * abs(speeds[0])
