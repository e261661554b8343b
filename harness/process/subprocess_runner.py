"""Programs in child processes with temporary directories of their own. Both end with the command that started them."""

import json
import os
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from math import inf
from pathlib import Path
from tempfile import TemporaryFile
from threading import Thread
from time import monotonic, sleep
from typing import Any, TextIO, TypeVar

from ..errors import HarnessError
from .interrupt import check_interrupt, defer_signals
from .temporary_directory import temporary_directory

PROJECT_ROOT = Path(__file__).parents[2]  # contains harness and build_fmus
RequestT = TypeVar("RequestT")
PARENT_VARIABLE = "FRICTION_FMUS_PARENT"  # environment variable with the process id of the parent
ORPHAN_INTERVAL = 0.5  # s between two checks of a child process for its parent
POLL_INTERVAL = 0.1  # s between two checks for signals, which a blocked thread does not notice


class SubprocessTimeoutError(HarnessError):
    """The process timed out and was killed. `process` holds its output up to then."""

    def __init__(self, timeout: float, done: subprocess.CompletedProcess[str]) -> None:
        super().__init__(f"no answer after {timeout:g} s")
        self.process = done


def run_subprocess(
    command: Sequence[str],
    text: str = "",
    environment: Mapping[str, str] = os.environ,
    timeout: float = inf,
    meanwhile: Callable[[], object] = check_interrupt,
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
    meanwhile : callable
        Called while waiting; must check for signals.

    Raises
    ------
    SubprocessTimeoutError
        If the process runs longer than `timeout`. The process group is killed.
    """
    deadline = monotonic() + timeout
    process = None
    environment = {**environment, PARENT_VARIABLE: str(os.getpid())}
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
                    env={**environment, **dict.fromkeys(("TMPDIR", "TEMP", "TMP"), str(directory))},
                    start_new_session=True,  # Ctrl-C reaches this process only, which then kills the child
                )
            while monotonic() <= deadline:
                try:
                    stdout, stderr = process.communicate(timeout=POLL_INTERVAL)
                    return subprocess.CompletedProcess(command, process.returncode, stdout, stderr)
                except subprocess.TimeoutExpired:
                    meanwhile()
        except BaseException:
            if process:
                kill_process_group(process)
            raise
        stdout, stderr = kill_process_group(process)
        raise SubprocessTimeoutError(timeout, subprocess.CompletedProcess(command, process.returncode, stdout, stderr))


def run_module(module: str, text: str, *arguments: str, **how: Any) -> subprocess.CompletedProcess[str]:
    """Run a module of this project with the present interpreter, from any working directory; see `run_subprocess`."""
    path = os.pathsep.join(filter(None, (str(PROJECT_ROOT), os.environ.get("PYTHONPATH", ""))))
    return run_subprocess([sys.executable, "-m", module, *arguments], text, os.environ | {"PYTHONPATH": path}, **how)


def serve_request(
    request: Callable[..., RequestT], answer: Callable[[RequestT], Any], memory: int | None = None
) -> None:
    """In a child process, read one JSON request from standard input and write the JSON answer to standard output.

    Other output, such as that of FMUs, is redirected to standard error. The process exits if its parent is killed.

    Parameters
    ----------
    request : callable
        Makes a request from the keys of the JSON table.
    answer : callable
        Returns the answer to a request.
    memory : int, optional
        Limit of the memory of the process in bytes, where the system can limit it.
    """
    if memory:
        limit_memory(memory)
    with open_replies() as replies:
        json.dump(answer(request(**json.load(sys.stdin))), replies)


def limit_memory(size: int) -> None:
    """Limit the memory of this process to a size in bytes, where the system can."""
    with suppress(ImportError, ValueError, OSError):
        import resource

        resource.setrlimit(resource.RLIMIT_AS, (size, size))


def open_replies() -> TextIO:
    """In a child process, return standard output and redirect other output to standard error; exit with the parent."""
    Thread(target=exit_when_orphaned, args=(parent_process_id(),), daemon=True).start()
    replies = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)
    return replies


def parent_process_id() -> int:
    """Return the process id of the parent that started this process, even if the parent has been killed since.

    On Windows the launcher of a virtual environment is between the two processes, and a parent's id never changes.
    """
    started_by = os.environ.pop(PARENT_VARIABLE, "")  # not for programs that this process starts
    return int(started_by) if started_by and os.name == "posix" else os.getppid()


def exit_when_orphaned(parent: int) -> None:
    """Exit once the process has another parent: the one that started it was killed."""
    while os.getppid() == parent:
        sleep(ORPHAN_INTERVAL)
    os._exit(1)


def kill_process_group(process: subprocess.Popen[str]) -> tuple[str, str]:
    """Kill a process and, on POSIX, its process group. Return its standard output and standard error."""
    if os.name == "posix":
        os.killpg(process.pid, 9)
    else:
        process.kill()
    return process.communicate()
