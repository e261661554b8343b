"""Hundreds of instances: successive, concurrent, in threads and processes, and in hosts with conflicting modules.

Both backends; every host is a separate process (life_cycles.py) that must exit cleanly. Memory is measured with glibc.
"""

from functools import partial

import native_fmus
import pytest
import worker_client
from build_cache import ROOT
from models import MODELS

KINDS = ("python", "native")
SOME = ("pacejka", "stickslip")  # one smooth, one with a mode: enough for processes


@pytest.fixture(scope="module", params=KINDS)
def folder(request, fmus):
    """The FMUs of one backend."""
    return fmus if request.param == "python" else native_fmus.build_native_fmus()


@pytest.fixture
def paths(folder):
    """All FMUs of one backend."""
    return [str(folder / f"{name}.fmu") for name in MODELS]


run_script = partial(worker_client.run_script, "life_cycles.py")


def test_hundreds_of_life_cycles_leave_little_memory(paths, record_property):
    """Measured: 2 kB per life cycle in Python, and no additions to sys.path."""
    result = run_script("run_in_turn", paths, 150)
    early, late = result["memory"]
    record_property("kB a life", (late - early) / 135)
    assert result["runs"] == [1] * len(paths)
    assert result["path"] == []
    assert late - early < 135 * 4.0


def test_hundreds_of_instances_coexist(paths, record_property):
    result = run_script("run_interleaved", paths, 40)
    record_property("kB an instance", result["each"])
    assert result["runs"] == 1
    assert result["each"] < 90.0  # of which fmpy uses 45


def test_an_fmu_unpacked_for_every_run_is_released(paths, record_property):
    """Memory and libraries of earlier runs are released, as with simulate_fmu of fmpy."""
    result = run_script("unpack_for_every_run", paths[-1], 30)
    early, late = result["memory"]
    record_property("kB a run", (late - early) / 27)
    assert result["libraries"] <= 2
    assert result["path"] == []
    assert late - early < 27 * 20.0


def test_threads_do_not_interfere(paths):
    assert run_script("run_in_threads", paths, 8, 5) == {"runs": [1] * len(paths), "errors": []}


@pytest.mark.parametrize("method", ["fork", "spawn"])
def test_child_processes_continue_instances_and_create_new_ones(folder, method):
    result = run_script("run_in_processes", [folder / f"{name}.fmu" for name in SOME], method)
    assert (result["same"], {*result["codes"]}) == (True, {0})


def test_a_host_with_the_sources_and_pythonfmu_loaded_changes_nothing(paths):
    result = run_script("run_beside_sources", str(ROOT), paths)
    assert result["foreign"] == []
    assert result["rows"] == run_script("run_each", paths)


def test_a_folder_name_may_contain_spaces(paths, tmp_path):
    """The native layer, which locates the folder, is the same for all models."""
    path = paths[-1]
    assert run_script("run_in_folder", path, str(tmp_path / "with  two")) == run_script("run_in_folder", path, None)
