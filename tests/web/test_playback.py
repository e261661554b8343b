"""Playback of the live page: changes, pulls and kicks on the way, and jumps to events."""

import pytest
import web_page
from models import STICKSLIP_IN_CI, declarations_of

pytestmark = pytest.mark.slow


def test_a_change_during_playback_acts_from_then_on_only(page):
    page.open(".model=smd")
    positions = page.run("[...app.runs.main.columns.x]")
    page.click("#play")
    page.wait("app.state().t > 0.2")
    page.type_number("c", "20")
    page.click("#play")
    (change,) = page.run("app.state().changes")
    assert change["name"] == "c"
    assert 0.2 < change["t"] < 4
    assert page.run("app.state().values") == {}
    columns = page.when_done("({ t: app.runs.main.time, x: app.runs.main.columns.x })")
    before = [x for t, x in zip(columns["t"], columns["x"], strict=True) if t < change["t"]]
    assert before == positions[: len(before)]
    assert max(map(abs, columns["x"][-200:])) < 0.1 * max(map(abs, positions[-200:]))
    assert page.run("app.runs.unchanged.columns.x.length") == len(positions)


def test_pausing_keeps_the_values_in_force_and_changes_edit_those(page):
    page.open(".model=smd")
    page.click("#play")
    page.wait("app.state().t > 0.1")
    page.type_number("c", "20")
    page.click("#play")
    field_values = "([field, slider]) => [Number(field.value), slider.getAttribute('aria-valuetext')]"
    find = "[...document.querySelectorAll('.field:has(#field-c) input')]"
    assert page.run(f"({field_values})({find})") == [20, "20 N·s/m"]
    page.type_number("c", "30")
    assert page.run("[app.state().values, app.state().changes.map(({ value }) => value)]") == [{}, [30]]
    page.seek(0)
    page.run(web_page.NEXT_PICTURE)
    assert page.run(f"({field_values})({find})")[0] == declarations_of("smd")["c"].start


@pytest.mark.parametrize("name", STICKSLIP_IN_CI)
def test_a_dragged_body_starts_where_it_is_released(page, name):
    page.browser.size(1280)
    page.open(f".model={name}")
    body = page.run("app.library.models.get(app.state().model).bodies[0]")
    x, y = page.middle("#mechanism .body")
    page.browser.mouse("Pressed", x, y)
    page.browser.mouse("Moved", x + 30, y)
    page.browser.mouse("Moved", x + 60, y)
    page.wait(f"app.state().values[{body['start']!r}] !== undefined")
    start = page.run(f"app.state().values[{body['start']!r}]")
    page.browser.mouse("Released", x + 60, y, buttons=0)
    page.wait("app.state().t > 0")
    page.click("#play")
    assert start > declarations_of(name)[body["start"]].start
    assert page.when_done(f"app.runs.main.columns[{body['position']!r}][0]") == start


@pytest.mark.parametrize("name", STICKSLIP_IN_CI)
def test_dragging_a_moving_body_applies_a_force_until_release(page, name):
    page.browser.size(1280)
    page.open(f".model={name}&.t=0.3")
    body = page.run("app.library.models.get(app.state().model).bodies[0]")
    x, y = page.middle("#mechanism .body")
    page.browser.mouse("Pressed", x, y)
    page.browser.mouse("Moved", x + 80, y)
    page.wait("app.state().changes.length > 0")
    page.browser.mouse("Released", x + 80, y, buttons=0)
    page.click("#play")
    changes = page.when_done("app.state().changes")
    assert {change["name"] for change in changes} == {body["input"]}
    assert any(change["value"] for change in changes)
    assert changes[-1]["value"] == 0
    comparison = "app.runs.main.columns[p].at(-1) !== app.runs.unchanged.columns[p].at(-1)"
    assert page.run(f"(p => {comparison})({body['position']!r})")


def test_dragging_with_a_slow_method_never_goes_back_in_time(page):
    """The next force waits for the previous run."""
    page.browser.size(1280)
    page.open(".model=pacejka&x_m=0.001&solver.method=2&solver.rtol=0.001&.t=8")
    x, y = page.middle("#mechanism .body")
    page.browser.mouse("Pressed", x, y)
    for way in (40, 80, 120):
        page.browser.mouse("Moved", x + way, y)
    page.wait("app.state().changes.length > 1")
    page.browser.mouse("Released", x + 120, y, buttons=0)
    page.click("#play")
    first, *_, last = page.when_done("app.state().changes")
    assert 8 <= first["t"] < last["t"] <= page.run("app.state().t") + 0.1
    assert (first["name"], last["value"]) == ("F_ext", 0)


def test_a_kick_is_a_push_of_finite_duration(page):
    page.open(".model=stickslip&.t=1")
    page.click("#kick")
    first, last = page.when_done("app.state().changes")
    assert (first["name"], first["t"], last["value"]) == ("F_ext", 1, 0)
    assert 1 < last["t"] < 2
    assert page.run("Math.max(...app.runs.main.columns.v.slice(100, 300))") > 0


def test_the_buttons_jump_to_the_next_and_the_previous_event(page):
    page.open(".model=coulomb")
    times = page.run("app.runs.main.events.map(({ t }) => t)")
    cursor_times = []
    for _ in times:
        page.click("#next-event")
        cursor_times.append(page.run("app.state().t"))
    assert cursor_times == times
    page.wait("document.getElementById('next-event').disabled")
    page.click("#previous-event")
    assert page.run("app.state().t") == times[-2]
