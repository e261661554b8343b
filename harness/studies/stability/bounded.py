"""A function in a process of its own, with a time limit: a hang or a crash there is a sentence here."""

import tempfile
from collections.abc import Callable
from multiprocessing.connection import Connection
from signal import SIG_IGN, SIGINT, signal
from threading import Lock
from time import monotonic
from typing import Any

from ...errors import HarnessError
from ...process.child import OFTEN
from ...process.crew import context
from ...process.interrupt import check, deaf_children
from ...process.room import room

ALONE = Lock()  # a start looks after all processes there are, and may take the exit code of one that is waited for
# imported once, where processes are forked from
PRELOAD = [f"{__package__}.study", "harness.truths.linear", "scipy.integrate"]

CONTEXT: Any = context(PRELOAD)


def bounded(limit: float, function: Callable[..., Any], *arguments: Any) -> Any:
    """function(*arguments) within `limit` s; HarnessError if it hangs, crashes or raises one itself.

    The function, which may not return None, must be known to pickle by name; any other exception of its comes through.
    """
    late = monotonic() + limit
    with room("bounded-") as folder:
        here, there = CONTEXT.Pipe(duplex=False)
        process = CONTEXT.Process(target=work, args=(there, str(folder), function, arguments), daemon=True)
        with ALONE, deaf_children():
            process.start()
        there.close()
        try:
            while not (known := here.poll(OFTEN)) and monotonic() < late:
                check()
            result = here.recv() if known else HarnessError(f"no answer after {limit:g} s")
        except EOFError:
            result = None
        finally:
            with ALONE:
                process.kill()
                process.join()
            here.close()
    if result is None:
        raise HarnessError(f"the process died with exit code {process.exitcode}")
    if isinstance(result, BaseException):
        raise result
    return result


def work(there: Connection, folder: str, function: Callable[..., Any], arguments: tuple[Any, ...]) -> None:
    """Send the result, or the exception; temporary files go into a folder that whoever waits for it removes."""
    signal(SIGINT, SIG_IGN)  # a Ctrl-C is for the process that waits, which ends this one
    tempfile.tempdir = folder
    try:
        result = function(*arguments)
    except Exception as error:
        result = error
    there.send(result)
