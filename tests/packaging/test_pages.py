"""The documentation in an FMU: its page, its icon, its certified result."""

import csv
import re
import struct
from html.parser import HTMLParser
from io import StringIO
from xml.etree import ElementTree

import fmi3_fixtures
import native_fmus
import pytest
from archives import read_archive
from build_cache import ROOT
from models import MODELS, declarations_of, model_class, outputs

from fmus.packaging import archive
from fmus.packaging.documentation_page import documentation_page, tick_values, typeset
from fmus.packaging.fmi_variables import declared_variables
from fmus.packaging.native import native_fmu as fmu

EVERY_MODEL = pytest.mark.parametrize("name", MODELS)
WITH = {  # an ending -> the models that have such a file
    ending: [name for name in MODELS if (ROOT / "fmus" / f"{name}.{ending}").is_file()] for ending in ("png", "csv")
}
PAGE, ICON, EXTRA = "documentation/index.html", "model.png", "extra/org.fmi-standard.fmi-ls-ref/"
VOID = {"meta", "img"}
NAMESPACE = "{http://fmi-standard.org/fmi-ls-manifest}"


@pytest.fixture
def content(fmus):
    """Return content(name): the files of an FMU."""
    return lambda name: read_archive(fmus / f"{name}.fmu")


@EVERY_MODEL
def test_a_native_fmu_has_the_same_page_and_each_states_which_hosts_run_it(content, name):
    files = {path: data for path, data in content(name).items() if path in (PAGE, ICON) or path.startswith(EXTRA)}
    others = read_archive(native_fmus.build_native_fmus() / f"{name}.fmu")
    assert len(files) == 1 + (name in WITH["png"]) + 2 * (name in WITH["csv"])
    python_note, native_note = archive.USAGE_NOTE.encode(), fmu.USAGE_NOTE.encode()
    assert python_note in files[PAGE]
    files[PAGE] = files[PAGE].replace(python_note, native_note, 1)
    assert files == {path: others.get(path) for path in files}


CAPABILITIES = {  # names as they begin in the model descriptions of both versions; attributes that are not false
    "FMI": (".", "fmiVersion"),
    "co-simulation; save, restore and serialize the state": ("CoSimulation", "canSerializeFMU"),
    "model exchange: event indicators, time events, nominal values": ("ModelExchange", "modelIdentifier"),
    "partial derivatives, also with respect to start values and parameters": ("CoSimulation", "providesDirectional"),
    "derivatives of outputs (order 1)": ("CoSimulation", "maxOutputDerivativeOrder"),
    "first derivatives of inputs": (
        "CoSimulation",
        "canInterpolateInputs",
    ),
    "event mode, early return at stick and slip": ("CoSimulation", "hasEventMode"),
    "intermediate update after each internal step, where inputs can be set": (
        "CoSimulation",
        "providesIntermediateUpdate",
    ),
}


def test_the_capabilities_listed_per_backend_are_true_on_every_page_and_in_the_guide(content):
    """For a model with a closed form, which has all capabilities."""
    kinds = [
        content("stickslip"),
        *(
            read_archive(build() / "stickslip.fmu")
            for build in (native_fmus.build_native_fmus, fmi3_fixtures.build_fmi3_fmus)
        ),
    ]
    for files in kinds:
        (table,) = re.findall(r"<table class='offered'>.*?</table>", files[PAGE].decode())
        rows = [re.findall(r"<td>(.*?)</td>", row) for row in table.split("<tr>")[2:]]
        text = (ROOT / "docs" / "how-to" / "native.md").read_text(encoding="utf-8")
        guide_table = text.split("|---|---|---|---|\n")[1].split("\n\n")[0]
        assert rows == [
            [re.sub("`(.*?)`", r"<code>\1</code>", cell.strip()) for cell in line.split("|")[1:-1]]
            for line in guide_table.splitlines()
        ]
    for capability, *marks in rows:
        if capability.startswith("terminal"):
            assert [bool(cell) for cell in marks] == [any("flange" in name for name in files) for files in kinds]
            continue
        element, start = CAPABILITIES[capability]
        elements = [ElementTree.fromstring(files["modelDescription.xml"]).find(element) for files in kinds]
        attributes = [
            {k: v for k, v in e.attrib.items() if k.startswith(start)} if e is not None else {} for e in elements
        ]
        assert [bool(cell) for cell in marks] == [set(item.values()) not in (set(), {"false"}) for item in attributes]


class Reader(HTMLParser):
    """Collect the text of a page, its headings, its links, and the open elements."""

    def __init__(self, text):
        super().__init__()
        self.open, self.words, self.headings, self.references = [], [], [], []
        self.feed(text)
        self.close()
        self.text = " ".join("".join(self.words).split())

    def handle_starttag(self, tag, attributes):
        if tag not in VOID:
            self.open.append(tag)
        self.references += [value for key, value in attributes if key in ("src", "href")]

    def handle_startendtag(self, tag, attributes):
        """An element of a drawing."""

    def handle_endtag(self, tag):
        optional_tags = ("p", "td", "tr", "th")
        while self.open[-1] != tag and self.open[-1] in optional_tags:
            self.open.pop()
        assert self.open.pop() == tag

    def handle_data(self, data):
        if self.open and self.open[-1] != "style":
            self.words.append(data)
        if self.open and self.open[-1] == "h2":
            self.headings.append(data.strip())


@EVERY_MODEL
def test_the_page_lists_every_variable_law_and_method(content, name):
    reader = Reader(content(name)[PAGE].decode())
    assert reader.open == []
    for variable, d in declarations_of(name).items():
        assert variable in reader.text
        assert d.text in reader.text.lower() or d.text in reader.text
        for label, _, sentence in d.items:
            assert label in reader.text
            assert sentence in reader.text
    assert model_class(name).__doc__.strip().splitlines()[0] in reader.text
    expected = {"Equations", "Parameters", "Outputs", "Use", *["Default run"] * (name in WITH["csv"])}
    assert expected <= set(reader.headings)


def test_an_angle_is_drawn_in_the_unit_that_its_label_names(content):
    """The pendulum starts at 10 degrees."""
    chart = re.search(
        r'<svg.*?aria-label="theta in deg over time in s".*?</svg>', content("pendulum")[PAGE].decode(), re.S
    )
    ticks = [float(tick) for tick in re.findall(r'text-anchor="end">(-?[\d.]+)<', chart[0])]
    assert max(ticks) == 10.0


@EVERY_MODEL
def test_the_page_is_self_contained(content, name):
    files = content(name)
    text = files[PAGE].decode()
    assert "http" not in text.lower()
    assert "<script" not in text
    for target in Reader(text).references:
        path = target.removeprefix("../") if target.startswith("../") else f"documentation/{target}"
        assert [file for file in files if file.startswith(path)]


@pytest.mark.parametrize("name", WITH["png"])
def test_the_icon_is_a_square_picture_of_some_size(content, name):
    icon = content(name)[ICON]
    assert icon[:8] == b"\x89PNG\r\n\x1a\n"
    assert struct.unpack(">II", icon[16:24]) == (256, 256)
    assert len(icon) > 2000


@pytest.mark.parametrize("name", WITH["csv"])
def test_the_manifest_names_the_certified_result_and_its_origin(content, name):
    files = content(name)
    root = ElementTree.fromstring(files[f"{EXTRA}fmi-ls-manifest.xml"])
    assert root.tag == "fmiReferences"
    assert root.get(f"{NAMESPACE}fmi-ls-name") == "org.fmi-standard.fmi-ls-ref"
    assert root.get(f"{NAMESPACE}fmi-ls-version")
    (element,) = root.findall("Related")
    assert (element.get("role"), element.get("type")) == ("result", "text/csv")
    assert f"{EXTRA}{element.get('source')}" in files
    assert re.search(r"difference [\d.]+e-1[0-9]\.", element.get("description"))


@pytest.mark.parametrize("name", WITH["csv"])
def test_the_fmu_reproduces_its_certified_result(content, launch, name):
    """Position and speed of the default run, relative to the largest value, within the contract."""
    text = content(name)[f"{EXTRA}{name}_out.csv"].decode()
    heads, *rows = csv.reader(StringIO(text))
    assert heads == ["time", *outputs(name)[:2]]
    table = [[float(word) for word in row] for row in rows]
    times = [row[0] for row in table]
    assert (times[0], times[-1]) == (0.0, model_class(name).stop_time)
    computed_rows = launch(name, stop=times[-1]).run(times, heads[1:])
    tolerance = {"pacejka": 1e-6, "pendulum": 1e-9}.get(name, 1e-13)
    for column, expected in zip(zip(*computed_rows, strict=True), list(zip(*table, strict=True))[1:], strict=True):
        largest = max(map(abs, expected))
        assert max(abs(a - b) for a, b in zip(column, expected, strict=True)) <= tolerance * largest


def test_a_model_without_a_certified_result_has_a_page():
    model = model_class("smd")
    reader = Reader(documentation_page(model, "sixth", declared_variables(model), None, [], "model.png", "").decode())
    assert "Default run" not in reader.headings
    assert "sixth" in reader.text


@pytest.mark.parametrize(("causality", "title"), [("input", "Input"), ("parameter", "Parameters")])
def test_a_page_has_no_table_without_rows(causality, title):
    model = model_class("smd")
    variables = [pair for pair in declared_variables(model) if pair[1].causality != causality]
    page = documentation_page(model, "free", variables, None, [], "", "").decode()
    assert f"<h2>{title}</h2>" not in page
    assert "<h2>Outputs</h2>" in page
    assert all("<td" in table for table in re.findall(r"<table.*?</table>", page, re.S))


def test_names_are_typeset_and_escaped():
    assert typeset("a < b & mu_s^2 - k x") == "a &lt; b &amp; &mu;<sub>s</sub><sup>2</sup> &minus; k x"


@pytest.mark.parametrize(("low", "high"), [(-1.0, 1.0), (0.0, 16.0), (-3e-7, 2e-7), (1e5, 1.2e5)])
def test_ticks_are_round_few_and_inside(low, high):
    values = tick_values(low, high)
    assert 3 <= len(values) <= 7
    assert all(low <= tick <= high for tick in values)


@EVERY_MODEL
def test_no_page_is_wider_than_the_window(content, name, tmp_path, browser):
    for path, data in content(name).items():
        if path in (PAGE, ICON):
            (tmp_path / path).parent.mkdir(exist_ok=True)
            (tmp_path / path).write_bytes(data)
    browser.open((tmp_path / PAGE).as_uri())
    for width in (360, 1200):
        browser.size(width)
        assert browser.run("document.documentElement.scrollWidth") <= width
    assert browser.console == []
