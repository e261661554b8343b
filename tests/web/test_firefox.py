"""The page works in Firefox as it does in Chromium."""

import pytest
import web_page
from models import MODELS

TOLERANCE = 3  # CSS pixels
CENTRE = (
    "(b => [b.x + b.width / 2, b.y + b.height / 2])"
    "(document.querySelector('{} .body :is(rect, circle)').getBoundingClientRect())"
)
NOTED = (
    "document.documentElement.dataset.errors ?? ''"  # scripts of the test share the elements of the page, not its names
)
NOTE_ERRORS = (
    "(() => { const note = text => (document.documentElement.dataset.errors = text);"
    "addEventListener('error', ({ message }) => note(message));"
    "addEventListener('unhandledrejection', ({ reason }) => note(String(reason))) })()"
)


def drag(firefox, host):
    """Drag the body in a host by some pixels and check that it follows."""
    firefox.run(f"document.querySelector({host!r}).scrollIntoView({{ block: 'center', behavior: 'instant' }})")
    firefox.run(web_page.DRAWN)
    x, y = firefox.run(CENTRE.format(host))
    firefox.pointer(("move", x, y), ("down",))
    for step in (20, -15):
        firefox.pointer(("move", x + step, y))
        firefox.run(web_page.DRAWN)
        at_x, _ = firefox.run(CENTRE.format(host))  # a pendulum leaves the height of the pointer
        assert at_x == pytest.approx(x + step, abs=TOLERANCE), host
    firefox.pointer(("up",))


@pytest.mark.slow
def test_every_model_runs_and_bodies_stay_under_the_pointer_in_firefox(firefox):
    page = web_page.build_page("web")
    firefox.size(1280)
    for name in MODELS:
        firefox.open(f"{page.as_uri()}#.model={name}")
        firefox.run(web_page.READY.format("main"))
        firefox.run(NOTE_ERRORS)
        assert firefox.run("[app.state().model, app.runs.main.failure]") == [name, ""]
        drag(firefox, "#mechanism")
        assert firefox.run(NOTED) == ""
    firefox.open(page.as_uri())
    firefox.run(web_page.READY.format(".story"))
    firefox.run(NOTE_ERRORS)
    true, sign = firefox.run("app.opening.shownRuns.map(run => run.counts['solver.steps'])")
    assert sign > 10 * true > 0
    drag(firefox, "#opening .mechanism")
    assert firefox.run(NOTED) == ""
