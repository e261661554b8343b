"""Models of users on a page of their own."""

import pytest
import web_page
from build_cache import ROOT
from model_text import CURVE
from models import EXAMPLE_MODELS, LARGER_MODELS, scalar_class

from fmus.compiler.model_lookup import find_model, more_model_names
from fmus.page.model_json import list_bodies


def test_moving_bodies_of_any_model_are_read_from_its_declaration():
    """For models that users might write: the kind of each body, and what acts on it."""
    bodies_by_model = {path.stem: list_bodies(find_model(path).analysis) for path in (*EXAMPLE_MODELS, *LARGER_MODELS)}
    kinds = {name: [body["kind"] for body in bodies_of_model] for name, bodies_of_model in bodies_by_model.items()}
    assert kinds["viscous_pendulum"] == ["pendulum"]
    assert kinds["rotor_brake"] == ["rotor"]
    assert kinds["stacked"] == kinds["sleds"] == ["block", "block"]
    assert kinds["clutch"] == ["none"]  # it has no position
    assert {bodies_by_model[name][0]["friction"] for name in ("bumper", "lugre")} == {"F_drag", "F_friction"}  # smooth
    assert bodies_by_model["sleds"][0]["linked"] == ["x_2"]
    assert bodies_by_model["viscous_pendulum"][0]["dampers"] == ["d"]


@pytest.mark.parametrize(("name", "driver"), [("joint", ""), ("forced", ""), ("elastoplastic", "x_driver")])
def test_a_phase_angle_is_no_driver(name, driver):
    """It enters the motion by its sine; a driver pulls through a spring."""
    assert list_bodies(find_model(name).analysis)[0].get("driver", "") == driver


@pytest.mark.campaign
def test_the_models_of_fmus_more_run_on_a_second_page(quiet):
    """It leaves index.html, the page of the shipped models, as it is."""
    page = web_page.Page(quiet, web_page.build_page("--more", file="more.html"))
    assert [file.name for file in page.file.parent.iterdir()] == ["more.html"]
    page.open()
    assert page.run("[...app.library.models.keys()]") == more_model_names()
    for name in more_model_names():
        page.open(f".model={name}")
        assert page.run("app.runs.main.failure") == ""
        assert page.run("app.runs.main.time.at(-1)") >= scalar_class(name).stop_time
    check_servo(page)


def check_servo(page):
    """The friction has the bits of the table in Python at the speed, and the page draws the table."""
    page.open(".model=servo")
    (table,) = find_model("servo").analysis.tables
    columns = page.run(
        "(({ columns: { v, mode, F_friction } }) => [v, mode, F_friction].map(c => [...c]))(app.runs.main)"
    )
    slides = [(v, mode, force) for v, mode, force in zip(*columns, strict=True) if mode]
    assert len(slides) > 100
    assert all(force == mode * table.at(abs(v)) for v, mode, force in slides)
    assert page.run("document.querySelector('#equations .table svg').getAttribute('aria-label')") == (
        "friction_curve in N over argument in m/s"
    )


def test_user_models_run_on_a_page_of_their_own(quiet, tmp_path):
    files = [ROOT / name for name in ("tests/example_models/rotor_brake.py", "fmus/more/stacked.py")]
    curve = tmp_path / "curve.py"
    curve.write_text(CURVE)
    page = web_page.Page(quiet, web_page.build_page(*files, curve, "--method", "ode45"))
    page.open()  # without the models of the stories, it opens with the panel
    assert page.run("document.getElementById('stories')") is None
    assert page.run("document.querySelector('h1').textContent") == "Dry friction, live"
    for path, count in zip(files, (1, 2), strict=True):
        page.open(f".model={path.stem}")
        assert page.run("document.getElementById('method').parentElement.hidden")  # with one method there is no choice
        assert page.run("app.runs.main.failure") == ""
        assert page.run("app.runs.main.events.length") > 2
        assert page.run("document.querySelectorAll('#mechanism .body').length") == count
        assert page.run("document.getElementById('body').parentElement.hidden") == (count == 1)
    check_table_values(page)
    page.open(".model=stacked")
    page.choose("body", 1)  # the plots of the motion come first here too
    shown_figures = (
        "[...document.querySelectorAll('figure')].filter(figure => !figure.hidden).map(figure => figure.id).slice(0, 3)"
    )
    second = page.run("app.library.models.get('stacked').bodies[1]")
    assert page.when_done(shown_figures) == [f"panel-{second[name]}" for name in ("position", "speed", "acceleration")]


def check_table_values(page):
    """A value of a table is among the parameters, not the settings of the solver, and a link sets it by its name."""
    page.open(".model=curve&force.y[2]=4.5")
    assert page.run("document.getElementById('field-force.y[2]').closest('#fields, #solver-fields').id") == "fields"
    assert page.run("document.getElementById('field-force.y[2]').value") == "4.5"
    assert page.run("app.runs.main.columns.a[0]") == (0.75 * 1.0 + 0.25 * 4.5) / 2.0


def test_several_contacts_are_shaded_and_named_each(quiet):
    """Bands, force panels and events of the lower block, on which two contacts act; its input is plotted if it acts."""
    files = [ROOT / name for name in ("tests/example_models/rotor_brake.py", "fmus/more/stacked.py")]
    page = web_page.Page(quiet, web_page.build_page(*files, "--method", "ode45"))
    page.open(".model=stacked&F_ext=3")
    content = "app.plots.get({!r}).panel.content"
    for key, rows in ((".sticking", ["F_1", "F_2"]), ("x_1", ["F_1", "F_2"]), ("F_1", ["F_1"]), ("F_2", ["F_2"])):
        assert page.run(f"{content.format(key)}.rows") == rows
    sticks = page.run(f"{content.format('F_2')}.bands")
    speeds = "(({ time, columns: { v_1, v_2 } }) => time.map((t, i) => [t, v_2[i] - v_1[i]]))(app.runs.main)"
    for t, slip in page.run(speeds):
        if any(band["from"] < t < band["to"] for band in sticks):
            assert abs(slip) < 1e-12
    assert set(page.run(f"{content.format('F_ext')}.curves.at(-1).y")) == {3.0}
    event_texts = [cells[-1] for cells in page.table("Events").values()]
    assert event_texts[:2] == ["F_1 slides forward", "F_2 slides forward"]
    assert {"F_1 sticks", "F_2 sticks"} <= {*event_texts}
