"""Comparisons of FMUs, ours and others, and of results."""

import json
from math import cos, sqrt

import commands
import foreign
import numpy as np
import pytest

from harness.errors import HarnessError
from harness.running.trajectory import Trajectory
from harness.studies.compare.difference import compare
from harness.studies.compare.trajectory import read


@pytest.fixture(scope="module")
def theirs():
    """The folder of FMUs that are not ours, built with plain pythonfmu."""
    return foreign.built()


@pytest.fixture
def harness(fmus, tmp_path):
    (tmp_path / "fmus").symlink_to(fmus)

    def run(*arguments):
        return commands.harness(tmp_path, *arguments, COLUMNS="120")

    return run


def test_one_of_ours_is_run_at_its_own_steps(harness, tmp_path):
    values = ("--set", "f=1", "--set", "solver.method=ode45")
    done = harness("run", "--fmu", "fmus/coulomb.fmu", *values)
    assert (done.returncode, done.stderr) == (0, "")
    assert "solver: ode45, hybrid" in done.stdout
    assert (tmp_path / "results/coulomb/trajectory.csv").exists()


def test_a_run_as_json_is_json_and_nothing_else(harness, theirs):
    done = harness("run", "--fmu", theirs / "Midpoint.fmu", "--tolerance", 1e-3, "--json")
    assert (done.returncode, done.stderr) == (0, "")
    assert json.loads(done.stdout)["final"]["x"] == pytest.approx(cos(sqrt(40)), abs=2e-3)
    done = harness("run", "coulomb", "--json")
    assert (done.returncode, done.stderr) == (0, "")
    found = {each["name"]: each["value"] for each in json.loads(done.stdout)["quantities"]}
    assert found["f"] == pytest.approx(0.5, rel=1e-12)


def test_two_fmus_are_compared_as_their_closed_forms_differ(harness, theirs, tmp_path):
    stiffer = {"resources/Midpoint.py": lambda text: text.replace("40.0", "40.4")}
    other = foreign.edited(theirs / "Midpoint.fmu", tmp_path / "Other.fmu", stiffer)
    arguments = (theirs / "Midpoint.fmu", other, "--tolerance", 1e-5)
    done = harness("compare", *arguments, "--json")
    assert (done.returncode, done.stderr) == (0, "")
    found = json.loads(done.stdout)
    times = np.linspace(0, 1, 1001)
    off = np.abs(np.cos(sqrt(40) * times) - np.cos(sqrt(40.4) * times))
    (x,) = (each for each in found["variables"] if each["name"] == "x")
    assert x["largest"] == pytest.approx(off.max(), rel=1e-2)
    assert x["rms"] == pytest.approx(np.sqrt(np.mean(off * off)), rel=1e-2)
    folder = tmp_path / "results/compare/Midpoint-Other"
    assert {file.name for file in folder.iterdir()} == {"compare.json", "figure.png", "provenance.json"}
    assert harness("compare", *arguments, "--within", 0.1, "--quiet").returncode == 0
    done = harness("compare", *arguments, "--within", 0.01, "--quiet")
    assert (done.returncode, done.stdout) == (1, "")
    assert "more than 0.01" in done.stderr


def test_a_result_agrees_with_a_new_run_of_its_fmu_events_included(harness):
    assert harness("run", "stickslip", "--quiet").returncode == 0
    done = harness("compare", "results/stickslip", "fmus/stickslip.fmu", "--within", 1e-12)
    assert (done.returncode, done.stderr) == (0, "")
    assert "8 changes of mode in both, at most 0 s apart" in done.stdout


@pytest.mark.parametrize(
    ("arguments", "status", "sentence"),
    [
        (["fmus/smd.fmu", "nosuch.csv"], 2, "there is no nosuch.csv"),
        (["fmus/smd.fmu", "nosuch.fmu"], 2, "there is no nosuch.fmu"),
        (["fmus", "fmus/smd.fmu"], 2, "has no trajectory.csv"),
        (["nosuch", "fmus/smd.fmu"], 2, "unknown scene 'nosuch'"),
    ],
)
def test_what_cannot_be_compared_is_one_sentence(harness, arguments, status, sentence):
    done = harness("compare", *arguments)
    assert done.returncode == status
    assert sentence in done.stderr
    assert done.stderr.count("\n") == 1


UNITS = {"x": "m", "v": "m/s", "y": "m", "mode": ""}


def path(name, times, events=None, **columns):
    return Trajectory(name, times, columns, {name: UNITS[name] for name in columns}, events)


def test_between_samples_a_variable_follows_its_rate_or_stays_between_its_neighbours():
    one, two = np.linspace(0, 6, 1001), np.linspace(0.0005, 5.9, 400)
    found = compare(*(path("x and v", t, x=np.sin(t), v=np.cos(t)) for t in (one, two)))
    assert found.interpolated
    assert len(found.time) == 400
    x, v = found.differences
    assert x.relative < 1e-10  # the fourth power of the spacing over 384 times 16
    assert v.relative < 1e-5
    stairs = np.floor(one) + 0.25
    found = compare(path("stairs", one, x=stairs), path("line", two, x=np.zeros(400)))
    assert found.differences[0].largest == 5.25  # no spline swings beyond the stairs


@pytest.mark.parametrize("late", [0.0, 1e-9, 1e-3])
def test_a_jump_is_compared_as_a_jump(late):
    """A body is let go at 1 s, which its speed and its position follow; its acceleration jumps."""

    def motion(name, grid, at):
        t = np.unique(np.append(grid, at))
        since = np.where(t >= at, t - at, 0.0)
        columns = {"a": np.where(t >= at, 2.0, 0.0), "v": 2 * since, "x": since**2}
        units = {"a": "m/s2", "v": "m/s", "x": "m"}
        return Trajectory(name, t, columns, units, np.array([[0, 0], [at, 1]]))

    found = compare(motion("one", np.linspace(0, 2, 101), 1.0), motion("two", np.linspace(0, 1.99, 57), 1.0 + late))
    largest = {each.name: each.largest for each in found.differences}
    assert largest["a"] == 0.0
    assert largest["v"] <= 2.1 * late + 1e-15
    assert largest["x"] <= 2.1 * late + 1e-15
    assert found.shift == pytest.approx(late, rel=1e-6, abs=1e-15)


def test_a_time_that_stands_twice_has_both_sides_of_a_jump(tmp_path):
    (tmp_path / "twice.csv").write_text("t [s],x [m]\n0,1\n1,1\n1,5\n2,5\n")
    for value, apart in ((1, 4.0), (3, 2.0), (5, 4.0), (6, 5.0)):
        (tmp_path / "other.csv").write_text(f"t [s],x [m]\n0,{value}\n1,{value}\n2,{value}\n")
        one, two = (read(tmp_path / name) for name in ("twice.csv", "other.csv"))
        (x,) = compare(one, two).differences
        assert x.largest == apart
        assert abs(x.left[1] - x.right[1]) == (0 if 1 <= value <= 5 else 1)


def test_what_only_one_side_has_and_what_has_no_unit_is_said():
    t = np.arange(20.0)
    one = Trajectory("one", t, {"x": t, "a": t, "F": t}, {"x": "m", "a": "m/s²", "F": "N"})
    two = Trajectory("two", t, {"x": t, "a": t, "E": t}, {"x": "", "a": "m/s^2", "E": "J"})
    found = compare(one, two)
    assert [each.name for each in found.differences] == ["x", "a"]
    assert found.left_out == (
        "x has no unit in two; it is taken to be in m",
        "only in one: F",
        "only in two: E",
    )


def test_the_first_example_of_the_help_shows_no_more_than_the_curves_have(harness):
    for scene in ("stickslip", "stickslip-threshold"):
        assert harness("run", scene, "--quiet").returncode == 0
    done = harness("compare", "results/stickslip", "results/stickslip-threshold", "--json")
    assert (done.returncode, done.stderr) == (0, "")
    (a,) = (each for each in json.loads(done.stdout)["variables"] if each["name"] == "a")
    assert a["largest"] < 9.0


def test_modes_are_not_interpolated():
    one, two = np.arange(30.0), np.arange(30.0) + 0.5
    found = compare(path("one", one, mode=one // 10), path("two", two, mode=two // 10))
    assert found.differences[0].largest in (0.0, 1.0)


def test_what_shares_no_variable_is_refused():
    t = np.arange(20.0)
    with pytest.raises(HarnessError, match="have no variable in common"):
        compare(path("one", t, x=t), path("two", t, y=t))
    with pytest.raises(HarnessError, match="have no time in common"):
        compare(path("one", t, x=t), path("two", t + 50, x=t))


@pytest.mark.parametrize(
    ("second", "sentence", "shift"),
    [
        ([[0, 0], [1, 1], [2.5, 0]], "2 changes of mode in both, at most 0.5 s apart", 0.5),
        ([[0, 0], [1, 1]], "2 changes of mode in one, 1 in two", np.nan),
        ([[0, 0], [1, -1], [2, 0]], "change of mode 1 is to 1 in one and to -1 in two", np.nan),
    ],
)
def test_changes_of_mode_are_paired(second, sentence, shift):
    t = np.arange(20.0)
    one = Trajectory("one", t, {"x": t}, {"x": "m"}, np.array([[0, 0], [1, 1], [2, 0.0]]))
    found = compare(one, Trajectory("two", t, {"x": t}, {"x": "m"}, np.array(second, float)))
    assert found.events == sentence
    assert found.shift == pytest.approx(shift, nan_ok=True)


@pytest.mark.parametrize("lost", [np.nan, np.inf])
@pytest.mark.parametrize("where", ["left", "right", "both"])
@pytest.mark.parametrize("at", [1, 7, 18])
@pytest.mark.parametrize("shift", [0.0, 0.013])
def test_what_is_not_finite_on_either_side_is_a_difference_beyond_any_bound(lost, where, at, shift):
    """Also beside a variable that agrees, before and after it, and where times have to be interpolated."""
    t = np.linspace(0, 1, 20)
    good, bad = np.sin(t), np.where(np.arange(20) == at, lost, np.cos(t))
    left = {"a": good, "x": bad if where != "right" else np.cos(t), "z": good}
    right = {"a": good, "x": bad if where != "left" else np.cos(t), "z": good}
    units = dict.fromkeys(left, "m")
    found = compare(Trajectory("one", t, left, units), Trajectory("two", t + shift, right, units))
    assert np.isnan(found.worst)
    assert not found.worst <= 1e300


def test_within_fails_on_what_is_not_a_number(tmp_path):
    (tmp_path / "good.csv").write_text("t [s],x [m]\n0,1\n1,2\n2,3\n")
    (tmp_path / "bad.csv").write_text("t [s],x [m]\n0,1\n1,nan\n2,3\n")
    for pair in (("good.csv", "bad.csv"), ("bad.csv", "good.csv"), ("bad.csv", "bad.csv")):
        done = commands.harness(tmp_path, "compare", *pair, "--within", "1e9", COLUMNS="120")
        assert done.returncode == 1
        assert "x is not a finite number at t = 1 s" in done.stdout
        assert done.stderr.count("\n") == 1
        assert "which is in no bound" in done.stderr


@pytest.mark.parametrize("turned", [False, True])
def test_a_difference_is_relative_to_the_larger_side(turned):
    t = np.linspace(0, 1, 20)
    small, large = ({"x": np.full(20, size)} for size in (1.0, 4.0))
    pair = [Trajectory(name, t, columns, {"x": "m"}) for name, columns in (("small", small), ("large", large))]
    (found,) = compare(*(reversed(pair) if turned else pair)).differences
    assert found.relative == 0.75
    assert found.largest == 3.0


def test_differences_near_the_end_of_the_range_of_numbers_have_a_share():
    t = np.linspace(0, 1, 20)
    one, two = ({"x": np.full(20, value)} for value in (1e308, -1e308))
    found = compare(Trajectory("one", t, one, {"x": "m"}), Trajectory("two", t, two, {"x": "m"}))
    assert found.worst == 2.0
