"""The report on results of real runs: complete, self-contained, and usable on a phone."""

import re
import shutil
from base64 import b64decode
from html.parser import HTMLParser

import pytest
from build_cache import run_published_cases
from commands import harness

EMPTY = {"meta", "link", "img", "br"}


@pytest.fixture(scope="module")
def report_run(fmus, tmp_path_factory):
    """A folder with results of several kinds, and the report on them."""
    folder = tmp_path_factory.mktemp("report")
    (folder / "fmus").symlink_to(fmus)
    for scene in ("coulomb", "coulomb-sign", "coulomb-stop"):
        shutil.copytree(run_published_cases() / "results" / scene, folder / "results" / scene)
    for command in (
        ("decay", "coulomb"),
        ("compare", "results/coulomb", "results/coulomb-sign"),
    ):
        assert harness(folder, *command, figures=True).returncode == 0
    return folder, harness(folder, "report")


@pytest.fixture
def page(report_run):
    return (report_run[0] / "results/report.html").read_text(encoding="utf-8")


class Tags(HTMLParser):
    """Collect every tag with its attributes; the elements must nest."""

    def __init__(self, text):
        super().__init__()
        self.elements, self.open = [], []
        self.feed(text)
        assert self.open == []

    def handle_starttag(self, tag, attributes):
        self.elements.append((tag, dict(attributes)))
        if tag not in EMPTY:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def of(self, tag):
        return [attributes for name, attributes in self.elements if name == tag]


def test_results_are_shown_under_the_title_and_nothing_else(report_run, page):
    """No missing results, verdicts, advice or other texts of the project."""
    result = report_run[1]
    assert (result.returncode, result.stdout, result.stderr) == (0, "Report in results/report.html\n", "")
    headings = re.findall(r"<h[123]>(.*?)</h[123]>", page)
    runs = ["Runs", "coulomb", "coulomb-sign", "coulomb-stop"]
    assert headings == [
        "Results",
        "Contents",
        "Decay",
        "coulomb",
        "Comparisons",
        "coulomb and coulomb-sign",
        *runs,  # last, because they are compared with known values
    ]
    assert "<title>Results</title>" in page
    assert "Published values: HJSIII, ME 481, course handout, 2020, figures of MATLAB." in page
    assert "Best described by dry friction" in page


def test_every_picture_has_alternative_text_and_nothing_is_loaded_from_elsewhere(page):
    tags = Tags(page)
    pictures = tags.of("img")
    assert len(pictures) == 5
    for picture in pictures:
        assert len(picture["alt"]) > 20
        assert picture["src"].startswith("data:image/svg+xml;base64,")
    assert not re.findall(r'src="(?!data:)', page)
    figures = [b64decode(picture["src"].partition(",")[2]).decode() for picture in pictures]
    assert not [figure for figure in figures if re.search(r"url\((?!#)|href=\"(?!#)", figure)]
    assert tags.of("script") == []


def test_every_heading_of_a_table_has_a_text_and_every_landmark_its_own_name(page):
    tags = Tags(page)
    cells = re.findall(r"<th [^>]*>(.*?)</th>", page)
    assert len(cells) == len(tags.of("th")) > 20
    assert all(cells)
    names = [attributes["aria-label"] for _, attributes in tags.elements if attributes.get("role") == "region"]
    assert len(names) == len({*names}) > 10


def test_the_contents_list_every_section_and_result(page):
    contents = re.search(r'<nav aria-label="Contents">.*?</nav>', page, re.S)[0]
    identifiers = {attributes.get("id", "") for tag, attributes in Tags(page).elements if tag in ("section", "div")}
    targets = set(re.findall(r'href="#([^"]+)"', contents))
    assert targets <= identifiers
    assert {"run", "run-1", "run-3", "decay", "compare"} <= targets


def test_every_link_leads_to_an_anchor_to_a_file_of_a_result_or_to_the_live_page(report_run, page):
    tags = Tags(page)
    anchors = {f"#{attributes.get('id')}" for _, attributes in tags.elements}
    files = {link["href"] for link in tags.of("a")} - anchors
    assert {"coulomb/trajectory.csv", "coulomb/events.csv", "decay/coulomb/turning-points.csv"} <= files
    assert [file for file in files if not (report_run[0] / "results" / file).is_file()] == ["../fmus/web/index.html"]


def test_text_from_results_is_escaped(report_run):
    """A name with markup is shown literally."""
    folder = report_run[0] / "results/decay/coulomb"
    summary = (folder / "summary.json").read_text()
    (folder / "summary.json").write_text(summary.replace('"title": "coulomb"', '"title": "<b>bold"'))
    assert harness(report_run[0], "report").returncode == 0
    assert "&lt;b&gt;bold" in (report_run[0] / "results/report.html").read_text()
    (folder / "summary.json").write_text(summary)
    assert harness(report_run[0], "report").returncode == 0


def test_a_figure_that_is_cut_off_is_not_shown(tmp_path, report_run):
    texts = "", "<svg><g>", "<svg></svg><g>", "</svg>"
    (source,) = (report_run[0] / "results/compare").iterdir()
    for i, text in enumerate(texts):
        shutil.copytree(source, tmp_path / f"results/{i}")
        (tmp_path / f"results/{i}/figure.svg").write_text(text)
    assert harness(tmp_path, "report").returncode == 0
    page = (tmp_path / "results/report.html").read_text(encoding="utf-8")
    assert page.count("cannot be shown: figure.svg is not a complete SVG drawing") == len(texts)


def test_a_report_that_cannot_be_written_leaves_no_file(tmp_path, report_run):
    results = tmp_path / "results"
    shutil.copytree(report_run[0] / "results/coulomb", results / "coulomb")
    (results / "report.html").mkdir()
    result = harness(tmp_path, "report")
    assert (result.returncode, result.stderr) == (1, "Error: cannot write results/report.html: Is a directory\n")
    assert sorted(path.name for path in results.iterdir()) == ["coulomb", "report.html"]


def test_without_results_there_is_no_report(tmp_path):
    result = harness(tmp_path, "report")
    assert result.returncode == 1
    assert "no results in results" in result.stderr
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("dark", [False, True])
def test_a_browser_shows_the_report_without_errors_or_horizontal_scrolling(report_run, browser, dark):
    """On a phone, figures keep a readable width and scroll on their own."""
    browser.dark(dark)
    browser.open((report_run[0] / "results/report.html").as_uri())
    for width, image_width in ((360, 736), (1200, 640)):
        browser.size(width)
        assert browser.run("document.documentElement.scrollWidth") <= width
        assert browser.run(f"[...document.images].filter(i => i.naturalWidth && i.width >= {image_width}).length") == 5
    assert browser.console == []
    assert browser.pdf().startswith(b"%PDF")


def test_the_navigation_stays_beside_the_text_on_a_wide_screen_only(report_run, browser):
    browser.open((report_run[0] / "results/report.html").as_uri())
    box = "document.querySelector('{}').getBoundingClientRect()"
    navigation, text = box.format("nav"), box.format("main")
    browser.size(1200)
    browser.run("scrollTo(0, 2000)")
    assert browser.run(f"{navigation}.right <= {text}.left && {navigation}.top >= 0 && {navigation}.top < innerHeight")
    assert browser.run("getComputedStyle(document.querySelector('nav ul ul')).display") == "block"
    browser.size(360)
    browser.run("scrollTo(0, 2000)")
    assert browser.run(f"{navigation}.bottom < 0 && {text}.width > 300")


def test_published_values_are_shown_and_other_quantities_folded(page):
    part = re.search(r'<h3>coulomb-sign</h3>.*?<div class="figure"', page, re.S)[0]
    shown_part, folded_part = part.split("<summary>Quantities without a known value</summary>")
    assert [cell in shown_part for cell in ("friction force, 3 cycles", "smallest step")] == [True, False]
    assert [cell in folded_part for cell in ("friction force, 3 cycles", "smallest step")] == [False, True]


def test_texts_have_no_backticks(page):
    assert "`" not in page


def test_a_decay_marks_its_rough_values(page):
    assert "two peaks (rough)</th>" in page
    assert "Best described by dry friction" in page


def test_figures_follow_the_colour_scheme_and_keep_text_as_text(report_run, browser):
    """Background, axis and text of the file itself, on a light screen and on a dark one."""
    look = "[...document.querySelectorAll('#patch_1 path, text')].slice(0, 2).map(e => getComputedStyle(e).fill)"
    colours = []
    for dark in (False, True):
        browser.dark(dark)
        browser.open((report_run[0] / "results/coulomb/figure.svg").as_uri())
        colours.append(browser.run(look))
    browser.dark(False)
    assert colours == [["rgb(255, 255, 255)", "rgb(0, 0, 0)"], ["rgb(29, 33, 37)", "rgb(230, 232, 234)"]]
    assert "position of the mass" in (report_run[0] / "results/coulomb/figure.svg").read_text(encoding="utf-8")
