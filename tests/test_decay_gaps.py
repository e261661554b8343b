"""A record with a pause: the command line takes one that misses no turning point, and refuses one that may."""

import os
import subprocess
import sys
from math import cos, exp, pi
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
HALF = 0.25  # s, of a half cycle


@pytest.mark.parametrize(("share", "taken"), [(0.45, True), (0.55, False), (0.95, False)])
def test_a_pause_of_half_a_half_cycle_is_the_longest(tmp_path, share, taken):
    where, gap = 1.03, share * HALF
    times = [t for t in (0.001 * i for i in range(3000)) if not where < t < where + gap]
    rows = [f"{t!r},{0.1 * exp(-0.3 * t) * cos(pi * t / HALF)!r}" for t in times]
    (tmp_path / "paused.csv").write_text("\n".join(["time [s],x [m]", *rows]))
    done = subprocess.run(
        [sys.executable, "-m", "harness", "decay", "paused.csv", "--json"],
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert (done.returncode == 0) is taken, done.stderr
    if not taken:
        assert "gap" in done.stderr
        assert done.stderr.count("\n") == 1
