"""Rivals: one protocol for all engines; what is missing, crashes or hangs is a gap with its reason."""

import json
import sys
from dataclasses import replace
from math import isnan
from types import ModuleType

import commands
import numpy as np
import pytest
from build_cache import build_once

from benchmarks.rivals import child, study
from benchmarks.rivals.catalogue import ENGINES, MAX_LINES, OTHERS, OWN_RIVAL, RIVALS, count_lines
from benchmarks.rivals.child import RivalCase, RivalReply, run_case
from benchmarks.rivals.comparison import Comparison, Result, exact_rivals, gap_lines, rivals_table
from benchmarks.rivals.measures import match_events, measure
from benchmarks.rivals.reference_motions import FINE, compute_reference_motion
from benchmarks.rivals.scenes import SCENES, Solution, slip_changes
from benchmarks.rivals.study import run_in_child
from harness.references.certified_reference import FOLDER, load_reference

CERTIFIED_FILES = {"sled": "stickslip", "belt": "more/belt", "pendulum": "pendulum"}  # whole runs have certified files


@pytest.fixture(scope="module")
def references():
    """The references of all scenes."""
    return {name: compute_reference_motion(scene) for name, scene in SCENES.items()}


@pytest.fixture
def engine(monkeypatch):
    """engine(function): an engine with this function simulate, for runs in this process."""

    def install(simulate):
        module = ModuleType("engine")
        module.simulate = simulate
        monkeypatch.setitem(sys.modules, f"{child.__package__}.engines.engine", module)
        return RivalCase("engine", "rest", {})

    return install


def at_rest(scene):
    """A motion that never begins."""
    return Solution(scene.times, np.tile(scene.start, (len(scene.times), 1)), steps=7)


@pytest.mark.parametrize("name", CERTIFIED_FILES)
def test_references_agree_with_the_certified_results(references, name):
    certified_result, scene = load_reference(CERTIFIED_FILES[name], FOLDER), SCENES[name]
    common, at_scene, at_certified = np.intersect1d(
        scene.times.round(9), certified_result.times.round(9), return_indices=True
    )
    assert len(common) > 50
    assert references[name].states[::FINE][at_scene, :2] == pytest.approx(
        certified_result.states[at_certified, :2], abs=1e-9
    )
    assert [mode for _, mode in references[name].events] == [mode for _, mode in certified_result.events]
    times = [t for t, _ in certified_result.events]
    assert [t for t, _ in references[name].events] == pytest.approx(times, abs=1e-9)


@pytest.mark.parametrize("name", SCENES)
def test_scipy_with_programmed_events_agrees_with_the_references(references, name):
    rival = RIVALS["scipy"]
    measures = measure(SCENES[name], references[name], run_case(RivalCase(rival.module, name, rival.best)))
    assert measures.error < 1e-9
    assert (measures.creep, measures.missed, measures.spurious) == (0.0, 0, 0)
    assert isnan(measures.event_error) if name == "held" else measures.event_error < 1e-9


@pytest.mark.parametrize("rival", [rival for rival in OTHERS if rival.module != "scipy"], ids=lambda rival: rival.name)
def test_an_installed_rival_simulates_a_scene_that_it_offers(references, rival):
    if rival.installed_version is None:
        pytest.skip(f"{rival.package} is not installed")
    (reply,) = run_in_child([RivalCase(rival.module, "rest", rival.default)], 120.0)
    assert reply.gap == ""
    measures = measure(SCENES["rest"], references["rest"], reply)
    assert measures.error < 0.05
    assert measures.steps > 10


@pytest.mark.campaign
def test_our_fmus_are_exact_in_all_scenes(references, fmus, tmp_path, monkeypatch):
    (tmp_path / "fmus").mkdir()
    for file in fmus.glob("*.fmu"):
        (tmp_path / "fmus" / file.name).symlink_to(file)
    (tmp_path / "fmus" / "more").symlink_to(build_once("belt", "clutch"))
    monkeypatch.chdir(tmp_path)
    for name, scene in SCENES.items():
        measures = measure(scene, references[name], run_case(RivalCase(OWN_RIVAL.module, name, OWN_RIVAL.best)))
        assert measures.error < 1e-9, name
        assert (measures.creep, measures.missed, measures.spurious) == (0.0, 0, 0), name


def test_each_rival_is_one_short_file():
    files = {file.stem: file for file in ENGINES.glob("[!_]*.py")}
    assert files.keys() == {rival.module for rival in RIVALS.values()}
    for file in files.values():
        assert len(file.read_text(encoding="utf-8").splitlines()) <= MAX_LINES, file.name


def test_lines_of_code_are_counted_without_blank_lines_comments_and_docstrings():
    source = '"""Title.\n\nMore."""\n\nimport os  # in\n\n# out\ndef f():\n    """Out."""\n    return os\n'
    assert count_lines(source) == 3
    n_own_lines = count_lines((ENGINES / "own_fmu.py").read_text(encoding="utf-8"))
    assert OWN_RIVAL.lines > n_own_lines + 100  # with its models
    assert RIVALS["scipy"].lines == count_lines((ENGINES / "scipy.py").read_text(encoding="utf-8"))


def test_a_missing_package_is_a_gap_with_its_reason(references):
    missing = replace(RIVALS["mujoco"], package="no-such-package")
    results = list(study.run_rival(missing, references, 1.0))
    assert len(results) == 2 * len(SCENES)
    reason = "no-such-package is not installed: python -m pip install 'friction-fmus[rivals]'"
    assert {result.gap for result in results} == {reason}
    comparison = Comparison((missing,), tuple(results))
    scenes = ", ".join(SCENES)
    assert [*gap_lines(comparison)] == [f"No result of MuJoCo (default: {scenes}; best: {scenes}): {reason}."]
    assert not rivals_table(comparison).items


def test_what_an_engine_raises_is_a_gap(engine):
    def fails(scene, setting):
        raise RuntimeError("the solver fell over\nsecond line")

    def diverges(scene, setting):
        return Solution(scene.times, np.full((len(scene.times), 3), np.nan), steps=1)

    assert run_case(engine(fails)).gap == "RuntimeError: the solver fell over"
    assert run_case(engine(diverges)).gap == "the result is not finite"
    assert run_case(RivalCase("no_such_engine", "rest", {})).gap.startswith("it cannot be imported: ")
    pytest.importorskip("mujoco", reason="extra rivals")
    assert run_case(RivalCase("mujoco", "sled", {})).gap == "frictionloss is one constant force"


BROKEN_ENGINE = """
import os, sys, time
from benchmarks.rivals import child
from benchmarks.rivals.scenes import Solution
import numpy as np
def simulate(scene, setting):
    print("noise of an engine")
    if scene.name == "sled":
        os.kill(os.getpid(), 9) if setting["ending"] == "dies" else time.sleep(600)
    return Solution(scene.times, np.zeros((len(scene.times), 3)), steps=1)
sys.modules[child.__package__ + ".engines.broken"] = sys.modules[__name__]
def run_case(case):
    return child.run_case(case)
"""


@pytest.mark.parametrize(
    ("ending", "reason"),
    [
        ("dies", "it ended with exit status -9: noise of an engine"),
        pytest.param("hangs", "no answer after 8 s", marks=pytest.mark.campaign),
    ],
)
def test_after_a_rival_that_dies_or_hangs_the_next_scene_runs(make_module, monkeypatch, ending, reason):
    monkeypatch.setattr(study, "run_case", make_module("broken_rival", BROKEN_ENGINE).run_case)
    replies = run_in_child([RivalCase("broken", name, {"ending": ending}) for name in ("rest", "sled", "held")], 8.0)
    assert [reply.gap for reply in replies] == ["", reason, ""]


def test_events_are_matched_by_kind_and_time():
    expected = [(1.0, 1), (2.0, 0), (3.0, 1), (4.0, 0)]
    assert match_events(expected, expected, 5.0) == (0, 0, 0.0)
    late = [(1.1, 1), (2.0, 0), (3.0, 1), (4.0, 0)]
    assert match_events(late, expected, 5.0) == (0, 0, pytest.approx(0.1))
    assert match_events([(1.0, 1), (2.0, 0)], expected, 5.0)[:2] == (2, 0)
    assert match_events([*expected, (4.5, 1)], expected, 5.0)[:2] == (0, 1)
    n_missed, n_spurious, error = match_events([], expected, 5.0)
    assert (n_missed, n_spurious, isnan(error)) == (4, 0, True)


def test_a_slip_begins_and_ends_where_it_passes_the_level_even_within_one_step():
    v = np.array([0.0, 1.0, 1.0, -1.0])
    motion = Solution(np.arange(4.0), np.column_stack([v, v, np.zeros(4)]), steps=3)
    changes = slip_changes(motion, 0.5)
    assert [kind for _, kind in changes] == [1, 0, 1]
    assert [t for t, _ in changes] == pytest.approx([0.5, 2.25, 2.75])


def test_a_body_that_stays_where_it_should_move_has_its_error_and_no_events(references, engine):
    scene = SCENES["rest"]
    measures = measure(scene, references["rest"], run_case(engine(lambda scene, setting: at_rest(scene))))
    assert measures.error == pytest.approx(np.abs(references["rest"].states[::FINE, 0] - 0.1).max())
    assert (measures.missed, measures.spurious, measures.steps) == (32, 0, 7)


def test_the_command_writes_a_table_a_figure_and_the_gaps(user_folder, tmp_path, monkeypatch):
    monkeypatch.setattr(study, "run_in_child", lambda requests, timeout: [*map(reply_of_reference, requests)])
    result = commands.benchmarks(user_folder, "rivals", "scipy", "--out", tmp_path)
    assert (result.returncode, result.stderr) == (0, "")
    words = " ".join(result.stdout.split())  # long lines are wrapped
    assert "Exact to 1e-09 in every scene, without missed or spurious events: scipy (default); scipy (best);" in words
    folder = tmp_path / study.FOLDER
    assert {file.name for file in folder.iterdir()} == {study.FILE, study.FIGURE, "provenance.json", "summary.json"}
    rows = (folder / study.FILE).read_text().splitlines()
    assert len(rows) == 1 + 2 * 2 * len(SCENES)
    assert rows[0].startswith("scene,unit of the error,rival,version,setting,error,")
    versions = json.loads((folder / "provenance.json").read_text())["scene"]
    assert versions.keys() == {"friction-fmus", "scipy"}


def reply_of_reference(request):
    """The reply of an exact engine; one setting gives no result."""
    if request.module == OWN_RIVAL.module and request.setting:
        return RivalReply("it fell over")
    reference = compute_reference_motion(SCENES[request.scene])
    return RivalReply("", reference.states[::FINE].tolist(), True, reference.events, 5, 0.5)


def test_other_exact_rivals_are_named_before_ours():
    measures = measure(SCENES["held"], compute_reference_motion(SCENES["held"]), RivalReply("", [[0.0] * 3] * 51, True))
    results = [Result(title, "1", "best", {}, "held", 1, measures) for title in (OWN_RIVAL.title, "scipy", "MuJoCo")]
    results.append(replace(results[2], setting="default", measures=replace(measures, error=0.1)))
    comparison = Comparison((OWN_RIVAL,), tuple(results))
    assert exact_rivals(comparison) == ["scipy (best)", "MuJoCo (best)", f"{OWN_RIVAL.title} (best)"]
