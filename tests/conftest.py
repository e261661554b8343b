"""Fixtures: the FMUs, built once, and a process that runs them."""

import gc
import os
import sys
from importlib import import_module
from pathlib import Path
from tempfile import TemporaryDirectory

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as in a command; must be set before numpy is imported

import build_cache
import pytest
from browser import CHROMIUM, Browser
from native_fmus import backend_fmus  # noqa: F401 - a fixture of all tests
from worker_client import Worker


def pytest_configure(config):
    """Create the folders shared by all test processes, or use those created by the main process."""
    gc.set_threshold(20_000, 50, 50)  # builds of models allocate much and free it by reference counts
    if hasattr(config, "workerinput"):
        build_cache.shared_folder = Path(config.workerinput["shared_folder"])
        build_cache.kept_folder = Path(config.workerinput["kept_folder"])
    else:
        folder = TemporaryDirectory()
        config.add_cleanup(folder.cleanup)
        build_cache.shared_folder = Path(folder.name)
        try:
            (parent := config.rootpath / "build" / "tests").mkdir(parents=True, exist_ok=True)
        except OSError:  # a checkout that cannot be written
            parent = build_cache.shared_folder
        build_cache.kept_folder, lock = build_cache.open_kept_folder(parent)
        config.add_cleanup(lock.close)


@pytest.hookimpl(tryfirst=True)  # before tests are deselected by their marks
def pytest_collection_modifyitems(items):
    """Mark the tests in a browser as slow."""
    for item in items:
        if "browser" in item.fixturenames:
            item.add_marker(pytest.mark.slow)


@pytest.hookimpl(optionalhook=True)  # of pytest-xdist
def pytest_configure_node(node):
    """Pass the shared folders to a worker process."""
    node.workerinput["shared_folder"] = str(build_cache.shared_folder)
    node.workerinput["kept_folder"] = str(build_cache.kept_folder)


@pytest.fixture(scope="session")
def fmus():
    """The folder of the built FMUs."""
    return build_cache.build_once()


@pytest.fixture(scope="module")
def user_folder(fmus, tmp_path_factory):
    """A folder with the built FMUs, which all tests of a module share."""
    folder = tmp_path_factory.mktemp("user")
    (folder / "fmus").symlink_to(fmus)
    return folder


@pytest.fixture
def workspace(fmus, tmp_path):
    """The folder of a test, with the built FMUs."""
    (tmp_path / "fmus").symlink_to(fmus)
    return tmp_path


@pytest.fixture
def in_workspace(workspace, monkeypatch):
    """The same folder, as the current directory."""
    monkeypatch.chdir(workspace)
    return workspace


@pytest.fixture
def make_module(tmp_path, monkeypatch):
    """A function that writes a module, which this process and its child processes can import, and returns it."""
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path), os.pathsep)

    def make(name, code):
        (tmp_path / f"{name}.py").write_text(code)
        monkeypatch.delitem(sys.modules, name, raising=False)
        return import_module(name)

    return make


@pytest.fixture(scope="session")
def _workers():
    workers = [Worker()]
    yield workers
    for worker in workers:
        worker.close()


@pytest.fixture
def worker(_workers):
    """A process that runs FMUs of FMI 2.0 and 3.0; replaced if the last test killed it."""
    if not _workers[-1].alive:
        _workers.append(Worker())
    _workers[-1].read_stderr()
    return _workers[-1]


@pytest.fixture
def fresh_worker():
    """A separate process that must exit cleanly, because late memory errors show at the exit."""
    worker = Worker()
    yield worker
    assert worker.close() == 0


@pytest.fixture(scope="session")
def browser_process():
    """A browser with the size of a screen."""
    if CHROMIUM is None:
        pytest.skip("there is no chromium here")
    browser = Browser()
    yield browser
    browser.close()


@pytest.fixture(scope="module")
def browser(browser_process):
    """The same browser, which shows an empty page after a module: an animation takes half a core."""
    yield browser_process
    browser_process.open("about:blank")


@pytest.fixture
def launch(worker, fmus):
    """launch(name, values, start=, stop=, tolerance=): an initialised instance, freed when the test ends."""
    instances = []

    def launch(name, values=None, **experiment):
        instances.append(worker.instantiate(fmus / f"{name}.fmu"))
        return instances[-1].begin(values, **experiment)

    yield launch
    for instance in instances:
        if worker.alive and not instance.is_freed:
            instance.free()
