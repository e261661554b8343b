"""Hundreds of instances: in turn, at once, in threads and processes, in hosts that hold what could be mistaken for
them.

Both kinds of FMU; every host is a process of its own (lives.py), which must end well.  Memory is measured where
glibc tells it, on Linux.
"""

from functools import partial

import driver
import native_fmus
import pytest
from builds import ROOT
from models import MODELS

KINDS = ("python", "native")
SOME = ("pacejka", "stickslip")  # smooth, and with a mode: processes know no more


@pytest.fixture(scope="module", params=KINDS)
def folder(request, fmus):
    """The FMUs of one kind."""
    return fmus if request.param == "python" else native_fmus.built()


@pytest.fixture
def paths(folder):
    """All FMUs of one kind."""
    return [str(folder / f"{name}.fmu") for name in MODELS]


host = partial(driver.host, "lives.py")


def test_hundreds_of_lives_leave_little_behind(paths, record_property):
    """Seen: 2 kB a life in Python; nothing in sys.path."""
    told = host("one_after_another", paths, 150)
    early, late = told["memory"]
    record_property("kB a life", (late - early) / 135)
    assert told["runs"] == [1] * len(paths)
    assert told["path"] == []
    assert late - early < 135 * 4.0


def test_hundreds_of_instances_live_side_by_side(paths, record_property):
    told = host("side_by_side", paths, 40)
    record_property("kB an instance", told["each"])
    assert told["runs"] == 1
    assert told["each"] < 90.0  # of which fmpy takes 45


def test_an_fmu_unpacked_anew_for_every_run_is_let_go(paths, record_property):
    """As fmpy's simulate_fmu does: memory and libraries of earlier runs are given back."""
    told = host("unpacked_anew", paths[-1], 30)
    early, late = told["memory"]
    record_property("kB a run", (late - early) / 27)
    assert told["libraries"] <= 2
    assert told["path"] == []
    assert late - early < 27 * 20.0


def test_threads_do_not_feel_each_other(paths):
    assert host("in_threads", paths, 8, 5) == {"runs": [1] * len(paths), "errors": []}


@pytest.mark.parametrize("method", ["fork", "spawn"])
def test_children_carry_on_what_they_were_given_and_begin_anew(folder, method):
    told = host("in_processes", [folder / f"{name}.fmu" for name in SOME], method)
    assert (told["same"], {*told["codes"]}) == (True, {0})


def test_a_host_that_holds_the_sources_and_a_pythonfmu_changes_nothing(paths):
    told = host("beside_sources", str(ROOT), paths)
    assert told["foreign"] == []
    assert told["rows"] == host("one_by_one", paths)


def test_a_folder_may_have_spaces_in_its_name(paths, tmp_path):
    """As the layer finds it, which is that of all models."""
    path = paths[-1]
    assert host("in_folder", path, str(tmp_path / "with  two")) == host("in_folder", path, None)
