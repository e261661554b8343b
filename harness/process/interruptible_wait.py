"""Waiting for threads and processes without leaving a lock acquired after a signal.

A signal between two lines of concurrent.futures would leave its lock acquired, and the command would wait forever.
"""

from collections.abc import Callable, Collection, Generator, Iterable
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from typing import TypeVar

from .interrupt import defer_signals
from .subprocess_runner import POLL_INTERVAL

Item = TypeVar("Item")
Result = TypeVar("Result")


def wait_for_any(futures: Collection[Future[Result]]) -> set[Future[Result]]:
    """Return the futures that are done, once one is done or after `POLL_INTERVAL` s."""
    with defer_signals():
        return wait(futures, timeout=POLL_INTERVAL, return_when=FIRST_COMPLETED).done


def map_in_threads(
    workers: int, function: Callable[[Item], Result], items: Iterable[Item]
) -> Generator[Result, None, None]:
    """Yield function(item) for all items, in order, computed by `workers` threads."""
    with ThreadPoolExecutor(workers) as pool:
        with defer_signals():
            futures = [pool.submit(function, item) for item in items]
        try:
            for future in futures:
                while not wait_for_any([future]):
                    pass
                yield future.result()
        finally:
            for future in futures:
                future.cancel()
