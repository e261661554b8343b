"""A dragged body stays under the pointer, whatever the pointer, the zoom and the model."""

from itertools import cycle

import pytest
import web_page
from models import MODELS
from variants import campaign_after

TOLERANCE = 3  # CSS pixels
PATH = (20, -20, 15)  # pixels from the point where the body is grabbed, twice that if wide
CENTRE = (
    "(b => [b.x + b.width / 2, b.y + b.height / 2])"
    "(document.querySelector('#mechanism .body :is(rect, circle)').getBoundingClientRect())"
)
PIN = (
    "(b => [b.x + b.width / 2, b.y + b.height / 2])(document.querySelector('#mechanism .pin').getBoundingClientRect())"
)


def path_of_pointer(page):
    """Return the points of a horizontal drag, for a pendulum along its arc, and where its body should be."""
    x, y = page.run(CENTRE)
    path = [step * (2 if page.run("innerWidth") > 1000 else 1) for step in PATH]
    if page.run("app.library.models.get(app.state().model).bodies[0].kind") == "block":
        return [(x + step, y) for step in path]
    pin_x, pin_y = page.run(PIN)
    radius = ((x - pin_x) ** 2 + (y - pin_y) ** 2) ** 0.5
    across = [min(max(x + step - pin_x, -0.9 * radius), 0.9 * radius) for step in path]
    return [(pin_x + dx, pin_y + (radius**2 - dx**2) ** 0.5) for dx in across]


def send(page, touch, kind, x, y):
    if not touch:
        return page.browser.mouse(kind, x, y, buttons=int(kind != "Released"))
    points = [] if kind == "Released" else [{"x": x, "y": y}]
    kinds = {"Pressed": "touchStart", "Moved": "touchMove", "Released": "touchEnd"}
    return page.browser.call("Input.dispatchTouchEvent", type=kinds[kind], touchPoints=points)


DESKTOP, ZOOMED_DESKTOP, PHONE = (1280, 900, 1, False), (640, 450, 2, False), (360, 740, 2, True)
SCREENS = [*zip(MODELS, cycle((DESKTOP, ZOOMED_DESKTOP, PHONE)), strict=False)]  # on a line, but for the pendulum
SCREENS += [("pendulum", screen) for screen in (DESKTOP, ZOOMED_DESKTOP, PHONE) if ("pendulum", screen) not in SCREENS]


@pytest.mark.parametrize(("name", "screen"), campaign_after(3, SCREENS), ids=str)
def test_a_dragged_body_stays_under_the_pointer(page, name, screen):
    width, height, zoom, touch = screen
    metrics = {"width": width, "height": height, "deviceScaleFactor": zoom, "mobile": touch}
    page.browser.call("Emulation.setDeviceMetricsOverride", **metrics)
    page.browser.call("Emulation.setTouchEmulationEnabled", enabled=touch)
    try:
        page.open(f".model={name}&.stop=2")
        page.run("document.querySelector('#mechanism').scrollIntoView({ block: 'center' })")
        page.run(web_page.NEXT_PICTURE)
        points = path_of_pointer(page)
        send(page, touch, "Pressed", *page.run(CENTRE))
        for x, y in points:
            send(page, touch, "Moved", x, y)
            page.run(web_page.NEXT_PICTURE)
            body_x, body_y = page.run(CENTRE)
            assert (body_x, body_y) == pytest.approx((x, y), abs=TOLERANCE)
        drag_time = page.run("app.state().t")
        send(page, touch, "Released", *points[-1])
        assert drag_time == 0
    finally:
        page.browser.call("Emulation.setTouchEmulationEnabled", enabled=False)
        page.browser.size(1280)


def test_a_body_cannot_be_dragged_out_of_the_picture(page):
    page.browser.size(1280)
    page.open(".model=coulomb")
    box = "(b => [b.left, b.right])(document.querySelector('#mechanism {}').getBoundingClientRect())"
    left, right = page.run(box.format("svg"))
    x, y = page.run(CENTRE)
    page.browser.mouse("Pressed", x, y)
    for target in (x + 2000, x - 2000):
        page.browser.mouse("Moved", target, y)
        page.run(web_page.NEXT_PICTURE)
        body = page.run(box.format(".body rect"))
        assert left <= body[0] < body[1] <= right
    page.browser.mouse("Released", x, y, buttons=0)
