"""A function in another process, with a time limit: a hang or a crash there is a sentence here.

To begin a process, and in it the code of an FMU, takes longer than most runs do; so one that has answered is asked
again.  If it dies then, a new one is asked the same: what is told of a call is of that call alone.
"""

import atexit
from collections.abc import Callable
from contextlib import ExitStack, suppress
from time import monotonic
from typing import Any

from ...errors import HarnessError
from ...process.interrupt import check_interrupt
from ...process.subprocess_runner import POLL_INTERVAL
from ...process.temporary_directory import temporary_directory
from ...process.worker_pool import Worker, WorkerDiedError, process_context

# imported once, where processes are forked from
PRELOAD = [f"{__package__}.study", "harness.references.piecewise_linear", "scipy.integrate"]

CONTEXT: Any = process_context(PRELOAD)


class TimedWorker(Worker):
    """A process with a folder of its own."""

    def __init__(self) -> None:
        self.held = ExitStack()
        super().__init__(CONTEXT, self.held.enter_context(temporary_directory("bounded-")))

    def run(self, limit: float, function: Callable[..., Any], *arguments: Any) -> Any:
        """As `bounded`; only who answers is asked again."""
        late = monotonic() + limit
        try:
            self.send_task(function, *arguments)
            while not self.has_result(POLL_INTERVAL):
                if monotonic() > late:
                    raise HarnessError(f"no answer after {limit:g} s")
                check_interrupt()
            found = self.receive_result()
        except BaseException:
            self.kill()
            raise
        IDLE.append(self)
        if isinstance(found, BaseException):
            raise found
        return found

    def kill(self) -> None:
        super().kill()
        self.held.close()


IDLE: list[TimedWorker] = []


@atexit.register
def end_idle_workers() -> None:
    """End those that wait."""
    while IDLE:
        IDLE.pop().kill()


def run_with_timeout(limit: float, function: Callable[..., Any], *arguments: Any) -> Any:
    """function(*arguments) within `limit` s; HarnessError if it hangs, crashes or raises one itself.

    The function must be known to pickle by name; any other exception of its comes through.
    """
    with suppress(IndexError, WorkerDiedError):  # where none waits, or what was asked of it before has killed it
        return IDLE.pop().run(limit, function, *arguments)
    return TimedWorker().run(limit, function, *arguments)
