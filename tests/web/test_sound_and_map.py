"""The sound of stick-slip, and the map over sliding friction and speed of the driver."""

import re
from itertools import pairwise

import pytest

pytestmark = pytest.mark.slow

STATUS = "document.getElementById('status').textContent"


def test_the_sound_is_off_until_asked_and_has_the_rhythm_of_the_slips(page):
    page.open(".model=stickslip&.stop=30", anew=True)
    page.run(
        "globalThis.made = 0;globalThis.AudioContext = class extends AudioContext { constructor() { super(); made++ } }"
    )
    page.click("#play")
    page.wait("app.state().t > 0.1")
    page.click("#play")
    assert page.run("made") == 0
    page.click("#sound")
    times = page.run(
        "(({ columns: { mode }, time }) => time.filter((t, row) => row && mode[row] && !mode[row - 1]))"
        "(app.session.runs.main)"
    )
    period = times[-1] - times[-2]
    tone = float(re.search(r"tone of ([\d.]+) Hz", page.run(STATUS))[1])
    assert tone == pytest.approx(1000 / period, rel=0.01)
    assert page.run("[made, app.sound.isOn]") == [1, True]
    samples = page.run("[...app.sound.samples]")
    assert max(map(abs, samples)) == 1
    assert abs(sum(samples)) < 1e-3 * len(samples)
    page.type_number("v_driver", "0.068")  # a changed run is heard, too
    page.wait(f"!{STATUS}.includes('{tone:g} Hz') && {STATUS}.includes('Hz')")
    page.type_number("mu_d", "0.9")
    page.type_number("v_driver", "0.001")
    page.wait(f"{STATUS}.startsWith('There is no sound')")  # it never slips
    page.click("#sound")
    assert page.run("app.sound.isOn") is False
    page.open(".model=coulomb")
    assert page.run("document.getElementById('sound').hidden")


def test_the_map_shows_how_often_each_run_slips_and_a_click_takes_its_values(page):
    page.browser.size(1280)
    page.open(".model=stickslip&k=600", anew=True)
    page.run(
        "globalThis.slices = 0; const slice = app.frictionMap.computeSlice;"
        "app.frictionMap.computeSlice = function () { slices++; slice.call(this) }"
    )
    page.run("document.getElementById('map-canvas').scrollIntoView({ behavior: 'instant' })")
    page.wait("app.frictionMap.isComplete")
    counts = page.run("app.frictionMap.counts")
    assert min(counts) == 0
    assert max(counts) > 10
    assert page.run("slices") > 1  # the page answers in between
    left, top, width, height = page.run(
        "(b => [b.left, b.top, b.width, b.height])(document.getElementById('map-canvas').getBoundingClientRect())"
    )
    for x, y in ((0.3, 0.3), (0.8, 0.5), (0.6, 0.1)):
        cell = page.run(f"app.frictionMap.cellAt({x * width}, {y * height})")
        for kind in ("Pressed", "Released"):
            page.browser.mouse(kind, left + x * width, top + y * height)
        values = page.run(f"app.frictionMap.valuesOf({cell})")
        state = page.when_done("app.state().values")
        assert state == values | {"k": 600}
        modes = page.run("app.session.runs.main.columns.mode")
        slips = sum(mode != 0 and before == 0 for before, mode in pairwise(modes))
        assert counts[cell] == slips
    page.wait("location.hash.includes('mu_d')")
    page.open(".model=pacejka")
    assert page.run("document.getElementById('map').hidden")
