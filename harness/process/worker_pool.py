"""Worker processes of this machine, asked again and again: they end with the command that started them, also when it is
killed, hear no Ctrl-C, and what they print goes nowhere.

Each is asked through a pipe of its own, and only while it waits there: no thread stands between, which could wait for
ever for one that was killed.
"""

import multiprocessing
import os
import tempfile
from collections import deque
from collections.abc import Callable, Collection, Iterator, Sequence
from concurrent.futures import Future
from contextlib import contextmanager
from multiprocessing.connection import Connection, wait
from pathlib import Path
from shutil import rmtree
from signal import SIG_IGN, SIGINT, signal
from threading import Lock, Thread
from typing import Any

from ..errors import HarnessError
from .interrupt import ignore_sigint
from .subprocess_runner import POLL_INTERVAL

MAX_SOCKET_DIRECTORY = (
    70  # bytes, of the path of temporary files: below it is a socket, whose path may have 107 (unix(7))
)
PROCESS_LOCK = (
    Lock()
)  # a start looks after all processes there are, and may take the exit code of one that is waited for


class WorkerDiedError(HarnessError):
    """The process has crashed."""


def process_context(preload: Sequence[str]) -> Any:
    """How processes are made: forked from a server that has imported what is named, where there is one and its socket
    has room for its path."""
    short = len(os.fsencode(tempfile.gettempdir())) <= MAX_SOCKET_DIRECTORY
    if not short or "forkserver" not in multiprocessing.get_all_start_methods():
        return multiprocessing.get_context("spawn")
    made = multiprocessing.get_context("forkserver")
    made.set_forkserver_preload(["__main__", *preload])
    return made


class Worker:
    """A process that does one thing after the other, with its temporary files in a folder."""

    def __init__(self, context: Any, folder: Path) -> None:
        self.connection, there = context.Pipe()
        self.process = context.Process(target=run_tasks, args=(there, str(folder)), daemon=True)
        with PROCESS_LOCK, ignore_sigint():
            self.process.start()
        there.close()

    def send_task(self, function: Callable[..., Any], *arguments: Any) -> None:
        """Have function(*arguments) done, in the folder where this process is."""
        with self.raise_if_died():
            self.connection.send((Path.cwd(), function, arguments))

    def has_result(self, timeout: float) -> bool:
        """Whether there is an answer within so many seconds."""
        with self.raise_if_died():
            return self.connection.poll(timeout)

    def receive_result(self) -> Any:
        """What the function returned, or the exception that it raised."""
        with self.raise_if_died():
            return self.connection.recv()

    @contextmanager
    def raise_if_died(self) -> Iterator[None]:
        """Died, if it has crashed."""
        try:
            yield
        except (EOFError, OSError):
            self.kill()
            raise WorkerDiedError(f"the process died with exit code {self.process.exitcode}") from None

    def kill(self) -> None:
        """Kill it, whatever it does."""
        with PROCESS_LOCK:
            self.process.kill()
            self.process.join()
        self.connection.close()


class WorkerPool:
    """Up to so many of them, with temporary files in `folder`.

    `died` is what a task raises during which its process died; another one takes its place.
    """

    death_errors: tuple[type[Exception], ...] = (WorkerDiedError,)

    def __init__(self, size: int, folder: Path, preload: Sequence[str]) -> None:
        self.size, self.folder, self.context = size, folder, process_context(preload)
        self.idle: list[Worker] = []
        self.busy: dict[Connection, tuple[Worker, Future[Any]]] = {}
        self.pending: deque[tuple[Future[Any], Callable[..., Any], tuple[Any, ...]]] = deque()

    def submit(self, function: Callable[..., Any], *arguments: Any) -> Future[Any]:
        """What function(*arguments) will return, from one of them."""
        future: Future[Any] = Future()
        self.pending.append((future, function, arguments))
        self.dispatch()
        return future

    def dispatch(self) -> None:
        """Ask those that have nothing to do."""
        while self.pending and len(self.busy) < self.size:
            future, function, arguments = self.pending.popleft()
            hand = self.idle.pop() if self.idle else Worker(self.context, self.folder)
            try:
                hand.send_task(function, *arguments)
            except WorkerDiedError as died:
                future.set_exception(died)
            else:
                self.busy[hand.connection] = hand, future

    def wait_for_any(self, futures: Collection[Future[Any]]) -> set[Future[Any]]:
        """Those that have ended once one has, or after OFTEN s."""
        ready = wait([*self.busy], POLL_INTERVAL)
        for here in [each for each in self.busy if each in ready]:
            hand, future = self.busy.pop(here)
            try:
                found = hand.receive_result()
                self.idle.append(hand)
            except WorkerDiedError as died:
                found = died
            if isinstance(found, BaseException):
                future.set_exception(found)
            else:
                future.set_result(found)
        self.dispatch()
        return {future for future in futures if future.done()}

    def kill(self) -> None:
        """Kill them, whatever they do."""
        for process in multiprocessing.active_children():
            process.kill()
            process.join()


def run_tasks(there: Connection, folder: str) -> None:
    """Send what comes of each call."""
    initialize_worker(folder)
    while True:
        try:
            place, function, arguments = there.recv()
        except EOFError:  # who asks is gone
            exit_with_parent(folder)
        os.chdir(place)
        try:
            found = function(*arguments)
        except Exception as error:
            found = error
        there.send(found)


def initialize_worker(folder: str) -> None:
    """The first that each process does."""
    signal(SIGINT, SIG_IGN)
    tempfile.tempdir = folder
    nowhere = os.open(os.devnull, os.O_WRONLY)
    for number in (1, 2):
        os.dup2(nowhere, number)
    Thread(target=exit_with_parent, args=(folder,), daemon=True).start()


def exit_with_parent(folder: str) -> None:
    """End with the process that started this one, which could not tidy up."""
    parent = multiprocessing.parent_process()
    if parent:
        parent.join()
        rmtree(folder, ignore_errors=True)
        os._exit(1)
