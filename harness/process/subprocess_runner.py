"""Programs in child processes, each with a temporary directory; the parent removes both when it ends."""

import os
import subprocess
import sys
from collections.abc import Mapping, Sequence
from contextlib import suppress
from math import inf
from pathlib import Path
from tempfile import TemporaryFile
from time import monotonic
from typing import Any

from ..errors import HarnessError
from .interrupt import check_interrupt, defer_signals
from .temporary_directory import temporary_directory

PROJECT_ROOT = Path(__file__).parents[2]  # contains harness and build_fmus
POLL_INTERVAL = 0.1  # s between two checks for signals, which a blocked thread does not notice


class SubprocessTimeoutError(HarnessError):
    """The process timed out and was killed. `process` holds its output."""

    def __init__(self, timeout: float, process: subprocess.CompletedProcess[str]) -> None:
        super().__init__(f"no answer after {timeout:g} s")
        self.process = process


def run_subprocess(
    command: Sequence[str],
    text: str = "",
    environment: Mapping[str, str] = os.environ,
    timeout: float = inf,
) -> subprocess.CompletedProcess[str]:
    """Run a command and return the completed process.

    The command's temporary files are in a directory whose path every compiler and library can read.

    Parameters
    ----------
    command : sequence of str
        Program and arguments.
    text : str
        Standard input.
    environment : mapping
        Environment variables.
    timeout : float
        Time limit in s.

    Raises
    ------
    SubprocessTimeoutError
        If the process runs longer than `timeout`. The process group is killed.
    """
    deadline = monotonic() + timeout
    process = None
    with temporary_directory("child-") as directory, TemporaryFile("w+", encoding="utf-8") as standard_input:
        standard_input.write(text)  # not a pipe: communicate() does not resume writing after its timeout
        standard_input.seek(0)
        try:
            with defer_signals():
                process = subprocess.Popen(
                    command,
                    stdin=standard_input,
                    stdout=subprocess.PIPE,
                    stderr=subprocess.PIPE,
                    encoding="utf-8",
                    errors="replace",
                    env=place_temporary_files(environment, directory),
                    start_new_session=True,  # Ctrl-C reaches this process only, which then kills the child
                )
            while monotonic() <= deadline:
                try:
                    stdout, stderr = process.communicate(timeout=POLL_INTERVAL)
                    return subprocess.CompletedProcess(command, process.returncode, stdout, stderr)
                except subprocess.TimeoutExpired:
                    check_interrupt()
        except BaseException:
            if process:
                kill_process_group(process)
                process.communicate()
            raise
        kill_process_group(process)
        stdout, stderr = process.communicate()
        raise SubprocessTimeoutError(timeout, subprocess.CompletedProcess(command, process.returncode, stdout, stderr))


def run_module(module: str, *arguments: str, **options: Any) -> subprocess.CompletedProcess[str]:
    """Run a module of this project with the current interpreter, from any working directory; see `run_subprocess`."""
    return run_subprocess([sys.executable, "-m", module, *arguments], environment=project_environment(), **options)


def project_environment() -> dict[str, str]:
    """Return the environment of a Python process that finds this project."""
    path = os.pathsep.join(filter(None, (str(PROJECT_ROOT), os.environ.get("PYTHONPATH", ""))))
    return os.environ | {"PYTHONPATH": path}


def place_temporary_files(environment: Mapping[str, str], directory: Path) -> dict[str, str]:
    """Return the environment of a process whose temporary files are in a directory."""
    return {**environment, **dict.fromkeys(("TMPDIR", "TEMP", "TMP"), str(directory))}


def kill_process_group(process: subprocess.Popen[Any]) -> None:
    """Kill a process and, on POSIX, the processes that it started."""
    if os.name == "posix":
        with suppress(ProcessLookupError):  # all have ended
            os.killpg(process.pid, 9)
    else:
        process.kill()
