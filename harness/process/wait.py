"""Waiting for what other threads and processes do, so that a signal leaves no lock of theirs held.

Between two lines of concurrent.futures it would: whoever wants the lock next, and the command with it, waits for ever.
"""

from collections.abc import Callable, Collection, Generator, Iterable
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from typing import TypeVar

from .child import OFTEN
from .interrupt import later

Item = TypeVar("Item")
Result = TypeVar("Result")


def ended(futures: Collection[Future[Result]]) -> set[Future[Result]]:
    """Those that have ended once one has, or after OFTEN s."""
    with later():
        return wait(futures, timeout=OFTEN, return_when=FIRST_COMPLETED).done


def each(workers: int, function: Callable[[Item], Result], items: Iterable[Item]) -> Generator[Result, None, None]:
    """function(item) of all items in their order, from so many threads."""
    with ThreadPoolExecutor(workers) as pool:
        with later():
            futures = [pool.submit(function, item) for item in items]
        try:
            for future in futures:
                while not ended([future]):
                    pass
                yield future.result()
        finally:
            for future in futures:
                future.cancel()
