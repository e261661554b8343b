"""Layout of the live page at any width, and names and colours that every reader can use."""

import json

import pytest
import web_page
from models import STICKSLIP_IN_CI, parameters
from variants import campaign_after

pytestmark = pytest.mark.slow

WIDTHS = (360, 768, 1280)

CONTROLS = {"button", "checkbox", "combobox", "radio", "slider", "spinbutton", "textbox", "link", "DisclosureTriangle"}


@pytest.mark.parametrize("name", STICKSLIP_IN_CI)
def test_no_width_makes_it_scroll_sideways_and_every_control_has_a_name(page, name):
    page.open(f".model={name}")
    for width in WIDTHS:
        page.browser.size(width)
        assert page.run("document.documentElement.scrollWidth") <= width
        cut = "[...document.querySelectorAll('.entry input')].filter(e => e.scrollWidth > e.clientWidth).length"
        assert page.run(cut) == 0  # every number is shown in full
    tree = page.browser.call("Accessibility.getFullAXTree")["nodes"]
    controls = [node for node in tree if node.get("role", {}).get("value") in CONTROLS and not node["ignored"]]
    nameless = [node for node in controls if not node.get("name", {}).get("value", "").strip()]
    assert nameless == []
    names = " ".join(node["name"]["value"] for node in controls)
    for variable, meaning in parameters(name).items():
        if "." not in variable:
            assert meaning.text in names
    assert "Mechanism:" in json.dumps(tree)


@pytest.mark.parametrize("width", campaign_after(1, WIDTHS))
def test_nothing_shifts_while_the_page_appears(page, width):
    page.browser.size(width)
    script = page.browser.call("Page.addScriptToEvaluateOnNewDocument", source=web_page.SHIFTS)
    page.open(".model=pendulum&.compare=pendulum", anew=True)
    page.browser.call("Page.removeScriptToEvaluateOnNewDocument", **script)
    page.wait_until_drawn(".story")
    assert page.run("shift") < 0.1


@pytest.mark.parametrize("width", [360, 1280])
def test_headings_of_tables_have_text_and_regions_that_scroll_take_the_focus(page, width):
    """These two kinds were found by axe-core 4; its other rules found nothing."""
    page.browser.size(width)
    page.open(".model=coulomb&.compare=pacejka")
    assert page.run("[...document.querySelectorAll('th')].filter(cell => !cell.textContent).length") == 0
    regions = page.run(
        "[...document.querySelectorAll('body *')].filter(e => /auto|scroll/.test(getComputedStyle(e).overflowX)"
        " && e.scrollWidth > e.clientWidth + 1 && e.tabIndex < 0).map(e => e.id || e.className || e.tagName)"
    )
    page.browser.size(1280)
    assert regions == []


def test_sticking_has_one_colour_and_slipping_another_in_mechanism_and_diagrams(page):
    style = "getComputedStyle(document.documentElement).getPropertyValue({!r})"
    body = "getComputedStyle(document.querySelector('#mechanism .body rect')).fill"
    still = [{"name": "prefers-reduced-motion", "value": "reduce"}]
    page.browser.call("Emulation.setEmulatedMedia", features=still)  # the colour has a transition
    page.open(".model=coulomb")
    for t, name in ((0.1, "--slip"), (4.2, "--stick")):
        page.seek(t)
        page.wait_until_drawn()
        colour = page.run(style.format(name)).lstrip("#")
        assert page.run(body) == f"rgb({', '.join(str(int(colour[i : i + 2], 16)) for i in (0, 2, 4))})"
