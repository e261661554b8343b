"""Systems of other tools in SSP archives: every engine gives the right value or is named with its reason."""

import csv
import json
from importlib.util import find_spec
from math import cos, cosh, sqrt
from zipfile import ZipFile

import build_cache
import commands
import external_fmus
import pytest
from model_text import CURVE
from ssp_archives import (
    ARCHIVES,
    CONNECTION,
    FILES,
    INNER,
    SINK,
    SOURCE,
    UNIT_TABLE,
    bind,
    bind_inline,
    component,
    parameter_set,
    structure,
)
from ssp_archives import write_archive as write

ENGINES = {"own master", "Ecos", "libcosim", "fmpy"}
HAS_ENGINES = all(map(find_spec, ("pyssp_standard", "ecospy", "libcosimpy")))
pytestmark = pytest.mark.skipif(not HAS_ENGINES, reason="the extras 'coupled' and 'importers' are not installed")


@pytest.fixture(scope="module")
def gain():
    return external_fmus.build_external_fmus() / "Gain.fmu"


@pytest.fixture(autouse=True)
def two_steps(monkeypatch):
    """Run the main engine at two communication steps, because no test of this file reads the order of convergence."""
    monkeypatch.setattr("harness.studies.coupled.external_archive.HALVINGS", 1)


@pytest.mark.parametrize("feature", ARCHIVES)
def test_each_engine_runs_a_system_or_is_named_with_its_reason(tmp_path, gain, feature):
    description, files, expected = ARCHIVES[feature]
    write(tmp_path / "pair.ssp", description, files, gain)
    done = commands.harness(tmp_path, "couple", "pair.ssp", "--json")
    assert (done.returncode, done.stderr) == (0, "")
    failures = {name: item["failure"] for name, item in json.loads(done.stdout)["engines"].items()}
    assert set(failures) == set(ENGINES)
    assert failures["own master"] == ""
    with (tmp_path / "results/coupled/pair/engines.csv").open(newline="") as file:
        heading, *rows = csv.reader(file)
    column = next(i for i, name in enumerate(heading) if "sink.y" in name)
    ends = {row[0]: float(row[column]) for row in rows if row[0] in ENGINES and not failures[row[0]]}
    assert ends == pytest.approx(dict.fromkeys(ends, expected), rel=1e-12)
    for name in set(ENGINES) - set(ends):
        assert failures[name].startswith(f"{name} does not support ")
    if feature in ("plain", "inputs without a connection", "linear transformations"):
        assert {"Ecos", "libcosim"} < set(ends)
    elif feature != "inline parameter values":
        assert feature in failures["Ecos"]


def test_a_parameter_that_reaches_no_variable_is_named(tmp_path, gain):
    files = FILES | {"sink": parameter_set(k=5.0, gian=2.0)}
    write(tmp_path / "pair.ssp", structure(SOURCE + SINK, LINK), files, gain)
    done = commands.harness(tmp_path, "couple", "pair.ssp")
    assert (done.returncode, done.stderr) == (0, "")
    sentence = "The parameter sink.gian of the archive reaches no variable of an FMU: check its name."
    assert " ".join(done.stdout.split()).count("reaches no variable") == 1
    assert sentence in " ".join(done.stdout.split())


def run_one_component(folder, fmu, content=""):
    """Couple an archive with one component; return the finished process, and the times and positions of the body."""
    part = f'<ssd:Component name="body" source="resources/{fmu.name}">{content}</ssd:Component>'
    with ZipFile(folder / "one.ssp", "w") as archive:
        archive.writestr("SystemStructure.ssd", structure(part, ""))
        archive.write(fmu, f"resources/{fmu.name}")
    done = commands.harness(folder, "couple", "one.ssp")
    assert (done.returncode, done.stderr) == (0, "")
    heading, *rows = (folder / "results/coupled/one/trajectory.csv").read_text().splitlines()
    column = next(i for i, name in enumerate(heading.split(",")) if name.startswith("body.x"))
    return done, [[float(row.split(",")[i]) for i in (0, column)] for row in rows]


def test_a_component_for_model_exchange_is_integrated(tmp_path):
    done, motion = run_one_component(tmp_path, external_fmus.build_external_fmus() / "ModelExchangeOnly.fmu")
    assert motion[-1][1] == pytest.approx(cos(sqrt(40.0)), abs=1e-6)
    assert "Ecos does not support components for model exchange" in done.stdout


def test_a_value_of_a_table_is_set_in_fmi_3(tmp_path):
    """It is an element of an array there, which other engines leave at its start value."""
    (tmp_path / "curve.py").write_text(CURVE)
    words = ("--fmi", "3", "--platform", "linux64", "--method", "ode45")
    fmu = build_cache.build_user_model(tmp_path / "curve.py", *words) / "native" / "fmi3" / "curve.fmu"
    done, motion = run_one_component(tmp_path, fmu, bind_inline(parameter_set(**{"force.y[2]": 2.0})))
    *_, (time, x) = (point for point in motion if point[1] < 1.0)  # in the first piece, 2 x'' = 1 + x
    assert time > 0.5
    assert x == pytest.approx(1.25 * cosh(time / sqrt(2.0)) - 1.0, rel=1e-6)
    assert "Ecos does not support values of elements of arrays" in done.stdout


LINK = f"<ssd:Connection {CONNECTION}/>"
MAPPED_LINK = f"<ssd:Connection {CONNECTION}><ssc:BooleanMappingTransformation/></ssd:Connection>"
CIRCLE = (
    '<ssd:System name="inner"><ssd:Elements/><ssd:Connections><ssd:Connection startConnector="b" endConnector="a"/>'
    '<ssd:Connection startConnector="a" endConnector="b"/></ssd:Connections></ssd:System>'
)
DICTIONARY = (
    '<ssd:SignalDictionaries><ssd:SignalDictionary name="bus" source="resources/bus.ssb"/></ssd:SignalDictionaries>'
)
TO_INNER = '<ssd:Connection startElement="inner" startConnector="a" endElement="sink" endConnector="u"/>'


@pytest.mark.parametrize(
    ("description", "sentence"),
    [
        (structure(SOURCE + SINK, more=DICTIONARY), "it has the signal dictionary bus; they are not supported"),
        (structure(SOURCE + SINK, version="3.0"), "it has SSP version 3.0; supported are 1.0 and 2.0"),
        (structure(SINK + CIRCLE, TO_INNER), "the connections to sink.u form a circle"),
        (structure(SINK + INNER, TO_INNER), "starts at inner.a, which is no output"),
        (structure(SOURCE + SINK, 2 * LINK), "two connections end at sink.u"),
        (structure(SOURCE + SINK.replace("Gain.fmu", "None.fmu")), "the component sink has no FMU: there is no file"),
        (structure(SOURCE + component("sink", bind("gone"))), "it has no file resources/gone.ssv"),
        (
            structure(SOURCE + SINK.replace("x-fmu-sharedlibrary", "x-ssp-package")),
            "of the type application/x-ssp-package",
        ),
        (structure(SOURCE + SINK, LINK.replace('"y"', '"z"')), "has no variable z"),
        (
            structure(
                component("source", bind("source"), "m") + component("sink", bind("sink"), "kg"), units=UNIT_TABLE
            ),
            "sink.u: m cannot be converted to kg",
        ),
        (structure(component("source", bind("source"), "m") + component("sink", "", "ell")), "the unit m at"),
        (
            structure(SOURCE + SINK, MAPPED_LINK),
            "the connection to sink.u has a BooleanMappingTransformation",
        ),
    ],
)
def test_what_a_system_cannot_have_is_refused_by_name(tmp_path, gain, description, sentence):
    write(tmp_path / "pair.ssp", description, FILES, gain)
    done = commands.harness(tmp_path, "couple", "pair.ssp")
    assert done.returncode == 1
    assert sentence in done.stderr
    assert done.stderr.count("\n") == 1
    assert not (tmp_path / "results/coupled/pair").exists()
