"""Fixtures: the FMUs built once, and a process that runs them."""

from pathlib import Path
from tempfile import TemporaryDirectory

import builds
import native_fmus
import pytest
from builds import ROOT, build  # noqa: F401 - for tests
from driver import Worker


def pytest_configure(config):
    """Open the room of what is built, or enter the one that the first process of this run has opened."""
    if hasattr(config, "workerinput"):
        builds.room = Path(config.workerinput["room"])
    else:
        folder = TemporaryDirectory()
        config.add_cleanup(folder.cleanup)
        builds.room = Path(folder.name)


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


def processes(kind, scope):
    """The fixtures `_workers`, `worker` and `fresh` for processes of a kind, under these names."""

    @pytest.fixture(scope=scope)
    def _workers():
        workers = [kind()]
        yield workers
        for worker in workers:
            worker.close()

    @pytest.fixture
    def worker(_workers):
        """The process that runs FMUs; a new one when the last test killed it."""
        if not _workers[-1].alive:
            _workers.append(kind())
        _workers[-1].complaints()
        return _workers[-1]

    @pytest.fixture
    def fresh():
        """A process of the test's own, which must end well: late damage to memory shows at the exit."""
        worker = kind()
        yield worker
        assert worker.close() == 0

    return _workers, worker, fresh


_workers, worker, fresh = processes(Worker, "session")


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
