"""Fixtures: the FMUs built once, and a process that runs them."""

import atexit
import gc
import os
from pathlib import Path
from tempfile import TemporaryDirectory

if "PYTEST_XDIST_WORKER" in os.environ:
    # The last of all, being the first to be told: to take down a worker that has told its results takes seconds.
    atexit.register(os._exit, 0)
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as a command has it: before what follows loads numpy

import build_cache
import fork_server
import native_fmus
import pytest
from browser import CHROMIUM, Browser
from worker_client import Worker, worker_fixtures


def pytest_configure(config):
    """Open the room of what is built, or enter the one that the first process of this run has opened."""
    if hasattr(config, "workerinput"):
        build_cache.shared_folder = Path(config.workerinput["shared_folder"])
    else:
        folder = TemporaryDirectory()
        config.add_cleanup(folder.cleanup)
        build_cache.shared_folder = Path(folder.name)
    fork_server.temporary_folder = build_cache.shared_folder


def pytest_collection_finish():
    """What is there now stays to the end; to look through it again and again for what is not in use takes seconds."""
    gc.collect()
    gc.freeze()


def pytest_unconfigure():
    """Nor is what is there in the end to be looked through five times for what raises when it goes; once is enough."""
    pytest_collection_finish()


@pytest.hookimpl(optionalhook=True)  # of pytest-xdist
def pytest_configure_node(node):
    """Tell another process of this run where the room is."""
    node.workerinput["shared_folder"] = str(build_cache.shared_folder)


@pytest.fixture(scope="session")
def fmus():
    """The folder of the built FMUs."""
    return build_cache.build_once("fmi2")


@pytest.fixture(params=["python", "native"])
def backend_fmus(request, fmus):
    """The folder of the FMUs of a kind."""
    return fmus if request.param == "python" else native_fmus.build_native_fmus()


@pytest.fixture(scope="module")
def user_folder(fmus, tmp_path_factory):
    """A folder with the built FMUs in it, as a user's would be."""
    folder = tmp_path_factory.mktemp("place")
    (folder / "fmus").symlink_to(fmus)
    return folder


_workers, worker, fresh_worker = worker_fixtures(Worker, "session")


@pytest.fixture(scope="session")
def browser():
    """A browser, of the size of a screen."""
    if CHROMIUM is None:
        pytest.skip("there is no chromium here")
    browser = Browser()
    yield browser
    browser.close()


@pytest.fixture
def launch(worker, fmus):
    """launch(name, values, start=, stop=, tolerance=): an initialised instance, freed when the test ends."""
    instances = []

    def launch(name, values=None, **experiment):
        instances.append(worker.instantiate(fmus / f"{name}.fmu"))
        return instances[-1].begin(values, **experiment)

    yield launch
    for instance in instances:
        if worker.alive and not instance.freed:
            instance.free()
