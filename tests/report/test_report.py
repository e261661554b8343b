"""The report on results of real runs: complete, self-contained, and usable on a phone."""

import re
import shutil
from base64 import b64decode
from html.parser import HTMLParser
from itertools import groupby

import pytest
from build_cache import ROOT, build_user_model, run_published_cases
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
        assert harness(folder, *command, "--quiet", figures=True).returncode == 0
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


def test_existing_results_are_shown_and_missing_ones_listed_with_their_command(report_run, page):
    done = report_run[1]
    assert (done.returncode, done.stderr) == (0, "")
    assert "Missing: smd; run `friction-fmus run smd`" in done.stdout
    assert "Missing: stability; run `friction-fmus stability`" in done.stdout
    assert "`friction-fmus run coulomb`" not in done.stdout
    assert "friction-fmus run smd" in page
    assert "friction force, 7.5 cycles" in page
    assert "Published values: HJSIII, ME 481, course handout, 2020, figures of MATLAB." in page
    assert "Best described by dry friction" in page


def test_every_picture_has_alternative_text_and_nothing_is_loaded_from_elsewhere(page):
    tags = Tags(page)
    pictures = tags.of("img")
    assert len(pictures) == 5
    for picture in pictures:
        assert len(picture["alt"]) > 20
        assert picture["src"].startswith("data:image/svg+xml,")
    assert not re.findall(r'(?:src|href)="(?!data:|#)', page)
    assert not re.findall(r"url\((?!%23)", page)  # a figure refers to its own parts only
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
    linked = set(re.findall(r'href="#([^"]+)"', contents))
    assert linked <= identifiers | {"missing"}
    assert {"decay", "compare", "reference", "reference-1", "published", "steps"} <= linked


def test_a_page_stays_below_one_megabyte_and_names_what_it_leaves_out(tmp_path, report_run):
    """Results of the user are embedded first."""
    results = tmp_path / "results"
    shutil.copytree(report_run[0] / "results", results)
    for i in range(20):
        shutil.copytree(results / "coulomb-sign", results / f"coulomb-sign-{i}")
    assert harness(tmp_path, "report", "--quiet").returncode == 0
    page = (results / "report.html").read_bytes()
    assert 800_000 < len(page) < 1_000_000
    text = page.decode()
    named = re.findall(r"Figure, not in this page to keep it small: ([^<]+)</p>", text)
    assert 10 < len(named) < 25
    assert len(named) + len(Tags(text).of("img")) == 25
    assert not [path for path in named if path.startswith(("decay", "compare"))]


def test_every_link_of_a_copied_report_leads_to_an_anchor_or_carries_its_file(report_run, page):
    """No link leads out of the page; small files are in it, large ones are named."""
    tags = Tags(page)
    anchors = {attributes.get("id") for _, attributes in tags.elements}
    links = tags.of("a")
    data = {link["download"]: link["href"].partition("base64,")[2] for link in links if "download" in link}
    assert {link["href"][1:] for link in links if "download" not in link} <= anchors
    assert {"coulomb-quantities.csv", "coulomb-events.csv", "decay-coulomb-turning-points.csv"} <= set(data)
    assert b64decode(data["coulomb-events.csv"]) == (report_run[0] / "results/coulomb/events.csv").read_bytes()
    assert "coulomb-trajectory.csv" not in data
    assert "coulomb/trajectory.csv" in page


def test_text_from_results_is_escaped(report_run):
    """A name with markup is shown literally."""
    folder = report_run[0] / "results/decay/coulomb"
    preserved = (folder / "summary.json").read_text()
    (folder / "summary.json").write_text(preserved.replace('"title": "coulomb"', '"title": "<b>bold"'))
    assert harness(report_run[0], "report", "--quiet").returncode == 0
    assert "&lt;b&gt;bold" in (report_run[0] / "results/report.html").read_text()
    (folder / "summary.json").write_text(preserved)
    assert harness(report_run[0], "report", "--quiet").returncode == 0


def test_a_report_with_only_users_models_begins_with_them(tmp_path):
    shutil.copy(build_user_model(ROOT / "tests/example_models/larger/sleds.py") / "sleds.fmu", tmp_path)
    assert harness(tmp_path, "run", "sleds.fmu", "--quiet").returncode == 0
    assert harness(tmp_path, "report", "--quiet").returncode == 0
    page = (tmp_path / "results/report.html").read_text(encoding="utf-8")
    headings = re.findall(r"<h[23]>(.*?)</h[23]>", page)
    assert headings[:4] == ["Contents", "Runs", "sleds", "What to use"]
    assert headings.count("sleds") == 1
    assert "the checks of this project" not in page


def test_a_figure_that_is_cut_off_is_not_shown(tmp_path, report_run):
    texts = "", "<svg><g>", "<svg></svg><g>", "</svg>"
    (source,) = (report_run[0] / "results/compare").iterdir()
    for i, text in enumerate(texts):
        shutil.copytree(source, tmp_path / f"results/{i}")
        (tmp_path / f"results/{i}/figure.svg").write_text(text)
    assert harness(tmp_path, "report", "--quiet").returncode == 0
    page = (tmp_path / "results/report.html").read_text(encoding="utf-8")
    assert page.count("cannot be shown: figure.svg is not a complete SVG drawing") == len(texts)


def test_a_report_that_cannot_be_written_leaves_no_file(tmp_path, report_run):
    results = tmp_path / "results"
    shutil.copytree(report_run[0] / "results/coulomb", results / "coulomb")
    (results / "report.html").mkdir()
    done = harness(tmp_path, "report")
    assert (done.returncode, done.stderr) == (1, "Error: cannot write results/report.html: Is a directory\n")
    assert sorted(path.name for path in results.iterdir()) == ["coulomb", "report.html"]


def test_without_results_there_is_no_report(tmp_path):
    done = harness(tmp_path, "report")
    assert done.returncode == 1
    assert "no results in results" in done.stderr
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


def test_the_report_begins_with_a_plot_of_the_computed_motion_to_its_stop(page):
    """The first drawing is the position over time, with the same number of turning points; then the mass is stuck."""
    width, lines = re.search(r'<svg viewBox="0 0 (\d+) \d+"(.*?)</svg>', page, re.S).groups()
    (motion, rest) = (
        [tuple(map(float, pair.split(","))) for pair in points.split()]
        for points in re.findall(r'<polyline[^>]* points="([^"]+)"', lines)
    )
    assert page.index("<svg") < page.index("What to use</h2>")
    begin, end = 6.0, float(width) - 6.0
    assert (motion[0][0], motion[-1][0]) == (begin, end)
    assert 'class="stuck"' in lines
    assert rest[0] == (pytest.approx(begin + (end - begin) * 4.000173 / 5.0, abs=0.5), rest[1][1])
    assert rest[1] == motion[-1]
    swinging = [y for t, y in motion if t < rest[0][0]]
    turns_of_plot = [y for y, _ in groupby(swinging)]
    turns = sum(
        (b - a) * (c - b) < 0 for a, b, c in zip(turns_of_plot, turns_of_plot[1:], turns_of_plot[2:], strict=False)
    )
    assert turns == 15  # of the 16 half swings


def test_published_values_are_shown_and_other_quantities_folded(page):
    part = re.search(r'<h3>coulomb-sign</h3>.*?<div class="figure"', page, re.S)[0]
    compared, folded = part.split("<summary>Quantities without a known value</summary>")
    assert [cell in compared for cell in ("friction force, 3 cycles", "smallest step")] == [True, False]
    assert [cell in folded for cell in ("friction force, 3 cycles", "smallest step")] == [False, True]


def test_run_times_have_two_digits_and_texts_no_backticks(page):
    times = re.findall(r"<td[^>]*>run time</td><td[^>]*>([^<]+)</td>", page)
    assert len(times) == 3
    assert all(len(time.replace(".", "").strip("0")) <= 2 for time in times)
    assert "`" not in page


def test_a_decay_marks_what_holds_only_for_a_single_loss(page):
    assert "first and last peak, if this loss acted alone</th>" in page
    assert "Best described by dry friction.</p>" in page


def test_missing_results_are_listed_once_at_the_end_and_have_no_section(page):
    last = page[page.index('<details class="missing"') :]
    assert "Not in this report: pacejka-0.001, " in last
    assert "stability: <code>friction-fmus stability</code>" in last
    assert "<section" not in last
    assert 'id="stability"' not in page


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


def test_an_existing_interactive_page_is_included_and_every_picture_links_to_it(tmp_path, report_run):
    shutil.copytree(report_run[0] / "results", tmp_path / "results")
    (tmp_path / "fmus/web").mkdir(parents=True)
    bench = '<!doctype html><title>it\'s "here" &amp; <b></title><script>"x"</script>'
    (tmp_path / "fmus/web/index.html").write_text(bench)
    assert harness(tmp_path, "report", "--quiet").returncode == 0
    report = (tmp_path / "results/report.html").read_text(encoding="utf-8")
    assert [frame["srcdoc"] for frame in Tags(report).of("iframe")] == [bench]
    assert '<a href="#live">Live: coulomb-stop</a>' in report
    assert "The file\nfmus/web/index.html is the same page" in report
    assert 'href="../' not in report
    assert "index.html" not in (report_run[0] / "results/report.html").read_text(encoding="utf-8")
