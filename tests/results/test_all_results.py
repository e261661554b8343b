"""Every result of every study: in one line, as the command prints it, as HTML, table and picture, saved and loaded."""

from functools import cache
from html.parser import HTMLParser
from pathlib import Path

import matplotlib
import numpy as np
import pytest
from decays import decay_record
from matplotlib.figure import Figure

import harness
from harness.results.files import to_json
from harness.results.registry import STUDIES
from harness.results.result import StoredResult

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


def compared_runs():
    return harness.compare(harness.simulate("coulomb"), harness.simulate("coulomb", {"f": 0.6}))


def fitted_parameters():
    run = harness.simulate("coulomb", interval=0.02, outputs=["x"])
    return harness.fit("coulomb", run, ["f", "k"])


def swept_parameters():
    return harness.sweep("smd", {"c": [0.0, 1.0, 2.0], "k": [100.0, 200.0]}, measures=["final", "largest"])


def pulled_sled():
    return harness.simulate("stickslip", stop=6.0)


MAKERS = {
    "run": pulled_sled,
    "decay": identified_decay,
    "fit": fitted_parameters,
    "sweep": swept_parameters,
    "compare": compared_runs,
}
result_of = cache(lambda study: MAKERS[study]())
every_study = pytest.mark.parametrize("study", MAKERS)


def curves(figure):
    """Return the data of every line in a figure."""
    return [np.asarray(line.get_xydata(), dtype=float) for axes in figure.axes for line in axes.lines]


def assert_same_picture(one, two):
    drawn, again = Figure(), Figure()
    one.draw(drawn)
    two.draw(again)
    assert len(drawn.axes) == len(again.axes) > 0
    for first, second in zip(curves(drawn), curves(again), strict=True):
        np.testing.assert_array_equal(first, second)


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
def test_a_saved_result_loads_as_the_same_class_with_the_same_picture(study):
    result = result_of(study)
    result.save("kept")
    loaded = harness.load_result("kept")
    assert type(loaded) is type(result)
    assert (repr(loaded), str(loaded)) == (repr(result), str(result))
    content = [to_json({**item.as_json(), "folder": None}) for item in (loaded, result)]
    assert content[0] == content[1]
    assert_same_picture(loaded, result)
    assert not isinstance(loaded, StoredResult)
    loaded.save("again")
    data = [Path(folder) / "figure.svg" for folder in ("kept", "again")]
    assert data[0].exists() == data[1].exists()


@every_study
def test_a_result_of_another_source_is_replaced_only_on_request(study):
    other = next(name for name in [*MAKERS][::-1] if name != study or len(MAKERS) == 1)
    result_of(study).save("kept")
    if other != study:
        with pytest.raises(harness.HarnessError, match=r"kept holds"):
            result_of(other).save("kept")
    result_of(study).save("kept", overwrite=True)
    assert harness.load_result("kept").study == study


@every_study
def test_damaged_data_are_reported(study):
    result_of(study).save("kept")
    data = Path("kept/data.npz")
    if not data.exists():
        pytest.skip("this result has no data besides its tables")
    for content in (b"", data.read_bytes()[:-200], data.read_bytes().replace(b"content", b"another")):
        data.write_bytes(content)
        with pytest.raises(harness.SceneError, match=r"data\.npz cannot be read .*: repeat the command"):
            harness.load_result("kept")


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
