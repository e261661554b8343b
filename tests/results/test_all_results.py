"""Every result of every study: in one line, as the command prints it, as HTML, table and picture, saved and loaded."""

import inspect
import itertools
import json
import shutil
from dataclasses import replace
from functools import cache
from html.parser import HTMLParser
from pathlib import Path
from tempfile import TemporaryDirectory, mkdtemp

import commands
import matplotlib
import numpy as np
import pytest
from decays import decay_record
from matplotlib.figure import Figure
from native_fmus import build_native_fmus

import harness
from harness.references.peer_solvers import FMU
from harness.references.reference_trajectory import CommunicationGrid
from harness.results.registry import STUDIES
from harness.studies.precision.study import Point, PrecisionCase
from harness.studies.stability.study import CaseOutcome, StabilityCase, StabilityRegion

pytestmark = pytest.mark.usefixtures("in_workspace")


@pytest.fixture(autouse=True)
def no_display(monkeypatch):
    """Draw without a display, and close all figures at the end."""
    pyplot = pytest.importorskip("matplotlib.pyplot")
    pyplot.switch_backend("Agg")
    yield
    pyplot.close("all")


def identified_decay():
    record = decay_record(0.02, 0.003, noise=1e-4)
    return harness.identify_decay(record.t, record.x, unit="m", k=157.9)


def identified_curve():
    v = np.array([s * w for w in np.geomspace(1e-3, 0.3, 10) for s in (1, -1)])
    force = np.sign(v) * (1.0 + 0.5 * np.exp(-((v / 0.02) ** 2))) + 2.0 * v + 0.1 + 0.01 * np.sin(1e3 * v)
    force[3] += 1.0
    return harness.identify_curve((v, force), mass=2.0)


def compared_runs():
    return harness.compare(harness.simulate("coulomb"), harness.simulate("coulomb", {"f": 0.6}))


def fitted_parameters():
    run = harness.simulate("coulomb", stop=2.0, interval=0.04, outputs=["x"])
    return harness.fit(build_native_fmus() / "coulomb.fmu", run, ["f", "k"])


def swept_parameters():
    return harness.sweep("smd", {"c": [0.0, 1.0, 2.0], "k": [100.0, 200.0]}, measures=["final", "largest"])


def pulled_sled():
    return harness.simulate("stickslip", stop=6.0)


def differentiated_sled():
    return harness.sensitivity(build_native_fmus() / "stickslip.fmu", ["mu_s", "k"], stop=6.0)


def moving_sled():
    return harness.orbit(build_native_fmus() / "stickslip.fmu", {"mu_d": 0.8})


def mapped_sled():
    return harness.map_motions(
        build_native_fmus() / "stickslip.fmu", {"mu_d": [0.6, 0.75, 0.9], "k": [700.0, 750.0, 800.0]}
    )


def measured_precision():
    """Points of one case by two methods, one of which failed once."""
    case = PrecisionCase("smd", "linear", {"k": 100.0})
    points = [
        Point("smd", tool, method, rtol, 1e-3 * rtol, 1e-3, 100, rtol, rtol, rtol)
        for tool, method in ((FMU, "dop853"), (FMU, "ode45"), ("scipy", "RK45"))
        for rtol in (1e-4, 1e-7)
    ]
    points.append(Point("smd", "scipy", "RK45", 1e-9, 1e-12, failure="too slow"))
    return harness.PrecisionResult("smd", (case,), tuple(points))


def judged_cases():
    """A run that finished, one that was refused, and the steps of a method."""
    run = harness.simulate("smd", {"solver.rtol": 1e-6}, method="dop853", stop=0.1)
    spec = replace(run.spec, values={"solver.method": 4, "solver.rtol": 1e-6})
    grid = CommunicationGrid(0.0, 1.0, 10)
    finished_case = StabilityCase("stiff", "smd", "dop853", spec, grid, [], max_error=1e-6)
    refused_case = StabilityCase("no mass", "smd", "dop853", spec, grid, [], expected_message="m = 0")
    motion = replace(run, time=np.zeros(0), columns={}, spec=spec)
    outcomes = (
        CaseOutcome(finished_case, "finished", "", 1e-8, 0.0, motion),
        CaseOutcome(refused_case, "refused", "m = 0 is not"),
    )
    region = StabilityRegion("dop853", np.array([1e-2, 1e-3]), np.array([100.0, 900.0]), -0.95)
    return harness.StabilityResult(outcomes, (region,))


MAKERS = {
    "run": pulled_sled,
    "decay": identified_decay,
    "curve": identified_curve,
    "fit": fitted_parameters,
    "sweep": swept_parameters,
    "compare": compared_runs,
    "sensitivity": differentiated_sled,
    "orbit": moving_sled,
    "map": mapped_sled,
    "precision": measured_precision,
    "stability": judged_cases,
}
FOLDER = TemporaryDirectory()  # of saved results, until this process ends
result_of = cache(lambda study: MAKERS[study]())
every_study = pytest.mark.parametrize("study", MAKERS)


@cache
def saved_folder(study):
    """Return the folder of a saved result, which all tests of this process share."""
    folder = Path(mkdtemp(dir=FOLDER.name)) / "kept"
    with commands.blank_figures():  # test_figures.py draws them
        result_of(study).save(folder)
    return folder


def files_of(folder):
    """Return the files of a result by name, without its origin, date and run times."""
    names = ("provenance.json", "summary.json", "data.npz")
    return {file.name: file.read_bytes() for file in Path(folder).iterdir() if file.name not in names}


def test_every_study_is_tested_here():
    assert list(MAKERS) == [study.name for study in STUDIES]


@every_study
def test_a_result_is_one_line_text_and_html(study):
    result = result_of(study)
    assert len(repr(result).splitlines()) == 1
    assert len(repr(result)) < 400
    assert repr(result).startswith(f"<{type(result).__name__} of {result.title}: ")
    assert str(result).strip()
    parser = HTMLParser()
    parser.feed(result._repr_html_())
    assert "<td>" in result._repr_html_() or "<p>" in result._repr_html_()
    summary = result.summary()
    assert (summary.study, bool(summary.sentences or summary.tables)) == (study, True)


def test_a_run_without_points_is_one_line():
    """As in the outcomes of stability, which keep no signals."""
    motion = judged_cases().outcomes[0].motion
    assert repr(motion) == f"<RunResult of {motion.title}: no outputs; 0 points>"


@every_study
def test_a_result_converts_to_a_table(study):
    pytest.importorskip("pandas")
    frame = result_of(study).to_pandas()
    assert len(frame)
    assert len(frame.select_dtypes("number").columns)


@every_study
def test_a_result_is_plotted_whole_or_in_given_axes(study):
    result = result_of(study)
    panels = result.plot()
    assert len(panels)
    assert all(panel.has_data() for panel in panels if panel.get_visible())
    axes = Figure().subplots()
    assert result.plot(ax=axes).tolist() == [axes]
    assert axes.has_data()
    assert matplotlib.rcParams["font.size"] != 9  # the style of the figure is not that of the user


@every_study
def test_a_saved_result_loads_as_the_same_class_with_the_same_files(study):
    """Among them the texts of its figure."""
    result, loaded_result = result_of(study), harness.load_result(saved_folder(study))
    assert type(loaded_result) is type(result)
    assert (repr(loaded_result), str(loaded_result)) == (repr(result), str(result))
    loaded_content, content = (
        json.loads(json.dumps(item.as_json(), default=str, sort_keys=True)) for item in (loaded_result, result)
    )
    if study == "sweep":
        assert (loaded_content.pop("folder"), content.pop("folder")) == (str(saved_folder(study)), None)
    assert loaded_content == content
    with commands.blank_figures():
        loaded_result.save("again")
    assert files_of(saved_folder(study)) == files_of("again")


@every_study
def test_a_saved_result_holds_its_summary_and_origin(study):
    stored_summary, result = json.loads((saved_folder(study) / "summary.json").read_text()), result_of(study)
    expected = result.summary()
    assert (stored_summary["study"], stored_summary["title"], stored_summary["sentences"]) == (
        study,
        "kept",
        [*expected.sentences],
    )
    assert [table["rows"] for table in stored_summary["tables"]] == [
        [*map(list, table.rows)] for table in expected.tables
    ]
    assert stored_summary["files"] == sorted(path.name for path in saved_folder(study).glob("*.csv"))
    assert f": harness.{result._function}" in stored_summary["origin"][0]


@every_study
def test_a_result_of_another_source_is_not_replaced(study):
    other = next(name for name in [*MAKERS][::-1] if name != study)
    shutil.copytree(saved_folder(study), "kept")
    with pytest.raises(harness.HarnessError, match=r"kept holds"):
        result_of(other).save("kept")
    assert harness.load_result("kept").study == study


@pytest.mark.parametrize("study", [study for study in MAKERS if study != "run"])  # which has its tables alone
def test_damaged_data_are_reported(study):
    shutil.copytree(saved_folder(study), "kept")
    data = Path("kept/data.npz")
    for content in (b"", data.read_bytes()[:-200], data.read_bytes().replace(b"content", b"another")):
        data.write_bytes(content)
        with pytest.raises(harness.SceneError, match=r"data\.npz cannot be read .*: write it again"):
            harness.load_result("kept")


def test_a_record_in_a_comparison_has_no_run():
    """Also after loading; the other side is the run."""
    run = result_of("run")
    record = {"t [s]": run.time, "x [m]": run["x"]}
    harness.compare(run, record).save("kept")
    comparison = harness.load_result("kept")
    assert [type(side) for side in (comparison.one, comparison.two)] == [harness.Trajectory, harness.Signals]
    assert not hasattr(comparison.two, "spec")
    assert comparison.worst == 0.0
    assert comparison.two.name == "the record"
    assert repr(comparison.two).startswith("<Signals of the record: x; ")
    assert json.loads(Path("kept/provenance.json").read_text())["files"].keys() == {str(run.spec.fmu)}
    np.testing.assert_array_equal(comparison.two.plot("x")[0].lines[0].get_ydata(), run["x"])
    assert comparison.plot()[-1].get_xlim() == (run.time[0], run.time[-1])


def test_a_run_is_a_mapping_from_its_outputs():
    run = result_of("run")
    assert list(run) == list(run.keys()) == list(run.columns)
    assert len(run) == len(run.columns)
    assert ("x" in run, "y" in run) == (True, False)
    assert all(values is run[name] for name, values in run.items())
    assert {name: len(values) for name, values in dict(run).items()} == dict.fromkeys(run, len(run.time))


def test_a_phase_plane_has_an_output_on_each_axis():
    run = result_of("run")
    (axes,) = run.plot("v", x="x")
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("x [m]", "v [m/s]")
    np.testing.assert_array_equal(axes.lines[0].get_xydata().T, [run["x"], run["v"]])
    with pytest.raises(harness.SceneError, match="unknown column 'y'"):
        run.plot("v", x="y")
    with pytest.raises(harness.HarnessError, match="name one"):
        run.plot("v", "x", ax=axes)


def report_on(folder):
    """Return the report on the results in a folder."""
    assert commands.harness(folder, "report", "--out", ".").returncode == 0
    return (Path(folder) / "report.html").read_text(encoding="utf-8")


def test_every_study_has_a_command_and_a_section_in_the_report(tmp_path):
    for study in STUDIES:
        assert commands.harness(tmp_path, study.command, "--help").returncode == 0
        shutil.copytree(saved_folder(study.name), tmp_path / "results" / study.name / "mine")
    page = report_on(tmp_path / "results")
    titles = [page.index(f">{study.title}<") for study in STUDIES]
    assert titles == sorted(titles)


def test_a_result_without_anything_to_draw_has_no_empty_figure():
    result = replace(result_of("stability"), regions=())
    with pytest.raises(harness.HarnessError, match="this stability result has nothing to plot"):
        result.plot()
    result.save("kept")
    assert not Path("kept/figure.svg").exists()
    assert json.loads(Path("kept/summary.json").read_text())["picture"] == ""


def test_a_summary_of_an_unknown_study_is_at_the_end_of_the_report(tmp_path):
    shutil.copytree(saved_folder("decay"), tmp_path / "decay" / "mine")
    file = tmp_path / "decay" / "mine" / "summary.json"
    file.write_text(file.read_text().replace('"study": "decay"', '"study": "wavelets"'))
    shutil.copytree(saved_folder("stability"), tmp_path / "stability")
    page = report_on(tmp_path)
    assert page.index(">Stability<") < page.index(">wavelets<")
    with pytest.raises(harness.SceneError, match="unknown study 'wavelets'"):
        harness.load_result(tmp_path / "decay" / "mine")


# methods by which the harness calls its own classes, with arguments of types that users do not make
INTERNAL = {
    "curve",
    "rank_solvers",
    "signals",
    "solvers",
    "unit_factor",
}
INTERNAL |= {"check_sampling", "column_of_role", "contact_of", "get_parameter", "sample_at", "rest", "signal"}
OTHER_MAKERS = {
    "Signals": lambda: result_of("compare").one,
    "ModeChanges": lambda: pulled_sled().events,
    "Record": lambda: harness.read_record(commands.ROOT / "docs/records/spring.csv"),
    "FmuDescription": lambda: harness.describe("smd"),
}
OPERATORS = {"__getitem__", "__contains__"}
VALID = {"folder": "kept", "begin": 0.5, "end": 1.0, "contact": "F_friction", "stop": 1.0, "rtol": 0.0, "atol": 0.0}
VALID |= {"output": "x", "parameter": "k"}
WRONG = [
    5,
    -1.0,
    float("nan"),
    None,
    True,
    "a\0b",
    "x",
    "a" * 9000,
    b"x",
    [],
    ["x"],
    {},
    (1, 2),
    object(),
    np.zeros(2),
    len,
]


@pytest.mark.parametrize("maker", [*MAKERS, *OTHER_MAKERS])
def test_a_method_uses_an_argument_or_refuses_it_in_one_sentence(maker, monkeypatch):
    monkeypatch.setattr("harness.results.result.Result._write_figure", lambda result, path: None)
    value, failures = result_of(maker) if maker in MAKERS else OTHER_MAKERS[maker](), []
    methods = [getattr(value, name) for name in dir(type(value)) if name in OPERATORS or name[0] != "_"]
    for method in filter(inspect.ismethod, methods):
        parameters = inspect.signature(method).parameters if method.__name__ not in INTERNAL else {}
        required_arguments = {name: VALID[name] for name in parameters if name in VALID}
        for name, wrong in itertools.product(parameters, WRONG):
            try:
                if name in ("name", "names"):
                    method(wrong)
                else:
                    method(**required_arguments | {name: wrong})
            except harness.HarnessError as error:
                failures += [(method.__name__, name, wrong, error)] * ("\n" in str(error))
            except Exception as error:
                failures.append((method.__name__, name, wrong, error))
    assert failures == []
