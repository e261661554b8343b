"""Workers on other machines: an existing Dask cluster with the interface of the local worker pool."""

import logging
from collections.abc import Callable, Collection, Iterator
from concurrent.futures import Future
from contextlib import contextmanager, suppress
from time import monotonic
from typing import Any

from ...errors import HarnessError, first_line, install_command
from ...process.interruptible_wait import wait_for_any

WORKER_TIMEOUT = 60.0  # s without a worker, after which the sweep ends


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
        raise HarnessError(f"a sweep over a cluster needs Dask: {install_command('cluster')}") from None
    for name in ("distributed", "distributed.client"):  # do not log lost workers
        logging.getLogger(name).setLevel(logging.ERROR)
    try:
        # not as the default, which xarray uses to write a file, even after it failed to connect
        client = Client(address, timeout=10, set_as_default=False)
    except (OSError, ValueError) as error:
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
