"""Worker processes of this machine, asked again and again: they end with the command that started them, also when it is
killed, hear no Ctrl-C, and what they print goes nowhere."""

import multiprocessing
import os
import tempfile
from collections.abc import Callable, Sequence
from concurrent.futures import BrokenExecutor, Future, ProcessPoolExecutor
from pathlib import Path
from shutil import rmtree
from signal import SIG_IGN, SIGINT, signal
from threading import Thread
from typing import Any

from .interrupt import deaf_children

LONGEST = 70  # bytes, of the path of temporary files: below it is a socket, whose path may have 107 (unix(7))


def context(preload: Sequence[str]) -> Any:
    """How processes are made: forked from a server that has imported what is named, where there is one and its socket
    has room for its path."""
    short = len(os.fsencode(tempfile.gettempdir())) <= LONGEST
    if not short or "forkserver" not in multiprocessing.get_all_start_methods():
        return multiprocessing.get_context("spawn")
    made = multiprocessing.get_context("forkserver")
    made.set_forkserver_preload(["__main__", *preload])
    return made


class Crew:
    """So many processes, with temporary files in `folder`; `died` is what a task raises during which one of them did.

    Then all its tasks are lost, and it wants to be renewed.
    """

    died: tuple[type[Exception], ...] = (BrokenExecutor,)

    def __init__(self, size: int, folder: Path, preload: Sequence[str]) -> None:
        self.size, self.folder, self.context = size, folder, context(preload)
        self.pool = self.started()

    def started(self) -> ProcessPoolExecutor:
        return ProcessPoolExecutor(self.size, self.context, begin, (str(self.folder),))

    def submit(self, function: Callable[..., Any], *arguments: Any) -> Future[Any]:
        """What function(*arguments) will return, from one of them."""
        with deaf_children():
            return self.pool.submit(function, *arguments)

    def renew(self) -> None:
        """Begin again with new processes."""
        self.end()
        self.pool = self.started()

    def end(self) -> None:
        """Kill them, whatever they do."""
        for process in multiprocessing.active_children():
            process.kill()
        self.pool.shutdown(cancel_futures=True)


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
