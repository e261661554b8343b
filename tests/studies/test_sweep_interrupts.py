"""Sweeps that are killed or lose their workers."""

import json
import os
import signal
from contextlib import contextmanager
from functools import partial
from zipfile import ZipFile

import build_cache
import commands
import external_fmus
import numpy as np
import pytest
from logged_process import logged_process, wait_for_end, wait_for_line
from sweep_results import sweep_folder

from harness import sweep

pytestmark = pytest.mark.slow

SWEEP = ("sweep", "stickslip", "--vary", "mu_d=0.3:0.8:100", "--measures", "peak_speed")
LONG = (*SWEEP, "--workers", "1")
NOTE = """
import sys
def note(event, arguments):
    if event in ('socket.bind', 'socket.connect'):
        print(event, type(arguments[1]).__name__, file=open('bound', 'a'))
sys.addaudithook(note)
"""


@pytest.fixture
def harness(workspace):
    """Return harness(argument, ...): the finished process, in a folder with the built FMUs."""
    return partial(commands.harness, workspace)


@pytest.fixture
def complete_files(fmus):
    """Return the files of an undisturbed sweep, by name."""

    def make(folder):
        (folder / "fmus").symlink_to(fmus)
        assert commands.harness(folder, *LONG).returncode == 0

    return files(build_cache.cached_folder("swept", make))


def files(folder):
    return {file.name: file.read_bytes() for file in sweep_folder(folder / "results", "stickslip-mu_d").glob("sweep.*")}


def checkpoint_file(folder):
    """Return the checkpoint of a sweep that has begun; None before."""
    return next((folder / "results/sweep").glob(".*.checkpoint"), None)


def finished_runs(folder):
    """Return the number of finished runs in the checkpoint of a sweep that has ended."""
    lines = checkpoint_file(folder).read_text().splitlines(keepends=True)
    return sum(len(json.loads(line)[1]) for line in lines if line.endswith("\n"))


@contextmanager
def started_sweep(folder):
    """Start the long sweep in a child process and wait until two of its blocks are finished; kill it at the end.

    The file `bound` lists the addresses at which its processes listen.
    """
    with logged_process(folder, "-m", "harness", *LONG, site_code=NOTE) as process:
        worker = wait_for_line(process, "is ready").split()[2]
        for _ in range(2):
            wait_for_line(process, "of 100 runs are finished")
        yield process, os.pidfd_open(int(worker))


@pytest.mark.skipif(not hasattr(os, "pidfd_open"), reason="the system cannot wait for the end of a grandchild")
def test_a_killed_sweep_resumes_and_leaves_no_worker(harness, complete_files, tmp_path):
    """A kill reaches only the sweep, Ctrl-C in a terminal also its workers."""
    with started_sweep(tmp_path) as (process, worker):
        process.kill()
        process.wait()
        wait_for_end(worker)
    first = finished_runs(tmp_path)

    with started_sweep(tmp_path) as (process, worker):
        os.killpg(process.pid, signal.SIGINT)
        error = process.communicate(timeout=60)[1]
        wait_for_end(worker)
    assert (process.returncode, error.count("\n")) == (130, 1)
    assert error.startswith("Error: interrupted: ")
    done_runs = finished_runs(tmp_path)
    assert 0 < first < done_runs < 100

    result = harness(*LONG)
    assert (result.returncode, result.stderr) == (0, "")
    assert f"100 runs, {done_runs} of them resumed" in result.stdout
    assert files(tmp_path) == complete_files
    assert checkpoint_file(tmp_path) is None
    bound = tmp_path / "bound"  # workers use pipes; a socket whose address is a file is no port
    assert "tuple" not in (bound.read_text() if bound.exists() else "")


@pytest.mark.campaign
def test_a_run_that_kills_its_worker_is_reported_and_the_others_finish(fmus, tmp_path):
    """In any block, and with any other work in progress; the process of this test is spared.

    The first run kills its worker only once, as a system does that lacks memory.
    """
    check = f"""killed = os.path.join({str(tmp_path)!r}, "killed by " + str(self.k))
        if os.getpid() != {os.getpid()} and (self.k in (7.0, 30.0) or self.k == 1.0 and not os.path.exists(killed)):
            os.makedirs(killed, exist_ok=True)
            os.kill(os.getpid(), 9)
        return OK"""

    def deadly(code):
        assert "def prepare(self):\n        return OK" in code
        return "import os\n" + code.replace("return OK", check)

    with ZipFile(fmus / "smd.fmu") as archive:
        (source,) = (name for name in archive.namelist() if name.endswith("/smd.py"))
    fmu = external_fmus.edited_copy(fmus / "smd.fmu", tmp_path / "deadly.fmu", {source: deadly})
    data = sweep(fmu, {"k": range(1, 41)}, stop=0.1, workers=2)
    errors = {int(k): str(data["error"].sel(k=k).item()) for k in data["k"].values}
    assert {k: text for k, text in errors.items() if text} == dict.fromkeys((7, 30), "the process died in this run")
    expected = sweep(fmus / "smd.fmu", {"k": range(1, 41)}, stop=0.1)["final_x"]
    assert (np.isnan(data["final_x"]) | (data["final_x"] == expected)).all()
    assert (tmp_path / "killed by 1.0").exists()
