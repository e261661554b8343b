"""A program in a process of its own, with a temporary folder of its own: both end with the command that started it."""

import json
import os
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from math import inf
from pathlib import Path
from tempfile import TemporaryFile
from time import monotonic
from typing import Any, TypeVar

from ..errors import HarnessError
from .interrupt import check_interrupt, defer_signals
from .temporary_directory import temporary_directory

PROJECT_ROOT = Path(__file__).parents[2]  # of the harness, and of what builds FMUs
RequestT = TypeVar("RequestT")
POLL_INTERVAL = 0.1  # s between two looks at whether a signal has come: a thread that waits does not hear it


class SubprocessTimeoutError(HarnessError):
    """It has not ended in time; `done` is the process with what it had answered and said until it was ended."""

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
    """The ended process, what it answered to the text on its standard input, and what it said; Hangs after `timeout`
    s.  Its temporary files are where every compiler and library can read their path.  What is done `meanwhile` checks
    whether a signal has come."""
    late = monotonic() + timeout
    process = None
    with temporary_directory("child-") as folder, TemporaryFile("w+", encoding="utf-8") as asked:
        asked.write(text)  # all at once: what a pipe has no room for, a second communicate would not write
        asked.seek(0)
        try:
            with defer_signals():
                process = subprocess.Popen(
                    command,
                    stdin=asked,
                    stdout=subprocess.PIPE,
                    stderr=subprocess.PIPE,
                    encoding="utf-8",
                    errors="replace",
                    env={**environment, **dict.fromkeys(("TMPDIR", "TEMP", "TMP"), str(folder))},
                    start_new_session=True,  # a Ctrl-C is for this process alone, which then ends that one
                )
            while monotonic() <= late:
                try:
                    answered, said = process.communicate(timeout=POLL_INTERVAL)
                    return subprocess.CompletedProcess(command, process.returncode, answered, said)
                except subprocess.TimeoutExpired:
                    meanwhile()
        except BaseException:
            if process:
                kill_process_group(process)
            raise
        answered, said = kill_process_group(process)
        raise SubprocessTimeoutError(timeout, subprocess.CompletedProcess(command, process.returncode, answered, said))


def run_module(module: str, text: str, *arguments: str, **how: Any) -> subprocess.CompletedProcess[str]:
    """The same of a module of ours, wherever one is."""
    path = os.pathsep.join(filter(None, (str(PROJECT_ROOT), os.environ.get("PYTHONPATH", ""))))
    return run_subprocess([sys.executable, "-m", module, *arguments], text, os.environ | {"PYTHONPATH": path}, **how)


def serve_request(request: Callable[..., RequestT], answer: Callable[[RequestT], Any]) -> None:
    """In such a module: answer the one request on standard input, both in JSON.  What is printed meanwhile, as by FMUs,
    is no answer, and goes to standard error."""
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)
    json.dump(answer(request(**json.load(sys.stdin))), answers)
    answers.close()


def kill_process_group(process: subprocess.Popen[str]) -> tuple[str, str]:
    """Kill a process and, where there are groups of them, those that it started; what it answered and said."""
    if os.name == "posix":
        os.killpg(process.pid, 9)
    else:
        process.kill()
    return process.communicate()
