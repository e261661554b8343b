"""The opening of the page and its five stories, as a visitor sees them."""

import re

import pytest
import web_page

pytestmark = pytest.mark.slow

STORIES = ("stops", "chatters", "squeaks", "creeps", "swings")
DRAGGED = ("opening", "stops", "squeaks", "creeps", "swings")
TOLERANCE = 3  # CSS pixels
OPENING_IS_DONE = "document.getElementById('opening-verdict').textContent.startsWith('In the same')"
STEPS = "Number(document.getElementById('opening-{}-count').textContent.replace(/\\D/g, ''))"


@pytest.fixture
def still(page):
    """The page for a visitor who prefers reduced motion: all results are there at once."""
    page.browser.size(1280)
    page.browser.call("Emulation.setEmulatedMedia", features=[{"name": "prefers-reduced-motion", "value": "reduce"}])
    page.open(anew=True)
    return page


def text(page, selector):
    return page.run(f"document.querySelector({selector!r}).textContent").replace("\u202f", "")


def show(page, story):
    """Scroll to a story and wait until it is computed."""
    page.run(f"document.getElementById({story!r}).scrollIntoView({{ behavior: 'instant' }})")
    page.wait(f"!document.getElementById({story!r}).classList.contains('pending')")
    page.run(web_page.DRAWN)


def test_the_opening_claims_that_real_things_stop_and_counts_the_steps_of_both_masses(still):
    assert text(still, "h1") == still.run("document.title") == "Real things stop. sign(v) never does."
    still.wait(OPENING_IS_DONE)
    true, sign = (still.run(STEPS.format(key)) for key in ("true", "sign"))
    assert sign > 10 * true > 0
    assert text(still, "#opening-true-clock").endswith("at rest")
    assert text(still, "#opening-sign-clock").endswith("still slips")


def test_the_opening_plays_once_at_load_and_not_under_reduced_motion(page):
    count = STEPS.format("sign")
    page.browser.size(1280)
    page.open(anew=True)
    page.wait(f"{count} > 100")
    shown = page.run(f"new Promise(done => requestAnimationFrame(() => done({count})))")
    page.browser.call("Emulation.setEmulatedMedia", features=[{"name": "prefers-reduced-motion", "value": "reduce"}])
    page.open(anew=True)
    page.run(
        "globalThis.clocks = new Set(); const clock = document.getElementById('opening-true-clock');"
        "new MutationObserver(() => clocks.add(clock.textContent)).observe(clock, { childList: true })"
    )
    page.wait(OPENING_IS_DONE)
    assert shown < page.run(count)  # the picture moved
    assert len(page.run("[...clocks]")) <= 2  # the start and the end


def test_the_stories_are_drawn_before_they_scroll_into_view(page):
    page.browser.size(1280)
    page.open(anew=True)
    page.wait("!document.querySelector('.story.pending')")
    assert page.run("scrollY") == 0
    painted = (
        "[...document.querySelectorAll('.story canvas')].map(canvas =>"
        "canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data.some(Boolean))"
    )
    assert page.run(painted) == [True] * 2 * len(STORIES)


LABELS_AND_CURVES = """app.stories.then(({ charts }) => {
  const { prototype } = CanvasRenderingContext2D;
  const { fillText, stroke, lineTo, beginPath } = prototype;
  const style = getComputedStyle(document.documentElement);
  const curves = ["--stick", "--slip", "--soft"].map(name => style.getPropertyValue(name).trim());
  const touching = [];
  for (const chart of charts) {
    const [labels, segments] = [[], []];
    let path = [];
    prototype.beginPath = function () { path = []; return beginPath.call(this) };
    prototype.lineTo = function (x, y) { path.push([x, y]); return lineTo.call(this, x, y) };
    prototype.stroke = function () {
      if (curves.includes(this.strokeStyle)) segments.push(...path.slice(1).map((point, i) => [path[i], point]));
      return stroke.call(this);
    };
    prototype.fillText = function (text, x, y) {
      const { width, actualBoundingBoxAscent: up, actualBoundingBoxDescent: down } = this.measureText(text);
      const left = x - width * { left: 0, center: 0.5, right: 1 }[this.textAlign];
      const isTick = /^[^a-z]*$/i.test(text); // outside the area to which curves are clipped
      if (curves.includes(this.fillStyle) && !isTick) labels.push([text, left, y - up, left + width, y + down]);
      return fillText.call(this, text, x, y);
    };
    chart.paint();
    for (const [text, left, top, right, bottom] of labels) {
      const count = ([[x0, y0], [x1, y1]]) => Math.min(Math.ceil(Math.hypot(x1 - x0, y1 - y0)), 2000) + 1; // points
      const isInside = (segment) => Array.from({ length: count(segment) }, (_, i) => i / count(segment)).some(s => {
        const [[x0, y0], [x1, y1]] = segment;
        const [x, y] = [x0 + s * (x1 - x0), y0 + s * (y1 - y0)];
        return x > left && x < right && y > top && y < bottom;
      });
      if (segments.some(isInside)) touching.push(text);
    }
  }
  Object.assign(prototype, { fillText, stroke, lineTo, beginPath });
  return touching;
})"""


@pytest.mark.parametrize("width", [360, pytest.param(1280, marks=pytest.mark.campaign)])
def test_labels_do_not_touch_curves(still, width):
    still.browser.size(width)
    still.wait("!document.querySelector('.pending')")
    still.wait(OPENING_IS_DONE)
    for key in ("", "End", "Home"):  # the text as it is, and with the numbers at their limits
        for i in range(still.run("document.querySelectorAll('.story .pull').length") if key else 1):
            if key:
                pull = f"document.querySelectorAll('.story .pull')[{i}]"
                still.run(f"{pull}.dispatchEvent(new KeyboardEvent('keydown', {{ key: {key!r} }}))")
            assert still.run(LABELS_AND_CURVES) == [], (key, i)
    still.browser.size(1280)


def test_every_story_has_a_picture_and_prose_with_numbers_to_drag(still):
    for story in STORIES:
        show(still, story)
        assert still.run(f"document.querySelectorAll('#{story} .pull[role=slider]').length") >= 2
        sentences = re.findall(r"[.?!](?=\s|$)", text(still, f"#{story} .prose p"))
        assert 2 <= len(sentences) <= 4, story
        painted = (
            "(canvas => canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data.some(Boolean))"
            f"(document.querySelector('#{story} canvas'))"
        )
        assert still.run(painted)


def test_a_number_in_the_text_changes_the_results_by_pointer_and_by_keys(still):
    show(still, "stops")
    number = "document.querySelector('#stops .pull[data-key=f]')"
    assert text(still, "#stops [data-out=loss]") == "12.7 mm"  # 4 f / k
    x, y = still.run(f"(b => [b.x + b.width / 2, b.y + b.height / 2])({number}.getBoundingClientRect())")
    still.browser.mouse("Pressed", x, y)
    still.browser.mouse("Moved", x + 60, y)  # ten steps of 0.05 N
    still.browser.mouse("Released", x + 60, y, buttons=0)
    assert text(still, "#stops .pull[data-key=f]") == "1.00 N"
    assert text(still, "#stops [data-out=loss]") == "25.3 mm"
    still.run(f"{number}.dispatchEvent(new KeyboardEvent('keydown', {{ key: 'Home' }}))")
    assert text(still, "#stops [data-out=loss]") == "12.7 mm"


@pytest.mark.parametrize("width", [360, 1280])
def test_bodies_of_the_opening_and_the_stories_stay_under_the_pointer(still, width):
    still.browser.size(width, 740)
    for section in DRAGGED:
        if section != "opening":
            show(still, section)
        else:
            still.run("scrollTo(0, 0)")
            still.wait(OPENING_IS_DONE)
            still.run(web_page.DRAWN)
        body = f"#{section} .grip :is(rect, circle).body"
        x, y = still.middle(body)
        still.browser.mouse("Pressed", x, y)
        for step in (20, -15):
            still.browser.mouse("Moved", x + step, y)
            still.run(web_page.DRAWN)
            at_x, at_y = still.middle(body)
            assert at_x == pytest.approx(x + step, abs=TOLERANCE), section
            assert at_y == pytest.approx(y, abs=TOLERANCE), section
        still.browser.mouse("Released", x, y, buttons=0)
    still.browser.size(1280)


@pytest.mark.parametrize("width", [360, 1280])
def test_the_opening_fits_its_window_and_does_not_shift(page, width):
    page.browser.size(width)
    script = page.browser.call("Page.addScriptToEvaluateOnNewDocument", source=web_page.SHIFTS)
    page.open(anew=True)
    page.browser.call("Page.removeScriptToEvaluateOnNewDocument", **script)
    page.run("new Promise(done => setTimeout(done, 600))")
    assert page.run("shift") < 0.1
    assert page.run("document.documentElement.scrollWidth") <= width
    page.browser.size(1280)


def test_a_link_shows_its_run_and_an_untouched_page_opens_with_the_claim_again(page):
    top = "document.getElementById('explore').getBoundingClientRect().top"
    page.open(".model=smd", anew=True)
    assert abs(page.run(top)) < 5
    page.open(anew=True)
    page.wait("document.querySelector('#tables caption')")
    assert page.run("[location.hash, scrollY]") == ["", 0]
    page.run("document.querySelector('nav a').click()")
    page.run("new Promise(done => setTimeout(done, 300))")
    assert page.run("[app.state().model, location.hash]") == ["coulomb", "#stops"]
