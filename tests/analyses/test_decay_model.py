"""The motion model of the fit agrees with an integrator and is smooth in its parameters."""

import numpy as np
import pytest
from decays import UNKNOWNS
from scipy.integrate import solve_ivp

from harness.analyses.decay.signal_model import SignalModel

QUANTITIES = ("position", "velocity", "acceleration")


@pytest.mark.parametrize(
    ("zeta", "r", "b", "sine", "a"),
    [
        (0.03, 0.004, 0.0, False, 0.1),
        (0.01, 0.02, 0.5, True, 1.0),
        (0.0, 0.02, 2.0, False, 1.0),
        (0.7, 0.0, 0.0, False, 1.0),
        (0.1, 0.0, 0.0, True, 2.9),
    ],
)
def test_the_model_agrees_with_an_integrator_restarted_at_every_turning_point(zeta, r, b, sine, a):
    times = np.linspace(0.0, 30.0, 1000)
    expected, begin, position, s = np.full((3, 1000), np.nan), 0.0, a, -1.0
    while np.isnan(expected[0, -1]):

        def rates(_, u, s=s):
            restoring = np.sin(u[0]) if sine else u[0]
            return np.array([u[1], -restoring - 2 * zeta * u[1] - s * b * u[1] * u[1] - s * r])

        def still(_, u):
            return u[1]

        still.terminal, still.direction = True, -s
        piece = solve_ivp(
            rates, (begin, 30.001), [position, 0], "DOP853", events=still, dense_output=True, rtol=1e-13, atol=1e-15
        )
        inside = (times >= begin) & (times <= piece.t[-1])
        u = piece.sol(times[inside])
        expected[:, inside] = u[0], u[1], rates(0, u)[1]
        begin, position, s = piece.t[-1], piece.y[0, -1], -s
        if abs(np.sin(position) if sine else position) <= r:
            expected[:, times > begin] = [[position], [0], [0]]
    for order in range(3):
        model = SignalModel(1.0, order, sine, 0.0, 1e-9 * a)
        samples, _ = model(np.array([0, a, 0, 0, 2.0, zeta, r, b]), UNKNOWNS, times / 2)
        assert samples == pytest.approx(expected[order] * 2.0**order, abs=3e-9 * 5**order * a)


@pytest.mark.parametrize("sine", [False, True])
@pytest.mark.parametrize("order", range(3), ids=QUANTITIES)
def test_the_jacobian_agrees_with_finite_differences(order, sine):
    """Between samples in the same half swing; the acceleration jumps at a reversal."""
    model, p = SignalModel(1.0, order, sine, 1.0, 1e-9), np.array([0.05, 1.0, 0.01, 0.02, 5.0, 0.01, 0.02, 0.05])
    unknowns, t = np.arange(8), np.linspace(0.0, 4.0, 500)
    _, jacobian = model(p, unknowns, t)
    for column, parameter in zip(jacobian.T, unknowns, strict=True):
        up, down = (p + sign * 1e-5 * (np.arange(8) == parameter) for sign in (1, -1))
        slope = (model(up, unknowns, t)[0] - model(down, unknowns, t)[0]) / 2e-5
        assert np.mean(np.abs(slope - column) < 1e-5 * np.abs(column).max()) > 0.95


@pytest.mark.parametrize(("sine", "r"), [(False, 0.51), (True, 0.49)])
def test_a_body_held_by_friction_does_not_move(sine, r):
    """Nor does a pendulum from an angle below arcsin r, which is larger than r."""
    model, p = SignalModel(1.0, 0, sine, 0.0, 1e-9), np.array([0, 0.5, 0, 0, 1.0, 0.0, r, 0])
    assert set(model(p, UNKNOWNS, np.linspace(-1.0, 10.0, 20))[0]) == {0.5}


@pytest.mark.parametrize("sine", [False, True])
@pytest.mark.parametrize("b", [0.0026, 0.0051, 0.0116])
def test_the_model_is_continuous_in_drag(b, sine):
    """A segment that begins just before a turning point once lost half a cycle."""
    t, model = np.linspace(0, 60, 3000), SignalModel(1.0, 0, sine, 0.0, 1e-9)
    near = [model(np.array([0, 1.0, 0, 0, 1.0, 0.01, 0.001, b + h]), UNKNOWNS, t)[0] for h in (0, 1e-7)]
    assert np.abs(near[1] - near[0]).max() < 1e-5
