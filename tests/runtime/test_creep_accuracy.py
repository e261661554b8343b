"""The sharper the friction curve, the slower the creep; the tolerance follows."""

import pytest
from models import DOP853, RADAU9, RODAS, outputs

STOP = 16.0
TOLERANT = {"solver.method": RODAS, "solver.rtol": 1e-5}


@pytest.mark.parametrize("x_m", [1e-3, 1e-4, 1e-5, 1e-6])
def test_a_sharp_friction_curve_costs_no_digits(launch, x_m):
    """A run at a tight tolerance that resolves the creep is the reference. With a scale that does not follow, errors of
    rodas exceed the tolerance where x_m is below the usual scale of 1e-3 m/s."""
    times = [STOP * i / 400 for i in range(401)]
    tight = {"solver.rtol": 1e-10, "solver.atol": 1e-13 * x_m}
    truth, default, tolerant = (
        [x for (x,) in launch("pacejka", {"x_m": x_m, **values}, stop=STOP).run(times, outputs("pacejka")[:1])]
        for values in (tight, {}, TOLERANT)
    )
    for positions, error in ((default, 1e-6), (tolerant, 0.3 * TOLERANT["solver.rtol"])):
        assert max(abs(a - b) for a, b in zip(positions, truth, strict=True)) < error * max(map(abs, truth))


def test_a_tight_tolerance_is_met_down_to_rounding_errors(launch):
    """Two methods agree to more digits than an allowance of many units of rounding per step would leave."""
    times = [0.04 * i for i in range(201)]
    truth, run = (
        launch("pacejka", {"solver.method": method, "solver.rtol": 1e-13}, stop=8.0).run(times, outputs("pacejka")[:2])
        for method in (RADAU9, DOP853)
    )
    for reference, column in zip(zip(*truth, strict=True), zip(*run, strict=True), strict=True):
        assert max(abs(a - b) for a, b in zip(reference, column, strict=True)) < 1e-11 * max(map(abs, reference))
