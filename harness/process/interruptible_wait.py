"""Waiting for what other threads and processes do, so that a signal leaves no lock of theirs held.

Between two lines of concurrent.futures it would: whoever wants the lock next, and the command with it, waits for ever.
"""

from collections.abc import Callable, Collection, Generator, Iterable
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from typing import TypeVar

from .interrupt import defer_signals
from .subprocess_runner import POLL_INTERVAL

Item = TypeVar("Item")
Result = TypeVar("Result")


def wait_for_any(futures: Collection[Future[Result]]) -> set[Future[Result]]:
    """Those that have ended once one has, or after OFTEN s."""
    with defer_signals():
        return wait(futures, timeout=POLL_INTERVAL, return_when=FIRST_COMPLETED).done


def map_in_threads(
    workers: int, function: Callable[[Item], Result], items: Iterable[Item]
) -> Generator[Result, None, None]:
    """function(item) of all items in their order, from so many threads."""
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
