"""The FMI 3.0 FMUs and the processes that run them, as fixtures with the names of those for FMI 2.0.

A test module selects them by assignment: `fmus, worker, _workers = fmi3_fixtures.FIXTURES`; `launch` then uses them.
"""

from functools import cache

import build_cache
import commands
import pytest
import worker_client
from native_fmus import require_compiler


class Worker(worker_client.Worker):
    """A process that runs FMI 3.0 FMUs."""

    script = "fmi3_worker.py"
    refused_step = "fmi3DoStep", 3  # Error

    def exchange(self, path, name="test"):
        """Create an instance for model exchange."""
        return worker_client.Instance(self, self.call(None, "exchange", str(path), name))

    def simulate(self, path, kind, **options):
        """Simulate with fmpy and return the columns; raise FmpyError if fmpy raises."""
        return self.simulate_and_count(path, kind, **options)[0]

    def simulate_and_count(self, path, kind, **options):
        """Simulate with fmpy and return the columns and the number of derivative evaluations."""
        answer = self.call(None, "simulate", str(path), {"fmi_type": kind, **options})
        if "error" in answer:
            raise FmpyError(answer["error"])
        return answer["columns"], answer["evaluations"]


class FmpyError(Exception):
    """fmpy aborted a run."""


@cache
def build_fmi3_fmus():
    """Return the folder of the FMI 3.0 FMUs."""
    require_compiler()
    return build_cache.build_once("fmi3", "--fmi", "3", "--platform", "linux64", timeout=600)


REDUCED = {"stickslip": ("ode23", "hybrid"), "coulomb": ("rodas", "sign")}


@cache
def build_reduced_fmu(name):
    """Return the FMI 3.0 FMU of a model with one method and one friction law."""
    require_compiler()

    def make(folder):
        method, law = REDUCED[name]
        chosen = ("--method", method, "--law", law, "--platform", "linux64")
        done = commands.build("--fmi", "3", name, *chosen, "--out", folder)
        assert done.returncode == 0, done.stderr

    return build_cache.cached_folder(f"lean fmi3 {name}", make) / f"{name}.fmu"


@pytest.fixture(scope="module")
def fmus():
    return build_fmi3_fmus()


_workers, worker, fresh_worker = worker_client.worker_fixtures(Worker, "module")
FIXTURES = fmus, worker, _workers
