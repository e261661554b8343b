"""The free decay is found within a record of a laboratory, and other motions are refused by their features."""

from dataclasses import replace

import numpy as np
import pytest
from laboratory_records import OTHERS, SCENES, laboratory_record, other_motion

from harness import HarnessError
from harness.analyses.decay.estimates import KnownParameters
from harness.analyses.decay.identification import fit_decay
from harness.analyses.decay.window import select_decay

SEEDS = range(300, 306)


@pytest.mark.parametrize("scene", SCENES)
def test_the_free_decay_is_found_within_a_laboratory_record(scene):
    """Up to one half cycle at its start; a rest at its end may be a part of it.  Every second record has a gap."""
    for seed in SEEDS:
        record, law, (begin, end) = laboratory_record(scene, seed)
        half_period = np.pi / law["omega"]
        if seed % 2:
            rng = np.random.default_rng(seed)
            gap = begin + half_period * (rng.uniform(6, 20) + np.array([0.0, rng.uniform(0.9, 4.0)]))
            keep = (record.t < gap[0]) | (record.t > gap[1])
            record = replace(record, t=record.t[keep], x=record.x[keep])
        found, _ = select_decay(record, False)
        assert begin - 1.6 * half_period < found.t[0] < begin + 1.6 * half_period
        if scene == "two":
            assert (begin + end) / 2 < found.t[-1] < end + 1.6 * half_period
        assert (found is record) == (scene == "stopped")


@pytest.mark.parametrize("scene", ["hold", "two"])
def test_the_law_is_identified_within_a_laboratory_record(scene):
    record, law, (begin, end) = laboratory_record(scene, 301)
    fit = fit_decay(record, KnownParameters(), drag=False)
    assert all(abs(fit[name].value - law[name]) < 4 * fit[name].error for name in ("omega", "zeta", "r"))
    assert begin < fit.t[0] + np.pi / law["omega"] < fit.t[-1] < end
    assert len(fit.record.t) == len(record.t)  # the figure shows the excluded samples
    assert "The free decay from t = " in " ".join(fit.remarks)


FEATURES = {
    "growing": "grows, from .* peak to peak: it is driven or gains energy",
    "constant": "has a constant amplitude: over [0-9]+ half cycles its swings change by",
    "beating": "beats: its swings fall to .* and rise again",
    "sawtooth": "stick-slip.*friction-fmus fit stickslip",
    "noise": "all noise|is not one oscillation",
    "relaxation": "no wave|is not one oscillation",
}


@pytest.mark.parametrize("kind", OTHERS)
def test_another_motion_is_refused_by_its_feature(kind):
    for seed in SEEDS:
        with pytest.raises(HarnessError, match=FEATURES[kind]):
            fit_decay(other_motion(kind, seed), KnownParameters())


def test_a_second_decay_of_nearly_the_same_weight_is_named():
    """Without the first swings of the first decay, both are alike."""
    record, _, (begin, end) = laboratory_record("two", 303)
    found, _ = select_decay(record.select(begin + 0.3 * (end - begin), np.inf), False)
    assert "The record also decays from t =" in " ".join(found.notes)
