"""Contents and description of FMI 3.0 FMUs: correct and reproducible."""

from html.parser import HTMLParser
from io import BytesIO
from pathlib import Path

import fmi3_fixtures
import fmpy
import numpy as np
import pytest
import worker_client
from archives import read_archive
from fmpy import read_model_description, simulate_fmu
from fmpy.validation import validate_fmu
from lxml import etree
from models import ROOT, declarations_of, model_class, scalar_class
from PIL import Image
from variants import slow_after

from fmus.compiler.lowering import model_exchange_run
from fmus.compiler.model_lookup import model_names
from fmus.packaging.fmi_variables import declared_variables
from fmus.packaging.native.native_fmu import FMI_HEADERS, OWN_HEADERS
from fmus.runtime.variable_declarations import variables
from tests.packaging.test_packaging import (  # noqa: F401
    EVERY_MODEL,
    command,
    description_of,
    test_validation_reports_no_problems,
)

SCHEMA = Path(fmpy.__file__).parent / "schema/fmi3"
DRY = {name for name in model_names() if scalar_class(name).has_dry_friction}
DRIVEN_MODELS = {name for name in model_names() if scalar_class(name).has_driver}
TYPES = {"Real": "Float64", "Integer": "Int64", "Enumeration": "Enumeration"}
STRUCTURE = ("Output", "ContinuousStateDerivative", "InitialUnknown", "EventIndicator")
# Every parameter has an effect, and friction often holds.
PARAMETERS = {"coulomb": {"c": 0.7, "k": 1.0}, "pendulum": {"r": 0.5}}


@pytest.fixture(scope="module")
def fmu():
    return lambda name: fmi3_fixtures.build_fmi3_fmus() / f"{name}.fmu"


@pytest.fixture(scope="module")
def inspect(fmu, tmp_path_factory):
    """Return inspect(function, name, ...), which inspects the FMU alone in a clean process; one process serves all
    tests."""
    requests = [("variables", name) for name in model_names()]
    requests += [("factors", name, PARAMETERS.get(name, {})) for name in model_names()] + [
        ("nominals", "pacejka", "x_m", 1e-5)
    ]
    calls = [(function, fmu(name), *arguments) for function, name, *arguments in requests]
    answers = worker_client.run_script(
        Path(__file__).with_name("fmi3_inspection.py"), "call_each", calls, folder=tmp_path_factory.mktemp("fmi3")
    )
    return lambda *call: answers[requests.index(call)]


def additional_names(name):
    """Return the names of the variables after the declared ones."""
    indicators = ["events.to_rest", "events.to_break_away"] if name in DRY else []
    return [*indicators, *(["der(x_driver)"] if name in DRIVEN_MODELS else []), "time"]


def structure(root, kind):
    """Return reference, dependencies and their kinds of every unknown of a kind."""
    unknowns = root.findall(f"ModelStructure/{kind}")
    return [
        (int(u.get("valueReference")), [int(r) for r in u.get("dependencies", "").split()], u.get("dependenciesKind"))
        for u in unknowns
    ]


@EVERY_MODEL
def test_one_fmu_offers_model_exchange_and_co_simulation(fmu, name):
    root = description_of(fmu(name))
    assert (root.get("fmiVersion"), root.get("modelName")) == ("3.0", name)
    for kind in ("ModelExchange", "CoSimulation"):
        able = root.find(kind).attrib
        assert able["modelIdentifier"] == name
        assert able["canGetAndSetFMUState"] == able["canSerializeFMUState"] == "true"
        assert able["needsExecutionTool"] == able["canBeInstantiatedOnlyOncePerProcess"] == "false"
    able = root.find("CoSimulation").attrib
    for ability in ("canHandleVariableCommunicationStepSize", "hasEventMode", "mightReturnEarlyFromDoStep"):
        assert able[ability] == "true"


@EVERY_MODEL
def test_declared_variables_keep_their_references_and_attributes(fmu, fmus, name):
    two = read_model_description(fmus / f"{name}.fmu").modelVariables
    three = read_model_description(fmu(name)).modelVariables
    for variable, as_before in zip(three, two, strict=False):
        for key in ("name", "valueReference", "description", "causality", "variability", "initial", "start"):
            assert getattr(variable, key) == getattr(as_before, key)
        for key in ("unit", "displayUnit", "min", "max"):
            assert getattr(variable, key) == getattr(as_before, key)
        assert variable.type == TYPES[as_before.type]
    assert [variable.name for variable in three[len(two) :]] == additional_names(name)
    assert [variable.valueReference for variable in three] == list(range(len(three)))


@EVERY_MODEL
def test_every_real_has_a_unit_and_every_enumeration_its_items(fmu, name):
    root = description_of(fmu(name))
    units = {unit.get("name") for unit in root.findall("UnitDefinitions/Unit")}
    assert {element.get("unit") for element in root.iterfind("ModelVariables/Float64")} == units
    types = {kind.get("name"): kind for kind in root.find("TypeDefinitions")}
    for variable, meaning in declarations_of(name).items():
        if meaning.items:
            element = root.find(f"ModelVariables/Enumeration[@name='{variable}']")
            items = types[element.get("declaredType")].findall("Item")
            assert [(i.get("name"), int(i.get("value")), i.get("description")) for i in items] == list(meaning.items)


@EVERY_MODEL
def test_derivatives_name_their_states_and_follow_the_order_of_the_states(fmu, name):
    description = read_model_description(fmu(name))
    rates = [unknown.variable for unknown in description.derivatives]
    outputs = [variable.name for variable in description.modelVariables if variable.causality == "output"]
    drivers = ["x_driver"] if name in DRIVEN_MODELS else []
    assert [rate.derivative.name for rate in rates] == [*outputs[:2], *drivers]
    assert [rate.name for rate in rates] == [*outputs[1:3], *(f"der({state})" for state in drivers)]
    assert [variable for variable in description.modelVariables if variable.derivative] == sorted(
        rates, key=lambda rate: rate.valueReference
    )


@EVERY_MODEL
def test_the_structure_lists_all_unknowns_in_schema_order(fmu, name):
    root = description_of(fmu(name))
    kinds = [element.tag for element in root.find("ModelStructure")]
    assert kinds == sorted(kinds, key=STRUCTURE.index)
    names = [variable.name for variable in read_model_description(fmu(name)).modelVariables]
    indicators = [names[reference] for reference, _, _ in structure(root, "EventIndicator")]
    assert indicators == [name for name in additional_names(name) if name.startswith("events.")]


@EVERY_MODEL
def test_only_the_speed_may_jump_and_only_with_dry_friction(fmu, name):
    jump_names = [
        element.get("name") for element in description_of(fmu(name)).findall("ModelVariables/*[@reinit='true']")
    ]
    _, speed, *_ = [variable for variable, meaning in variables(scalar_class(name)()) if meaning.causality == "output"]
    assert jump_names == ([speed] if name in DRY else [])


@EVERY_MODEL
def test_nominal_values_are_those_of_the_description(fmu, name):
    _model, run = model_exchange_run(model_class(name))
    rates = [unknown.variable for unknown in read_model_description(fmu(name)).derivatives]
    assert run.model_exchange.nominals == [float(rate.derivative.nominal) for rate in rates]


def test_a_finer_creep_lowers_the_nominal_speed_and_the_event_reports_it(inspect):
    default, fine = [1e-3, 1e-3, 1e-3], [1e-3, 1e-5, 1e-3]
    nominals = inspect("nominals", "pacejka", "x_m", 1e-5)
    assert nominals == [[False, default], [True, fine], [False, fine]]


@EVERY_MODEL
def test_declared_dependencies_are_true(fmu, inspect, name):
    """A small change of a state or input affects only declared dependents; all dependents of rates and indicators
    respond. tests/model_exchange/test_parameter_derivatives.py changes parameters."""
    root = description_of(fmu(name))
    parameters = {int(e.get("valueReference")) for e in root.findall("ModelVariables/*[@causality='parameter']")}
    declared_structure = {
        kind: [(reference, {*knowns} - parameters, kinds) for reference, knowns, kinds in structure(root, kind)]
        for kind in ("Output", "ContinuousStateDerivative", "EventIndicator")
    }
    responses = inspect("factors", name, PARAMETERS.get(name, {}))
    responses = {int(unknown): {int(known): f for known, f in row.items()} for unknown, row in responses.items()}
    for reference, knowns, _ in [row for rows in declared_structure.values() for row in rows]:
        assert set(responses.get(reference, {})) <= set(knowns)
    for reference, knowns, _ in declared_structure["ContinuousStateDerivative"] + declared_structure["EventIndicator"]:
        assert set(responses.get(reference, {})) == set(knowns)
    (push,) = [int(e.get("valueReference")) for e in root.findall("ModelVariables/*[@causality='input']")]
    for reference, knowns, _ in declared_structure["Output"]:
        continuous = root.find(f"ModelVariables/*[@valueReference='{reference}']").get("variability") == "continuous"
        assert (push in responses.get(reference, {})) == (push in knowns and continuous)


@EVERY_MODEL
def test_constant_factors_are_declared_and_are_constant(fmu, inspect, name):
    rates = structure(description_of(fmu(name)), "ContinuousStateDerivative")
    smd = ["constant", "dependent dependent dependent tunable tunable tunable"]  # parameters come first
    expected = {"smd": smd, "pacejka": ["constant", None, None]}
    assert [kinds for _, _, kinds in rates] == expected.get(name, [None] * len(rates))
    responses = inspect("factors", name, {}) if name in expected else {}
    for reference, knowns, kinds in rates:
        for known, kind in zip(knowns, (kinds or "").split(), strict=bool(kinds)):
            if kind == "dependent":
                continue
            factors = responses[str(reference)][str(known)]
            assert factors == pytest.approx([1.0 if kind == "constant" else factors[0]] * len(factors), rel=1e-9)


@EVERY_MODEL
def test_an_instance_starts_with_the_values_of_the_xml_and_accepts_others(fmu, inspect, name):
    values = inspect("variables", name)
    elements = description_of(fmu(name)).find("ModelVariables")
    starts = {e.get("name"): e.get("start") for e in elements if e.get("start") is not None}
    assert set(values["starts"]) == {e.get("name") for e in elements}
    assert starts == {variable: values["starts"][variable] for variable in starts}
    settable = {
        variable
        for variable, meaning in declared_variables(scalar_class(name))
        if meaning.causality in ("parameter", "input")
    }
    assert set(values["after"]) == settable == set(starts)
    for e in elements:
        if e.tag == "Float64" and e.get("start") is not None:
            assert float(values["after"][e.get("name")]) == 0.5 * float(e.get("start")) + 0.0625


@EVERY_MODEL
def test_the_files_are_those_of_fmi3(fmu, name):
    content = read_archive(fmu(name))
    assert content["documentation/licenses/license.txt"].decode() == (ROOT / "LICENSE").read_text(encoding="utf-8")
    certified_files = {"fmi-ls-manifest.xml", f"{name}_out.csv"}
    headers = [file for files in (OWN_HEADERS, FMI_HEADERS["3"], ("fmi3.c", "guid.h", "model.h")) for file in files]
    assert all(
        b"2-Clause BSD License" in content[f"sources/{file}"] for file in FMI_HEADERS["3"]
    )  # the licence is packed
    assert set(content) == {
        "documentation/index.html",
        "documentation/licenses/license.txt",
        "modelDescription.xml",
        "terminalsAndIcons/flange.png",
        "terminalsAndIcons/icon.png",
        "terminalsAndIcons/terminalsAndIcons.xml",
        f"binaries/x86_64-linux/{name}.so",
        "resources/model_data.json",
        *(f"sources/{file}" for file in (*headers, "buildDescription.xml")),
        *(f"extra/org.fmi-standard.fmi-ls-ref/{file}" for file in certified_files),
    }


@EVERY_MODEL
def test_the_terminal_describes_the_body_and_is_valid_and_drawn(fmu, name):
    files = read_archive(fmu(name))
    content = files["terminalsAndIcons/terminalsAndIcons.xml"]
    schema = etree.XMLSchema(etree.parse(str(SCHEMA / "fmi3TerminalsAndIcons.xsd")))
    schema.assertValid(etree.fromstring(content))
    members = [
        tuple(map(m.get, ("variableName", "variableKind")))
        for m in etree.fromstring(content).iter("TerminalMemberVariable")
    ]
    x, v = [variable for variable, meaning in variables(scalar_class(name)()) if meaning.role == "state"][:2]
    assert members == [(x, "signal"), (v, "signal"), ("T_ext" if name == "pendulum" else "F_ext", "inflow")]
    (representation,) = etree.fromstring(content).iter("TerminalGraphicalRepresentation")
    with Image.open(BytesIO(files[f"terminalsAndIcons/{representation.get('iconBaseName')}.png"])) as icon:
        icon.verify()


@EVERY_MODEL
def test_the_page_shows_the_icon_and_describes_model_exchange(fmu, name):
    content, icons = read_archive(fmu(name)), []

    class Reader(HTMLParser):
        def handle_starttag(self, tag, attributes):
            icons.extend(value for key, value in attributes if (tag, key) == ("img", "src"))

    text = content["documentation/index.html"].decode()
    Reader().feed(text)
    assert [source.removeprefix("../") for source in icons] == ["terminalsAndIcons/icon.png"]
    assert "In model exchange" in text


@pytest.mark.parametrize(
    ("arguments", "status", "sentence"),
    [
        (("--platform", "amiga"), 1, None),
        (("--method", "euler"), 2, None),
        (("--law", "sign"), 1, "smd has no friction law 'sign'; it has none to choose."),
    ],
)
def test_an_unavailable_option_is_refused_in_one_sentence_and_nothing_is_built(arguments, status, sentence, tmp_path):
    run = command("--fmi", "3", *arguments, "smd", "--out", tmp_path)
    assert (run.returncode, run.stdout) == (status, "")
    assert sentence is None or run.stderr == f"Error: {sentence}\n"
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "gone"),
    slow_after(1, [("stickslip", {"Exact", "Ode45", "Dop853", "Rodas"}), ("coulomb", {"Exact", "Ode45", "Dop853"})]),
)
def test_a_reduced_fmu_carries_only_its_selection_and_runs_both_ways(name, gone):
    """In model exchange, fmpy records a second row at an event, here a change of mode."""
    path = fmi3_fixtures.build_reduced_fmu(name)
    assert validate_fmu(str(path)) == []
    text = read_archive(path)["sources/model.h"].decode()
    assert not [word for word in gone if f"struct {word}" in text]
    runs = [
        simulate_fmu(str(path), fmi_type=kind, stop_time=0.1, output_interval=0.01, relative_tolerance=1e-9)
        for kind in ("CoSimulation", "ModelExchange")
    ]
    is_event = np.diff(runs[1]["time"]) == 0.0
    assert list(is_event) == list(np.diff(runs[1]["mode"]) != 0)
    runs[1] = runs[1][np.append(~is_event, True)]
    for column, error in ("time", 1e-12), ("x", 1e-6), ("mode", 0):
        assert runs[0][column] == pytest.approx(runs[1][column], abs=error)
