"""Worker processes of harness.sweep, in scripts of their own."""

import os
import re
import select
import subprocess
import sys

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


SWEEP_WITH_LOG = """
import logging, sys
import harness

logging.basicConfig(stream=sys.stdout, format="%(message)s")
logging.getLogger("harness").setLevel("DEBUG")
harness.sweep("pacejka", {"x_m": [0.001 + 3e-5 * n for n in range(3000)]}, workers=2)
"""


@pytest.mark.skipif(not hasattr(os, "pidfd_open"), reason="the system cannot wait for the end of a grandchild")
def test_the_files_of_a_killed_sweep_are_removed_by_its_workers_or_by_the_next_command(workspace):
    temporary = workspace / "temporary"
    temporary.mkdir()
    environment = {"PYTHONPATH": str(ROOT), "TMPDIR": str(temporary)}
    with subprocess.Popen(
        [sys.executable, "-u", "-c", SWEEP_WITH_LOG],
        cwd=workspace,
        env=os.environ | environment,
        stdout=subprocess.PIPE,
        text=True,
    ) as process:
        try:
            ready = filter(None, (re.match(r"worker process (\d+) is ready", line) for line in process.stdout))
            workers = [os.pidfd_open(int(next(ready)[1])) for _ in range(2)]
            assert list(temporary.glob("friction-fmus-child-*"))
        finally:
            process.kill()
    for worker in workers:  # they end once their parent is dead
        select.select([worker], [], [])
        os.close(worker)
    done = commands.run_process(workspace, "run", "smd", **environment)
    assert (done.returncode, done.stderr) == (0, "")
    assert sorted(temporary.iterdir()) == []
