"""The interactive page, built once and opened in one browser."""

import json
import re

import build_cache
import commands
import pytest

READY = (  # all runs of the scenes that a selector matches are done and drawn
    "new Promise(done => {{ const look = () => document.querySelector('{0}')"
    "&& !document.querySelector('{0}:not([data-ready])') ? done(true) : setTimeout(look, 1); look() }})"
)
NEXT_PICTURE = (
    "new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))"  # the next picture is complete
)
SHIFTS = (
    "globalThis.shift = 0; new PerformanceObserver(list => { for (const entry of list.getEntries())"
    "if (!entry.hadRecentInput) shift += entry.value }).observe({ type: 'layout-shift', buffered: true })"
)


def build_page(*words, file="index.html"):
    """Build the page with these arguments, which may be model files, and return its file."""
    pytest.importorskip("ziglang", reason="the page is compiled by the package ziglang: pip install -e '.[native]'")

    def make(folder):
        result = commands.build("--web", *map(str, words), "--out", folder)
        assert result.returncode == 0, result.stderr

    return build_cache.keep_build(build_cache.name_build("page", *words), make) / file


class Page:
    """The page at an address, as a visitor uses it."""

    def __init__(self, browser, file):
        self.browser, self.file = browser, file

    def open(self, hash="", anew=False):
        """Open the page with this URL fragment and wait until all runs are done.

        An open page follows the link, which resets all settings; `anew` reloads the page instead.
        """
        expected = self.run("globalThis.app && location.href")
        link = f"{self.file.as_uri()}#{hash}"
        if anew or not expected or expected.split("#")[0] != self.file.as_uri() or expected == link:
            self.browser.open(link)
        else:
            script = (
                "new Promise(done => { addEventListener('hashchange', done, { once: true }); location.hash = HASH })"
            )
            self.run(script.replace("HASH", json.dumps(hash)))
        return self.wait_until_drawn()

    def run(self, script):
        return self.browser.run(script)

    def wait_until_drawn(self, scene="main"):
        """Wait until all runs of Explore, or of other scenes, are done and drawn."""
        return self.run(READY.format(scene))

    def when_done(self, script):
        """Evaluate an expression after all runs are done."""
        self.wait_until_drawn()
        return self.run(script)

    def type_number(self, name, text, prefix="", scene="main"):
        """Type into a number field."""
        field = json.dumps(f"{prefix}field-{name}")
        change = "e.dispatchEvent(new Event('change'))"
        self.run(f"(() => {{ const e = document.getElementById({field}); e.value = {json.dumps(text)}; {change} }})()")
        self.wait_until_drawn(scene)

    def choose(self, name, value):
        """Choose from a list."""
        self.run(
            f"(() => {{ const e = document.getElementById({json.dumps(name)}); e.value = {json.dumps(str(value))}; "
            "e.dispatchEvent(new Event('change')) })()"
        )
        self.wait_until_drawn()

    def check(self, id, on):
        """Tick or untick a box."""
        click = f"e => {{ if (e.checked !== {json.dumps(on)}) e.click() }}"
        self.run(f"({click})(document.getElementById({json.dumps(id)}))")

    def click(self, selector):
        self.run(f"document.querySelector({json.dumps(selector)}).click()")
        self.wait_until_drawn()

    def seek(self, t):
        """Move the cursor to a time."""
        self.run(f"app.seek({t!r})")

    def middle(self, selector):
        """Return the centre of an element in window coordinates."""
        box = f"document.querySelector({json.dumps(selector)}).getBoundingClientRect()"
        return self.run(f"(b => [b.x + b.width / 2, b.y + b.height / 2])({box})")

    def table(self, caption):
        """Return row heading -> cells of the table with this caption."""
        rows = "[...t.tBodies[0].rows].map(r => [...r.cells].map(c => c.textContent))"
        find = f"[...document.querySelectorAll('table')].find(t => t.caption?.textContent === {json.dumps(caption)})"
        return {head: cells for head, *cells in self.run(f"(t => {rows})({find})")}

    def wait(self, condition):
        """Wait until an expression is true."""
        look = f"const look = () => {condition} ? done(true) : setTimeout(look, 10);"
        return self.run(f"new Promise(done => {{ {look} look() }})")


def number(text):
    """Return the number at the beginning of a cell, such as 0.5 or 2.5·10⁻⁶."""
    plain = text.split()[0].replace("\N{MINUS SIGN}", "-").translate(str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹⁻", "0123456789-"))
    sign, mantissa, exponent = re.fullmatch(r"(-?)(?:([\d.]+)·?)??(?:10(-?\d+))?", plain).groups()
    return float(f"{sign}{mantissa or 1}e{exponent or 0}")
