"""A build ends like every command: exit status, one line, nothing left behind."""

import os
import signal
import subprocess
import sys
from contextlib import contextmanager

import pytest
from build_cache import ROOT
from logged_process import logged_process, wait_for_line

pytestmark = pytest.mark.slow


@pytest.fixture
def temporary(tmp_path):
    """The temporary directory of a build."""
    folder = tmp_path / "temporary"
    folder.mkdir()
    return folder


@contextmanager
def started_build(folder, *options):
    """Start a build of smd whose temporary files are in `folder` / temporary, and its FMU in `folder` / out."""
    arguments = (ROOT / "build_fmus.py", "smd", *options, "--out", folder / "out")
    with logged_process(folder, *arguments, TMPDIR=str(folder / "temporary")) as process:
        yield process


@pytest.mark.campaign
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize(
    ("options", "line"), [((), "the build of smd starts"), (("--native",), "the C compiler starts")]
)
def test_a_signal_ends_a_build_and_leaves_nothing_behind(temporary, tmp_path, options, line, number):
    with started_build(tmp_path, *options) as process:
        wait_for_line(process, line)
        os.killpg(process.pid, number)
        stdout, stderr = process.communicate(timeout=60)
    sentence = {signal.SIGINT: "Error: interrupted", signal.SIGTERM: "Error: terminated"}[number]
    assert (process.returncode, stdout, stderr.splitlines()[-1]) == (128 + number, "", sentence)
    assert "Traceback" not in stderr
    assert not list(temporary.iterdir())
    assert not (tmp_path / "out").exists()


def test_standard_output_that_is_full_is_one_sentence():
    with open("/dev/full", "w") as full:
        command = [sys.executable, ROOT / "build_fmus.py", "--help"]
        result = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, text=True, timeout=60)
    assert (result.returncode, result.stderr) == (1, "Error: No space left on device\n")


@pytest.mark.campaign
def test_optimized_bytecode_without_docstrings_builds_the_same_fmu(fmus, tmp_path):
    command = [sys.executable, "-OO", ROOT / "build_fmus.py", "smd", "--out", tmp_path]
    result = subprocess.run(command, capture_output=True, text=True, timeout=120)
    assert (result.returncode, result.stderr) == (0, "")
    assert (tmp_path / "smd.fmu").read_bytes() == (fmus / "smd.fmu").read_bytes()
