"""Worker processes of harness.sweep, in scripts of their own."""

import os
import subprocess
import sys
import time
from pathlib import Path

import commands
import pytest
from build_cache import ROOT

pytest.importorskip("xarray")
pytest.importorskip("distributed")

SWEEP = "harness.sweep('coulomb', {'f': [0.5, 1.0]}, stop=0.2, workers=2, folder='swept')"


def test_a_script_without_a_main_guard_sweeps_twice_and_leaves_no_files(workspace):
    """Workers import the modules of the functions that they call, never the script."""
    (workspace / "temporary").mkdir()
    lines = [f"print(float({SWEEP}['final_x'][0]))\n" for _ in range(2)]
    (workspace / "script.py").write_text("import harness\n\n" + "".join(lines))
    done = commands.run_python(workspace, "script.py", PYTHONPATH=str(ROOT), TMPDIR=str(workspace / "temporary"))
    assert (done.returncode, done.stderr) == (0, "")
    first, second = done.stdout.split()
    assert first == second
    assert list((workspace / "temporary").iterdir()) == []


def is_running(process):
    """Return whether a process has not ended; one that nobody waits for is a zombie."""
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


@pytest.mark.skipif(not Path("/proc/self/task").is_dir(), reason="the system does not list processes as files")
def test_the_files_of_a_killed_sweep_are_removed_by_its_workers_or_by_the_next_command(workspace):
    temporary = workspace / "temporary"
    temporary.mkdir()
    environment = {"PYTHONPATH": str(ROOT), "TMPDIR": str(temporary)}
    sweep = ["sweep", "pacejka", "--vary", "x_m=0.001:0.1:3000", "--workers", "2"]
    process = subprocess.Popen(
        [sys.executable, "-m", "harness", *sweep],
        cwd=workspace,
        env=os.environ | environment,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    workers = []  # a worker starts after its files
    while process.poll() is None and not workers:
        time.sleep(0.01)
        files = Path(f"/proc/{process.pid}/task").glob("*/children")
        workers = [worker for file in files for worker in file.read_text().split()]
    assert process.poll() is None
    assert list(temporary.glob("friction-fmus-child-*"))
    process.kill()
    process.wait()
    while any(map(is_running, workers)):  # they end once their parent is dead
        time.sleep(0.05)
    done = commands.run_process(workspace, "run", "smd", **environment)
    assert (done.returncode, done.stderr) == (0, "")
    assert sorted(temporary.iterdir()) == []
