"""A record with a pause: the command line uses both sides, and counts the swings that nobody saw."""

import json
import os
import subprocess
import sys
from math import cos, exp, pi, sqrt
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
HALF, RATE = 0.25, 0.3  # s, of a half cycle; 1/s, of the decay


@pytest.mark.parametrize("begin", [2.03, 2.2])
@pytest.mark.parametrize("share", [0.45, 0.55, 0.95, 1.6, 3.3])
def test_a_pause_of_any_length_leaves_the_answer_right(tmp_path, begin, share):
    end = begin + share * HALF
    times = [t for t in (0.001 * i for i in range(5000)) if not begin < t < end]
    rows = [f"{t!r},{0.1 * exp(-RATE * t) * cos(pi * t / HALF)!r}" for t in times]
    (tmp_path / "paused.csv").write_text("\n".join(["time [s],x [m]", *rows]))
    done = subprocess.run(
        [sys.executable, "-m", "harness", "decay", "paused.csv", "--json"],
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert done.returncode == 0, done.stderr
    fit = {each["name"]: each["value"] for each in json.loads(done.stdout)["fit"]}
    omega = sqrt((pi / HALF) ** 2 + RATE**2)
    assert fit["omega"] == pytest.approx(omega, rel=1e-5)
    assert fit["zeta"] == pytest.approx(RATE / omega, rel=1e-3)
