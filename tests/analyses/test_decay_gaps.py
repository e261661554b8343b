"""Records with a pause: both sides are used, unseen half cycles are counted, and too few before the pause are
reported."""

import json
from math import pi, sqrt

import numpy as np
import pytest
from commands import harness
from decays import Signal, identify
from variants import slow_after

from harness import HarnessError

HALF, RATE = 0.25, 0.3  # s, a half cycle; 1/s, the decay rate
OMEGA = sqrt((pi / HALF) ** 2 + RATE**2)


def decay_with_pause(begin, share, noise=0.0):
    """Return the record of a decay without the samples from `begin` (s) on for `share` of a half cycle."""
    t = 0.004 * np.arange(1000)
    t = t[(t <= begin) | (t >= begin + share * HALF)]
    x = 0.1 * np.exp(-RATE * t) * np.cos(pi * t / HALF)
    return Signal(t, x + noise * np.random.default_rng(1).standard_normal(len(t)))


SHARES, BEGINS = [0.45, 0.95, 1.3, 3.3], [0.1, 0.3, 1.2, 2.2]


@pytest.mark.parametrize(  # each share and each begin with noise and without
    ("share", "begin", "noise"),
    slow_after(
        3, [(s, BEGINS[(i + j) % 4], noise) for i, s in enumerate(SHARES) for j, noise in enumerate((0.0, 1e-4))]
    ),
)
def test_a_pause_of_any_length_does_not_bias_the_fit(begin, share, noise):
    """Without the laws with drag, which take most of the time of a fit and follow the pause handling; some tests
    below include them."""
    estimates = {item.name: item for item in identify(decay_with_pause(begin, share, noise), drag=False).estimates}
    for name, truth in {"omega": OMEGA, "zeta": RATE / OMEGA}.items():
        assert abs(estimates[name].value - truth) < 1e-7 * truth + 5 * estimates[name].error
    assert estimates["omega"].error < 1e-3 * OMEGA


@pytest.mark.parametrize("share", slow_after(1, [0.35, 0.7]))
def test_a_pause_without_a_turning_point_costs_no_other_samples(share):
    fit = identify(decay_with_pause(0.55, share))
    assert fit.t[0] == 0.0
    assert fit.remarks == ()


def test_half_cycles_before_a_pause_are_skipped_and_reported_if_too_few():
    fit = identify(decay_with_pause(0.55, 1.3))
    assert fit.t[0] > 0.55
    assert "The record before the gap that ends at t = 0.8760 s has too few cycles" in " ".join(fit.remarks)


def test_the_command_line_uses_both_sides_of_a_pause(tmp_path):
    record = decay_with_pause(2.03, 0.95)
    rows = [f"{t!r},{x!r}" for t, x in zip(record.t.tolist(), record.x.tolist(), strict=True)]
    (tmp_path / "paused.csv").write_text("\n".join(["time [s],x [m]", *rows]))
    result = harness(tmp_path, "decay", "paused.csv", "--json")
    assert result.returncode == 0, result.stderr
    data = json.loads(result.stdout)
    assert {item["name"]: item["value"] for item in data["fit"]}["omega"] == pytest.approx(OMEGA, rel=1e-8)
    assert data["used"]["from"] < 2.03 < data["used"]["until"]


@pytest.mark.parametrize(
    ("n_samples", "sentence"),
    [
        (0, "no sample follows the law that fits its turning points"),
        (3, "has only 3 samples in a row that follow .* and 12 are needed"),
        (11, "has only 11 samples in a row that follow .* and 12 are needed"),
    ],
)
def test_a_window_with_too_few_samples_is_reported(n_samples, sentence):
    """Whatever removed the other samples."""
    problem = identify(decay_with_pause(2.03, 0.95), drag=False).problem
    with pytest.raises(HarnessError, match=sentence):
        problem.subset(slice(n_samples))
