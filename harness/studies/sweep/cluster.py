"""Workers on other machines: an existing Dask cluster, asked as the processes of this one are."""

import logging
from collections.abc import Callable, Collection, Iterator
from concurrent.futures import Future
from contextlib import contextmanager, suppress
from time import monotonic
from typing import Any

from ...errors import HarnessError, first_line
from ...process.interruptible_wait import wait_for_any

WORKER_TIMEOUT = 60.0  # s without a worker
EXTRA = "python -m pip install 'friction-fmus[sweep]'"


class DaskCluster:
    """The workers that a client knows.  Dask gives the task of a worker that died to others, until it has taken too
    many of them along."""

    def __init__(self, client: Any, address: str) -> None:
        from distributed import KilledWorker

        self.client, self.address = client, address
        self.pool = client.get_executor(pure=False)
        self.death_errors: tuple[type[Exception], ...] = (KilledWorker,)
        self.last_seen = monotonic()

    @property
    def size(self) -> int:
        """How many tasks they do at a time; HarnessError once there has been no worker for long."""
        size = sum(self.client.nthreads().values())
        if size:
            self.last_seen = monotonic()
        elif monotonic() > self.last_seen + WORKER_TIMEOUT:
            raise HarnessError(f"the scheduler at {self.address} has lost its workers; the same command does the rest")
        return size

    def submit(self, function: Callable[..., Any], *arguments: Any) -> Future[Any]:
        return self.pool.submit(function, *arguments)

    def wait_for_any(self, futures: Collection[Future[Any]]) -> set[Future[Any]]:
        """Those that have ended once one has, or after a while."""
        return wait_for_any(futures)


@contextmanager
def connect_cluster(address: str, unload: Callable[[], None]) -> Iterator[DaskCluster]:
    """The cluster whose scheduler is at an address; in the end each worker is told to `unload`."""
    try:
        from distributed import Client
    except ImportError:
        raise HarnessError(f"a sweep over a cluster needs Dask: {EXTRA}") from None
    for name in ("distributed", "distributed.client"):  # that a worker is gone is no news
        logging.getLogger(name).setLevel(logging.ERROR)
    try:
        client = Client(address, timeout=10)
    except (OSError, ValueError) as error:
        raise HarnessError(f"no scheduler answers at {address}: {first_line(error)}") from None
    with client:
        found = DaskCluster(client, address)
        if not found.size:
            raise HarnessError(f"the scheduler at {address} has no workers; start one: dask worker {address}")
        try:
            yield found
        finally:
            found.pool.shutdown(wait=False)
            with suppress(Exception):  # of a worker that is gone
                client.run(unload)
