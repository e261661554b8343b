"""What happens to a sweep while it runs: it is killed, or loses those who do its runs."""

import os
import signal
import subprocess
import sys
import time
from contextlib import ExitStack, contextmanager
from functools import partial
from pathlib import Path

import commands
import deadly
import pytest
from builds import ROOT
from sweeps import folder_of

distributed = pytest.importorskip("distributed", reason="the extra 'sweep' is not installed")

from harness.errors import HarnessError  # noqa: E402
from harness.studies.sweep import study  # noqa: E402
from harness.studies.sweep.journal import Journal  # noqa: E402
from harness.studies.sweep.rerun import Runs  # noqa: E402
from harness.studies.sweep.space import Points, axis  # noqa: E402
from harness.studies.sweep.study import DIED, Sweep  # noqa: E402

ENVIRONMENT = os.environ | {"PYTHONPATH": str(ROOT)}


@pytest.fixture
def harness(fmus, tmp_path):
    """harness(argument, ...): the finished process, in a folder with the built FMUs."""
    (tmp_path / "fmus").symlink_to(fmus)

    return partial(commands.harness, tmp_path)


def begun(tmp_path, *arguments):
    """A sweep in a process of its own, once it has finished two blocks of runs, and its journal."""
    heard = partial(signal.signal, signal.SIGINT, signal.SIG_DFL)  # a test run in the background ignores it
    process = subprocess.Popen(
        [sys.executable, "-m", "harness", *map(str, arguments)],
        cwd=tmp_path,
        env=ENVIRONMENT,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        preexec_fn=heard,
    )
    while process.poll() is None:
        for journal in (tmp_path / "results/sweep").glob(".*.journal"):
            if journal.read_bytes().count(b"\n") > 1:
                return process, journal
        time.sleep(0.02)
    raise AssertionError(process.communicate()[1])


LONG = ("sweep", "stickslip", "--vary", "mu_d=0.3:0.8:100", "--measure", "peak_speed", "--workers", "1")


@pytest.fixture(scope="module")
def whole(place):
    """The files of that sweep, by their name, when nothing happens to it."""
    assert commands.harness(place, *LONG, blank=True).returncode == 0
    return files(place)


def files(place):
    return {file.name: file.read_bytes() for file in folder_of(place / "results", "stickslip-mu_d").glob("sweep.*")}


@pytest.mark.parametrize(("stop", "status"), [(signal.SIGKILL, -signal.SIGKILL), (signal.SIGINT, 130)])
def test_what_a_kill_left_is_kept_and_only_the_rest_is_run(harness, whole, tmp_path, stop, status):
    """The signal reaches the workers as well, as one from a terminal does."""
    process, journal = begun(tmp_path, *LONG)
    os.killpg(process.pid, stop)
    said = process.communicate(timeout=60)[1]
    assert process.returncode == status
    if stop == signal.SIGINT:
        assert said.startswith("Error: interrupted: ")
        assert said.count("\n") == 1
    kept = Journal(journal, 100, 1).done
    assert 0 < kept < 100
    with journal.open("a") as file:
        file.write("[299, [0.1")  # cut off in the middle of a line
    done = harness(*LONG, blank=True)
    assert (done.returncode, done.stderr) == (0, "")
    assert f"100 runs, {kept} of them done before" in done.stdout
    assert files(tmp_path) == whole
    assert list((tmp_path / "results/sweep").glob(".*")) == []


@pytest.mark.skipif(not Path("/proc/self/environ").exists(), reason="processes are found in /proc")
def test_no_worker_outlives_a_sweep_that_is_killed(harness, tmp_path):
    """The kill reaches the sweep alone; what it started is known by its environment."""
    mark = f"SWEEP_OF={tmp_path}".encode()

    def left():
        found = []
        for file in Path("/proc").glob("[0-9]*/environ"):
            try:
                found += [file.parent.name] if mark in file.read_bytes() else []
            except OSError:  # another's, or gone
                continue
        return found

    os.environ["SWEEP_OF"] = ENVIRONMENT["SWEEP_OF"] = str(tmp_path)
    try:
        process, _ = begun(tmp_path, "sweep", "pacejka", "--vary", "x_m=0.001:0.1:30000", "--workers", "2")
    finally:
        del os.environ["SWEEP_OF"], ENVIRONMENT["SWEEP_OF"]
    assert len(left()) >= 3
    process.kill()
    process.communicate(timeout=60)
    late = time.monotonic() + 60
    while left() and time.monotonic() < late:
        time.sleep(0.05)
    assert left() == []


@contextmanager
def worker(address, cwd):
    """A process of Dask's that works for the scheduler at an address."""
    words = (address, "--no-dashboard", "--nthreads", "2", "--no-nanny")
    command = [sys.executable, "-m", "distributed.cli.dask_worker", *words]
    with subprocess.Popen(command, cwd=cwd, env=ENVIRONMENT, stderr=subprocess.PIPE, text=True) as process:
        try:
            yield process
        finally:
            process.terminate()


def test_a_cluster_one_of_whose_workers_is_killed_does_the_same(harness, whole, tmp_path):
    with ExitStack() as held:
        cluster = distributed.LocalCluster("127.0.0.1", n_workers=0, dashboard_address=None)
        address = held.enter_context(cluster).scheduler_address
        workers = [held.enter_context(worker(address, tmp_path)) for _ in range(2)]
        for each in workers:
            next(line for line in each.stderr if "Registered to" in line)
        process, journal = begun(tmp_path, *LONG, "--scheduler", address)
        before = Journal(journal, 100, 1).done
        workers[0].kill()
        said = process.communicate(timeout=120)[1]
    assert (process.returncode, said) == (0, "")
    assert before < 100
    assert files(tmp_path) == whole


def test_a_sweep_listens_at_no_port(harness, tmp_path):
    """Workers are reached through pipes; a socket that has a file for an address is no port."""
    (tmp_path / "sitecustomize.py").write_text(
        "import sys\n"
        "def note(event, arguments):\n"
        "    if event in ('socket.bind', 'socket.connect'):\n"
        "        print(event, type(arguments[1]).__name__, file=open('bound', 'a'))\n"
        "sys.addaudithook(note)\n"
    )
    small = ("sweep", "smd", "--vary", "m=1:2:4", "--workers", 2, "--quiet")
    done = harness(*small, fresh=True, PYTHONPATH=f"{tmp_path}{os.pathsep}{ROOT}")
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
    file = tmp_path / "bound"
    assert "tuple" not in (file.read_text() if file.exists() else "")


def test_a_scheduler_that_does_not_answer_is_told(monkeypatch):
    """After 10 s, of which a test waits for one."""
    client, address = distributed.Client, "tcp://127.0.0.1:1"
    monkeypatch.setattr(distributed, "Client", lambda address, timeout: client(address, timeout=timeout / 10))
    with pytest.raises(HarnessError, match=f"no scheduler answers at {address}"), study.crew(address, 1, 1):
        pass


def test_a_run_that_kills_its_worker_is_found_and_told_and_the_others_are_done(monkeypatch):
    """Whatever block it is in, and whatever else was under way meanwhile."""
    monkeypatch.setattr(study, "work", deadly.work)
    sweep = Sweep(Runs("deadly", ("a",), (), ()), Points((axis("a=0:39:40", False),)), b"", 1)
    found = {}
    with study.crew(None, 2, 40) as hands:
        for block in study.Shift(sweep, hands, [(0, 40)]).finished():
            for i, value in enumerate(block.values[:, 0]):
                assert block.first + i not in found
                found[block.first + i] = block.sentences.get(i, value)
    assert found == {i: DIED if i in (7, 30) else 2.0 * i for i in range(40)}
