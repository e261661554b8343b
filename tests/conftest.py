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

import builds
import forked
import native_fmus
import pytest
from browser import CHROMIUM, Browser
from driver import Worker, processes


def pytest_configure(config):
    """Open the room of what is built, or enter the one that the first process of this run has opened."""
    if hasattr(config, "workerinput"):
        builds.room = Path(config.workerinput["room"])
    else:
        folder = TemporaryDirectory()
        config.add_cleanup(folder.cleanup)
        builds.room = Path(folder.name)
    forked.room = builds.room


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
    node.workerinput["room"] = str(builds.room)


@pytest.fixture(scope="session")
def fmus():
    """The folder of the built FMUs."""
    return builds.once("fmi2")


@pytest.fixture(params=["python", "native"])
def kind(request, fmus):
    """The folder of the FMUs of a kind."""
    return fmus if request.param == "python" else native_fmus.built()


@pytest.fixture(scope="module")
def place(fmus, tmp_path_factory):
    """A folder with the built FMUs in it, as a user's would be."""
    folder = tmp_path_factory.mktemp("place")
    (folder / "fmus").symlink_to(fmus)
    return folder


_workers, worker, fresh = processes(Worker, "session")


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
