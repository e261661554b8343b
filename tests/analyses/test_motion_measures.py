"""harness.measure: sampled motions with known decrements, slips and rests."""

from math import log, pi

import numpy as np
import pytest
from native_fmus import build_native_fmus

import harness


def simulate(model, **options):
    """Times, positions and velocities of a run of a native FMU, and the run."""
    run = harness.simulate(build_native_fmus() / f"{model}.fmu", **options)
    roles = run.motion_outputs
    return run.time, run[roles["position"]], run[roles["velocity"]], run


def test_dry_friction_lowers_each_peak_by_the_same_length():
    t, x, v, run = simulate("coulomb", stop=6.0, interval=0.003)
    measures = harness.measure(t, x, v)
    fall = 2 * run.parameters["f"] / run.parameters["k"]
    assert measures.decrements == pytest.approx(np.full(15, fall), rel=1e-4)
    assert measures["decrement"] == pytest.approx(fall, rel=1e-5)
    assert measures["period"] == pytest.approx(2 * pi * (run.parameters["m"] / run.parameters["k"]) ** 0.5, rel=1e-3)
    assert (measures["creep"], measures["chatter"], measures["slips"]) == (0, 0, 0)
    assert measures.rest_begin == pytest.approx(run.events.t[-1:], abs=0.01)


@pytest.mark.parametrize("signals", ["velocity", "position alone"])
def test_viscous_damping_lowers_each_peak_by_the_same_ratio(signals):
    zeta, t = 0.05, np.linspace(0.0, 5.0, 50001)
    decay = -zeta + 1j * (1 - zeta**2) ** 0.5
    z = np.exp(2 * pi * decay * t) / decay.imag
    x, v = (z * np.conj(decay)).imag * -1, 2 * pi * z.imag * -1
    measures = harness.measure(t, x, v if signals == "velocity" else None, unit="rad")
    delta = 2 * pi * zeta / (1 - zeta**2) ** 0.5
    assert 2 * measures.log_decrements == pytest.approx(np.full(len(measures.turning_t) - 1, delta), rel=1e-3)
    assert measures["log_decrement"] == pytest.approx(delta, rel=1e-3)
    assert "rad" in str(measures)
    assert "rest" not in measures.to_pandas().index


@pytest.mark.parametrize("longer", [1.0, 10.0])
def test_slips_are_those_of_the_events(longer):
    """However long the body rests before, between and after them."""
    t, x, v, run = simulate("stickslip", values={"v_driver": 0.034 / longer}, stop=16.0 * longer, interval=0.002)
    measures = harness.measure(t, x, v)
    starts, ends = run.events.t[1::2], run.events.t[2::2]
    assert measures["slips"] == len(starts) == 4
    assert measures.rest_end[:-1] == pytest.approx(starts, abs=0.005)
    assert measures.rest_begin[1:] == pytest.approx(ends, abs=0.005)
    assert measures["slip_time"] == pytest.approx(np.mean(ends - starts), abs=0.01)
    assert (measures["creep"], measures["chatter"]) == (0, 0)


@pytest.mark.parametrize(("law", "creeps", "chatters"), [("hybrid", False, False), ("sign", True, True)])
def test_chatter_at_rest_is_counted(law, creeps, chatters):
    t, x, v, _ = simulate("coulomb", values={"friction": law}, stop=6.0, method="ode23", rtol=1e-3)
    measures = harness.measure(t, x, v)
    assert (measures["creep"] > 0, measures["chatter"] > 0) == (creeps, chatters)


def test_no_rest_is_found_in_an_oscillation_that_decays_to_nothing():
    t = np.linspace(0.0, 20.0, 4001)
    measures = harness.measure(t, np.exp(-0.1 * t) * np.cos(5 * t), -5 * np.exp(-0.1 * t) * np.sin(5 * t))
    assert measures["rests"] == 0
    assert measures["log_decrement"] == pytest.approx(0.1 * 2 * pi / 5, rel=0.02)
    assert 0.9 < measures["log_decrement"] / log(np.exp(0.04 * pi)) < 1.1


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (([0.0, 1.0, 2.0], [0.0, 1.0]), "x has 2 values and t has 3"),
        (([0.0, 2.0, 1.0], [0.0, 1.0, 2.0]), "t falls"),
        (([0.0, 0.0, 1.0], [0.0, 1.0, 2.0]), "2 different times"),
        (([0.0, 1.0, 2.0], [5.0, 5.0, 5.0]), "nothing moves"),
        (([0.0, 1.0, 2.0], [0.0, float("nan"), 1.0]), "x must be a row of finite numbers"),
        (("abc", [1.0]), "t must be a row of finite numbers"),
    ],
)
def test_arrays_that_are_no_motion_are_refused(arguments, words):
    with pytest.raises(harness.SceneError, match=words):
        harness.measure(*arguments)


def test_a_quantity_that_was_not_found_is_named():
    t = np.linspace(0.0, 1.0, 11)
    with pytest.raises(harness.HarnessError, match="slip_time"):
        harness.measure(t, t)["slip_time"]
