"""Runs a function in another process with a time limit; a timeout or crash raises HarnessError.

Starting a process and loading an FMU takes longer than most runs, so processes are reused.  If a reused process dies,
the call is repeated in a new one, so that a failure always belongs to the call itself.
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

# imported once in the server from which processes are forked
PRELOAD = [f"{__package__}.study", "harness.references.piecewise_linear", "scipy.integrate"]

CONTEXT: Any = process_context(PRELOAD)


class TimedWorker(Worker):
    """A worker process with its own folder."""

    def __init__(self) -> None:
        self.held = ExitStack()
        super().__init__(CONTEXT, self.held.enter_context(temporary_directory("bounded-")))

    def run(self, limit: float, function: Callable[..., Any], *arguments: Any) -> Any:
        """Run function(*arguments) within `limit` s; the worker is reused only after a result."""
        deadline = monotonic() + limit
        try:
            self.send_task(function, *arguments)
            while not self.has_result(POLL_INTERVAL):
                if monotonic() > deadline:
                    raise HarnessError(f"no answer after {limit:g} s")
                check_interrupt()
            result = self.receive_result()
        except BaseException:
            self.kill()
            raise
        IDLE.append(self)
        if isinstance(result, BaseException):
            raise result
        return result

    def kill(self) -> None:
        super().kill()
        self.held.close()


IDLE: list[TimedWorker] = []


@atexit.register
def end_idle_workers() -> None:
    """End the idle workers."""
    while IDLE:
        IDLE.pop().kill()


def run_with_timeout(limit: float, function: Callable[..., Any], *arguments: Any) -> Any:
    """Run function(*arguments) in another process within `limit` s.

    The function must be picklable.  Its exceptions are raised here.

    Raises
    ------
    HarnessError
        If the call times out or the process crashes.
    """
    with suppress(IndexError, WorkerDiedError):  # no idle worker, or it was killed by its previous call
        return IDLE.pop().run(limit, function, *arguments)
    return TimedWorker().run(limit, function, *arguments)
