"""Slow departures from the law that no residual shows by itself are reported, and the intervals cover them."""

import numpy as np
import pytest
from decays import decay_record, identify
from variants import slow_after

T = np.linspace(0.0, 30.0, 1800)
TRUTH = {"omega": 12.566, "zeta": 0.001, "r": 1e-4, "b": 0.0}
NOISE = 2e-5  # 2e-4 of the amplitude


def swung(seed, clock=0.0, gain=0.0):
    """Return the fit of a decay with an error of the clock in rad, and of the amplitude, both as random walks."""
    clean = decay_record(**TRUTH, turn=-0.1, t=T, noise=NOISE, rest=0.0, seed=seed)
    knots = np.linspace(T[0], T[-1], 9)
    walk = np.interp(T, knots, np.cumsum(np.random.default_rng(seed).standard_normal(9)))
    bridge = walk - np.polyval(np.polyfit(T, walk, 1), T)
    record = clean._replace(t=T + clock / TRUTH["omega"] * bridge, x=clean.x * (1 + gain * walk))
    return identify(record)


def errors(fit):
    """Return the deviations of the values from the truth, in standard errors."""
    return [abs(fit[name].value - value) / fit[name].error for name, value in TRUTH.items()]


@pytest.mark.parametrize(
    ("defect", "cause"), slow_after(1, [("clock", "a clock whose rate varies"), ("gain", "another law")])
)
def test_a_wander_near_the_noise_is_reported_and_covered(defect, cause):
    fits = [swung(seed, **{defect: 2e-4}) for seed in range(4)]
    assert sum(cause in " ".join(fit.remarks) for fit in fits) >= 3
    assert np.mean([np.array(errors(fit)) < 2 for fit in fits]) > 0.8
    assert max(max(errors(fit)) for fit in fits) < 4


@pytest.mark.slow
def test_white_noise_is_no_wander():
    fits = [swung(seed) for seed in range(4)]
    assert not any("departs slowly" in " ".join(fit.remarks) for fit in fits)
