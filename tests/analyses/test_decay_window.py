"""The free decay is found within a record of a laboratory, and other motions are refused by their features."""

import numpy as np
import pytest
from decays import Signal, identify
from laboratory_records import OTHERS, SCENES, laboratory_record, other_motion

from harness import HarnessError


@pytest.mark.parametrize("seed", [301, 302])
@pytest.mark.parametrize("scene", SCENES)
def test_the_free_decay_and_its_law_are_found_within_a_laboratory_record(scene, seed):
    """Up to one half cycle at its start; a rest at its end may be a part of it.  One record of two has a gap."""
    record, law, (begin, end) = laboratory_record(scene, seed)
    half_period = np.pi / law["omega"]
    if seed % 2:
        rng = np.random.default_rng(seed)
        gap = begin + half_period * (rng.uniform(6, 20) + np.array([0.0, rng.uniform(0.9, 4.0)]))
        keep = (record.t < gap[0]) | (record.t > gap[1])
        record = record._replace(t=record.t[keep], x=record.x[keep])
    fit = identify(record, drag=False)
    assert begin - 1.6 * half_period < fit.t[0] < begin + 1.6 * half_period
    if scene == "two":
        assert (begin + end) / 2 < fit.t[-1] < end + 1.6 * half_period
    assert ("The free decay from t = " in " ".join(fit.remarks)) == (scene != "stopped")
    assert len(fit.record.t) == len(record.t)  # the figure shows the excluded samples
    assert all(abs(fit[name].value - law[name]) < 4 * fit[name].error for name in ("omega", "zeta", "r"))


FEATURES = {
    "growing": "grows, from .* peak to peak: it is driven or gains energy",
    "constant": "has a constant amplitude: over [0-9]+ half cycles its swings change by",
    "beating": "beats: its swings fall to .* and rise again",
    "sawtooth": r"stick-slip.*harness\.fit\('stickslip'",
    "noise": "all noise|is not one oscillation",
    "relaxation": "no wave|is not one oscillation",
}


@pytest.mark.parametrize("kind", OTHERS)
def test_another_motion_is_refused_by_its_feature(kind):
    for seed in range(300, 303):
        with pytest.raises(HarnessError, match=FEATURES[kind]):
            identify(other_motion(kind, seed))


def test_a_second_decay_of_nearly_the_same_weight_is_named():
    """Without the first swings of the first decay, both are alike."""
    record, _, (begin, end) = laboratory_record("two", 303)
    fit = identify(record.select(begin + 0.3 * (end - begin), np.inf), drag=False)
    assert "The record also decays from t =" in " ".join(fit.remarks)


@pytest.mark.parametrize("stop", [16, 20, 60])
def test_a_driven_motion_whose_amplitude_tends_to_a_constant_is_refused(stop):
    """Of x'' = -4 x - 0.5 x' + cos 2t from x = 1, a part has swings of nearly equal size."""
    t = np.linspace(0.0, stop, 50 * stop)
    root = np.sqrt(4 - 0.25**2)  # x = sin(2t) + a free decay from x = 1, v = -2
    x = np.sin(2 * t) + np.exp(-0.25 * t) * (np.cos(root * t) + (0.25 - 2) / root * np.sin(root * t))
    with pytest.raises(HarnessError, match=r"is driven or gains energy.*; .*fit a model with its drive by"):
        identify(Signal(t, x))
