"""Many lives of FMI 3.0 FMUs, for co-simulation and for model exchange, in turn, at once, in threads and processes,
beside those of FMI 2.0; every host is a process of its own (fmi3_lives.py), which must end well and say nothing."""

from functools import partial

import driver
import fmi3_hosts
import pytest
from builds import ROOT
from compare import identical
from models import CASES, MODELS, counts, declared, label, outputs

host = partial(driver.host, "fmi3_lives.py")


fresh = fmi3_hosts.fresh


@pytest.fixture(scope="module")
def each():
    """Every FMI 3.0 FMU twice: it is taken for co-simulation, then for model exchange."""
    return [str(fmi3_hosts.built() / f"{name}.fmu") for name in MODELS for _ in range(2)]


@pytest.fixture(scope="module")
def older(fmus):
    """The FMI 2.0 FMUs."""
    return [str(fmus / f"{name}.fmu") for name in MODELS]


def test_lives_one_after_another_leave_little_behind(each, record_property):
    """Fifteen for each of ten, each with a reset: seen is 0.2 kB a life, and nothing in sys.path."""
    told = host("one_after_another", each, 150)
    early, late = told["memory"]
    record_property("kB a life", (late - early) / 135)
    assert told["runs"] == [1] * len(each)
    assert told["path"] == []
    assert late - early < 135 * 4.0


def test_instances_of_both_kinds_and_both_versions_live_side_by_side(each, older):
    """All alive at once and stepped in turns: every instance of an FMU gives the same run."""
    assert host("side_by_side", each + older, 1)["runs"] == 1


def test_an_fmu_unpacked_anew_for_every_run_is_let_go(each, record_property):
    """As fmpy's simulate_fmu does: memory and libraries of earlier runs are given back."""
    told = host("unpacked_anew", each[0], 30)
    early, late = told["memory"]
    record_property("kB a run", (late - early) / 27)
    assert told["libraries"] <= 2
    assert told["path"] == []
    assert late - early < 27 * 20.0


def test_threads_do_not_feel_each_other(each, older):
    paths = each + older
    assert host("in_threads", paths, 4, 2) == {"runs": [1] * len(paths), "errors": []}


@pytest.mark.parametrize("method", ["fork", "spawn"])
def test_children_carry_on_what_they_were_given_and_begin_anew(method):
    """In co-simulation the sled, in model exchange the pendulum."""
    paths = [fmi3_hosts.built() / f"{name}.fmu" for name in ("stickslip", "pendulum")]
    told = host("in_processes", paths, method)
    assert (told["same"], {*told["codes"]}) == (True, {0})


def test_a_host_that_holds_the_sources_and_a_pythonfmu_changes_nothing(each):
    told = host("beside_sources", str(ROOT), each)
    assert told["foreign"] == []
    assert told["rows"] == host("one_by_one", each)


def test_a_folder_may_have_any_name(each, tmp_path):
    """But one with %20, which the native layer takes for a space."""
    expected = host("in_folder", each[0], None)
    for folder in ("with  two", "Grüße, 世界", "a b/ü", "50% off", "d" * 200):
        (tmp_path / folder).parent.mkdir(exist_ok=True)
        assert host("in_folder", each[0], str(tmp_path / folder)) == expected, folder


def test_a_process_may_end_with_instances_alive(fresh):
    """The fixture asks for a good end; so that is not luck, of all FMUs at once."""
    for name in MODELS:
        for make in (fresh.instantiate, fresh.exchange, fresh.instantiate):
            make(fmi3_hosts.built() / f"{name}.fmu").begin().get(outputs(name)[0])


# ---- the two versions of FMI in one process


@pytest.fixture(scope="module")
def process():
    """A process that must end well."""
    worker = fmi3_hosts.Worker()
    yield worker
    assert worker.close() == 0


@pytest.mark.parametrize("case", CASES, ids=label)
def test_co_simulation_is_that_of_fmi_2_to_the_last_bit(process, fmus, case):
    """On the same grid, with a change of input in mid-run, where neither knows a stop time."""
    name, values, stop = case
    names, times = outputs(name) + counts(name), [stop * i / 100 for i in range(101)]
    force = next(v for v, d in declared(name).items() if d.causality == "input")
    changes = {times[30]: {force: 0.004 if name == "pendulum" else 3.0}, times[60]: {force: 0.0}}
    rows = []
    for folder in (fmi3_hosts.built(), fmus):
        fmu = process.instantiate(folder / f"{name}.fmu").begin(values)
        rows.append(fmu.through(times, names, changes))
        fmu.free()
    identical(*rows, names)
