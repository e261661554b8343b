"""A build ends like every command: exit status, one line, nothing left behind."""

import os
import signal
import subprocess
import sys
import time
from contextlib import ExitStack, suppress
from functools import partial

import pytest
from build_cache import ROOT

pytestmark = pytest.mark.slow


@pytest.fixture
def environment(tmp_path):
    """Environment of a build with a temporary directory of its own."""
    (tmp_path / "temporary").mkdir()
    return os.environ | {"TMPDIR": str(tmp_path / "temporary")}


@pytest.fixture
def start_build(environment):
    """Return a function that starts a build; kill at the end what a failed test leaves.

    A build has a process group of its own, and handles signals although pytest may ignore them.
    """
    with ExitStack() as stack:

        def start(*arguments, **streams):
            reset_sigint = partial(signal.signal, signal.SIGINT, signal.SIG_DFL)
            command = [sys.executable, ROOT / "build_fmus.py", *arguments]
            streams = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True} | streams
            process = subprocess.Popen(
                command, env=environment, start_new_session=True, preexec_fn=reset_sigint, **streams
            )
            stack.enter_context(process)
            stack.callback(kill_group, process)
            return process

        yield start


def kill_group(process):
    """Kill a process with its children, unless all have ended."""
    with suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)


def wait_for_directory(process, tmp_path):
    while process.poll() is None and not list((tmp_path / "temporary").glob("friction-fmus-build-*")):
        time.sleep(0.01)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize(("options", "delay"), [((), 0.05), (("--native",), 0.5)])  # within the build, of 0.3 s and 3 s
def test_a_signal_ends_a_build_and_leaves_nothing_behind(start_build, tmp_path, options, delay, number):
    process = start_build("smd", *options, "--out", tmp_path / "out")
    wait_for_directory(process, tmp_path)
    time.sleep(delay)  # into the code generation or the compiler
    os.killpg(process.pid, number)
    stdout, stderr = process.communicate(timeout=60)
    sentence = {signal.SIGINT: "Error: interrupted", signal.SIGTERM: "Error: terminated"}[number]
    assert (process.returncode, stdout, stderr.splitlines()[-1]) == (128 + number, "", sentence)
    assert "Traceback" not in stderr
    assert not list((tmp_path / "temporary").iterdir())
    assert not (tmp_path / "out").exists()


def test_the_directory_of_a_killed_build_is_removed_by_the_next_run_and_that_of_a_running_one_kept(
    environment, start_build, tmp_path
):
    killed, running = (start_build("smd", "--native", "--out", tmp_path / "out") for _ in range(2))
    for process in (killed, running):
        wait_for_directory(process, tmp_path)
    while len(directories := {file.parent for file in (tmp_path / "temporary").glob("friction-fmus-build-*/*")}) < 2:
        time.sleep(0.01)  # a directory with files is locked; an empty one may not be
    os.killpg(running.pid, signal.SIGSTOP)
    os.killpg(killed.pid, signal.SIGKILL)
    killed.communicate(timeout=60)
    program = "from harness.process.temporary_directory import temporary_directory as create\nwith create(): pass"
    subprocess.run([sys.executable, "-c", program], cwd=ROOT, env=environment, check=True, timeout=60)
    files = list((tmp_path / "temporary").iterdir())
    assert len(files) == 1
    assert files[0] in directories
    os.killpg(running.pid, signal.SIGCONT)
    os.killpg(running.pid, signal.SIGTERM)
    running.communicate(timeout=60)
    assert not list((tmp_path / "temporary").iterdir())


def test_standard_output_that_is_full_is_one_sentence(start_build, tmp_path):
    with open("/dev/full", "w") as full:
        process = start_build("--help", stdout=full)
        assert process.communicate(timeout=60)[1] == "Error: No space left on device\n"
    assert process.returncode == 1


def test_optimized_bytecode_without_docstrings_builds_the_same_fmu(fmus, tmp_path):
    command = [sys.executable, "-OO", ROOT / "build_fmus.py", "smd", "--out", tmp_path]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120)
    assert (done.returncode, done.stderr) == (0, "")
    assert (tmp_path / "smd.fmu").read_bytes() == (fmus / "smd.fmu").read_bytes()
