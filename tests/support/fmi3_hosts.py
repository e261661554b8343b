"""The FMI 3.0 FMUs, built once, and the processes that run them, as fixtures under the names of those for FMI 2.0.

A test module takes them over by assignment: `fmus, worker, _workers = fmi3_hosts.FIXTURES`; `launch` follows.
"""

from functools import cache

import builds
import commands
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


LEAN = {"stickslip": ("ode23", "hybrid"), "coulomb": ("rodas", "sign")}


@cache
def lean(name):
    """The FMI 3.0 FMU of a model with one method and one law."""
    needed()

    def make(folder):
        method, law = LEAN[name]
        chosen = ("--method", method, "--law", law, "--platform", "linux64")
        done = commands.build("--fmi", "3", name, *chosen, "--out", folder)
        assert done.returncode == 0, done.stderr

    return builds.made(f"lean fmi3 {name}", make) / f"{name}.fmu"


@pytest.fixture(scope="module")
def fmus():
    return built()


_workers, worker, fresh = driver.processes(Worker, "module")
FIXTURES = fmus, worker, _workers
