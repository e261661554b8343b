"""Many life cycles of FMI 3.0 FMUs, in both interfaces: successive, concurrent, in threads and processes, with FMI 2.0.

Each host is a separate process (fmi3_life_cycles.py) that must exit cleanly and print nothing.
"""

from functools import partial

import fmi3_fixtures
import pytest
import worker_client
from build_cache import ROOT
from models import CASES, MODELS, counts, declared, label, outputs
from row_comparison import assert_identical

run_script = partial(worker_client.run_script, "fmi3_life_cycles.py")


fresh_worker = fmi3_fixtures.fresh_worker


@pytest.fixture(scope="module")
def folders():
    """Every FMI 3.0 FMU twice: the first is used for co-simulation, the second for model exchange."""
    return [str(fmi3_fixtures.build_fmi3_fmus() / f"{name}.fmu") for name in MODELS for _ in range(2)]


@pytest.fixture(scope="module")
def fmi2_folders(fmus):
    """The FMI 2.0 FMUs."""
    return [str(fmus / f"{name}.fmu") for name in MODELS]


def test_successive_life_cycles_leave_little_memory(folders, record_property):
    """Fifteen life cycles of each of ten, each with a reset; the measured growth is 0.2 kB per life cycle."""
    result = run_script("run_in_turn", folders, 150)
    early, late = result["memory"]
    record_property("kB a life", (late - early) / 135)
    assert result["runs"] == [1] * len(folders)
    assert result["path"] == []
    assert late - early < 135 * 4.0


def test_instances_of_both_interfaces_and_both_versions_coexist(folders, fmi2_folders):
    """All instances exist at once and are stepped in turn; every instance of an FMU gives the same run."""
    assert run_script("run_interleaved", folders + fmi2_folders, 1)["runs"] == 1


def test_an_fmu_unpacked_for_every_run_is_released(folders, record_property):
    """Memory and libraries of earlier runs are released, as with simulate_fmu of fmpy."""
    result = run_script("unpack_for_every_run", folders[0], 30)
    early, late = result["memory"]
    record_property("kB a run", (late - early) / 27)
    assert result["libraries"] <= 2
    assert result["path"] == []
    assert late - early < 27 * 20.0


def test_threads_do_not_interfere(folders, fmi2_folders):
    paths = folders + fmi2_folders
    assert run_script("run_in_threads", paths, 4, 2) == {"runs": [1] * len(paths), "errors": []}


@pytest.mark.parametrize("method", ["fork", "spawn"])
def test_child_processes_continue_instances_and_create_new_ones(method):
    """Co-simulation of the sled, model exchange of the pendulum."""
    paths = [fmi3_fixtures.build_fmi3_fmus() / f"{name}.fmu" for name in ("stickslip", "pendulum")]
    result = run_script("run_in_processes", paths, method)
    assert (result["same"], {*result["codes"]}) == (True, {0})


def test_a_host_with_the_sources_and_pythonfmu_loaded_changes_nothing(folders):
    result = run_script("run_beside_sources", str(ROOT), folders)
    assert result["foreign"] == []
    assert result["rows"] == run_script("run_each", folders)


def test_a_folder_may_have_any_name(folders, tmp_path):
    """Except one with %20, which the native layer takes for a space."""
    expected = run_script("run_in_folder", folders[0], None)
    for folder in ("with  two", "Grüße, 世界", "a b/ü", "50% off", "d" * 200):
        (tmp_path / folder).parent.mkdir(exist_ok=True)
        assert run_script("run_in_folder", folders[0], str(tmp_path / folder)) == expected, folder


def test_a_process_may_end_with_live_instances(fresh_worker):
    """The fixture requires a clean exit. All FMUs are loaded, so that this is not luck."""
    for name in MODELS:
        for make in (fresh_worker.instantiate, fresh_worker.exchange, fresh_worker.instantiate):
            make(fmi3_fixtures.build_fmi3_fmus() / f"{name}.fmu").begin().get(outputs(name)[0])


# ---- both versions of FMI in one process


@pytest.fixture(scope="module")
def process():
    """A process that must exit cleanly."""
    worker = fmi3_fixtures.Worker()
    yield worker
    assert worker.close() == 0


@pytest.mark.parametrize("case", CASES, ids=label)
def test_co_simulation_agrees_with_fmi2_bit_for_bit(process, fmus, case):
    """On the same grid, with a change of the input during the run and without a stop time."""
    name, values, stop = case
    names, times = outputs(name) + counts(name), [stop * i / 100 for i in range(101)]
    force = next(v for v, d in declared(name).items() if d.causality == "input")
    changes = {times[30]: {force: 0.004 if name == "pendulum" else 3.0}, times[60]: {force: 0.0}}
    rows = []
    for folder in (fmi3_fixtures.build_fmi3_fmus(), fmus):
        fmu = process.instantiate(folder / f"{name}.fmu").begin(values)
        rows.append(fmu.run_with_changes(times, names, changes))
        fmu.free()
    assert_identical(*rows, names)
