"""The FMI 3.0 FMUs, built once, and the processes that run them, as fixtures under the names of those for FMI 2.0.

A test module takes them over by assignment: `fmus, worker, _workers = fmi3_hosts.FIXTURES`; `launch` follows.
"""

from functools import cache

import builds
import driver
import pytest
from native_fmus import needed


class Worker(driver.Worker):
    """A process that runs FMI 3.0 FMUs."""

    script = "fmi3_worker.py"

    def exchange(self, path, name="test"):
        """An instance for model exchange."""
        return driver.Instance(self, self.call(None, "exchange", str(path), name))

    def simulate(self, path, kind, **options):
        """The columns of a run by fmpy; Failed when it raises."""
        return self.evaluated(path, kind, **options)[0]

    def evaluated(self, path, kind, **options):
        """The same, and how often the derivatives were evaluated."""
        answer = self.call(None, "simulate", str(path), {"fmi_type": kind, **options})
        if "error" in answer:
            raise Failed(answer["error"])
        return answer["columns"], answer["evaluations"]


class Failed(Exception):
    """fmpy gave up a run."""


@cache
def built():
    """The folder of the FMI 3.0 FMUs."""
    needed()
    return builds.once("fmi3", "--fmi", "3", "--platform", "linux64", timeout=600)


@pytest.fixture(scope="module")
def fmus():
    return built()


_workers, worker, fresh = driver.processes(Worker, "module")
FIXTURES = fmus, worker, _workers
