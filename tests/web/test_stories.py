"""The opening of the page and its five stories, as a visitor sees them."""

import re

import pytest
import web_page
from variants import campaign_after

from tests.docs.test_docs import load, read_description

pytestmark = pytest.mark.slow

STORIES = ("stops", "chatters", "squeaks", "creeps", "swings")
TOLERANCE = 3  # CSS pixels
COUNTS = (
    "[...document.querySelectorAll('#opening .count')].map(element => Number(element.textContent.replace(/\\D/g, '')))"
)
START = "app.opening.state.values.x0"


def text(page, selector):
    return page.run(f"document.querySelector({selector!r}).textContent")


def press(page, selector, *keys):
    for key in keys:
        event = f"new KeyboardEvent('keydown', {{ key: {key!r}, bubbles: true }})"
        page.run(f"document.querySelector({selector!r}).dispatchEvent({event})")
        page.run(web_page.NEXT_PICTURE)


def test_the_opening_claims_that_real_things_stop_and_counts_the_steps_of_both_masses(still):
    assert text(still, "h1") == still.run("document.title") == "Real things stop. sign(v) never does."
    true, sign = still.run(COUNTS)
    assert sign > 10 * true > 0
    assert still.run("[...document.querySelectorAll('#opening .motion')].map(element => element.textContent)") == [
        "at rest",
        "slips",
    ]


def test_the_picture_of_the_live_page_shows_its_opening(still):
    opening = still.run("document.querySelector('#opening').outerHTML")
    assert load("make_images").read_text_of_opening(opening) == read_description("live"), "run docs/make_images.py live"


def test_a_mass_under_sign_never_sticks_on_the_page(still):
    """Also where its speed, and so its mode, is zero: at the start."""
    labels = "svgs => [...svgs].map(svg => /sticks|slips/.exec(svg.textContent)?.[0])"
    for t, expected in ((4.3, ["sticks", "slips"]), (0.0, ["slips", "slips"])):
        still.run(f"app.opening.seek({t})")
        still.run(web_page.NEXT_PICTURE)
        assert still.run(f"({labels})(document.querySelectorAll('#opening .mechanism svg'))") == expected


def test_the_opening_plays_once_at_load_and_not_under_reduced_motion(page, still):
    assert still.run("[app.opening.playing, app.opening.state.t]") == [False, 4.3]
    page.browser.call("Emulation.setEmulatedMedia", features=[])
    page.open(anew=True)
    page.wait("app.opening.playing && app.opening.state.t > 0.1")
    page.wait("!app.opening.playing && app.opening.state.t === 4.3")


def test_every_story_is_drawn_before_it_scrolls_into_view_with_a_text_and_fields(still):
    assert still.run("scrollY") == 0
    is_painted = "(c => c.getContext('2d').getImageData(0, 0, c.width, c.height).data.some(Boolean))"
    for story in STORIES:
        canvases = f"[...document.querySelectorAll('#{story} canvas[role=img]')]"
        assert still.run(f"{canvases}.map({is_painted})") == [True, True]
        assert still.run(f"document.querySelectorAll('#{story} .field [type=range]').length") >= 1
        assert 2 <= len(re.findall(r"[.?!](?=\s|$)", text(still, f"#{story} .text p"))) <= 7


def test_a_slider_of_a_story_changes_its_text_and_stops_where_the_model_refuses(still):
    still.type_number("f", "1", "stops-", "#stops")
    assert "25.3\N{NO-BREAK SPACE}mm" in text(still, "#stops .text")  # 4 f / k
    still.type_number("mu_d", "0.95", "squeaks-", "#squeaks")
    assert "above mu_s = 0.9" in text(still, "#squeaks .alert")
    assert "0.6 instead of 0.9" in text(still, "#squeaks .text")


@pytest.mark.parametrize("width", campaign_after(1, [360, 1280]))
def test_bodies_of_the_opening_and_the_stories_stay_under_the_pointer(still, width):
    still.browser.size(width, 740)
    still.run("app.stories.forEach(story => story.seek(0))")
    for section in ("opening", "stops", "squeaks"):
        still.run(f"document.querySelector('#{section} .mechanism').scrollIntoView({{ block: 'center' }})")
        still.run(web_page.NEXT_PICTURE)
        body = f"#{section} .body :is(rect, circle)"
        x, y = still.middle(body)
        still.browser.mouse("Pressed", x, y)
        for step in (20, -15):
            still.browser.mouse("Moved", x + step, y)
            still.run(web_page.NEXT_PICTURE)
            at_x, at_y = still.middle(body)
            assert at_x == pytest.approx(x + step, abs=TOLERANCE), section
            assert at_y == pytest.approx(y, abs=TOLERANCE), section
        still.browser.mouse("Released", x, y, buttons=0)
    still.browser.size(1280)


def test_keys_move_a_body_and_let_it_go(still):
    press(still, "#opening .body", "ArrowRight")
    start, t = still.run(f"[{START}, app.opening.state.t]")
    press(still, "#opening .body", "ArrowRight", "ArrowRight")
    assert t == 0
    assert still.run(START) > start
    press(still, "#opening .body", "Enter")
    still.wait_until_drawn("#opening")
    assert still.run("app.opening.state.t") > 0
    assert text(still, "#opening .motion") == "at rest"


@pytest.mark.parametrize("width", campaign_after(1, [360, 1280]))
def test_the_opening_fits_its_window_and_does_not_shift(page, width):
    page.browser.size(width)
    script = page.browser.call("Page.addScriptToEvaluateOnNewDocument", source=web_page.SHIFTS)
    page.open(anew=True)
    page.browser.call("Page.removeScriptToEvaluateOnNewDocument", **script)
    page.wait_until_drawn(".story")
    assert page.run("shift") < 0.1
    assert page.run("document.documentElement.scrollWidth") <= width
    page.browser.size(1280)


def test_a_phone_shows_the_first_picture_and_the_first_field_on_its_first_screen(still):
    still.browser.size(360, 740)
    for selector in ("#opening .mechanism svg", "#opening .play", "#opening .field input"):
        assert still.run(f"document.querySelector('{selector}').getBoundingClientRect().bottom") < 740, selector
    still.browser.size(1280)


def test_a_story_opens_in_explore_with_the_same_run(still):
    still.type_number("x_m", "0.002", "creeps-", "#creeps")
    ends = "[{0}.main, {0}.comparison].map(run => [run.time.length, run.columns.x.at(-1), run.counts])"
    still.run("document.querySelector('#creeps .to-explore').click()")
    still.wait("app.state().model === 'pacejka'")
    still.wait_until_drawn()
    assert still.run(ends.format("app.runs")) == still.run(ends.format("app.stories[3].runs"))
    assert abs(still.run("document.getElementById('explore').getBoundingClientRect().top")) < 5


def test_a_link_shows_its_run_and_an_untouched_page_opens_with_the_claim_again(page):
    top = "document.getElementById('explore').getBoundingClientRect().top"
    page.open(".model=smd", anew=True)
    page.wait(f"Math.abs({top}) < 5")
    page.wait_until_drawn(".story")
    assert abs(page.run(top)) < 5
    page.open(anew=True)
    assert page.run("[location.hash, scrollY]") == ["", 0]
    page.run("document.querySelector('#story-links a').click()")
    page.wait("Math.abs(document.getElementById('stops').getBoundingClientRect().top) < 5")
    assert page.run("[app.state().model, location.hash]") == ["coulomb", "#stops"]
