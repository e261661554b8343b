"""Hundreds of instances: successive, concurrent, in threads and processes, and in hosts with conflicting modules.

All backends, and both interfaces of FMI 3.0; every host is a separate process (life_cycles.py) that must exit cleanly
and print nothing. Memory is measured with glibc.
"""

from functools import partial
from pathlib import Path

import fmi3_fixtures
import native_fmus
import pytest
import worker_client
from build_cache import ROOT
from models import MODELS, outputs

from tests.hosts.life_cycles import MODEL_EXCHANGE

pytestmark = pytest.mark.slow

CO_SIMULATION = "CoSimulation"
BACKENDS = ("python", "native", "fmi3")
FOLDER_NAMES = ("with  two", "Grüße, 世界", "a b/ü", "50% off", "d" * 200)

run_script = partial(worker_client.run_script, Path(__file__).with_name("life_cycles.py"))


def fmus_of(backend, python_fmus, names=MODELS):
    """Return path and interface of the FMUs of a backend."""
    if backend == "fmi3":
        folder, interfaces = fmi3_fixtures.build_fmi3_fmus(), (CO_SIMULATION, MODEL_EXCHANGE)
    else:
        folder, interfaces = native_fmus.build_native_fmus() if backend == "native" else python_fmus, (CO_SIMULATION,)
    return [[str(folder / f"{name}.fmu"), interface] for name in names for interface in interfaces]


@pytest.fixture(scope="module", params=BACKENDS)
def backend(request):
    return request.param


@pytest.fixture
def fmu_paths(backend, fmus):
    """All FMUs of one backend."""
    return fmus_of(backend, fmus)


@pytest.mark.campaign
def test_hundreds_of_life_cycles_leave_little_memory(fmu_paths, record_property):
    """Measured: 2 kB per life cycle in Python, 0.2 kB in FMI 3.0, and no additions to sys.path."""
    result = run_script("run_in_turn", fmu_paths, 150)
    early, late = result["memory"]
    record_property("kB a life", (late - early) / 135)
    assert result["runs"] == [1] * len(fmu_paths)
    assert result["path"] == []
    assert late - early < 135 * 4.0


@pytest.mark.campaign
def test_an_fmu_unpacked_for_every_run_is_released(fmu_paths, record_property):
    """Memory and libraries of earlier runs are released, as with simulate_fmu of fmpy."""
    result = run_script("unpack_for_every_run", fmu_paths[-1], 30)
    early, late = result["memory"]
    record_property("kB a run", (late - early) / 27)
    assert result["libraries"] <= 2
    assert result["path"] == []
    assert late - early < 27 * 20.0


@pytest.mark.campaign
def test_hundreds_of_instances_of_both_versions_of_fmi_coexist_in_one_process(fmus, record_property):
    """All instances exist at once and are stepped in turn, then in threads."""
    fmu_paths = fmus_of("fmi3", fmus) + fmus_of("python", fmus)  # tests/native/test_c_host.py has native ones
    result = run_script("run_interleaved", fmu_paths, 20)
    record_property("kB an instance", result["each"])
    assert result["runs"] == 1
    assert result["each"] < 90.0  # of which fmpy uses 45
    assert run_script("run_in_threads", fmu_paths, 8, 2) == {"runs": [1] * len(fmu_paths), "errors": []}


@pytest.mark.campaign
@pytest.mark.parametrize("method", ["fork", "spawn"])
def test_child_processes_continue_instances_and_create_new_ones(backend, fmus, method):
    """One smooth model and one with a mode are enough for processes."""
    result = run_script("run_in_processes", fmus_of(backend, fmus, ("pacejka", "stickslip")), method)
    assert (result["same"], {*result["codes"]}) == (True, {0})


@pytest.mark.campaign
@pytest.mark.parametrize("backend", ["python"])  # the others load no Python
def test_a_host_with_the_sources_and_pythonfmu_loaded_changes_nothing(fmu_paths):
    result = run_script("run_beside_sources", str(ROOT), fmu_paths)
    assert result["foreign"] == []
    assert result["rows"] == run_script("run_each", fmu_paths)


def test_a_folder_may_have_any_name(fmu_paths, backend, tmp_path):
    """Except one with %20, which the native layer takes for a space; that of pythonfmu reads plain characters and
    spaces only."""
    names = FOLDER_NAMES[: 1 if backend == "python" else None]
    (tmp_path / "a b").mkdir()
    expected, *results = run_script("run_in_folders", fmu_paths[-1], [None, *(str(tmp_path / name) for name in names)])
    assert results == [expected] * len(names)


def test_a_process_may_end_with_live_instances(fresh_worker):
    """The fixture requires a clean exit. All FMUs are loaded, so that this is not luck."""
    for name in MODELS:
        for make in (fresh_worker.instantiate, fresh_worker.exchange, fresh_worker.instantiate):
            make(fmi3_fixtures.build_fmi3_fmus() / f"{name}.fmu").begin().get(outputs(name)[0])
