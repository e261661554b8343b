"""Fixtures: the FMUs built once, and a process that runs them."""

import subprocess
import sys
from pathlib import Path

import pytest
from driver import Worker

ROOT = Path(__file__).parent.parent


def build(root, out, *names, timeout=120):
    """Build FMUs from the sources under `root` in a process of their own."""
    command = [sys.executable, "build_fmus.py", *names, "--out", str(out)]
    done = subprocess.run(command, cwd=root, capture_output=True, text=True, timeout=timeout)
    assert done.returncode == 0, done.stderr
    return out


@pytest.fixture(scope="session")
def fmus(tmp_path_factory):
    """The folder of the built FMUs."""
    return build(ROOT, tmp_path_factory.mktemp("fmus"))


@pytest.fixture(params=["python", "native"])
def kind(request, fmus):
    """The folder of the FMUs of a kind."""
    from native_fmus import built  # which needs this file

    return fmus if request.param == "python" else built()


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
