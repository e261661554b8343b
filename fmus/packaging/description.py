"""The model description: `modelDescription.xml` from the declared variables (FMI 2.0.4, sections 2.2 and 4.3)."""

import sys
from datetime import datetime
from math import isfinite
from typing import cast
from uuid import NAMESPACE_OID, uuid5
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from ..runtime.declare import Declared, Declaring, Output
from . import BuildError, __version__
from .units import UNITS, unit_of

CAPABILITIES = {
    "needsExecutionTool": "false",
    "canHandleVariableCommunicationStepSize": "true",
    "canBeInstantiatedOnlyOncePerProcess": "false",
    "canNotUseMemoryManagementFunctions": "true",
    "canGetAndSetFMUstate": "true",
    "canSerializeFMUstate": "true",
}
EXPERIMENT = {"stopTime": "stop_time", "tolerance": "tolerance", "stepSize": "step_size"}
LOG_CATEGORIES = {
    "logStatusWarning": "Messages with status fmi2Warning.",
    "logStatusDiscard": "Messages with status fmi2Discard.",
    "logStatusError": "Messages with status fmi2Error: what was wrong, and what is allowed.",
    "logStatusFatal": "Messages with status fmi2Fatal.",
    "logAll": "All messages.",
}


def describe(model: type[Declaring], name: str, code: str, date: datetime) -> bytes:
    """The model description of the FMU `name` as XML.

    `code` is the digest of the source that travels inside.  The guid follows from it and from all of the
    description but the date: equal guids mean equal content.
    """
    if not model.__doc__:
        raise BuildError(f"{model.__name__} has no docstring; its first line is the description of the FMU.")
    root = Element("fmiModelDescription", fmiVersion="2.0", modelName=name, guid="")
    root.set("description", model.__doc__.strip().splitlines()[0])
    root.attrib |= {"author": "friction-fmus", "version": __version__, "license": "MIT"}
    root.attrib |= {"generationTool": f"friction-fmus {__version__}", "variableNamingConvention": "structured"}
    SubElement(root, "CoSimulation", CAPABILITIES, modelIdentifier=name)
    declared = declared_by(model)
    _define_units(root, declared)
    _define_types(root, declared)
    categories = SubElement(root, "LogCategories")
    for category, text in LOG_CATEGORIES.items():
        SubElement(categories, "Category", name=category, description=text)
    experiment = SubElement(root, "DefaultExperiment", startTime="0.0")
    for key, attribute in EXPERIMENT.items():
        experiment.set(key, repr(float(getattr(model, attribute))))
    scalars = SubElement(root, "ModelVariables")
    for reference, (variable, meaning) in enumerate(declared):
        scalars.append(_scalar(variable, meaning, reference))
    _structure(root, [meaning for _, meaning in declared])
    root.set("guid", f"{{{uuid5(NAMESPACE_OID, code + tostring(root, 'unicode'))}}}")
    root.set("generationDateAndTime", date.strftime("%Y-%m-%dT%H:%M:%SZ"))
    indent(root)
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{tostring(root, "unicode")}\n'.encode()


def declared_by(model: type[Declaring]) -> list[tuple[str, Declared]]:
    """The variables of a model by the runtime that it was written with: ours, or one that travels (lean.py)."""
    runtime = next(base.__module__ for base in model.__mro__ if base.__name__ == Declaring.__name__)
    return sys.modules[runtime].variables(model())


def _define_units(root: Element, declared: list[tuple[str, Declared]]) -> None:
    """UnitDefinitions: every unit that a variable has, in the order of the table."""
    used = {meaning.unit: unit_of(name, meaning.unit) for name, meaning in declared if meaning.type == "Real"}
    definitions = SubElement(root, "UnitDefinitions")
    for symbol in filter(used.get, UNITS):
        unit = used[symbol]
        powers = {base: str(getattr(unit, base)) for base in ("kg", "m", "s", "rad") if getattr(unit, base)}
        element = SubElement(definitions, "Unit", name=symbol)
        SubElement(element, "BaseUnit", powers)
        if unit.display:
            SubElement(element, "DisplayUnit", name=unit.display, factor=repr(unit.factor))


def _define_types(root: Element, declared: list[tuple[str, Declared]]) -> None:
    """TypeDefinitions: a quantity for every unit, and every enumeration with its items."""
    used = {meaning.unit for _, meaning in declared if meaning.type == "Real"}
    types = SubElement(root, "TypeDefinitions")
    for symbol, unit in UNITS.items():
        if symbol in used:
            element = SubElement(types, "SimpleType", name=unit.quantity)
            attributes = {"quantity": unit.quantity, "unit": symbol, "displayUnit": unit.display}
            SubElement(element, "Real", {key: value for key, value in attributes.items() if value})
    for name, meaning in declared:
        if meaning.items:
            element = SubElement(types, "SimpleType", name=_type_name(name), description=meaning.text)
            items = SubElement(element, "Enumeration")
            for label, value, text in meaning.items:
                SubElement(items, "Item", name=label, value=str(value), description=text)


def _type_name(variable: str) -> str:
    """The name of an enumeration: `solver.method` is of the type SolverMethod."""
    return "".join(word.capitalize() for word in variable.replace(".", "_").split("_"))


def _scalar(name: str, meaning: Declared, reference: int) -> Element:
    """One ScalarVariable.  FMI has no open bounds, so a value `above` or `below` a bound gets that bound."""
    scalar = Element("ScalarVariable", name=name, valueReference=str(reference), description=meaning.text)
    scalar.attrib |= {"causality": meaning.causality, "variability": meaning.variability}
    if meaning.initial:
        scalar.set("initial", meaning.initial)
    value = SubElement(scalar, meaning.type)
    if meaning.items:
        value.set("declaredType", _type_name(name))
    if meaning.type == "Real":
        unit = unit_of(name, meaning.unit, meaning.display)
        value.attrib |= {"declaredType": unit.quantity, "unit": meaning.unit}
        if display := meaning.display or unit.display:
            value.set("displayUnit", display)
    number = float if meaning.type == "Real" else int
    for key, bound in ("min", max(meaning.low, meaning.above)), ("max", min(meaning.high, meaning.below)):
        if isfinite(bound):
            value.set(key, repr(number(bound)))
    if meaning.initial != "calculated":
        value.set("start", repr(number(meaning.start)))
    return scalar


def _structure(root: Element, meanings: list[Declared]) -> None:
    """ModelStructure: which outputs follow an input at once; at the start all outputs may depend on everything."""
    places = [(str(place), meaning) for place, meaning in enumerate(meanings, 1)]
    inputs = " ".join(place for place, meaning in places if meaning.causality == "input")
    structure = SubElement(root, "ModelStructure")
    outputs, unknowns = SubElement(structure, "Outputs"), SubElement(structure, "InitialUnknowns")
    for place, meaning in places:
        if meaning.causality == "output":
            SubElement(outputs, "Unknown", index=place, dependencies=inputs if cast(Output, meaning).direct else "")
            SubElement(unknowns, "Unknown", index=place)
