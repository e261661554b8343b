"""A function in a process of its own, with a time limit: a hang or a crash there is a sentence here."""

import multiprocessing
from collections.abc import Callable
from multiprocessing.connection import Connection
from threading import Lock
from typing import Any

from ..errors import HarnessError

METHODS = multiprocessing.get_all_start_methods()
ALONE = Lock()  # a start looks after all processes there are, and may take the exit code of one that is waited for
CONTEXT: Any = multiprocessing.get_context("forkserver" if "forkserver" in METHODS else "spawn")
# imported once, where processes are forked from
CONTEXT.set_forkserver_preload(
    ["__main__", "harness.stability.probe", "harness.stability.truth_linear", "harness.stability.truth_smooth"]
)


def bounded(limit: float, function: Callable[..., Any], *arguments: Any) -> Any:
    """function(*arguments) within `limit` s; HarnessError if it hangs, crashes or raises one itself.

    The function, which may not return None, must be known to pickle by name; any other exception of its comes through.
    """
    here, there = CONTEXT.Pipe(duplex=False)
    process = CONTEXT.Process(target=work, args=(there, function, arguments), daemon=True)
    with ALONE:
        process.start()
    there.close()
    try:
        result = here.recv() if here.poll(limit) else HarnessError(f"no answer after {limit:g} s")
    except EOFError:
        result = None
    finally:
        here.close()
        with ALONE:
            process.kill()
            process.join()
    if result is None:
        raise HarnessError(f"the process died with exit code {process.exitcode}")
    if isinstance(result, BaseException):
        raise result
    return result


def work(there: Connection, function: Callable[..., Any], arguments: tuple[Any, ...]) -> None:
    """Send the result, or the exception."""
    try:
        result = function(*arguments)
    except Exception as error:
        result = error
    there.send(result)
