"""The analyses of step sizes and of slips."""

import json

import commands
import numpy as np
import pytest

import harness
from harness.analyses.slip import peak_value, slips_from_modes, upward_crossings


@pytest.mark.parametrize("speed", [0.1, 0.0])
def test_step_collapse_compares_the_median_step_with_the_smallest_at_reversals(workspace, speed):
    """A body at rest has no reversal."""
    scene = "title = 'a title'\nmodel = 'smd'\nmethod = 'ode23'\nstop = 4.0\noutputs = ['x', 'v']\nplots = []\n"
    values = f"analyses = ['steps']\n[values]\nx0 = 0.0\nv0 = {speed}\n"
    (workspace / "scene.toml").write_text(scene + values)
    result = commands.harness(workspace, "run", "scene.toml", "--json")
    quantities = {item["name"]: item["value"] for item in json.loads(result.stdout)["quantities"]}
    run = harness.load_result(workspace / "results/scene")
    turns = [t for t, before, after in zip(run.time[1:], run["v"], run["v"][1:], strict=False) if before * after < 0]
    assert bool(turns) == ("collapse" in quantities) == bool(speed)
    if turns:
        steps = [np.searchsorted(run.steps.t, t) - 1 for t in turns]
        smallest = [min(run.steps.h[max(i - 5, 0) : i + 6]) for i in steps]
        expected = np.median(run.steps.h) / np.median(smallest)
        assert quantities["collapse"] == pytest.approx(expected)


@pytest.mark.parametrize(
    ("mode", "starts", "durations"),
    [
        ([0, 1, 0, 1, 0], [1, 3], [1, 1]),
        ([0, 1, 0, 1], [1, 3], [1]),  # the last slip is cut off
        ([1, 0, 1, 0], [2], [1]),  # a slip already in progress did not start here
        ([0, 1, -1, 0, -1], [1, 4], [2]),  # a reversal continues the slip
        ([0], [], []),
    ],
)
def test_slips_last_from_stick_to_stick(mode, starts, durations):
    result = slips_from_modes(np.arange(float(len(mode))), np.array(mode))
    assert [list(values) for values in result] == [starts, durations]


def test_upward_zero_crossings_are_interpolated():
    assert list(upward_crossings(np.arange(6.0), np.array([-1.0, 1.0, -3.0, 1.0, 0.0, 2.0]))) == [0.5, 2.75]


def test_the_vertex_of_a_parabola_is_interpolated_between_uneven_samples():
    t = np.array([0.0, 1.0, 1.5, 3.0])
    y = 7 - 2 * (t - 1.3) ** 2
    assert peak_value(t, y, np.full(4, True)) == pytest.approx(7.0, abs=1e-12)
    assert peak_value(t, y, np.array([True, True, False, False])) == y[1]  # not across the edge of the selection
