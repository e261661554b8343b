"""Worker processes of harness.sweep, in scripts of their own."""

import os
import subprocess
import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory

import commands
import pytest
from build_cache import ROOT

pytest.importorskip("xarray")
pytest.importorskip("distributed")

SWEEP = "harness.sweep('coulomb', {'f': [0.5, 1.0]}, stop=0.2, workers=2, folder='swept')"


def test_a_script_without_a_main_guard_ends_with_its_remedy(workspace):
    """Each worker imports the script, which would start workers in turn."""
    (workspace / "script.py").write_text(f"import harness\n\n{SWEEP}\n")
    done = commands.run_python(workspace, "script.py", PYTHONPATH=str(ROOT))
    assert done.returncode == 1
    *_, last = done.stderr.splitlines()
    assert "the worker processes end before their first run" in last
    assert "if __name__ == '__main__':" in last
    assert done.stderr.count("Traceback") == 1


@pytest.fixture
def temporary():
    """A temporary directory whose path is short enough for sockets."""
    with TemporaryDirectory(dir="/tmp") as folder:
        yield Path(folder)


def test_two_sweeps_of_a_script_share_their_sockets_and_leave_none(workspace, temporary):
    lines = [f"    print(float({SWEEP}['final_x'][0]))\n" for _ in range(2)]
    (workspace / "script.py").write_text("import harness\n\nif __name__ == '__main__':\n" + "".join(lines))
    done = commands.run_python(workspace, "script.py", PYTHONPATH=str(ROOT), TMPDIR=str(temporary))
    assert (done.returncode, done.stderr) == (0, "")
    first, second = done.stdout.split()
    assert first == second
    assert list(temporary.iterdir()) == []


def test_the_sockets_of_a_killed_sweep_are_removed_by_the_next_command(workspace, temporary):
    environment = {"PYTHONPATH": str(ROOT), "TMPDIR": str(temporary)}
    sweep = ["sweep", "pacejka", "--vary", "x_m=0.001:0.1:3000", "--workers", "2"]
    process = subprocess.Popen(
        [sys.executable, "-m", "harness", *sweep],
        cwd=workspace,
        env=os.environ | environment,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    while process.poll() is None and not list(temporary.glob("*/listener-*")):
        time.sleep(0.01)
    assert process.poll() is None
    process.kill()
    process.wait()
    assert list(temporary.glob("*/listener-*"))
    done = commands.run_process(workspace, "run", "smd", **environment)
    assert (done.returncode, done.stderr) == (0, "")
    deadline = time.monotonic() + 60  # workers remove their own files once their parent is dead
    while (left := sorted(temporary.iterdir())) and time.monotonic() < deadline:
        time.sleep(0.1)
    assert left == []
