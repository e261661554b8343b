"""Worker processes, for code that may crash or hang, and for many runs at a time.

A worker imports the functions that it calls by their names, so they are defined in modules, not in scripts.
"""

import logging
import pickle
import subprocess
import sys
from collections import deque
from collections.abc import Callable, Collection
from concurrent.futures import Future
from contextlib import ExitStack, suppress
from math import inf
from queue import Empty, SimpleQueue
from threading import Thread
from time import monotonic
from types import TracebackType
from typing import Any

from ..errors import HarnessError
from . import worker_process
from .interrupt import check_interrupt, defer_signals
from .subprocess_runner import POLL_INTERVAL, kill_process_group, place_temporary_files, project_environment
from .temporary_directory import temporary_directory
from .worker_process import ERROR, FAILURE, PROGRESS, READY

LOG = logging.getLogger(__name__)
START_TIMEOUT = 60.0  # s until a process that was started is ready
EXIT_TIMEOUT = 5.0  # s until a process that closes its standard output has ended


class Progress(float):
    """Progress from 0 to 1, with a note on the state of the work; empty if there is none."""

    note: str

    def __new__(cls, share: float, note: str = "") -> "Progress":
        progress = super().__new__(cls, share)
        progress.note = note
        return progress


class WorkerError(HarnessError):
    """A call in a worker process returned nothing.

    Attributes
    ----------
    messages, last_line : str
        Captured output of the process, and its last line.
    """

    def __init__(self, text: str, messages: str) -> None:
        super().__init__(text)
        self.messages, self.last_line = messages, (messages.strip().splitlines() or ["no message"])[-1]


class WorkerCallError(WorkerError):
    """The function raised an exception that is no HarnessError; `last_line` is its type and text."""

    def __init__(self, text: str, messages: str) -> None:
        super().__init__(f"a worker failed: {text}", messages)
        self.last_line = text


class WorkerTimeoutError(WorkerError):
    """The process did not answer in time and was killed."""


class WorkerDiedError(WorkerError):
    """The process ended with an exit `status`, which is negative after a signal."""

    def __init__(self, status: int, messages: str) -> None:
        super().__init__("", messages)
        self.status, self.args = status, (f"it ended with exit status {status}: {self.last_line}",)


class WorkerStartError(WorkerError):
    """The process ended before its first call."""

    def __init__(self, error: WorkerDiedError) -> None:
        super().__init__(f"a worker process cannot start: {error}", error.messages)


class WorkerProcess:
    """A started process. Defer signals until its owner, which kills it, has stored it.

    Parameters
    ----------
    replies : queue.SimpleQueue
        Receives pairs of this object and a pickled reply; None in place of a reply when the process ends.
    memory : int
        Limit of the memory of the process in bytes, where the system can limit it; 0 for none.

    Attributes
    ----------
    is_ready : bool
        Whether the process has been ready for a call.
    """

    def __init__(self, replies: "SimpleQueue[tuple[WorkerProcess, bytes | None]]", memory: int = 0) -> None:
        self.resources, self.is_ready = ExitStack(), False
        directory = self.resources.enter_context(temporary_directory("child-"))
        self.output_file = directory / "output"
        command = [sys.executable, "-m", worker_process.__name__, str(directory), str(memory)]
        with self.output_file.open("ab") as output:
            self.process = subprocess.Popen(
                command,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=output,
                env=place_temporary_files(project_environment(), directory),
                start_new_session=True,  # Ctrl-C reaches this process only, which then kills the child
            )
        Thread(target=self.read_replies, args=(replies,), daemon=True).start()

    def read_replies(self, replies: "SimpleQueue[tuple[WorkerProcess, bytes | None]]") -> None:
        """Queue all replies, then None."""
        assert self.process.stdout is not None
        with self.process.stdout as stream:
            for reply in worker_process.read_messages(stream):
                replies.put((self, reply))
        replies.put((self, None))

    def start_call(self, function: Callable[..., Any], arguments: tuple[Any, ...], wants_report: bool = False) -> None:
        """Let the process call a function. It reads the request at once, because it has answered the previous one."""
        assert self.process.stdin is not None
        request = pickle.dumps((function, arguments, wants_report), pickle.HIGHEST_PROTOCOL)
        self.output_file.write_bytes(b"")
        with suppress(OSError):  # the process has ended, and its reply will be None
            worker_process.write_message(self.process.stdin, request)

    def read_reply(self, reply: bytes | None) -> tuple[str, Any]:
        """Return kind and content of a reply; raise WorkerError if the process has ended."""
        if reply is None:
            error = WorkerDiedError(self.wait(), self.read_output())
            raise error if self.is_ready else WorkerStartError(error)
        kind, content = pickle.loads(reply)
        if kind == READY:
            self.is_ready = True
            LOG.debug("worker process %d is ready", self.process.pid)
        return (ERROR, WorkerCallError(content, self.read_output())) if kind == FAILURE else (kind, content)

    def read_output(self) -> str:
        """Return the output that was captured since the last call was started."""
        return self.output_file.read_text(encoding="utf-8", errors="replace")

    def end(self) -> None:
        """Let the idle process end."""
        assert self.process.stdin is not None
        with suppress(OSError):  # it has ended
            worker_process.write_message(self.process.stdin, worker_process.END)

    def wait(self) -> int:
        """Return the exit status of a process that has closed its standard output."""
        with suppress(subprocess.TimeoutExpired):
            return self.process.wait(EXIT_TIMEOUT)
        kill_process_group(self.process)
        return self.process.wait()

    def kill(self) -> None:
        """Kill the process and its child processes, and remove its files."""
        kill_process_group(self.process)
        self.process.wait()
        assert self.process.stdin is not None
        with suppress(OSError):  # closing sends the rest of a request, which may fail
            self.process.stdin.close()
        self.resources.close()


class Worker:
    """Calls functions in a process, and is a context manager that kills it. The next call replaces an ended process.

    Parameters
    ----------
    memory : int
        Limit of the memory of the process in bytes, where the system can limit it; 0 for none.

    Attributes
    ----------
    messages : str
        Captured output of the last call.
    """

    def __init__(self, memory: int = 0) -> None:
        self.memory, self.messages = memory, ""
        self.process: WorkerProcess | None = None

    def call(
        self,
        function: Callable[..., Any],
        *arguments: Any,
        timeout: float = inf,
        report: Callable[[Progress], object] | None = None,
    ) -> Any:
        """Return function(*arguments), called in the process.

        Parameters
        ----------
        function : callable
            A function of a module.
        *arguments : object
            Its arguments, which can be pickled.
        timeout : float
            Time limit in s, also between two progress reports.
        report : callable, optional
            Receives the progress. The function then has an argument `report`, which takes a progress from 0 to 1 and
            a note.

        Raises
        ------
        WorkerError
            If the process crashes or times out, or the function fails. The next call starts another process.
        HarnessError
            If the function raises it.
        """
        try:
            process = self.process
            if process is None or process.process.poll() is not None:
                process = self.start()
            process.start_call(function, arguments, report is not None)
            kind = PROGRESS
            while kind == PROGRESS:
                kind, content = self.receive(process, timeout)
                if kind == PROGRESS and report:
                    report(Progress(*content))
            self.messages = process.read_output()
        except BaseException:
            self.kill()
            raise
        if kind == ERROR:
            raise content
        return content

    def start(self) -> WorkerProcess:
        """Start the process and wait until it is ready."""
        self.kill()
        self.replies: SimpleQueue[tuple[WorkerProcess, bytes | None]] = SimpleQueue()
        with defer_signals():
            self.process = WorkerProcess(self.replies, self.memory)
        self.receive(self.process, START_TIMEOUT)
        return self.process

    def receive(self, process: WorkerProcess, timeout: float) -> tuple[str, Any]:
        """Return kind and content of the next reply; raise WorkerError if there is none within `timeout` s."""
        deadline = monotonic() + timeout
        while True:
            with suppress(Empty):
                _, reply = self.replies.get(timeout=max(0.0, min(POLL_INTERVAL, deadline - monotonic())))
                return process.read_reply(reply)
            check_interrupt()
            if monotonic() > deadline:
                raise WorkerTimeoutError(f"no answer after {timeout:g} s", process.read_output())

    def finish(self) -> None:
        """Let the process end; raise WorkerError if it crashes or hangs."""
        if self.process is None:
            return
        try:
            self.process.end()
            with suppress(WorkerDiedError):
                self.receive(self.process, START_TIMEOUT)
            if status := self.process.wait():
                raise WorkerDiedError(status, self.process.read_output())
        finally:
            self.kill()

    def kill(self) -> None:
        """Kill the process and its child processes, and remove its files."""
        process, self.process = self.process, None
        if process is not None:
            process.kill()

    def __enter__(self) -> "Worker":
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.kill()


def call_once(function: Callable[..., Any], *arguments: Any, timeout: float = inf, memory: int = 0) -> Any:
    """Return function(*arguments), called in a process of its own; see `Worker.call`."""
    with Worker(memory) as worker:
        return worker.call(function, *arguments, timeout=timeout)


class WorkerPool:
    """Calls functions in up to `size` processes, and is a context manager that kills them.

    A process that dies is replaced; `death_errors` are the exceptions of its call.
    """

    death_errors: tuple[type[Exception], ...] = (WorkerDiedError,)

    def __init__(self, size: int) -> None:
        self.size = size
        self.replies: SimpleQueue[tuple[WorkerProcess, bytes | None]] = SimpleQueue()
        self.idle: list[WorkerProcess] = []
        self.busy: dict[WorkerProcess, Future[Any]] = {}
        self.pending: deque[tuple[Future[Any], Callable[..., Any], tuple[Any, ...]]] = deque()

    def submit(self, function: Callable[..., Any], *arguments: Any) -> Future[Any]:
        """Queue function(*arguments) and return its future."""
        future: Future[Any] = Future()
        self.pending.append((future, function, arguments))
        self.start_calls()
        return future

    def start_calls(self) -> None:
        """Give queued calls to idle processes."""
        while self.pending and len(self.busy) < self.size:
            future, function, arguments = self.pending.popleft()
            with defer_signals():
                process = self.idle.pop() if self.idle else WorkerProcess(self.replies)
                self.busy[process] = future
            process.start_call(function, arguments)

    def wait_for_any(self, futures: Collection[Future[Any]]) -> set[Future[Any]]:
        """Return the futures that are done, once one is done or after `POLL_INTERVAL` s."""
        with suppress(Empty):
            self.handle_reply(*self.replies.get(timeout=POLL_INTERVAL))
            self.start_calls()
        return {future for future in futures if future.done()}

    def handle_reply(self, process: WorkerProcess, reply: bytes | None) -> None:
        """Set the result of a call, if the reply is one."""
        try:
            kind, content = process.read_reply(reply)
        except WorkerError as error:
            kind, content = ERROR, error
            process.kill()
        if kind == READY:
            return
        if process in self.idle:  # it died there
            self.idle.remove(process)
            return
        future = self.busy[process]
        if reply is not None:
            self.idle.append(process)  # before it leaves the others: a signal may come in between
        del self.busy[process]
        if kind == ERROR:
            future.set_exception(content)
        else:
            future.set_result(content)

    def __enter__(self) -> "WorkerPool":
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        for process in (*self.idle, *self.busy):
            process.kill()
