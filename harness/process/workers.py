"""Workers of many tasks: processes, or this process."""

from collections.abc import Callable, Collection, Iterator
from concurrent.futures import Future
from contextlib import contextmanager
from typing import Any

from .worker import WorkerPool


class InProcess:
    """Runs tasks at once in this process, for callers without worker processes."""

    size = 1
    death_errors: tuple[type[Exception], ...] = ()

    def submit(self, function: Callable[..., Any], *arguments: Any) -> Future[Any]:
        """Call function(*arguments) and return its result as a finished future."""
        future: Future[Any] = Future()
        try:
            future.set_result(function(*arguments))
        except Exception as error:
            future.set_exception(error)
        return future

    def wait_for_any(self, futures: Collection[Future[Any]]) -> set[Future[Any]]:
        """Return the futures that are done, which are all."""
        return set(futures)


Workers = WorkerPool | InProcess


@contextmanager
def open_workers(workers: int | None, tasks: int) -> Iterator[Workers]:
    """Open a number of processes, at most one for each task, or this process if the number is None."""
    if workers is None:
        yield InProcess()
    else:
        with WorkerPool(min(workers, tasks)) as pool:
            yield pool
