"""External FMUs are run, or refused in one sentence; nothing hangs, nothing is lost."""

import csv
import json
import os
import re
from math import cos, exp, sin, sqrt
from pathlib import Path
from types import SimpleNamespace
from zipfile import ZipFile

import commands
import external_fmus
import numpy as np
import pytest
from variants import campaign_after, slow_after

from harness import describe, load_result
from harness.scenes.run_spec import RunSpec
from harness.simulation.external.step_refinement import RefinementRun, refine


@pytest.fixture(scope="module")
def external_fmu_folder():
    """The folder of the external FMUs."""
    return external_fmus.build_external_fmus()


@pytest.fixture
def run(external_fmu_folder, tmp_path):
    """Return run(name, ...): the finished `run`, and the result by column; each FMU is plotted once in this
    file."""

    def run(name, *arguments, figures=False):
        fmu = name if name.endswith(".fmu") else external_fmu_folder / f"{name}.fmu"
        result = commands.harness(tmp_path, "run", fmu, *arguments, COLUMNS="120", figures=figures)
        assert "Traceback" not in result.stderr
        assert "np." not in result.stdout + result.stderr
        return result, table(tmp_path / "results" / name.removesuffix(".fmu") / "trajectory.csv")

    return run


def table(file):
    """Return the columns of a result by heading, if there is one: numbers, or strings."""
    if not file.is_file():
        return None
    with file.open(encoding="utf-8", newline="") as lines:
        heads, *rows = csv.reader(lines)
    columns = [np.array(column) for column in zip(*rows, strict=True)]
    return {
        head: column if head == "says" else column.astype(float) for head, column in zip(heads, columns, strict=True)
    }


def assert_succeeded(result):
    assert (result.returncode, result.stderr) == (0, "")


def assert_refused(result, status, *sentences):
    assert result.returncode == status
    assert result.stderr.startswith("Error: ")
    assert result.stderr.count("Error: ") == 1
    for sentence in sentences:
        assert sentence in result.stderr


@pytest.mark.parametrize("name", slow_after(1, ["Midpoint", "Fmi3Midpoint", "ModelExchangeOnly"]))
@pytest.mark.parametrize("tolerance", [1e-3, pytest.param(1e-5, marks=pytest.mark.slow)])
def test_an_fmu_with_hidden_steps_is_refined_until_two_results_agree(run, name, tolerance):
    result, rows = run(name, "--set", "k=50", "--rtol", tolerance)
    assert_succeeded(result)
    assert "changes no output by more than" in result.stdout
    time, position, *_ = rows.values()
    assert time[-1] == 1.0
    assert np.abs(position - np.cos(sqrt(50) * time)).max() < 2 * tolerance


def test_a_state_that_jumps_at_events_agrees_with_its_closed_form(run):
    """FMI 2.0: after bounce n the ball rises with e^n times the speed of its first fall."""
    e, g = 0.8, 9.81
    result, rows = run("Bouncing", "--set", f"e={e}")
    assert_succeeded(result)
    fall = sqrt(2 / g)
    bounces = fall + 2 * fall * np.cumsum([0, *(e**n for n in (1, 2))])
    since = rows["t [s]"][-1] - bounces[-1]
    assert rows["bounces"][-1] == len(bounces)
    assert rows["h [m]"][-1] == pytest.approx(g * fall * e**3 * since - g / 2 * since**2, abs=1e-5)
    jumps = np.flatnonzero(np.diff(rows["bounces"]))
    assert rows["t [s]"][jumps] == pytest.approx(bounces, abs=1e-6)
    assert rows["v [m/s]"][jumps + 1] == pytest.approx(-e * rows["v [m/s]"][jumps], abs=1e-9)


@pytest.mark.parametrize("interface", ["CoSimulation", "ModelExchange"])
def test_clocks_tick_at_their_times_in_event_mode(run, interface):
    """x = e^(-2 t). The FMU refuses ticks at other times, steps past a tick, and reading without an active clock."""
    result, rows = run("Ticking", "--interface", interface)
    assert_succeeded(result)
    ticks = {"samples": 0.05 + 0.1 * np.arange(10), "growths": [0.125, 0.375, 0.875], "timed_out": [0.25 + 0.07]}
    for name, times in ticks.items():
        assert rows["t [s]"][1:][np.diff(rows[name]) != 0] == pytest.approx(times, abs=1e-12)
    assert rows["held"][-1] == pytest.approx(exp(-2 * 0.95), rel=1e-6)
    assert rows["fifth_x"][-1] == pytest.approx(exp(-2 * 0.45), rel=1e-6)  # of a clock that the FMU ticks itself


def test_clocks_that_cannot_tick_are_refused(run, external_fmu_folder, tmp_path):
    def run_edited(old, new, *arguments):
        assert old in (external_fmus.SOURCES / "Ticking/modelDescription.xml").read_text()
        edit = {"modelDescription.xml": lambda text: text.replace(old, new)}
        copy = external_fmus.edited_copy(external_fmu_folder / "Ticking.fmu", tmp_path / "Ticking.fmu", edit)
        return run(str(copy), *arguments)

    result, _ = run_edited('hasEventMode="true"', "")
    assert_refused(result, 1, "(sample, timeout, growing, fifth), but no event mode; use --interface ModelExchange")
    name, countdown = 'name="timeout" ', 'intervalVariability="countdown"'
    triggered_attributes = 'causality="input" variability="discrete" intervalVariability="triggered"'
    result, _ = run_edited(
        f'{name}valueReference="10" causality="input" variability="discrete" {countdown}',
        f'{name}valueReference="10" {triggered_attributes}',
    )
    assert_refused(result, 1, "Ticking has triggered input clocks (timeout), which only another FMU can tick")
    result, _ = run_edited('intervalDecimal="0.1"', 'intervalDecimal="0"')
    assert_refused(result, 1, "its clock sample has an interval of 0.0 s; it must be positive")
    (tmp_path / "x.csv").write_text("time,x\n" + "".join(f"{0.1 * i},{exp(-0.2 * i)}\n" for i in range(21)))
    result = commands.harness(tmp_path, "fit", external_fmu_folder / "Ticking.fmu", "x.csv", "--free", "k")
    assert_refused(
        result,
        1,
        "it has clocks (sample, timeout, growing, fifth), which only single runs, comparisons and sweeps tick",
    )


def test_an_fmu_with_a_fixed_internal_step_is_reported_as_such_also_in_its_result(run, tmp_path):
    result, rows = run("FixedStep")
    assert_succeeded(result)
    note = "fixed internal step of 0.1 s, error unknown"
    assert note in result.stdout
    assert note in load_result(tmp_path / "results/FixedStep").note
    assert rows["x"][-1] == pytest.approx(0.9**100)  # 41 % off
    assert abs(0.9**100 / exp(-10) - 1) > 0.4


def test_booleans_integers_and_strings_are_recorded_drawn_and_set(run, tmp_path):
    result, rows = run("Switching", "--set", "enabled=true", "--set", "most=3", "--set", "name=007", figures=True)
    assert_succeeded(result)
    assert (tmp_path / "results/Switching/figure.svg").is_file()
    assert {*rows["on"]} == {0, 1}
    assert rows["switched"][-1] == 3
    assert {*rows["says"]} == {"cold", "007 cold", "007 warm"}
    assert re.search(r"^says +cold +007 ", result.stdout, re.M)
    result, rows = run("Switching", "--set", "enabled=FALSE", "--set", "most=3.0")
    assert_succeeded(result)
    assert not rows["on"][-1]


def test_arrays_and_enumerations_are_recorded_elementwise_and_set(run):
    result, rows = run("Arrays", "--set", "begin=0,2", "--set", "sense=right", "--set", "omega=1.5")
    assert_succeeded(result)
    turn = [f"turn[{i},{j}]" for i in (1, 2) for j in (1, 2)]
    assert [*rows] == ["t [s]", *turn, "place[1]", "place[2]", "going", "says"]
    assert rows["place[1]"][-1] == pytest.approx(2 * sin(1.5))
    assert rows["turn[2,1]"][-1] == pytest.approx(-sin(1.5))
    assert rows["turn[2,2]"][-1] == pytest.approx(cos(1.5))
    assert {*rows["going"]} == {2}


SCENE = """
title = "Of somebody's"
fmu = "{fmu}"
outputs = {outputs}
tolerance = 1e-4
{more}
"""


@pytest.mark.parametrize(
    ("name", "outputs", "more", "columns"),
    slow_after(
        1,
        [
            ("Arrays", ["place[2]", "says", "turn"], "grid = 0.01\n[values]\nsense = 'right'\nbegin = [0, 2]", None),
            ("ModelExchangeOnly", ["v"], "exchange = true", ["v"]),
        ],
    ),
)
def test_a_scene_may_use_any_fmu(external_fmu_folder, tmp_path, name, outputs, more, columns):
    (tmp_path / "mine.toml").write_text(
        SCENE.format(fmu=external_fmu_folder / f"{name}.fmu", outputs=outputs, more=more)
    )
    without_strings = name != "Arrays"  # whose strings and elements are drawn
    result = commands.harness(tmp_path, "run", "mine.toml", figures=not without_strings, COLUMNS="120")
    assert_succeeded(result)
    rows = table(tmp_path / "results/mine/trajectory.csv")
    turn = [f"turn[{i},{j}]" for i in (1, 2) for j in (1, 2)]
    assert [*rows][1:] == (columns or ["place[2]", "says", *turn])
    if name == "Arrays":
        assert len(rows["t [s]"]) == 101
        assert rows["place[2]"][-1] == pytest.approx(2 * cos(3))
    assert (tmp_path / "results/mine/figure.svg").is_file()
    assert "error unknown" in result.stdout or "changes no output by more than" in result.stdout
    assert "the same, bit for bit" in commands.harness(tmp_path, "run", "mine.toml", COLUMNS="120").stdout


@pytest.mark.parametrize(
    ("name", "arguments", "end", "message"),
    [
        (
            "Falling",
            ["--set", "height=1.22625"],
            0.5,
            "fmi2Terminated at t = 0.5 s: the stone is on the ground",
        ),
        (
            "Fmi3Midpoint",
            ["--set", "limit=0.5", "--rtol", "1e-3"],
            0.5,
            "fmi3DoStep returned terminateSimulation at t = 0.5",
        ),
    ],
)
def test_an_fmu_that_terminates_is_reported_by_status_and_keeps_its_samples(run, name, arguments, end, message):
    result, rows = run(name, *arguments)
    assert_refused(
        result,
        1,
        f"{name}.fmu: it terminated the simulation: ",
        message,
        f"the results up to that time are in results/{name}",
    )
    assert rows["t [s]"][-1] == pytest.approx(end, abs=1e-3)
    assert len(rows["t [s]"]) > 60


@pytest.mark.parametrize(
    ("kind", "message"),
    [
        *campaign_after(
            3,
            [
                (2, "its binary crashed (Segmentation fault), after t = 0.5 s"),
                (3, "fmi2DoStep returned Fatal at t = 0.5 s: "),
                (5, "x is nan at t = 0.515625 s"),
                (6, "it terminated the simulation: fmi2DoStep returned Discard with fmi2Terminated at t = 0.5 s"),
                (1, "a call did not return within 4 s (--timeout sets the limit), after t = 0.5 s"),
            ],
        ),
        pytest.param(7, "a call did not return within 4 s", marks=pytest.mark.campaign),  # as 1, stopped by a signal
    ],
)
def test_a_hang_crash_exception_or_nan_is_one_sentence_and_keeps_its_samples(run, kind, message):
    result, rows = run("Faulty", "--set", f"kind={kind}", "--timeout", "4")
    assert_refused(result, 1, f"Faulty.fmu: {message}")
    assert result.stderr.count("\n") == 1
    assert rows["t [s]"][-1] == 0.5
    assert (rows["x"] == rows["t [s]"]).all()


def test_a_scene_that_fails_keeps_its_stop_time_for_a_repetition(external_fmu_folder, tmp_path):
    scene = SCENE.format(fmu=external_fmu_folder / "Faulty.fmu", outputs=["x"], more="stop = 0.9\nvalues.kind = 5")
    (tmp_path / "mine.toml").write_text(scene)
    assert_refused(commands.harness(tmp_path, "run", "mine.toml"), 1, "x is nan at t = 0.5")
    assert json.loads((tmp_path / "results/mine/provenance.json").read_text())["run"]["stop"] == 0.9


def test_the_longest_of_the_refinement_runs_is_kept(run, external_fmu_folder, tmp_path):
    """The first ends, and the second, with shorter steps, crashes."""
    crash = "if h < 0.01 and t > 0.25:\n            import os; os.kill(os.getpid(), 11)\n        x, v ="
    changes = {"resources/Midpoint.py": lambda text: text.replace("x, v =", crash, 1)}
    external_fmus.edited_copy(external_fmu_folder / "Midpoint.fmu", tmp_path / "Midpoint.fmu", changes)
    result, rows = run(str(tmp_path / "Midpoint.fmu"))
    assert_refused(result, 1, "its binary crashed (Segmentation fault), after t = 1 s")
    assert rows is None
    assert len(load_result(tmp_path / "results/Midpoint").time) == 65


def test_the_output_of_an_fmu_is_reported_and_harmless(run):
    result, rows = run("Faulty", "--set", "kind=4", "--json")
    assert_succeeded(result)
    assert "it printed: I am at 1.0" in json.loads(result.stdout)["note"]
    assert rows["x"][-1] == 1.0


def test_violations_of_the_standard_are_listed_and_tolerated_with_lenient(run):
    result, rows = run("NonConforming")
    assert_refused(
        result,
        1,
        "NonConforming.fmu violates the FMI standard in 2 places:",
        '"count" (line 16)',
        '"up" (line 19)',
        "--lenient",
    )
    assert rows is None
    result, rows = run("NonConforming", "--lenient")
    assert_succeeded(result)
    assert rows["x"][-1] == pytest.approx(cos(sqrt(40)))
    assert (rows["up"] == (rows["x"] > 0)).all()


TYPE = '<TypeDefinitions><SimpleType name="T"><Real odd="1"/></SimpleType></TypeDefinitions>'
UNREADABLE = [
    ("<Real", '<Real declaredType="Nowhere"'),
    ("<DefaultExperiment", f"{TYPE}<DefaultExperiment"),  # an unknown attribute of a type
    ('index="1"', 'index="77" dependencies="78"'),
    ('start="40"', 'start="40" derivative="77"'),
    ('variability="tunable"', 'variability="continuous"'),
    ("</ModelVariables>", '<ScalarVariable name="z" valueReference="9"/></ModelVariables>'),  # without a type
    ('fmiVersion="2.0"', 'fmiVersion="2.0.4"'),
]


def test_descriptions_that_fmpy_cannot_read_are_read_with_lenient(run, external_fmu_folder, tmp_path):
    def edit(name, replacements):
        def change(text):
            for old, new in replacements:
                assert old in text
                text = text.replace(old, new)
            return text

        midpoint = external_fmu_folder / "Midpoint.fmu"
        return external_fmus.edited_copy(midpoint, tmp_path / name, edited_description(change))

    for old, new in UNREADABLE:
        result, _ = run(str(edit("odd.fmu", [(old, new)])))
        assert result.returncode == 1, new
    edit("odd.fmu", UNREADABLE)
    result, rows = run("odd.fmu", "--lenient", "--stop", "0.5", "--rtol", "1e-3")
    assert_succeeded(result)
    assert {"x", "v"} <= {*rows}
    assert rows["x"][-1] == pytest.approx(cos(0.5 * sqrt(40)), abs=1e-3)


@pytest.mark.parametrize(
    ("name", "arguments", "status", "sentence"),
    [
        ("Midpoint", ["--set", "mass=1"], 2, "unknown variable to set 'mass'; allowed: k"),
        ("Midpoint", ["--set", "k=abc"], 2, "k = 'abc' is a text, not a number"),
        ("Midpoint", ["--set", "k=1e999"], 2, "k = inf must be a finite number or a text"),
        ("Midpoint", ["--stop", "-1"], 2, "stop = -1.0 s is not after start"),
        ("Midpoint", ["--interface", "ModelExchange"], 1, "offers co-simulation; model exchange is not among them"),
        ("Switching", ["--set", "enabled=5"], 2, "enabled = 5.0 is not a Boolean; use true or false"),
        ("Switching", ["--set", "most=1.5"], 2, "most = 1.5 is outside its range; allowed: any whole number"),
        ("Switching", ["--set", "most=3000000000"], 2, "any whole number, at least -2147483648 and at most 2147483647"),
        ("Arrays", ["--set", "begin=1,2,3"], 2, "begin = '1,2,3' has 3 elements, not 2"),
        ("Arrays", ["--set", "begin=1,x"], 2, "begin = 'x' is a text, not a number"),
        ("Arrays", ["--set", "sense=up"], 2, "unknown value of sense 'up'; allowed: left, right"),
    ],
)
def test_an_unsupported_request_is_one_sentence(run, name, arguments, status, sentence):
    result, _ = run(name, *arguments)
    assert_refused(result, status, sentence)


def test_a_scene_that_requests_invisible_steps_is_refused(external_fmu_folder, tmp_path):
    scene = SCENE.format(fmu=external_fmu_folder / "Midpoint.fmu", outputs=["x", "v"], more="analyses = ['steps']")
    (tmp_path / "mine.toml").write_text(scene)
    result = commands.harness(tmp_path, "run", "mine.toml", COLUMNS="120")
    assert_refused(result, 2, "Midpoint.fmu does not expose its solver steps")


def edited_description(change):
    return {"modelDescription.xml": change}


@pytest.mark.parametrize(
    ("name", "changes", "sentence"),
    [
        (
            "Midpoint",
            edited_description(lambda text: text.replace('fmiVersion="2.0"', 'fmiVersion="1.0"')),
            "has FMI version 1.0",
        ),
        ("Midpoint", edited_description(lambda text: text.replace('"v"', '"x"')), 'The variable name "x" (line'),
        ("Midpoint", edited_description(lambda text: text.replace(' start="40"', "")), 'Variable "k" (line'),
        ("Midpoint", edited_description(lambda text: text.replace("<ModelVariables", "<Nonsense")), "cannot be read: "),
        (
            "Midpoint",
            edited_description(lambda text: text.replace('stopTime="1.0"', "")),
            "has no default stop time; set one",
        ),
        *[
            (
                "Midpoint",
                edited_description(lambda text, times=times: text.replace('startTime="0.0" stopTime="1.0"', times)),
                "there are too few floating-point times",
            )
            for times in ('startTime="0.0" stopTime="INF"', 'startTime="1e17" stopTime="100000000000000016"')
        ],
        (
            "Midpoint",
            edited_description(lambda text: text.replace('index="1"', 'index="77"')),
            "lacks a required element",
        ),
        (
            "Midpoint",
            edited_description(lambda text: text.replace('fmiVersion="2.0"', "")),
            "lacks a required element or the FMI version",
        ),
        ("Midpoint", {"modelDescription.xml": None}, 'cannot be read: "There is no item'),
        (
            "Midpoint",
            {"binaries/linux64/Midpoint.so": None},
            "has no binary linux64/Midpoint for this machine",
        ),
        (
            "Midpoint",
            {"binaries/linux64/Midpoint.so": None, "binaries/linux64/Other.so": b"\x7fELF"},
            "binaries/linux64 has Other.so, and the name must be the modelIdentifier",
        ),
        ("Midpoint", {"binaries/linux64/Midpoint.so": b"\x7fELF"}, "needs the tool that exported it"),
        (
            "Fmi3Midpoint",
            {"binaries/x86_64-linux/Fmi3Midpoint.so": None},
            "has no binary x86_64-linux/Fmi3Midpoint for this machine",
        ),
    ],
)
def test_a_damaged_file_is_one_sentence(run, external_fmu_folder, tmp_path, name, changes, sentence):
    external_fmus.edited_copy(external_fmu_folder / f"{name}.fmu", tmp_path / "damaged.fmu", changes)
    result, _ = run("damaged.fmu")
    assert result.returncode in (1, 2)
    assert_refused(result, result.returncode, "damaged.fmu", sentence)


def repeat_variable(count, causality):
    """Return a change of a model description of FMI 2.0: aliases of its first variable, which is x."""
    variables = "".join(
        f'<ScalarVariable name="alias{i}" valueReference="0" causality="{causality}"><Real/></ScalarVariable>'
        for i in range(count)
    )
    return lambda text: text.replace("</ModelVariables>", f"{variables}</ModelVariables>")


@pytest.mark.parametrize(("causality", "count"), slow_after(1, [("output", 3000), ("local", 3000)]))
def test_an_fmu_with_many_variables_runs_or_is_refused(run, external_fmu_folder, tmp_path, causality, count):
    """By default all outputs are recorded, but not the local variables of an FMU that has outputs."""
    changes = edited_description(repeat_variable(count, causality))
    external_fmus.edited_copy(external_fmu_folder / "FixedStep.fmu", tmp_path / "many.fmu", changes)
    result, rows = run("many.fmu", "--lenient")
    if causality == "output":
        assert_refused(result, 1, f"has {count + 1} outputs, more than the 1000 that are recorded by default")
        scene = 'title = "one of many"\nfmu = "many.fmu"\noutputs = ["x", "alias7"]\nlenient = true\nplots = []\n'
        (tmp_path / "mine.toml").write_text(scene)
        assert_succeeded(commands.harness(tmp_path, "run", "mine.toml"))
        rows = table(tmp_path / "results/mine/trajectory.csv")
        assert (rows["x"] == rows["alias7"]).all()
    else:
        assert_succeeded(result)
        assert set(rows) == {"t [s]", "x"}


def test_an_array_that_is_too_large_is_refused_before_its_elements_are_named(run, external_fmu_folder, tmp_path):
    huge = edited_description(lambda text: text.replace('start="2"', 'start="1000000000"', 1))
    external_fmus.edited_copy(external_fmu_folder / "Arrays.fmu", tmp_path / "huge.fmu", huge)
    result, _ = run("huge.fmu")
    assert_refused(result, 1, "outputs, more than the 1000 that are recorded by default")


@pytest.mark.filterwarnings("ignore:Duplicate name")
def test_a_second_model_description_is_refused(run, external_fmu_folder, tmp_path):
    fmu = external_fmus.edited_copy(external_fmu_folder / "Midpoint.fmu", tmp_path / "two.fmu", {})
    with ZipFile(fmu, "a") as archive:
        archive.writestr("modelDescription.xml", archive.read("modelDescription.xml").replace(b'"x"', b'"y"'))
    result, _ = run("two.fmu")
    assert_refused(result, 1, "two.fmu cannot be read: it holds modelDescription.xml 2 times")


def test_a_changed_file_is_read_again(external_fmu_folder, tmp_path):
    fmu = external_fmus.edited_copy(external_fmu_folder / "Midpoint.fmu", tmp_path / "mine.fmu", {})
    assert "x" in describe(fmu).to_pandas().index
    external_fmus.edited_copy(
        external_fmu_folder / "Midpoint.fmu", fmu, edited_description(lambda text: text.replace('name="x"', 'name="y"'))
    )
    os.utime(fmu, ns=(0, 1))  # for file systems with coarse time stamps
    assert "y" in describe(fmu).to_pandas().index


def test_unicode_names_and_missing_units_are_supported(run, external_fmu_folder, tmp_path):
    external_fmus.edited_copy(
        external_fmu_folder / "Midpoint.fmu",
        tmp_path / "\u03c9.fmu",
        edited_description(lambda text: text.replace('name="x"', 'name="\u03c6, \u3042"')),
    )
    result, _ = run("\u03c9.fmu", "--rtol", "1e-3")
    assert_succeeded(result)
    assert re.search("^\u03c6, \u3042 +1 +0.99", result.stdout, re.M)


def test_a_file_that_would_fill_the_disk_is_not_unpacked(run, external_fmu_folder, tmp_path):
    with ZipFile(
        external_fmus.edited_copy(external_fmu_folder / "Midpoint.fmu", tmp_path / "huge.fmu", {}), "a"
    ) as archive:
        archive.writestr("resources/huge", b"")
        archive.infolist()[-1].file_size = 2**60
    result, _ = run("huge.fmu")
    assert_refused(result, 1, "huge.fmu", "do not fit into the temporary directory")


WITHOUT_DECLARED_STEP = SimpleNamespace(
    coSimulation=SimpleNamespace(fixedInternalStepSize=None), defaultExperiment=None
)


def refine_synthetic(final_value, **options):
    """Refine a synthetic FMU whose output ends at final_value(number of the run, step in s); return also all steps."""
    steps = []

    def run(h, tolerance):
        steps.append(h)
        time = np.linspace(0.0, 1.0, 65)
        return RefinementRun(len(steps) - 1, time, {"x": final_value(len(steps), h) * time})

    spec = RunSpec(Path("any.fmu"), start=0.0, stop=1.0, **options)
    return refine(spec, WITHOUT_DECLARED_STEP, run), steps


@pytest.mark.parametrize("values", [(1.0, 2.0), (1e308, -1e308)])
@pytest.mark.parametrize("exchange", [False, True])
def test_results_that_never_agree_are_a_failure_only_if_the_tolerance_is_demanded(exchange, values):
    for tolerance in None, 1e-6:
        answer, steps = refine_synthetic(lambda i, h: values[i % 2], exchange=exchange, tolerance=tolerance)
        assert answer.run_number == len(steps) - 1
        assert len(steps) < 10
        assert re.search(r"(error about|changes an output by) (inf|1|0\.5|2) of (the|its) largest", answer.note)
        assert answer.failure == (f"the rtol of 1e-06 is not reached: {answer.note}; raise rtol" if tolerance else "")


@pytest.mark.parametrize("order", [0.8, 1.0, 2.0, 4.0])
@pytest.mark.parametrize("floor", [0.0, 1e-4])
def test_the_achieved_error_is_stated_and_refinement_ends_when_it_cannot_help(order, floor):
    """The error of x is known: (8 h)^order, and a floor that jumps from run to run, as with steps that do not align."""

    def error(i, h):
        return (8.0 * h) ** order + floor * sin(17.0 * i)

    answer, steps = refine_synthetic(lambda i, h: 1.0 + error(i, h))
    achieved_error = abs(error(len(steps), steps[-1]))
    stated_error = float(re.search(r"(?:error about|by more than) ([0-9.e-]+)", answer.note)[1])
    assert answer.failure == ""
    assert achieved_error <= 2.0 * stated_error
    assert stated_error <= max(1.1 * 2.0**order * achieved_error, 3.0 * floor)
    assert round(1.0 / steps[-1]) <= 2**14
    if not floor:
        assert float(re.search(r"order ([0-9.]+)", answer.note)[1]) == pytest.approx(order, abs=0.1)


@pytest.mark.parametrize("kind", [float, int, bool])
@pytest.mark.parametrize(
    ("shift", "stated_error"),
    [
        (lambda i, h: 1e-12 * (-1) ** i, 0.0),  # an event at a communication point, before it in every second run
        (lambda i, h: 0.0, 0.0),
        (lambda i, h: 3.5 * h, None),  # an event that is located with first order
    ],
)
def test_times_of_jumps_are_compared_and_not_the_values_between_them(kind, shift, stated_error):
    """Outputs are 0.3 t, and one that jumps from 0 to 1 at t = 0.25 s, and by -1 at t = 0.75 s."""

    def run(h, tolerance):
        runs.append(h)
        time = np.linspace(0.0, 1.0, round(1.0 / h) + 1)
        begin, end = 0.25 + shift(len(runs), h), 0.75 + shift(len(runs), h)
        jumping = ((time >= begin) & (time < end)).astype(kind)
        return RefinementRun(
            len(runs) - 1, time, {"x": 0.3 * time, "y": jumping + (0.1 * time if kind is float else 0)}
        )

    runs = []
    answer = refine(RunSpec(Path("any.fmu"), start=0.0, stop=1.0, tolerance=1e-5), WITHOUT_DECLARED_STEP, run)
    assert answer.failure == ""
    if stated_error is None:
        assert 0.35e-5 <= runs[-1] <= 2e-5
        assert re.search(r"changes no output by more than ([0-9.e-]+), order 1\.0", answer.note)
    else:
        assert len(runs) <= 5


def test_a_jump_in_one_run_only_is_a_difference_of_values():
    def run(h, tolerance):
        runs.append(h)
        time = np.linspace(0.0, 1.0, round(1.0 / h) + 1)
        return RefinementRun(len(runs) - 1, time, {"mode": (time >= 0.5).astype(int) * (len(runs) % 2)})

    runs = []
    answer = refine(RunSpec(Path("any.fmu"), start=0.0, stop=1.0), WITHOUT_DECLARED_STEP, run)
    assert "error about 1 of the largest mode; further halving does not reduce it" in answer.note


@pytest.fixture(scope="module")
def typed_fmu(external_fmu_folder, tmp_path_factory):
    """The FMU Arrays with parameters of all integer types, and a structural parameter for the size of `place`."""
    integers = "".join(
        f'<{kind} name="{kind}" valueReference="{50 + i}" causality="parameter" variability="fixed" start="0"/>'
        for i, kind in enumerate(INTEGERS)
    )
    size = '<UInt64 name="n" valueReference="90" causality="structuralParameter" variability="fixed" start="2"/>'

    def change(text):
        head, name, tail = text.partition('name="place"')
        tail = re.sub(r'<Dimension start="2"\s*/>', '<Dimension valueReference="90"/>', tail, count=1)
        return (head + name + tail).replace("</ModelVariables>", f"{integers}{size}</ModelVariables>")

    copy = tmp_path_factory.mktemp("typed") / "Typed.fmu"
    return external_fmus.edited_copy(external_fmu_folder / "Arrays.fmu", copy, edited_description(change))


INTEGERS = ("Int8", "UInt8", "Int16", "UInt16", "Int32", "UInt32", "Int64", "UInt64")


def test_an_array_has_the_size_of_its_structural_parameters(run, typed_fmu, tmp_path):
    result, _ = run(str(typed_fmu), "--stop", "0.1")
    assert_succeeded(result)
    columns = load_result(tmp_path / "results/Typed").columns
    assert [name for name in columns if "place" in name] == ["place[1]", "place[2]"]
    result, _ = run(str(typed_fmu), "--set", "n=-1")
    assert_refused(result, 2, "n = -1 is outside its range; allowed: any whole number")


def test_integers_of_any_width_are_exact_and_refused_beyond_their_range(run, typed_fmu):
    """The FMU has no such variables and refuses to set them, but the values beside the bounds are not even tried."""
    valid = []
    for kind in INTEGERS:
        width = int(kind.lstrip("UInt"))
        smallest, largest = (0, 2**width - 1) if kind[0] == "U" else (-(2 ** (width - 1)), 2 ** (width - 1) - 1)
        for value in (smallest - 1, largest + 1):
            result, _ = run(str(typed_fmu), "--set", f"{kind}={value}")
            assert_refused(
                result, 2, f"{kind} = {value} is ", f"any whole number, at least {smallest} and at most {largest}"
            )
        valid += ["--set", f"{kind}={largest}"]
    result, _ = run(str(typed_fmu), *valid)
    assert result.returncode == 1
    assert "whole number" not in result.stderr
