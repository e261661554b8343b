"""The report on results of real runs: complete, self-contained, and fit for a phone."""

import re
import shutil
import subprocess
from html.parser import HTMLParser

import pytest
from commands import harness

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
FLAGS = (
    "--headless=new",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-background-networking",
    "--disable-dev-shm-usage",
)
EMPTY = {"meta", "link", "img", "br"}


@pytest.fixture(scope="module")
def made(fmus, tmp_path_factory):
    """A folder with results of some kinds, and the finished report on them."""
    folder = tmp_path_factory.mktemp("report")
    (folder / "fmus").symlink_to(fmus)
    for command in (
        ("run", "coulomb"),
        ("run", "coulomb-sign"),
        ("decay", "coulomb"),
        ("compare", "results/coulomb", "results/coulomb-sign"),
    ):
        assert harness(folder, *command, "--quiet").returncode == 0
    return folder, harness(folder, "report")


@pytest.fixture
def page(made):
    return (made[0] / "results/report.html").read_text(encoding="utf-8")


class Tags(HTMLParser):
    """Every tag with its attributes; the elements must nest."""

    def __init__(self, text):
        super().__init__()
        self.found, self.open = [], []
        self.feed(text)
        assert self.open == []

    def handle_starttag(self, tag, attributes):
        self.found.append((tag, dict(attributes)))
        if tag not in EMPTY:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def of(self, tag):
        return [attributes for name, attributes in self.found if name == tag]


def test_what_is_there_is_shown_and_what_is_not_is_named_with_its_command(made, page):
    done = made[1]
    assert (done.returncode, done.stderr) == (0, "")
    assert "Missing: smd; make it with `python -m harness run smd`" in done.stdout
    assert "Missing: stability; make it with `python -m harness stability`" in done.stdout
    assert "`python -m harness run coulomb`" not in done.stdout
    assert "python -m harness run smd" in page
    assert "friction force, 7.5 cycles" in page
    assert "Best described by dry friction" in page


def test_every_picture_has_its_text_and_nothing_comes_from_elsewhere(page):
    tags = Tags(page)
    pictures = tags.of("img")
    assert len(pictures) == 4
    for picture in pictures:
        assert len(picture["alt"]) > 20
        assert picture["src"].startswith("data:image/png;base64,")
    assert not re.findall(r'(?:src|href)="(?!data:|#)', page)
    assert "url(" not in page
    assert tags.of("script") == []


def test_every_link_of_the_page_has_its_place(page):
    tags = Tags(page)
    places = {attributes.get("id") for _, attributes in tags.found}
    assert {link["href"][1:] for link in tags.of("a")} <= places


def test_text_from_results_is_text(made):
    """A name with mark-up in it stays a name."""
    folder = made[0] / "results/decay/coulomb"
    kept = (folder / "decay.json").read_text()
    (folder / "decay.json").write_text(kept.replace('"record": "coulomb"', '"record": "<b>bold"'))
    assert harness(made[0], "report", "--quiet").returncode == 0
    assert "&lt;b&gt;bold" in (made[0] / "results/report.html").read_text()
    (folder / "decay.json").write_text(kept)
    assert harness(made[0], "report", "--quiet").returncode == 0


def test_without_results_there_is_no_report(tmp_path):
    done = harness(tmp_path, "report")
    assert done.returncode == 1
    assert "there are no results in results" in done.stderr
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(CHROMIUM is None, reason="there is no chromium here")
@pytest.mark.parametrize("width", [360, 1200])
def test_a_browser_shows_it_without_complaint_and_without_scrolling_sideways(made, tmp_path, width):
    """A frame of that width reports how wide the page is, and how many pictures could be drawn."""
    shutil.copy(made[0] / "results/report.html", tmp_path)
    (tmp_path / "frame.html").write_text(
        f'<iframe id="f" width="{width}" height="3000" style="border:0" src="report.html"></iframe>'
        "<script>f.onload = () => { const d = f.contentDocument; document.title = `wide ${"
        "d.documentElement.scrollWidth} drawn ${[...d.images].filter(i => i.naturalWidth).length}` }</script>"
    )
    options = (
        "--hide-scrollbars",
        f"--user-data-dir={tmp_path / 'profile'}",
        "--allow-file-access-from-files",
        "--enable-logging=stderr",
    )
    command = [CHROMIUM, *FLAGS, *options, "--virtual-time-budget=5000", "--dump-dom", f"file://{tmp_path}/frame.html"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120)
    assert f"wide {width} drawn 4" in done.stdout
    assert "CONSOLE" not in done.stderr
