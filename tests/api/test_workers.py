"""Worker processes of harness.sweep, in scripts of their own."""

import os

import commands
import pytest
from build_cache import ROOT
from logged_process import logged_process, wait_for_end, wait_for_line

pytest.importorskip("xarray")

SWEEP = "harness.sweep('coulomb', {'f': [0.5, 1.0]}, stop=0.2, workers=2, folder='swept')"


@pytest.mark.campaign
def test_a_script_without_a_main_guard_sweeps_twice_and_leaves_no_files(workspace):
    """Workers import the modules of the functions that they call, never the script."""
    (workspace / "temporary").mkdir()
    lines = [f"print(float({SWEEP}['final_x'][0]))\n" for _ in range(2)]
    (workspace / "script.py").write_text("import harness\n\n" + "".join(lines))
    result = commands.run_python(workspace, "script.py", PYTHONPATH=str(ROOT), TMPDIR=str(workspace / "temporary"))
    assert (result.returncode, result.stderr) == (0, "")
    first, second = result.stdout.split()
    assert first == second
    assert list((workspace / "temporary").iterdir()) == []


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(os, "pidfd_open"), reason="the system cannot wait for the end of a grandchild")
def test_the_files_of_a_killed_sweep_are_removed_by_its_workers_or_by_the_next_command(workspace):
    temporary = workspace / "temporary"
    temporary.mkdir()
    sweep = ("-m", "harness", "sweep", "pacejka", "--vary", "x_m=0.001:0.1:3000", "--workers", "2")
    with logged_process(workspace, *sweep, TMPDIR=str(temporary)) as process:
        workers = [os.pidfd_open(int(wait_for_line(process, "is ready").split()[2])) for _ in range(2)]
        assert list(temporary.glob("friction-fmus-child-*"))
        process.kill()
        process.wait()
        for worker in workers:  # they end once their parent is dead
            wait_for_end(worker)
    result = commands.run_process(workspace, "run", "smd", TMPDIR=str(temporary))
    assert (result.returncode, result.stderr) == (0, "")
    assert sorted(temporary.iterdir()) == []
