"""Comparisons of project FMUs, external FMUs, and results."""

import json
from functools import partial
from itertools import combinations
from math import cos, sqrt

import commands
import external_fmus
import numpy as np
import pytest
from build_cache import run_published_cases
from scipy.io import savemat
from variants import campaign_after, slow_after

from harness import HarnessError, ModeChanges, Signals, compare

DECLARED_STEP = '<CoSimulation fixedInternalStepSize="0.1" '


@pytest.fixture(scope="module")
def external_fmu_folder():
    """The folder of the external FMUs, built with plain pythonfmu."""
    return external_fmus.build_external_fmus()


@pytest.fixture
def harness(workspace):
    """Return harness(argument, ...): the finished process, in a folder with the built FMUs."""
    return partial(commands.harness, workspace, COLUMNS="120")


def test_a_project_fmu_is_run_at_its_internal_steps(harness, tmp_path):
    values = ("--set", "f=1", "--set", "solver.method=ode45")
    result = harness("run", "fmus/coulomb.fmu", *values)
    assert (result.returncode, result.stderr) == (0, "")
    assert "solver: ode45, hybrid" in result.stdout
    assert (tmp_path / "results/coulomb/trajectory.csv").exists()


def test_a_run_as_json_prints_only_json(harness, external_fmu_folder):
    result = harness("run", external_fmu_folder / "Midpoint.fmu", "--rtol", 1e-3, "--json")
    assert (result.returncode, result.stderr) == (0, "")
    assert json.loads(result.stdout)["final"]["x"] == pytest.approx(cos(sqrt(40)), abs=2e-3)
    result = harness("run", "coulomb", "--json")
    assert (result.returncode, result.stderr) == (0, "")
    quantities = {item["name"]: item["value"] for item in json.loads(result.stdout)["quantities"]}
    assert quantities["f"] == pytest.approx(0.5, rel=1e-12)


def test_two_fmus_differ_as_their_closed_forms_do(harness, external_fmu_folder, tmp_path):
    stiffer = {"resources/Midpoint.py": lambda text: text.replace("40.0", "40.4")}
    other = external_fmus.edited_copy(external_fmu_folder / "Midpoint.fmu", tmp_path / "Other.fmu", stiffer)
    arguments = (external_fmu_folder / "Midpoint.fmu", other, "--rtol", 1e-4)
    result = harness("compare", *arguments, "--json", figures=True)
    assert (result.returncode, result.stderr) == (0, "")
    comparison = json.loads(result.stdout)
    times = np.linspace(0, 1, 1001)
    off = np.abs(np.cos(sqrt(40) * times) - np.cos(sqrt(40.4) * times))
    (x,) = (item for item in comparison["variables"] if item["name"] == "x")
    assert x["largest"] == pytest.approx(off.max(), rel=1e-2)
    assert x["rms"] == pytest.approx(np.sqrt(np.mean(off * off)), rel=1e-2)
    folder = tmp_path / "results/compare/Midpoint-Other"
    files = {"compare.json", "data.npz", "figure.svg", "provenance.json", "summary.json"}
    assert {file.name for file in folder.iterdir()} == files


def test_the_interface_of_the_command_line_is_used(harness, external_fmu_folder):
    fmu = external_fmu_folder / "Midpoint.fmu"
    result = harness("compare", fmu, fmu, "--interface", "modelexchange")
    assert result.returncode == 1
    assert "offers co-simulation; model exchange is not among them" in result.stderr


@pytest.mark.campaign
@pytest.mark.parametrize("stop", [10, pytest.param(9.95, marks=pytest.mark.campaign)])
def test_fmus_with_one_fixed_internal_step_agree_on_a_shared_grid(harness, external_fmu_folder, tmp_path, stop):
    """FMI 3.0 can declare the step, FMI 2.0 cannot; each way round."""
    step_declaration = {"modelDescription.xml": lambda text: text.replace("<CoSimulation ", DECLARED_STEP)}
    fmi2_fmu = external_fmu_folder / "FixedStep.fmu"
    fmi3_fmu = external_fmus.edited_copy(
        external_fmu_folder / "Fmi3FixedStep.fmu", tmp_path / "Declared.fmu", step_declaration
    )
    for sources in ((fmi2_fmu, fmi3_fmu), (fmi3_fmu, fmi2_fmu)):
        result = harness("compare", *sources, "--stop", stop, "--json")
        assert (result.returncode, result.stderr) == (0, "")
        comparison = json.loads(result.stdout)
        assert not comparison["interpolated"]
        assert comparison["times"] >= 100
        assert [(variable["name"], variable["largest"]) for variable in comparison["variables"]] == [("x", 0.0)]


@pytest.fixture
def results(tmp_path):
    """The results folder, with the published cases."""
    (tmp_path / "results").mkdir()
    for folder in (run_published_cases() / "results").iterdir():
        (tmp_path / "results" / folder.name).symlink_to(folder)
    return tmp_path / "results"


def test_a_result_agrees_with_a_new_run_of_its_fmu_including_events(harness, results):
    result = harness("compare", "results/stickslip", "fmus/stickslip.fmu", "--within", 1e-12, figures=True)
    assert (result.returncode, result.stderr) == (0, "")
    assert "8 changes of mode in both, at most 0 s apart" in result.stdout


def test_a_scene_and_its_fmu_are_run_to_the_same_times(harness):
    result = harness("compare", "stickslip", "fmus/stickslip.fmu", "--within", 1e-12)
    assert (result.returncode, result.stderr) == (0, "")
    assert "(common to both)" in result.stdout


UNITS = {"x": "m", "v": "m/s", "y": "m", "mode": ""}


def mode_changes(rows, contacts=("mode",)):
    """Return the changes of mode in rows of a time and the mode of each contact."""
    t, *modes = np.array(rows, float).T
    return ModeChanges(t, dict(zip(contacts, modes, strict=True)))


def signals(name, times, columns, units, events=None):
    return Signals(times, columns, units, events=events, label=name)


def read_signals(path):
    """Return the signals in a file or a folder."""
    return compare(path, path).one


def path(name, times, events=None, **columns):
    return signals(name, times, columns, {name: UNITS.get(name, "") for name in columns}, events)


@pytest.mark.parametrize(
    ("other", "is_interpolated"), [([0.0, 0.5, 1.5, 2.5, 3.0], False), ([0.5, 1.5, 2.5, 3.0], True)]
)
def test_nothing_is_interpolated_where_half_of_the_times_are_common(other, is_interpolated):
    first, second = (path("x", np.array(t), x=np.array(t)) for t in ([0.0, 1.0, 2.0, 3.0], other))
    assert compare(first, second).interpolated is is_interpolated


def test_interpolation_follows_the_rate_or_stays_between_neighbours():
    first_times, second_times = np.linspace(0, 6, 1001), np.linspace(0.0005, 5.9, 400)
    comparison = compare(*(path("x and v", t, x=np.sin(t), v=np.cos(t)) for t in (first_times, second_times)))
    assert comparison.interpolated
    assert len(comparison.time) == 400
    x, v = comparison.differences
    assert x.relative < 1e-10  # the fourth power of the spacing over 384 times 16
    assert v.relative < 1e-5
    stairs = np.floor(first_times) + 0.25
    comparison = compare(path("stairs", first_times, x=stairs), path("line", second_times, x=np.zeros(400)))
    assert comparison.differences[0].largest == 5.25  # no spline overshoots the steps


def test_a_variable_uses_its_own_rate_in_an_fmu_without_units():
    pace = np.linspace(1, 3, 60)
    first_times, second_times = np.linspace(0, 6, 1001), np.linspace(0.0005, 5.9, 400)
    motions = [
        np.concatenate([np.sin(pace * t[:, None]), pace * np.cos(pace * t[:, None])], axis=1)
        for t in (first_times, second_times)
    ]
    comparison = compare(
        *(
            path("many", t, **{f"y{i}": y for i, y in enumerate(item.T)})
            for t, item in zip((first_times, second_times), motions, strict=True)
        )
    )
    assert max(item.relative for item in comparison.differences[:60]) < 1e-8  # 81 times that of pace 1
    assert min(item.relative for item in comparison.differences[60:]) > 1e-8  # no rates are recorded for these


@pytest.mark.parametrize("late", [0.0, 1e-9, 1e-3])
def test_a_jump_is_compared_as_a_jump(late):
    """A body is released at 1 s: its acceleration jumps, its speed and position follow."""

    def motion(name, grid, at):
        t = np.unique(np.append(grid, at))
        since = np.where(t >= at, t - at, 0.0)
        columns = {"a": np.where(t >= at, 2.0, 0.0), "v": 2 * since, "x": since**2}
        units = {"a": "m/s2", "v": "m/s", "x": "m"}
        return signals(name, t, columns, units, mode_changes([[0, 0], [at, 1]]))

    comparison = compare(
        motion("one", np.linspace(0, 2, 101), 1.0), motion("two", np.linspace(0, 1.99, 57), 1.0 + late)
    )
    largest = {difference.name: difference.largest for difference in comparison.differences}
    assert largest["a"] == 0.0
    assert largest["v"] <= 2.1 * late + 1e-15
    assert largest["x"] <= 2.1 * late + 1e-15
    assert comparison.pairs.shift == pytest.approx(late, rel=1e-6, abs=1e-15)


def test_a_repeated_time_holds_both_sides_of_a_jump(tmp_path):
    (tmp_path / "twice.csv").write_text("t [s],x [m]\n0,1\n1,1\n1,5\n2,5\n")
    for value, difference in ((1, 4.0), (3, 2.0), (5, 4.0), (6, 5.0)):
        (tmp_path / "other.csv").write_text(f"t [s],x [m]\n0,{value}\n1,{value}\n2,{value}\n")
        (x,) = compare(tmp_path / "twice.csv", tmp_path / "other.csv").differences
        assert x.largest == difference
        assert abs(x.left[1] - x.right[1]) == (0 if 1 <= value <= 5 else 1)


def test_unmatched_variables_and_missing_units_are_reported():
    t = np.arange(20.0)
    first = signals("one", t, {"x": t, "a": t, "F": t}, {"x": "m", "a": "m/s²", "F": "N"})
    second = signals("two", t, {"x": t, "a": t, "E": t}, {"x": "", "a": "m/s^2", "E": "J"})
    comparison = compare(first, second)
    assert [difference.name for difference in comparison.differences] == ["x", "a"]
    assert comparison.left_out == (
        "x has no unit in two; assumed m",
        "only in one: F",
        "only in two: E",
    )


def test_the_first_help_example_shows_no_more_than_the_curves_contain(harness, results):
    result = harness("compare", "results/stickslip", "results/stickslip-threshold", "--json")
    assert (result.returncode, result.stderr) == (0, "")
    (a,) = (item for item in json.loads(result.stdout)["variables"] if item["name"] == "a")
    assert a["largest"] < 9.0


@pytest.mark.parametrize("types", [(int, int), (int, float), (float, int)])
def test_a_variable_that_is_an_integer_on_one_side_is_held(types):
    first_times, second_times = np.arange(30.0), np.arange(30.0) + 0.5
    sides = [
        path(str(t[0]), t, mode=(t // 10).astype(type_))
        for t, type_ in zip((first_times, second_times), types, strict=True)
    ]
    (mode,) = compare(*sides).differences
    assert {*mode.left, *mode.right} == {0.0, 1.0, 2.0}
    assert mode.largest == 1.0


def test_a_position_in_whole_millimetres_is_interpolated(tmp_path):
    """The record is rounded to 1 mm, so it is at most 0.5 mm from the motion, and its interpolation hardly farther."""
    coarse, fine = np.arange(0, 4.01, 0.05), np.arange(0.0125, 3.99, 0.025)
    table = "".join(f"{t:.2f},{round(40 * cos(2 * t))}\n" for t in coarse)
    (tmp_path / "laser.csv").write_text("t [s],x [mm]\n" + table)
    motion = signals("model", fine, {"x": 40 * np.cos(2 * fine)}, {"x": "mm"})
    for sides in ((tmp_path / "laser.csv", motion), (motion, tmp_path / "laser.csv")):
        comparison = compare(*sides)
        assert comparison.interpolated
        assert comparison.differences[0].largest < 0.6  # 4 if it is held


@pytest.mark.parametrize(
    ("file", "text", "integer_names"),
    [
        ("results/trajectory.csv", "t [s],mode,x [mm]\n0.0,0,1.0\n1.0,0,2.0\n2.0,1,3.0\n", {"mode"}),
        ("fmpy.csv", '"time","mode","x","on"\n0.0,0,1.0,True\n1.0,0,2.0,True\n2.0,1,3.0,False\n', {"mode", "on"}),
        ("omc.csv", '"time","mode","x","on"\n0,0,1,1\n1,0,2,1\n2,1,3,0\n', set()),
        ("logger.csv", "t [s],mode,x [mm]\n0.0,0,1\n1.0,0,2\n2.0,1,3\n", set()),
    ],
)
def test_a_file_has_integers_only_if_its_program_marks_reals(tmp_path, file, text, integer_names):
    (tmp_path / file).parent.mkdir(exist_ok=True)
    (tmp_path / file).write_text(text)
    trajectory = read_signals(tmp_path / "results" if file.startswith("results") else tmp_path / file)
    assert {name for name, column in trajectory.columns.items() if column.dtype.kind == "i"} == integer_names


@pytest.mark.parametrize(
    ("file", "text", "units"),
    [
        ("fmpy.csv", '"time","h","h_ft"\n0.0,1.0,3.3\n1.0,2.0,6.6\n', {"h": "", "h_ft": ""}),
        ("results/trajectory.csv", "t [s],x_mm,h [ft]\n0.0,1.0,3.3\n1.0,2.0,6.6\n", {"x_mm": "", "h": "ft"}),
        ("logger.csv", "t [s],x_mm\n0.0,1.0\n1.0,2.0\n", {"x": "mm"}),
    ],
)
def test_names_of_simulated_variables_are_not_split_into_name_and_unit(tmp_path, file, text, units):
    (tmp_path / file).parent.mkdir(exist_ok=True)
    (tmp_path / file).write_text(text)
    assert read_signals(tmp_path / "results" if file.startswith("results") else tmp_path / file).units == units


def test_results_without_a_common_variable_are_refused():
    t = np.arange(20.0)
    with pytest.raises(HarnessError, match="have no variable in common"):
        compare(path("one", t, x=t), path("two", t, y=t))
    with pytest.raises(HarnessError, match="have no time in common"):
        compare(path("one", t, x=t), path("two", t + 50, x=t))


@pytest.mark.parametrize(
    ("changes", "sentence", "shift"),
    [
        ([[1, 1], [2.5, 0]], "2 changes of mode in both, at most 0.5 s apart", 0.5),
        ([[1.25, 1]], "1 change of mode in both, at most 0.25 s apart; only in one: to 0 at t = 2 s", np.nan),
        (
            [[1, -1], [2, 0]],
            "1 change of mode in both, at most 0 s apart; only in one: to 1 at t = 1 s; only in two: to -1 at t = 1 s",
            np.nan,
        ),
        (
            [[0.5, 1], [1.125, 1], [2, 0], [3, 1], [4, 1], [5, 1], [6, 1]],
            "2 changes of mode in both, at most 0.125 s apart; "
            "only in two: to 1 at t = 0.5 s, to 1 at t = 3 s, to 1 at t = 4 s, 2 more",
            np.nan,
        ),
        ([], "0 changes of mode in both; only in one: to 1 at t = 1 s, to 0 at t = 2 s", np.nan),
    ],
)
def test_events_are_matched_by_kind_and_time(changes, sentence, shift):
    t = np.arange(20.0)
    first = signals("one", t, {"x": t}, {"x": "m"}, mode_changes([[0, 0], [1, 1], [2, 0]]))
    second = signals("two", t, {"x": t}, {"x": "m"}, mode_changes([[0, 0], *changes]))
    pairs = compare(first, second).pairs
    assert pairs.summary(("one", "two")) == sentence
    assert pairs.shift == pytest.approx(shift, nan_ok=True)
    reverse = compare(second, first).pairs
    assert [rows.tolist() for rows in reverse.unmatched] == [rows.tolist() for rows in pairs.unmatched][::-1]
    assert (reverse.one.tolist(), reverse.two.tolist()) == (pairs.two.tolist(), pairs.one.tolist())


def test_events_of_several_contacts_are_matched_per_contact_and_named():
    """Both contacts slide, but not in the same order of contacts; at 3 s one of them sticks on one side only."""
    t = np.arange(20.0)
    names = ("F_lower", "F_upper")
    rows = [[0, 0, 0], [1, 1, 0], [2, 1, 1], [3, 0, 1]]
    first = signals("one", t, {"x": t}, {"x": "m"}, mode_changes(rows, names))
    swapped_rows = [[0, 0, 0], [1.5, 0, 1], [1.75, 1, 1]]
    second = signals("two", t, {"x": t}, {"x": "m"}, mode_changes(swapped_rows, names))
    comparison = compare(first, second)
    assert comparison.events == (
        "2 changes of mode in both, at most 0.75 s apart; only in one: F_lower to 0 at t = 3 s; "
        "the first that differs is F_lower to 1 at t = 1 s in one and 1.75 s in two"
    )
    assert comparison["only_one"] == [[3.0, 0.0, "F_lower"]]


def test_a_distant_event_match_hides_no_difference():
    """The other one jumps back in between, so that the values in between belong to no jump."""
    t = np.linspace(0, 3, 301)
    first = signals("one", t, {"y": (t >= 1) + 0.5}, {"y": "m"}, mode_changes([[0, 0], [1, 1]]))
    step = (t >= 0.5) & (t < 0.8) | (t >= 2)
    second = signals("two", t, {"y": step + 0.5}, {"y": "m"}, mode_changes([[0, 0], [0.5, 2], [0.8, 0], [2, 1]]))
    assert compare(first, second).differences[0].largest == 1.0


@pytest.mark.parametrize(
    ("left", "right", "factor"),
    [
        *(("m/s2", other, 1.0) for other in ("m/s^2", "m.s-2", "m s^-2", "m·s⁻²", "m/s²", "m/s/s", "m*s**-2")),
        ("N.m", "Nm", 1.0),
        ("N.m", "N·m", 1.0),
        ("kg.m2", "kg*m^2", 1.0),
        ("N/(m.s)", "N/m/s", 1.0),
        ("rad", "deg", np.pi / 180),
        ("rad/s", "rpm", np.pi / 30),
        ("m", "mm", 1e-3),
        ("N", "kN", 1e3),
        ("m", "Nm", None),
        ("m", "rad", None),
        ("m/s", "m", None),
    ],
)
def test_units_have_one_spelling_and_are_converted_or_refused(left, right, factor):
    t = np.arange(20.0)
    pair = (signals(name, t, {"y": t, "x": t}, {"y": unit, "x": "m"}) for name, unit in (("one", left), ("two", right)))
    comparison = compare(*pair)
    if factor is None:
        assert comparison.left_out == (f"y is in {left} in one and in {right} in two; skipped",)
        return
    (y, _) = comparison.differences
    assert y.unit == left
    assert y.largest == pytest.approx(19 * abs(1 - factor))
    assert bool(comparison.left_out) == (factor != 1.0)


OTHERS = {
    "fmpy.csv": '"time","x","on","turn"\n0.0,1.0,True,1 2\n1.0,2.0,False,3 4\n2.0,3.0,True,5 6\n',
    "openmodelica.csv": '"time","x","on","turn[1]","turn[2]"\n0,1,1,1,2\n1,2,0,3,4\n2,3,1,5,6\n',
    "ours.csv": "t [s],x,on,turn[1],turn[2]\n0,1,1,1,2\n1,2,0,3,4\n2,3,1,5,6\n",
    "instrument.csv": "t in s;x;on;turn[1];turn[2]\n0;1,0;1;1;2\n1;2,0;0;3;4\n2;3,0;1;5;6\n",
}


@pytest.mark.parametrize("pair", [*combinations([*OTHERS, "modelica.mat"], 2)], ids=" and ".join)
def test_results_of_other_tools_can_be_compared(tmp_path, pair):
    for name, text in OTHERS.items():
        (tmp_path / name).write_text(text)
    modelica(tmp_path / "modelica.mat", np.array([[0.0, 1, 1, 1, 2], [1, 2, 0, 3, 4], [2, 3, 1, 5, 6]]))
    comparison = compare(*(tmp_path / name for name in pair))
    assert {difference.name: difference.largest for difference in comparison.differences} == {
        "x": 0,
        "on": 0,
        "turn[1]": 0,
        "turn[2]": 0,
    }


def modelica(file, rows, is_transposed=True, version="4"):
    """Write a result like OpenModelica: a MATLAB file of version 4, transposed; one variable is an alias with a
    sign."""
    names = ["time", "x", "on", "turn[1]", "turn[2]", "minus", "p"]
    letters = {
        "Aclass": ["Atrajectory", "1.1", "", "binTrans" if is_transposed else "binNormal"],
        "name": names,
        "description": ["time [s]", "place [m|mm]", "[:#(type=Boolean)]", "", "", "", ""],
    }
    lines = {key: [text.ljust(20) for text in texts] for key, texts in letters.items()}
    for key in ("name", "description") if is_transposed else ():  # each is a column of characters
        lines[key] = ["".join(row) for row in zip(*lines[key], strict=True)]
    info = [[0, 1, 0, -1], *([2, i, 0, -1] for i in range(2, 6)), [2, -2, 0, -1], [1, 2, 0, -1]]
    constants = np.array([[0.0, 2.0], [7.0, 7.0]])
    tables = {"dataInfo": np.array(info, np.int32), "data_1": constants.T, "data_2": rows}
    tables = {key: table.T if is_transposed else table for key, table in tables.items()}
    savemat(file, {key: np.array(texts) for key, texts in lines.items()} | tables, format=version)


@pytest.mark.parametrize("version", slow_after(1, ["4", "5"]))
@pytest.mark.parametrize("is_transposed", [True, False])
def test_units_and_signs_of_a_modelica_result_are_read(tmp_path, is_transposed, version):
    """In both of its layouts, and saved again by MATLAB."""
    modelica(tmp_path / "modelica.mat", np.array([[0.0, 1, 1, 1, 2], [1, 2, 0, 3, 4]]), is_transposed, version)
    trajectory = read_signals(tmp_path / "modelica.mat")
    assert (trajectory.units["x"], trajectory.units["on"]) == ("m", "")
    assert [*trajectory.columns] == ["x", "on", "turn[1]", "turn[2]", "minus"]
    assert trajectory.columns["minus"].tolist() == [-1.0, -2.0]


def test_strings_are_compared_as_strings(tmp_path):
    (tmp_path / "one.csv").write_text("t [s],says,x\n0,cold,1\n1,cold,1\n2,warm,1\n")
    (tmp_path / "two.csv").write_text("t [s],says,x\n0,cold,1\n1,warm,1\n2,warm,one\n")
    comparison = compare(tmp_path / "one.csv", tmp_path / "two.csv")
    (says,) = comparison.differences
    assert (says.name, says.largest, says.at) == ("says", 1.0, 1.0)
    assert comparison.left_out == ("x is a string in two and a number in one; skipped",)


@pytest.mark.parametrize(
    ("bounds", "status"),
    [
        (["--within", "0.1"], 0),
        (["--within", "0.01"], 1),
        (["--atol", "0.3"], 0),
        (["--atol", "0.2"], 1),
        (["--within", "0.05", "--atol", "0.1"], 0),
    ],
)
def test_within_and_atol_set_the_allowed_difference(tmp_path, bounds, status):
    (tmp_path / "one.csv").write_text("t [s],x [m]\n0,1\n1,4\n2,3\n")
    (tmp_path / "two.csv").write_text("t [s],x [m]\n0,1\n1,3.75\n2,3\n")
    result = commands.harness(tmp_path, "compare", "one.csv", "two.csv", *bounds)
    assert result.returncode == status
    assert ("x differs by 0.25 m at t = 1 s, more than" in result.stderr) == bool(status)


def test_a_name_longer_than_its_column_is_printed_in_full(tmp_path):
    name = f"mechanics.{'axis.' * 20}position"
    (tmp_path / "one.csv").write_text(f"t [s],{name}\n0,1\n1,4\n")
    (tmp_path / "two.csv").write_text(f"t [s],{name}\n0,1\n1,3\n")
    output = commands.harness(tmp_path, "compare", "one.csv", "two.csv", COLUMNS="80").stdout
    assert name in "".join(line.split(" ")[0] for line in output.splitlines())


@pytest.mark.parametrize(
    ("pair", "message"),
    campaign_after(
        1,
        [
            (("Midpoint", "ModelExchangeOnly"), "fmpy's CVode at rtol"),
            (("Arrays", "Arrays"), "turn[1,2]"),
            (("Fmi3Midpoint", "NonConforming"), "NonConforming: internal steps"),
            (("FixedStep", "FixedStep"), "fixed internal step"),
            (("Switching", "Switching"), "says"),
            (("Bouncing", "Bouncing"), "bounces"),
        ],
    ),
)
def test_external_fmus_are_compared(harness, external_fmu_folder, pair, message):
    first, second = (external_fmu_folder / f"{name}.fmu" for name in pair)
    result = harness("compare", first, second, "--rtol", 1e-4, "--within", 2e-4, "--lenient")
    assert (result.returncode, result.stderr) == (0, "")
    assert message in result.stdout


def test_rtol_sets_the_solver_in_the_command_as_in_the_api(harness, fmus):
    pair = [str(fmus / f"{name}.fmu") for name in ("pacejka", "stickslip")]
    texts = [harness("compare", *pair, "--rtol", rtol, "--json").stdout for rtol in (1e-3, 1e-6)]
    answers = [json.loads(text)["variables"] for text in texts]
    assert answers[0] != answers[1]
    expected = compare(*pair, rtol=1e-3).as_json()["variables"]
    assert answers[0] == json.loads(json.dumps(expected))


def test_fmus_are_run_to_the_same_stop_time(harness, external_fmu_folder, tmp_path):
    shorter = {"modelDescription.xml": lambda text: text.replace('stopTime="1.0"', 'stopTime="0.75"')}
    external_fmus.edited_copy(external_fmu_folder / "NonConforming.fmu", tmp_path / "Shorter.fmu", shorter)
    result = harness("compare", "Shorter.fmu", external_fmu_folder / "NonConforming.fmu", "--lenient", "--within", 0)
    assert (result.returncode, result.stderr) == (0, "")
    assert "(common to both)" in result.stdout


def test_an_fmu_that_terminates_is_compared_up_to_its_end(harness, external_fmu_folder):
    result = harness("compare", external_fmu_folder / "Falling.fmu", external_fmu_folder / "Falling.fmu", "--json")
    assert result.returncode == 1
    assert json.loads(result.stdout)["variables"][0]["largest"] == 0.0
    assert "it terminated the simulation: fmi2DoStep returned Discard" in result.stderr


@pytest.mark.parametrize("value", [np.nan, np.inf])
@pytest.mark.parametrize("side", ["left", "right", "both"])
@pytest.mark.parametrize("at", [1, 7, 18])
@pytest.mark.parametrize("shift", [0.0, 0.013])
def test_a_nonfinite_value_on_either_side_is_an_infinite_difference(value, side, at, shift):
    """Also beside a variable that agrees, before and after it, and where times are interpolated."""
    t = np.linspace(0, 1, 20)
    good, bad = np.sin(t), np.where(np.arange(20) == at, value, np.cos(t))
    left = {"a": good, "x": bad if side != "right" else np.cos(t), "z": good}
    right = {"a": good, "x": bad if side != "left" else np.cos(t), "z": good}
    units = dict.fromkeys(left, "m")
    comparison = compare(signals("one", t, left, units), signals("two", t + shift, right, units))
    assert np.isnan(comparison.worst)
    assert not comparison.worst <= 1e300


def test_within_fails_on_nan(tmp_path):
    (tmp_path / "good.csv").write_text("t [s],x [m]\n0,1\n1,2\n2,3\n")
    (tmp_path / "bad.csv").write_text("t [s],x [m]\n0,1\n1,nan\n2,3\n")
    for pair in (("good.csv", "bad.csv"), ("bad.csv", "good.csv"), ("bad.csv", "bad.csv")):
        result = commands.harness(tmp_path, "compare", *pair, "--within", "1e9", COLUMNS="120")
        assert result.returncode == 1
        assert "x is not a finite number at t = 1 s" in result.stdout
        assert result.stderr.count("\n") == 1
        assert "has values that are not finite" in result.stderr


@pytest.mark.parametrize("is_reversed", [False, True])
def test_a_difference_is_relative_to_the_larger_side(is_reversed):
    t = np.linspace(0, 1, 20)
    small, large = ({"x": np.full(20, size)} for size in (1.0, 4.0))
    pair = [signals(name, t, columns, {"x": "m"}) for name, columns in (("small", small), ("large", large))]
    (difference,) = compare(*(reversed(pair) if is_reversed else pair)).differences
    assert difference.relative == 0.75
    assert difference.largest == 3.0


def test_differences_near_overflow_have_a_relative_value():
    t = np.linspace(0, 1, 20)
    first, second = ({"x": np.full(20, value)} for value in (1e308, -1e308))
    comparison = compare(signals("one", t, first, {"x": "m"}), signals("two", t, second, {"x": "m"}))
    assert comparison.worst == 2.0


def test_a_comparison_first_says_what_differs_in_the_events():
    """Changes of mode; slips, which need no modes; the sticks of one side, if there is no driver."""
    t = np.linspace(0.0, 4.0, 4001)
    units = {"v": "m/s", "x_driver": "m"}

    def make_signals(name, shift, events=None, driver=True):
        columns = {"v": 0.1 - 0.2 * np.cos(np.pi * (t - shift))} | ({"x_driver": 0.1 * t} if driver else {})
        return Signals(t, columns, units, events=events, label=name)

    def modes(*times):
        return ModeChanges(np.array([0.0, *times]), {"F": np.arange(len(times) + 1) % 2})

    comparison = compare(make_signals("one", 0.0, modes(1.0, 2.0)), make_signals("two", 0.0, modes(1.0, 2.5)))
    assert comparison.events == (
        "2 changes of mode in both, at most 0.5 s apart; "
        "the first that differs is to 0 at t = 2 s in one and 2.5 s in two"
    )
    slips = compare(make_signals("one", 0.0, modes(1.0, 2.0)), make_signals("two", 0.125))
    assert slips.events == (
        "4 starts and ends of slips, at the speed of the driver, in both, at most 0.125 s apart; "
        "the first that differs is the start at t = 0.5 s in one and 0.625 s in two"
    )
    sticks = compare(make_signals("one", 0.0, modes(1.0, 2.0)), make_signals("two", 0.125, driver=False))
    assert sticks.events == "one sticks from t = 0 to 1 s, from t = 2 to 4 s; two has no modes"
    assert slips.pairs is sticks.pairs is sticks.slips is None
