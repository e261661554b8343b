"""Dependencies in the model descriptions: which outputs depend on which parameters and inputs.

The build derives them from the equations; this test measures them on the built FMUs.
"""

import random
from math import isfinite
from xml.etree import ElementTree
from zipfile import ZipFile

import fmi3_fixtures
import fmpy
import pytest
from fmi3_as_fmi2 import Slave
from models import MODELS, ROOT, declarations_of, model_class, outputs, push

from fmus.compiler.lowering import lowered_model
from fmus.packaging.dependencies import output_dependencies
from fmus.packaging.fmi_variables import declared_variables

EVERY_MODEL = pytest.mark.parametrize("name", MODELS)
SITUATIONS = 150
LADDER = (1e-7, 1e-3, 1.0)  # for start values of zero, in their unit or relative to what overcomes friction
LOADS = (-1.1, -1.0, -0.9, 0.9, 1.0, 1.1)  # of a body at rest, relative to the static limit


def structure(fmu):
    """Return the element ModelStructure of an FMU."""
    with ZipFile(fmu) as archive:
        return ElementTree.fromstring(archive.read("modelDescription.xml")).find("ModelStructure")


def dependencies_by_name(unknowns, names):
    """Return for each unknown the names that it depends on; FMI 2.0 counts variables from 1."""
    dependencies = {}
    for unknown in unknowns:
        names_known = {names[int(i) - 1] for i in unknown.get("dependencies").split()}
        dependencies[names[int(unknown.get("index")) - 1]] = names_known
    return dependencies


@pytest.fixture
def at_the_start(fmus):
    """Return the initial dependencies in the description of a model."""
    return lambda name: dependencies_by_name(
        structure(fmus / f"{name}.fmu").findall("InitialUnknowns/Unknown"), list(declarations_of(name))
    )


def draw_value(name, variable, draw):
    """Return a valid value."""
    d = declarations_of(name)[variable]
    if d.items:
        return draw.choice(d.items)[1]
    if d.start == 0.0 and draw.random() < 0.5:
        return 0.0
    size = push(name)[1] if d.causality == "input" else d.start or 1.0
    steps = (0.0, 0.5, 1.0, 2.0) if d.start else LADDER
    return draw.choice([value for step in steps for value in (step * size, -step * size) if d.accepts(value)])


def situation(name, knowns, draw):
    """Return a value for each known; half of the situations are bodies at rest close to breakaway."""
    values = {v: draw_value(name, v, draw) for v in knowns}
    model, (x, v, *_), (entry, _) = model_class(name)(), outputs(name), push(name)
    if model.rests_when_stuck and f"{v}0" in values and draw.random() < 0.5:
        values[f"{v}0"] = 0.0
        for variable in (value for value in values if "." not in value):
            setattr(model, variable, values[variable])
        model.prepare()
        load, _, limit = model.stick_load(0.0, values[f"{x}0"], 0.0)
        values[entry] += draw.choice(LOADS) * limit - load
    return values


@EVERY_MODEL
def test_initial_dependencies_are_exactly_as_declared(worker, fmus, at_the_start, name):
    """Each known is changed alone: only the declared unknowns respond, and each of them does in some situation."""
    draw, declared_dependencies = random.Random(name), at_the_start(name)
    knowns = [v for v, d in declarations_of(name).items() if d.causality in ("parameter", "input")]
    responses = {v: set() for v in declared_dependencies}
    fmu = worker.instantiate(fmus / f"{name}.fmu")
    for _ in range(SITUATIONS):
        values = situation(name, knowns, draw)
        before, *rows = fmu.vary_each(
            values, {v: draw_value(name, v, draw) for v in knowns}, list(declared_dependencies)
        )
        for v, after in zip(knowns, rows, strict=True):
            if all(map(isfinite, before + after)):  # otherwise the values are inconsistent
                for output, old, new in zip(declared_dependencies, before, after, strict=True):
                    responses[output] |= {v} if old != new else set()
    fmu.free()
    assert responses == declared_dependencies


@EVERY_MODEL
def test_fmi3_outputs_depend_on_exactly_the_declared_parameters_after_initialisation(tmp_path, name):
    """As above, at a communication point. Laws are fixed then; FMI 2.0 declares no dependencies on parameters."""
    path, draw = fmi3_fixtures.build_fmi3_fmus() / f"{name}.fmu", random.Random(name)
    description, folder = fmpy.read_model_description(path), str(fmpy.extract(path, tmp_path))
    fmu = Slave(guid=description.guid, modelIdentifier=name, unzipDirectory=folder, instanceName=name)
    fmu.instantiate()
    names, references = list(declarations_of(name)), {v: i for i, v in enumerate(declarations_of(name))}
    knowns = [v for v, d in declarations_of(name).items() if d.causality in ("parameter", "input")]
    tunable_knowns = [v for v in knowns if declarations_of(name)[v].variability != "fixed"]
    declared_dependencies = {
        v: {
            names[reference]
            for reference in (k.valueReference for k in unknown.dependencies)
            if names[reference] in tunable_knowns
        }
        for unknown in description.outputs
        for v in [unknown.variable.name]
    }
    reals = [references[v] for v in declared_dependencies if declarations_of(name)[v].type == "Real"]
    modes = [references[v] for v in declared_dependencies if declarations_of(name)[v].type != "Real"]
    responses = {v: set() for v in declared_dependencies}
    for _ in range(SITUATIONS):
        values = situation(name, knowns, draw)
        fmu.reset()
        for v, value in values.items():
            (fmu.setReal if declarations_of(name)[v].type == "Real" else fmu.setInteger)([references[v]], [value])
        fmu.setupExperiment()
        fmu.enterInitializationMode()
        before = [*fmu.getReal(reals), *fmu.getInteger(modes)]
        if not all(map(isfinite, before)):
            continue  # the values are inconsistent
        fmu.exitInitializationMode()
        state = fmu.getFMUstate()
        for v in tunable_knowns:
            fmu.setFMUstate(state)
            fmu.setReal([references[v]], [draw_value(name, v, draw)])
            after = [*fmu.getReal(reals), *fmu.getInteger(modes)]
            if all(map(isfinite, after)):
                for output, old, new in zip([*reals, *modes], before, after, strict=True):
                    responses[names[output]] |= {v} if old != new else set()
        fmu.freeFMUstate(state)
    fmu.freeInstance()
    for v, respond in responses.items():  # under some laws a mode responds at the next event only
        is_real = declarations_of(name)[v].type == "Real"
        assert respond == declared_dependencies[v] if is_real else respond <= declared_dependencies[v]


@EVERY_MODEL
def test_initial_feedthrough_implies_permanent_feedthrough(fmus, at_the_start, name):
    """Two FMUs coupled by such outputs never form an algebraic loop."""
    entry = push(name)[0]
    always = dependencies_by_name(
        structure(fmus / f"{name}.fmu").findall("Outputs/Unknown"), list(declarations_of(name))
    )
    assert [v for v, knowns in at_the_start(name).items() if entry in knowns] == [v for v in always if always[v]]


@EVERY_MODEL
def test_fmi3_declares_the_same_and_the_driver_depends_on_its_speed(at_the_start, name):
    """The declared variables have the same positions, which FMI 3.0 counts from 0."""
    names, dependencies = list(declarations_of(name)), {}
    for unknown in structure(fmi3_fixtures.build_fmi3_fmus() / f"{name}.fmu").findall("InitialUnknown"):
        dependencies[int(unknown.get("valueReference"))] = {names[int(i)] for i in unknown.get("dependencies").split()}
    expected = {names.index(v): knowns for v, knowns in at_the_start(name).items()}
    additional = {index: knowns for index, knowns in dependencies.items() if index not in expected}
    assert dependencies == expected | additional
    assert list(additional.values()) == [{"v_driver"}] * model_class(name).has_driver


def test_rare_dependencies_are_declared_too(tmp_path):
    """A stop beyond the start; a logarithm behind a condition that is false there."""
    text = (ROOT / "tests" / "example_models" / "bumper.py").read_text(encoding="utf-8")
    output_line = '    depth = Output("1", "how far beyond the gap", choose(x > gap, log(x / gap), 0.0))\n'
    (tmp_path / "bumper.py").write_text(text + output_line, encoding="utf-8")
    model = lowered_model(tmp_path / "bumper.py")
    dependencies = output_dependencies(model, declared_variables(model), at_start=True)
    assert {"gap", "s"} <= set(dependencies["a"])
    assert dependencies["depth"] == ["gap"]
