"""Child processes that answer requests, for code that may crash or hang.

Requests and replies are lines of JSON on standard input and output. A process answers any number of requests. Each
request has a time limit, which every progress report renews. All other output of the process is captured.
"""

import json
import os
import subprocess
import sys
from collections.abc import Callable
from contextlib import ExitStack, suppress
from dataclasses import is_dataclass
from math import inf
from pathlib import Path
from queue import Empty, SimpleQueue
from threading import Thread
from time import monotonic, sleep
from types import TracebackType
from typing import IO, Any

from ..errors import HarnessError
from .interrupt import check_interrupt, defer_signals
from .subprocess_runner import POLL_INTERVAL, kill_process_group, place_temporary_files, project_environment
from .temporary_directory import temporary_directory

PARENT_VARIABLE = "FRICTION_FMUS_PARENT"  # environment variable with the process id of the parent
READY, PROGRESS, REPLY, ERROR = "ready", "progress", "reply", "error"  # kinds of lines from a child process
START_TIMEOUT = 60.0  # s until a process that was started is ready
EXIT_TIMEOUT = 5.0  # s until a process that closes its standard output has ended
REPORT_INTERVAL = 0.2  # s between progress reports
MAX_OUTPUT_BYTES = 1_000_000  # captured output of a process; checked when it reports progress
ORPHAN_INTERVAL = 0.5  # s between two checks of a child process for its parent


class Progress(float):
    """Progress from 0 to 1, with a note on the state of the work; empty if there is none."""

    note: str

    def __new__(cls, share: float, note: str = "") -> "Progress":
        progress = super().__new__(cls, share)
        progress.note = note
        return progress


class ChildError(HarnessError):
    """The process did not answer and has ended or was killed. `messages` is its captured output."""

    def __init__(self, text: str, messages: str) -> None:
        super().__init__(text)
        self.messages = messages


class ChildTimeoutError(ChildError):
    """The process did not answer in time."""


class ChildDiedError(ChildError):
    """The process ended with an exit `status`, which is negative after a signal."""

    def __init__(self, status: int, messages: str) -> None:
        self.status, self.last_line = status, (messages.strip().splitlines() or ["no message"])[-1]
        super().__init__(f"it ended with exit status {status}: {self.last_line}", messages)


class ChildProcess:
    """A process that answers requests, and a context manager that kills it. The next request replaces an ended process.

    Parameters
    ----------
    module : str
        Module that the process runs; it calls `RequestServer.serve`.

    Attributes
    ----------
    messages : str
        Captured output of the last request.
    """

    def __init__(self, module: str) -> None:
        self.module, self.messages = module, ""
        self.process: subprocess.Popen[str] | None = None
        self.resources = ExitStack()

    def ask(self, request: Any, timeout: float = inf, report: Callable[[float], object] = lambda share: None) -> Any:
        """Return the reply to a request.

        Parameters
        ----------
        request : object
            Dataclasses, dicts, lists, arrays, paths, texts and numbers.
        timeout : float
            Time limit in s, also between two progress reports.
        report : callable
            Receives a Progress.

        Raises
        ------
        ChildError
            If the process crashes or times out. The next request starts another process.
        HarnessError
            If the reply is an error.
        """
        try:
            if self.process is None or self.process.poll() is not None:
                self.start()
            self.output_file.write_bytes(b"")
            self.send(request)
            kind = PROGRESS
            while kind == PROGRESS:
                kind, content = self.receive(timeout)
                if kind == PROGRESS:
                    report(Progress(*content))
            self.messages = self.read_messages()
        except BaseException:
            self.kill()
            raise
        if kind == ERROR:
            raise HarnessError(content)
        return content

    def start(self) -> None:
        """Start the process and wait until it is ready."""
        self.kill()
        directory = self.resources.enter_context(temporary_directory("child-"))
        self.output_file = directory / "output"
        environment = project_environment() | {PARENT_VARIABLE: str(os.getpid())}
        with self.output_file.open("ab") as output, defer_signals():
            self.process = subprocess.Popen(
                [sys.executable, "-m", self.module],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=output,
                encoding="utf-8",
                env=place_temporary_files(environment, directory),
                start_new_session=True,  # Ctrl-C reaches this process only, which then kills the child
            )
        self.lines: SimpleQueue[str] = SimpleQueue()
        Thread(target=read_lines, args=(self.process.stdout, self.lines), daemon=True).start()
        self.receive(START_TIMEOUT)

    def send(self, request: Any) -> None:
        """Send a request. The process reads it at once, because it has answered the previous one."""
        assert self.process is not None
        assert self.process.stdin is not None
        with suppress(OSError):  # it died, and `receive` says why
            self.process.stdin.write(json.dumps(request, default=to_plain) + "\n")
            self.process.stdin.flush()

    def receive(self, timeout: float) -> tuple[str, Any]:
        """Return kind and content of the next line; raise ChildError if there is none within `timeout` s."""
        deadline = monotonic() + timeout
        while True:
            with suppress(Empty):
                line = self.lines.get(timeout=max(0.0, min(POLL_INTERVAL, deadline - monotonic())))
                if not line:
                    raise ChildDiedError(self.wait(), self.read_messages())
                kind, content = json.loads(line)
                return kind, content
            check_interrupt()
            if monotonic() > deadline:
                raise ChildTimeoutError(f"no answer after {timeout:g} s", self.read_messages())

    def wait(self) -> int:
        """Return the exit status of a process that has closed its standard output."""
        assert self.process is not None
        with suppress(subprocess.TimeoutExpired):
            return self.process.wait(EXIT_TIMEOUT)
        kill_process_group(self.process)
        return self.process.wait()

    def read_messages(self) -> str:
        """Return the output that was captured since the last request was sent."""
        return self.output_file.read_text(encoding="utf-8", errors="replace")

    def finish(self) -> None:
        """Close standard input, on which the process ends; raise ChildError if it crashes or hangs."""
        if self.process is None:
            return
        assert self.process.stdin is not None
        try:
            with suppress(OSError):
                self.process.stdin.close()
            with suppress(ChildDiedError):
                self.receive(START_TIMEOUT)
            if status := self.wait():
                raise ChildDiedError(status, self.read_messages())
        finally:
            self.kill()

    def kill(self) -> None:
        """Kill the process and its child processes, and remove its files."""
        process, self.process = self.process, None
        if process is not None:
            kill_process_group(process)
            process.wait()
            assert process.stdin is not None
            with suppress(OSError):  # closing sends the rest of a request, which may fail
                process.stdin.close()
        self.resources.close()

    def __enter__(self) -> "ChildProcess":
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.kill()


def ask_once(module: str, request: Any, timeout: float) -> Any:
    """Return the reply of a process that answers one request; see `ChildProcess.ask`."""
    with ChildProcess(module) as child:
        return child.ask(request, timeout)


def read_lines(stream: IO[str], lines: SimpleQueue[str]) -> None:
    """Put the lines of a stream into a queue, and an empty text at the end."""
    with stream:
        for line in stream:
            lines.put(line)
    lines.put("")


def to_plain(value: Any) -> Any:
    """Return the fields of a dataclass, the list of an array, or the text of a path, for JSON."""
    if is_dataclass(value):
        return vars(value)
    return str(value) if isinstance(value, Path) else value.tolist()


class RequestServer:
    """Answers the requests of the parent, in a child process.

    Other output, such as that of FMUs, is redirected to standard error, and standard input is empty for other readers.
    The process exits if its parent is killed.

    Parameters
    ----------
    memory : int, optional
        Limit of the memory of the process in bytes, where the system can limit it.
    """

    def __init__(self, memory: int | None = None) -> None:
        if memory:
            limit_memory(memory)
        Thread(target=exit_when_orphaned, args=(parent_process_id(),), daemon=True).start()
        self.requests = os.fdopen(os.dup(0), encoding="utf-8")
        self.replies = os.fdopen(os.dup(1), "w", encoding="utf-8")
        null_device = os.open(os.devnull, os.O_RDONLY)
        os.dup2(null_device, 0)
        os.dup2(2, 1)
        self.next_report = 0.0

    def serve(self, answer: Callable[[Any], Any]) -> None:
        """Send answer(request) for each request until the parent closes standard input.

        A HarnessError becomes an error reply; another exception ends the process.
        """
        self.send(READY, None)
        for line in self.requests:
            try:
                self.send(REPLY, answer(json.loads(line)))
            except HarnessError as error:
                self.send(ERROR, str(error))

    def report(self, progress: float, note: str = "") -> None:
        """Report a progress from 0 to 1 with a note, which renews the time limit of the request."""
        now = monotonic()
        if now < self.next_report:
            return
        self.next_report = now + REPORT_INTERVAL
        self.send(PROGRESS, (progress, note))
        if os.fstat(2).st_size > MAX_OUTPUT_BYTES:
            os.ftruncate(2, 0)

    def send(self, kind: str, content: Any) -> None:
        """Send a line to the parent."""
        self.replies.write(json.dumps((kind, content), default=to_plain) + "\n")
        self.replies.flush()


def limit_memory(size: int) -> None:
    """Limit the memory of this process to a size in bytes, where the system can."""
    with suppress(ImportError, ValueError, OSError):
        import resource

        resource.setrlimit(resource.RLIMIT_AS, (size, size))


def parent_process_id() -> int:
    """Return the process id of the parent that started this process, even if the parent has been killed since.

    On Windows the launcher of a virtual environment is between the two processes, and a parent's id never changes.
    """
    started_by = os.environ.pop(PARENT_VARIABLE, "")  # not for programs that this process starts
    return int(started_by) if started_by and os.name == "posix" else os.getppid()


def exit_when_orphaned(parent: int) -> None:
    """Exit once the parent that started the process has been killed, so that it has another parent."""
    while os.getppid() == parent:
        sleep(ORPHAN_INTERVAL)
    os._exit(1)  # sys.exit would end this thread only, and the main thread may be in a call of an FMU
