"""The closed form of motions from rest, at times so short that its terms cancel."""

from types import SimpleNamespace

import pytest
from independent_solution import LinearSegment, stickslip
from independent_solution import smd as system
from mpmath import mpf

from fmus.runtime.linear_closed_form import LinearClosedForm
from tests.runtime.test_exact_method import DAMPING, ClosedFormMotion

STEADY = 12.0  # rad/s
RUNS = [1e-1, 1e-2, 1e-3, 1e-4, 1e-5]  # s


@pytest.mark.parametrize("run", RUNS)
@pytest.mark.parametrize("zeta", [z for z in DAMPING if z >= 1.0])
def test_a_push_from_rest_keeps_its_digits_in_any_short_run(launch, zeta, run):
    """Overdamped: position and speed are accurate to 1e-13 of their current values."""
    values = {"k": STEADY**2, "c": 2.0 * STEADY * zeta, "F_ext": 3.0}
    assert_exact(launch("smd", {**values, "x0": 0.0, "v0": 0.0}, stop=run), system(**values), run)


@pytest.mark.parametrize("run", RUNS)
def test_a_pull_from_rest_keeps_its_digits_in_any_short_run(launch, run):
    """Without friction: the position is that of the driver, less a sine that is nearly as large."""
    assert_exact(launch("stickslip", {"g": 0.0}, stop=run), stickslip(g=0.0), run)


@pytest.mark.parametrize("run", RUNS)
@pytest.mark.parametrize("zeta", [z for z in DAMPING if z > 0.0])
def test_a_ramp_from_rest_keeps_its_digits_in_any_short_run(zeta, run):
    """The position grows with the third power of the time."""
    closed_form, c = LinearClosedForm(True), 2.0 * STEADY * zeta
    closed_form.prepare(1.0, c, STEADY**2, 0.0)
    closed_form.set_force_rate(3.0)
    closed_form.start_segment(0.0, 0.0, 0.0, 0.0, 0.0)
    segment = LinearSegment(SimpleNamespace(m=1, c=c, k=STEADY**2, rate=3), 0, 0)
    for value, true in zip(closed_form.evaluate(run), segment.at(mpf(run)), strict=True):
        assert abs(value - true) <= 1e-13 * abs(true)


def assert_exact(fmu, system, run):
    """Check position and speed of a motion from rest at zero, relative to their current values."""
    times = [run * i / 10 for i in range(11)]
    rows = fmu.run(times, ["x", "v"])
    motion = ClosedFormMotion([(0.0, system)], 0.0, 0.0, run)
    for t, row in zip(times[1:], rows[1:], strict=True):
        for value, true in zip(row, motion.at(t), strict=True):
            assert abs(value - true) <= 1e-13 * abs(true)
