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
from .child import OFTEN
from .interrupt import deaf_children

LONGEST = 70  # bytes, of the path of temporary files: below it is a socket, whose path may have 107 (unix(7))
ALONE = Lock()  # a start looks after all processes there are, and may take the exit code of one that is waited for


class Died(HarnessError):
    """The process has crashed."""


def context(preload: Sequence[str]) -> Any:
    """How processes are made: forked from a server that has imported what is named, where there is one and its socket
    has room for its path."""
    short = len(os.fsencode(tempfile.gettempdir())) <= LONGEST
    if not short or "forkserver" not in multiprocessing.get_all_start_methods():
        return multiprocessing.get_context("spawn")
    made = multiprocessing.get_context("forkserver")
    made.set_forkserver_preload(["__main__", *preload])
    return made


class Hand:
    """A process that does one thing after the other, with its temporary files in a folder."""

    def __init__(self, context: Any, folder: Path) -> None:
        self.here, there = context.Pipe()
        self.process = context.Process(target=work, args=(there, str(folder)), daemon=True)
        with ALONE, deaf_children():
            self.process.start()
        there.close()

    def ask(self, function: Callable[..., Any], *arguments: Any) -> None:
        """Have function(*arguments) done, in the folder where this process is."""
        with self.alive():
            self.here.send((Path.cwd(), function, arguments))

    def answers(self, patience: float) -> bool:
        """Whether there is an answer within so many seconds."""
        with self.alive():
            return self.here.poll(patience)

    def answer(self) -> Any:
        """What the function returned, or the exception that it raised."""
        with self.alive():
            return self.here.recv()

    @contextmanager
    def alive(self) -> Iterator[None]:
        """Died, if it has crashed."""
        try:
            yield
        except (EOFError, OSError):
            self.end()
            raise Died(f"the process died with exit code {self.process.exitcode}") from None

    def end(self) -> None:
        """Kill it, whatever it does."""
        with ALONE:
            self.process.kill()
            self.process.join()
        self.here.close()


class Crew:
    """Up to so many of them, with temporary files in `folder`.

    `died` is what a task raises during which its process died; another one takes its place.
    """

    died: tuple[type[Exception], ...] = (Died,)

    def __init__(self, size: int, folder: Path, preload: Sequence[str]) -> None:
        self.size, self.folder, self.context = size, folder, context(preload)
        self.idle: list[Hand] = []
        self.busy: dict[Connection, tuple[Hand, Future[Any]]] = {}
        self.left: deque[tuple[Future[Any], Callable[..., Any], tuple[Any, ...]]] = deque()

    def submit(self, function: Callable[..., Any], *arguments: Any) -> Future[Any]:
        """What function(*arguments) will return, from one of them."""
        future: Future[Any] = Future()
        self.left.append((future, function, arguments))
        self.deal()
        return future

    def deal(self) -> None:
        """Ask those that have nothing to do."""
        while self.left and len(self.busy) < self.size:
            future, function, arguments = self.left.popleft()
            hand = self.idle.pop() if self.idle else Hand(self.context, self.folder)
            try:
                hand.ask(function, *arguments)
            except Died as died:
                future.set_exception(died)
            else:
                self.busy[hand.here] = hand, future

    def ended(self, futures: Collection[Future[Any]]) -> set[Future[Any]]:
        """Those that have ended once one has, or after OFTEN s."""
        ready = wait([*self.busy], OFTEN)
        for here in [each for each in self.busy if each in ready]:
            hand, future = self.busy.pop(here)
            try:
                found = hand.answer()
                self.idle.append(hand)
            except Died as died:
                found = died
            if isinstance(found, BaseException):
                future.set_exception(found)
            else:
                future.set_result(found)
        self.deal()
        return {future for future in futures if future.done()}

    def end(self) -> None:
        """Kill them, whatever they do."""
        for process in multiprocessing.active_children():
            process.kill()
            process.join()


def work(there: Connection, folder: str) -> None:
    """Send what comes of each call."""
    begin(folder)
    while True:
        try:
            place, function, arguments = there.recv()
        except EOFError:  # who asks is gone
            follow(folder)
        os.chdir(place)
        try:
            found = function(*arguments)
        except Exception as error:
            found = error
        there.send(found)


def begin(folder: str) -> None:
    """The first that each process does."""
    signal(SIGINT, SIG_IGN)
    tempfile.tempdir = folder
    nowhere = os.open(os.devnull, os.O_WRONLY)
    for number in (1, 2):
        os.dup2(nowhere, number)
    Thread(target=follow, args=(folder,), daemon=True).start()


def follow(folder: str) -> None:
    """End with the process that started this one, which could not tidy up."""
    parent = multiprocessing.parent_process()
    if parent:
        parent.join()
        rmtree(folder, ignore_errors=True)
        os._exit(1)
