"""What the diagrams of the live page show, and what their texts say."""

import re
from math import pi, sqrt

import pytest
import web_page
from models import MODELS, declarations_of


@pytest.mark.parametrize("name", MODELS)
def test_the_default_run_shows_a_rest_that_begins_soon_after_the_default_stop_time(page, name):
    page.open(f".model={name}")
    stop = page.run("app.library.models.get(app.state().model).stop")
    shown_stop, rest = page.run("[app.state().stop, app.runs.main.restTime() ?? null]")
    assert stop <= shown_stop <= 1.2 * stop
    if name == "coulomb":  # at rest after eight full swings
        assert rest == pytest.approx(8 * 2 * pi / sqrt(157.9), abs=1e-9)
        assert stop == 4 < rest < shown_stop - 0.1


@pytest.mark.parametrize("name", MODELS)
def test_the_legend_explains_every_line_shading_and_mark(page, name):
    page.open(f".model={name}&.compare={name}&.change=1 {'k' if 'k' in declarations_of(name) else 'm'} 1")
    page.check("envelopes", True)
    page.run(web_page.NEXT_PICTURE)
    legend = page.run("document.getElementById('legend').innerText")
    labels = page.run(
        "[...app.plots.values()].filter(({ figure }) => !figure.hidden).flatMap(({ panel }) => panel.content.curves)"
        ".filter(({ x }) => x.length).map(({ legend }) => legend ?? null)"
    )
    page.check("envelopes", False)
    assert {"run", "second run", "without the changes"} <= {*labels}
    assert all(text in legend for text in labels)
    assert "change of a value" in legend
    has_modes = page.run("app.library.models.get(app.state().model).contacts.length > 0")
    assert ("sticks" in legend) == has_modes


def test_friction_has_one_sign_in_diagram_arrow_and_titles(page):
    """The arrow is the friction on the body, opposing the motion; the diagram shows its negative, and both say so."""
    page.open(".model=coulomb")
    page.seek(0.1)
    page.run(web_page.NEXT_PICTURE)
    force, speed = page.run("['F_friction', 'v'].map(name => app.runs.main.at(name, 0.1))")
    arrow = page.run("document.querySelector('#mechanism .force').getAttribute('d')")
    length = float(re.match(r"M\S+ \S+h(\S+)m", arrow)[1])
    assert speed < 0
    assert force == -0.5
    assert length > 0
    assert "the arrow is \N{MINUS SIGN}F_friction" in page.run("document.getElementById('panel-F_friction').innerText")
    assert "\N{MINUS SIGN}F_friction" in page.run("document.getElementById('legend').innerText")


def test_the_arrow_of_friction_has_its_value(page):
    page.open(".model=coulomb&.t=0.1")
    page.wait("document.querySelector('#mechanism .value').textContent === 'friction 0.5 N'")


def test_numbers_have_the_digits_of_the_computation_and_typeset_powers(page):
    page.open(".model=stickslip&.compare=stickslip")
    text = page.run("document.body.innerText")
    assert not re.findall(r"\d+\.\d{10,}", text)
    assert not re.findall("\\de[-\N{MINUS SIGN}]\\d", text)
    page.open(".model=coulomb&solver.method=2&solver.rtol=1e-5")
    times = [cells[0] for cells in page.table("Events").values()]
    assert max(len(t.replace(".", "").lstrip("0")) for t in times) == 5


@pytest.mark.parametrize("name", MODELS)
def test_summaries_of_diagrams_state_the_extremes_of_the_run(page, name):
    page.open(f".model={name}")
    x = page.run("app.library.models.get(app.state().model).bodies[0].position")
    label, values, factor = page.run(
        f"[app.plots.get('{x}').panel.content.description, app.runs.main.columns.{x},"
        f"app.runs.main.fmu.variables.get('{x}').factor]"
    )
    low, high = re.search(r"from (\S+) to (\S+),", label).groups()
    assert web_page.number(low) == pytest.approx(min(values) * factor, rel=5e-3)
    assert web_page.number(high) == pytest.approx(max(values) * factor, rel=5e-3)


@pytest.mark.parametrize("name", sorted({*MODELS} - {"smd"}))
def test_the_friction_law_is_drawn_over_the_slip_speed_with_the_point_at_the_cursor(page, name):
    page.open(f".model={name}&.t=0.3")
    body = page.run("app.library.models.get(app.state().model).bodies[0]")
    curves = page.run("app.plots.get('.law').panel.content.curves")
    stick_curves = [curve for curve in curves if curve["colour"] == "stick"]
    for curve in stick_curves:  # one vertical line
        assert max(map(abs, curve["x"])) == 0
    if name in ("coulomb", "stickslip"):  # level lines
        d = {variable: meaning.start for variable, meaning in declarations_of(name).items()}
        force = d["f"] if name == "coulomb" else d["mu_d"] * d["m"] * d["g"]
        assert stick_curves
        for curve in curves:
            if curve["colour"] == "slip":
                assert {round(abs(value) / force, 9) for value in curve["y"]} == {1}
    (point,) = page.run("app.plots.get('.law').plot.cursor.points")
    at = "app.runs.main.at({!r}, 0.3) * app.runs.main.fmu.variables.get({!r}).factor"
    assert [point["x"], point["y"]] == page.run(
        f"[{at.format(body['slip'], body['slip'])}, {at.format(body['friction'], body['friction'])}]"
    )


@pytest.mark.parametrize("name", ["coulomb", "pendulum"])
def test_the_value_of_a_force_that_jumps_is_never_between_its_values(page, name):
    page.open(f".model={name}")
    (friction,) = page.run("app.library.models.get(app.state().model).contacts.map(({ name }) => name)")
    before = "app.runs.main.events.slice(1, -1).map(({ t }) => Math.abs(app.runs.main.at(F, t - 1e-5)))"
    sizes = page.run(f"(F => {before})({friction!r})")
    assert sizes
    largest = page.run(f"app.runs.main.largestMagnitude({friction!r})")
    assert all(size > 0.9 * largest for size in sizes)


RANGES = (
    "['x', 'v', '.phase'].map(key => app.plots.get(key).plot.content).map(({ x, y }) => [x.low, x.high, y.low, y.high])"
)


def test_a_rectangle_enlarges_a_diagram_and_the_times_of_all_and_a_double_click_shows_all(page):
    page.browser.size(1280)
    page.open(".model=coulomb", anew=True)
    page.run("document.getElementById('panels').scrollIntoView({ behavior: 'instant' })")
    full_ranges = page.run(RANGES)
    left, top = page.run("(b => [b.left, b.top])(app.plots.get('x').plot.host.getBoundingClientRect())")
    start, end = (page.run(f"app.plots.get('x').plot.valuesAt({x}, {y})") for x, y in ((150, 60), (250, 90)))
    page.browser.mouse("Pressed", left + 150, top + 60)
    page.browser.mouse("Moved", left + 200, top + 80)
    page.browser.mouse("Moved", left + 250, top + 90)
    page.browser.mouse("Released", left + 250, top + 90, buttons=0)
    x, v, phase = page.run(RANGES)
    assert x == pytest.approx([start["x"], end["x"], end["y"], start["y"]], abs=1e-3)
    assert v == [*x[:2], *full_ranges[1][2:]]
    assert phase == full_ranges[2]
    assert page.run("app.state().t") == 0  # a rectangle does not move the cursor
    page.type_number("f", "0.6")
    assert page.run(RANGES)[0] == x  # a changed run is shown in the same part
    page.run("app.plots.get('v').plot.host.dispatchEvent(new MouseEvent('dblclick'))")
    assert page.run(RANGES)[1] == page.run(
        "(({ x, y }) => [x.low, x.high, y.low, y.high])(app.plots.get('v').panel.content)"
    )
    page.browser.mouse("Pressed", left + 150, top + 60)
    page.browser.mouse("Released", left + 150, top + 60, buttons=0)
    assert page.run("app.state().t") == pytest.approx(page.run("app.plots.get('x').plot.valuesAt(150, 60).x"), abs=0.02)


def test_keys_enlarge_a_diagram_and_escape_shows_all(page):
    page.open(".model=coulomb", anew=True)
    key = (
        "app.plots.get('.phase').plot.host.dispatchEvent(new KeyboardEvent('keydown', {{ key: {!r}, bubbles: true }}))"
    )
    full_range = page.run(RANGES)[2]
    page.run(key.format("+"))
    part = page.run(RANGES)[2]
    assert full_range[0] < part[0] < part[1] < full_range[1]
    page.run(key.format("ArrowRight"))
    assert page.run(RANGES)[2][0] > part[0]
    page.run(key.format("-"))
    page.run(key.format("Escape"))
    assert page.run(RANGES)[2] == full_range
    page.run(key.format("+"))
    page.click("#panel-\\.phase .show-all")
    assert page.run(RANGES)[2] == full_range
