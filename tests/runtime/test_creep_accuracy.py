"""The sharper the friction curve, the slower the creep; the tolerance follows."""

import pytest
from models import outputs

STOP = 16.0


@pytest.mark.parametrize("x_m", [1e-3, 1e-4, 1e-5, 1e-6])
def test_a_sharp_friction_curve_costs_no_digits(launch, x_m):
    """By default within 1e-6 of a run at a tight tolerance that resolves the creep."""
    times = [STOP * i / 400 for i in range(401)]
    tight = {"solver.rtol": 1e-10, "solver.atol": 1e-13 * x_m}
    runs = [
        launch("pacejka", {"x_m": x_m, **more}, stop=STOP).run(times, outputs("pacejka")[:1]) for more in ({}, tight)
    ]
    places, truth = ([x for (x,) in rows] for rows in runs)
    assert max(abs(a - b) for a, b in zip(places, truth, strict=True)) < 1e-6 * max(map(abs, truth))
