"""Workers of many tasks: processes on this machine, the workers of a Dask cluster, or this process."""

import logging
from collections.abc import Callable, Collection, Iterator
from concurrent.futures import Future
from contextlib import contextmanager, suppress
from time import monotonic
from typing import Any

from ..errors import HarnessError, first_line, install_command
from .interruptible_wait import wait_for_any
from .worker import WorkerPool

WORKER_TIMEOUT = 60.0  # s without a worker, after which the tasks end


class DaskCluster:
    """The workers of a Dask client.

    Dask reschedules the task of a worker that died, until the task has killed several workers.
    """

    def __init__(self, client: Any, address: str) -> None:
        from distributed import KilledWorker

        self.client, self.address = client, address
        self.pool = client.get_executor(pure=False)
        self.death_errors: tuple[type[Exception], ...] = (KilledWorker,)
        self.last_seen = monotonic()

    @property
    def size(self) -> int:
        """Return the number of tasks that run at a time; HarnessError after WORKER_TIMEOUT without workers."""
        size = sum(self.client.nthreads().values())
        if size:
            self.last_seen = monotonic()
        elif monotonic() > self.last_seen + WORKER_TIMEOUT:
            raise HarnessError(f"the scheduler at {self.address} has lost its workers")
        return size

    def submit(self, function: Callable[..., Any], *arguments: Any) -> Future[Any]:
        return self.pool.submit(function, *arguments)

    def wait_for_any(self, futures: Collection[Future[Any]]) -> set[Future[Any]]:
        """Wait until a future has ended, or for a short time; return those that have ended."""
        return wait_for_any(futures)


@contextmanager
def connect_cluster(address: str, unload: Callable[[], None]) -> Iterator[DaskCluster]:
    """Connect to the scheduler at an address; at the end every worker calls `unload`."""
    try:
        from distributed import Client
    except ImportError:
        raise HarnessError(f"a cluster needs Dask: {install_command('cluster')}") from None
    for name in ("distributed", "distributed.client"):  # do not log lost workers
        logging.getLogger(name).setLevel(logging.ERROR)
    try:
        # not as the default, which xarray uses to write a file, even after it failed to connect
        client = Client(address, timeout=10, set_as_default=False)
    except (OSError, ValueError, AssertionError) as error:  # the last one rarely, of an invalid address
        raise HarnessError(f"no scheduler found at {address}: {first_line(error)}") from None
    with client:
        cluster = DaskCluster(client, address)
        if not cluster.size:
            raise HarnessError(f"the scheduler at {address} has no workers; start one: dask worker {address}")
        try:
            yield cluster
        finally:
            cluster.pool.shutdown(wait=False)
            with suppress(Exception):  # a worker may have ended
                client.run(unload)


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


Workers = WorkerPool | DaskCluster | InProcess


def do_nothing() -> None:
    """Do nothing."""


@contextmanager
def open_workers(
    scheduler: str | None, workers: int | None, tasks: int, unload: Callable[[], None] = do_nothing
) -> Iterator[Workers]:
    """Open the workers: the cluster of a scheduler, a number of processes on this machine, or this process.

    At the end, every worker of a cluster, or this process, calls `unload`.
    """
    if scheduler is not None:
        with connect_cluster(scheduler, unload) as connection:
            yield connection
    elif workers is None:
        try:
            yield InProcess()
        finally:
            unload()
    else:
        with WorkerPool(min(workers, tasks)) as pool:
            yield pool
