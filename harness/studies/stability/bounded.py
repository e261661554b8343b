"""A function in another process, with a time limit: a hang or a crash there is a sentence here.

To begin a process, and in it the code of an FMU, takes longer than most runs do; so one that has answered is asked
again.  If it dies then, a new one is asked the same: what is told of a call is of that call alone.
"""

import atexit
import os
from collections.abc import Callable
from contextlib import ExitStack, suppress
from multiprocessing.connection import Connection
from pathlib import Path
from threading import Lock
from time import monotonic
from typing import Any

from ...errors import HarnessError
from ...process.child import OFTEN
from ...process.crew import begin, context, follow
from ...process.interrupt import check, deaf_children
from ...process.room import room

ALONE = Lock()  # a start looks after all processes there are, and may take the exit code of one that is waited for
# imported once, where processes are forked from
PRELOAD = [f"{__package__}.study", "harness.truths.linear", "scipy.integrate"]

CONTEXT: Any = context(PRELOAD)


class Died(HarnessError):
    """The process has crashed."""


class Hand:
    """A process that does one thing after the other, with a folder for its temporary files."""

    def __init__(self) -> None:
        self.held = ExitStack()
        folder = str(self.held.enter_context(room("bounded-")))
        self.here, there = CONTEXT.Pipe()
        self.process = CONTEXT.Process(target=work, args=(there, folder), daemon=True)
        with ALONE, deaf_children():
            self.process.start()
        there.close()

    def ask(self, limit: float, function: Callable[..., Any], *arguments: Any) -> Any:
        """As `bounded`; only who answers is asked again."""
        late = monotonic() + limit
        try:
            self.here.send((Path.cwd(), function, arguments))
            while not self.here.poll(OFTEN):
                if monotonic() > late:
                    raise HarnessError(f"no answer after {limit:g} s")
                check()
            result = self.here.recv()
        except (EOFError, OSError):
            self.end()
            raise Died(f"the process died with exit code {self.process.exitcode}") from None
        except BaseException:
            self.end()
            raise
        IDLE.append(self)
        if isinstance(result, BaseException):
            raise result
        return result

    def end(self) -> None:
        """Kill it, whatever it does."""
        with ALONE:
            self.process.kill()
            self.process.join()
        self.here.close()
        self.held.close()


IDLE: list[Hand] = []


@atexit.register
def dismiss() -> None:
    """End those that wait."""
    while IDLE:
        IDLE.pop().end()


def bounded(limit: float, function: Callable[..., Any], *arguments: Any) -> Any:
    """function(*arguments) within `limit` s; HarnessError if it hangs, crashes or raises one itself.

    The function must be known to pickle by name; any other exception of its comes through.
    """
    with suppress(IndexError, Died):  # where none waits, or what was asked of it before has killed it
        return IDLE.pop().ask(limit, function, *arguments)
    return Hand().ask(limit, function, *arguments)


def work(there: Connection, folder: str) -> None:
    """Send the result of each call, or its exception."""
    begin(folder)
    while True:
        try:
            place, function, arguments = there.recv()
        except EOFError:  # who asks is gone
            follow(folder)
        os.chdir(place)
        try:
            result = function(*arguments)
        except Exception as error:
            result = error
        there.send(result)
