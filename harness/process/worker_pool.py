"""Worker pool. Workers exit with the parent, ignore SIGINT and discard their output.

Each worker has its own pipe, so a killed worker cannot deadlock the others.
"""

import atexit
import multiprocessing
import os
import tempfile
from collections import deque
from collections.abc import Callable, Collection, Iterator, Sequence
from concurrent.futures import Future
from contextlib import ExitStack, contextmanager
from functools import cache
from multiprocessing.connection import Connection, wait
from pathlib import Path
from shutil import rmtree
from signal import SIG_IGN, SIGINT, signal
from threading import Thread
from typing import Any

from ..errors import HarnessError
from .interrupt import ignore_sigint
from .subprocess_runner import POLL_INTERVAL
from .temporary_directory import temporary_directory

# bytes; a socket of the fork server has 41 more in its path, which macOS limits to 103 bytes and Linux to 107 (unix(7))
MAX_SOCKET_DIRECTORY = 62
READY = "ready"  # the first message of a worker
RESOURCES = ExitStack()  # of this process
atexit.register(RESOURCES.close)


class WorkerDiedError(HarnessError):
    """A worker process crashed."""


class WorkerStartError(HarnessError):
    """No worker process could start."""

    def __init__(self) -> None:
        super().__init__(
            "the worker processes end before their first run: a script that starts workers must call sweep below "
            "`if __name__ == '__main__':`, because each worker imports the script"
        )


def exit_while_importing_main() -> None:
    """Exit in a process that imports the script which started it. The parent then raises WorkerStartError."""
    if getattr(multiprocessing.current_process(), "_inheriting", False):  # as multiprocessing itself tests it
        raise SystemExit(1)


@cache
def use_own_socket_directory() -> None:
    """Let multiprocessing put its sockets into a directory of this project.

    If this process is killed, the next command removes the directory.
    """
    process: Any = multiprocessing.current_process()
    process._config["tempdir"] = str(RESOURCES.enter_context(temporary_directory("")))


def process_context(preload: Sequence[str]) -> Any:
    """Return the multiprocessing context: a fork server that has imported `preload`, or spawn.

    Spawn is used where there is no fork server, or where the path of its socket would be too long.
    """
    path_is_short = len(os.fsencode(tempfile.gettempdir())) <= MAX_SOCKET_DIRECTORY
    if not path_is_short or "forkserver" not in multiprocessing.get_all_start_methods():
        return multiprocessing.get_context("spawn")
    use_own_socket_directory()
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(["__main__", *preload])
    return context


class Worker:
    """A process that runs one task after the other, with its temporary files in `folder`.

    `is_ready` is whether it has started and waits for tasks or runs one.
    """

    def __init__(self, context: Any, folder: Path) -> None:
        self.is_ready = False
        self.connection, child_connection = context.Pipe()
        self.process = context.Process(target=run_tasks, args=(child_connection, str(folder)), daemon=True)
        try:
            with ignore_sigint():
                self.process.start()
        except (EOFError, OSError):  # the fork server ended
            raise WorkerStartError from None
        child_connection.close()

    def send_task(self, function: Callable[..., Any], *arguments: Any) -> None:
        """Start function(*arguments) in the worker, in the current working directory."""
        with self.raise_if_died():
            self.connection.send((Path.cwd(), function, arguments))

    def receive(self) -> Any:
        """Return the next message: READY, the result of the function, or the exception that it raised."""
        with self.raise_if_died():
            return self.connection.recv()

    @contextmanager
    def raise_if_died(self) -> Iterator[None]:
        """Turn a broken connection into WorkerDiedError."""
        try:
            yield
        except (EOFError, OSError):
            self.kill()
            raise WorkerDiedError(f"the process died with exit code {self.process.exitcode}") from None

    def kill(self) -> None:
        """Kill the process."""
        self.process.kill()
        self.process.join()
        self.connection.close()


class WorkerPool:
    """Up to `size` workers, with temporary files in `folder`.

    `death_errors` are the exceptions of a task whose worker died. The pool replaces a dead worker, unless none has been
    ready before.
    """

    death_errors: tuple[type[Exception], ...] = (WorkerDiedError,)

    def __init__(self, size: int, folder: Path, preload: Sequence[str]) -> None:
        self.size, self.folder, self.context = size, folder, process_context(preload)
        self.has_started = False  # whether a worker has been ready
        self.idle: list[Worker] = []
        self.busy: dict[Connection, tuple[Worker, Future[Any]]] = {}
        self.pending: deque[tuple[Future[Any], Callable[..., Any], tuple[Any, ...]]] = deque()

    def submit(self, function: Callable[..., Any], *arguments: Any) -> Future[Any]:
        """Queue function(*arguments) and return its future."""
        future: Future[Any] = Future()
        self.pending.append((future, function, arguments))
        self.dispatch()
        return future

    def dispatch(self) -> None:
        """Give queued tasks to idle workers."""
        while self.pending and len(self.busy) < self.size:
            future, function, arguments = self.pending.popleft()
            worker = self.idle.pop() if self.idle else Worker(self.context, self.folder)
            try:
                worker.send_task(function, *arguments)
            except WorkerDiedError as died:
                future.set_exception(self.death(died))
            else:
                self.busy[worker.connection] = worker, future

    def death(self, died: WorkerDiedError) -> HarnessError:
        """Return the exception of a task whose worker died: WorkerStartError if no worker has been ready."""
        return died if self.has_started else WorkerStartError()

    def wait_for_any(self, futures: Collection[Future[Any]]) -> set[Future[Any]]:
        """Return the futures that are done, once one is done or after `POLL_INTERVAL` s."""
        readable = wait([*self.busy], POLL_INTERVAL)
        for connection in [connection for connection in self.busy if connection in readable]:
            worker, future = self.busy[connection]
            try:
                result = worker.receive()
                if not worker.is_ready:
                    worker.is_ready = self.has_started = True
                    continue
                self.idle.append(worker)
            except WorkerDiedError as died:
                result = self.death(died)
            del self.busy[connection]
            if isinstance(result, BaseException):
                future.set_exception(result)
            else:
                future.set_result(result)
        self.dispatch()
        return {future for future in futures if future.done()}

    def kill(self) -> None:
        """Kill all workers."""
        for process in multiprocessing.active_children():
            process.kill()
            process.join()


def run_tasks(connection: Connection, folder: str) -> None:
    """Run tasks from the connection and send back their results."""
    initialize_worker(folder)
    connection.send(READY)
    while True:
        try:
            directory, function, arguments = connection.recv()
        except EOFError:  # the parent has ended
            exit_with_parent(folder)
        os.chdir(directory)
        try:
            result = function(*arguments)
        except Exception as error:
            result = error
        connection.send(result)


def initialize_worker(folder: str) -> None:
    """Set up the process: signals, temporary files, output, and the exit with its parent."""
    signal(SIGINT, SIG_IGN)
    tempfile.tempdir = folder
    null_device = os.open(os.devnull, os.O_WRONLY)
    for descriptor in (1, 2):
        os.dup2(null_device, descriptor)
    Thread(target=exit_with_parent, args=(folder,), daemon=True).start()


def exit_with_parent(folder: str) -> None:
    """Wait for the parent to end, remove its temporary files and exit."""
    parent = multiprocessing.parent_process()
    if parent:
        parent.join()
        rmtree(folder, ignore_errors=True)
        os._exit(1)  # sys.exit would end this thread only, and the main thread may be in a call of an FMU
