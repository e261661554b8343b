"""The model description: `modelDescription.xml` from the declared variables (FMI 2.0.4, sections 2.2, 3.3 and 4.3).

A Python FMU is for co-simulation; a native one for model exchange as well, with further variables (further.py).  What
does not depend on the version of FMI is shared with description3.py.
"""

from datetime import datetime
from math import isfinite
from typing import Any, cast
from uuid import NAMESPACE_OID, uuid5
from xml.etree.ElementTree import Element, SubElement, tostring

from ..runtime.variable_access import SETTABLE_CAUSALITIES
from ..runtime.variable_declarations import Output, VariableDeclaration, VariableOwner, variables
from . import __version__
from .fmi_variables import (
    DERIVATIVE_NAME,
    TIME,
    Variables,
    all_variables,
    derivative_indices,
    event_indicator_indices,
    model_exchange_instance,
)
from .initial_dependencies import initial_dependencies
from .units import UNITS, Unit, unit_of
from .xml_output import xml_bytes

STEPPING_CAPABILITIES = {
    "needsExecutionTool": "false",
    "canHandleVariableCommunicationStepSize": "true",
    "canBeInstantiatedOnlyOncePerProcess": "false",
    "canNotUseMemoryManagementFunctions": "true",
    "canGetAndSetFMUstate": "true",
    "canSerializeFMUstate": "true",
}
DIRECTIONAL_DERIVATIVES = {"providesDirectionalDerivative": "true"}
OUTPUT_DERIVATIVES = {"maxOutputDerivativeOrder": "1"}
INPUT_INTERPOLATION = {"canInterpolateInputs": "true"}  # as polynomials
EXCHANGE_CAPABILITIES = {  # what is said of model exchange: the same, but for the steps
    **{key: able for key, able in STEPPING_CAPABILITIES.items() if "Communication" not in key},
    "completedIntegratorStepNotNeeded": "true",
    **DIRECTIONAL_DERIVATIVES,
}
EXPERIMENT_ATTRIBUTES = {"stopTime": "stop_time", "tolerance": "tolerance", "stepSize": "step_size"}
LOG_CATEGORIES = {
    "logStatusWarning": "Messages with status {fmi}Warning.",
    "logStatusDiscard": "Messages with status {fmi}Discard.",
    "logStatusError": "Messages with status {fmi}Error: what was wrong, and what is allowed.",
    "logStatusFatal": "Messages with status {fmi}Fatal.",
    "logAll": "All messages.",
}


def describe(model: type[VariableOwner], name: str, code: str, date: datetime, exchanging: bool = False) -> bytes:
    """The model description of the FMU `name`, also for model exchange if wanted, as XML.

    `code` is the digest of the source that travels inside.  The guid follows from it and from all of the
    description but the date: equal guids mean equal content.
    """
    root = create_root(model, name, "2.0", "guid")
    thing: Any = model_exchange_instance(model) if exchanging else model()
    declared = variables(thing)
    if exchanging:  # FMI 2.0 needs no variable for the time, and FMILibrary takes one for a mistake
        declared = [one for one in all_variables(thing) if one[0] != TIME]
        root.set("numberOfEventIndicators", str(len(event_indicator_indices(declared))))
        SubElement(root, "ModelExchange", EXCHANGE_CAPABILITIES, modelIdentifier=name)
    stepping = (
        STEPPING_CAPABILITIES
        | (DIRECTIONAL_DERIVATIVES | OUTPUT_DERIVATIVES if exchanging else {})
        | (INPUT_INTERPOLATION if thing.has_input_derivatives else {})
    )
    SubElement(root, "CoSimulation", stepping, modelIdentifier=name)
    add_units(root, declared)
    _add_types(root, declared)
    add_log_categories_and_experiment(root, model, "fmi2")
    scalars = SubElement(root, "ModelVariables")
    places = {variable: str(place) for place, (variable, _) in enumerate(declared, 1)}
    for reference, (variable, meaning) in enumerate(declared):
        scalar = SubElement(scalars, "ScalarVariable", common_attributes(variable, meaning, reference))
        of_type = SubElement(scalar, meaning.type, type_attributes(variable, meaning))
        if meaning.rate_of:
            of_type.set("derivative", places[meaning.rate_of])
    rates = derivative_indices(declared) if exchanging else {}
    mark_states([scalar[0] for scalar in scalars], thing, rates, first=1)
    _add_structure(root, model, declared, rates)
    return serialize(root, "guid", code, date)


def create_root(model: type[VariableOwner], name: str, version: str, key: str) -> Element:
    """The root; the attribute `key` is the last to be known."""
    root = Element("fmiModelDescription", {"fmiVersion": version, "modelName": name, key: ""})
    root.set("description", (model.__doc__ or "").strip().splitlines()[0])
    root.attrib |= {"author": "friction-fmus", "version": __version__, "license": "MIT"}
    root.attrib |= {"generationTool": f"friction-fmus {__version__}", "variableNamingConvention": "structured"}
    return root


def serialize(root: Element, key: str, code: str, date: datetime) -> bytes:
    """The text; all but the date goes into the attribute `key`."""
    root.set(key, f"{{{uuid5(NAMESPACE_OID, code + tostring(root, 'unicode'))}}}")
    root.set("generationDateAndTime", date.strftime("%Y-%m-%dT%H:%M:%SZ"))
    return xml_bytes(root)


def add_log_categories_and_experiment(root: Element, model: type[VariableOwner], fmi: str) -> None:
    """LogCategories, with the prefix of the status names, and DefaultExperiment."""
    categories = SubElement(root, "LogCategories")
    for category, text in LOG_CATEGORIES.items():
        SubElement(categories, "Category", name=category, description=text.format(fmi=fmi))
    experiment = SubElement(root, "DefaultExperiment", startTime="0.0")
    for key, attribute in EXPERIMENT_ATTRIBUTES.items():
        experiment.set(key, repr(float(getattr(model, attribute))))


def declared_variables(model: type[VariableOwner]) -> Variables:
    """Name and declaration of every variable of a model."""
    return variables(model())


def add_units(root: Element, declared: Variables) -> None:
    """UnitDefinitions: every unit that a variable has, in the order of the table."""
    definitions = SubElement(root, "UnitDefinitions")
    for symbol, unit in used_units(declared):
        powers = {base: str(getattr(unit, base)) for base in ("kg", "m", "s", "rad") if getattr(unit, base)}
        element = SubElement(definitions, "Unit", name=symbol)
        SubElement(element, "BaseUnit", powers)
        if unit.display:
            SubElement(element, "DisplayUnit", name=unit.display, factor=repr(unit.factor))


def _add_types(root: Element, declared: Variables) -> None:
    """TypeDefinitions: a quantity for every unit, and every enumeration with its items."""
    types = SubElement(root, "TypeDefinitions")
    for quantity in quantities(declared):
        element = SubElement(types, "SimpleType", name=quantity["quantity"])
        SubElement(element, "Real", quantity)
    for name, meaning in declared:
        if meaning.items:
            element = SubElement(types, "SimpleType", name=type_name(name), description=meaning.text)
            add_enumeration_items(SubElement(element, "Enumeration"), meaning)


def quantities(declared: Variables) -> list[dict[str, str]]:
    """What is measured and in which unit, for every unit that a variable has."""
    found = [{"quantity": u.quantity, "unit": symbol, "displayUnit": u.display} for symbol, u in used_units(declared)]
    return [{key: value for key, value in one.items() if value} for one in found]


def used_units(declared: Variables) -> list[tuple[str, Unit]]:
    """Every unit that a variable has: those with a name in the order of the table, then the others."""
    used = {meaning.unit: unit_of(name, meaning.unit) for name, meaning in declared if meaning.type == "Real"}
    return [(symbol, used[symbol]) for symbol in dict.fromkeys((*UNITS, *used)) if symbol in used]


def add_enumeration_items(element: Element, meaning: VariableDeclaration) -> None:
    """The items of an enumeration."""
    for label, value, text in meaning.items:
        SubElement(element, "Item", name=label, value=str(value), description=text)


def type_name(variable: str) -> str:
    """The name of an enumeration: `solver.method` is of the type SolverMethod."""
    return "".join(word.capitalize() for word in variable.replace(".", "_").split("_"))


def common_attributes(name: str, meaning: VariableDeclaration, reference: int) -> dict[str, str]:
    """The attributes that a variable of any type has."""
    attributes = {"name": name, "valueReference": str(reference), "description": meaning.text}
    attributes |= {"causality": meaning.causality, "variability": meaning.variability}
    return attributes | ({"initial": meaning.initial} if meaning.initial else {})


def type_attributes(name: str, meaning: VariableDeclaration) -> dict[str, str]:
    """The others.  FMI has no open bounds, so a value `above` or `below` a bound gets that bound."""
    attributes: dict[str, str] = {}
    if meaning.items:
        attributes["declaredType"] = type_name(name)
    if meaning.type == "Real":
        unit = unit_of(name, meaning.unit, meaning.display)
        attributes |= {"declaredType": unit.quantity, "unit": meaning.unit}
        if display := meaning.display or unit.display:
            attributes["displayUnit"] = display
    number = float if meaning.type == "Real" else int
    for key, bound in ("min", max(meaning.low, meaning.above)), ("max", min(meaning.high, meaning.below)):
        if isfinite(bound):
            attributes[key] = repr(number(bound))
    if meaning.causality in SETTABLE_CAUSALITIES:
        attributes["start"] = repr(number(meaning.start))
    return attributes


def mark_states(elements: list[Element], thing: Any, rates: dict[int, int], first: int) -> None:
    """Derivatives name their states, the first of all variables being that number; a state has a nominal value, and a
    speed may be put to zero at an event."""
    if not rates:
        return
    for (rate, state), size in zip(rates.items(), thing.model_exchange.nominals, strict=True):
        elements[rate].set("derivative", str(state + first))
        elements[state].set("nominal", repr(size))
    slips = [slip for slip in thing.contacts.values() if slip]
    if len(slips) < len(thing.contacts):  # one that is an expression: any speed may be
        slips = [name for name in thing.states if name in thing.states.values()] or list(thing.states)
    for slip in slips:
        elements[list(rates.values())[list(thing.states).index(slip)]].set("reinit", "true")


def continuous_dependencies(declared: Variables, rates: dict[int, int], place: int) -> list[int]:
    """The places of what a variable follows from between events: an output or a derivative.

    A state follows from itself, and a driver's rate from nothing that moves.
    """
    name, meaning = declared[place]
    states = list(rates.values())
    inputs = [other for other, (_, known) in enumerate(declared) if known.causality == "input"]
    if place in states:
        return [place]
    if name.startswith(DERIVATIVE_NAME[:4]):
        return []
    return states + inputs * cast(Output, meaning).direct


DependencyTable = dict[int, list[int]]  # the place of a variable -> those of what it follows from


def dependency_tables(model: type[VariableOwner], declared: Variables, rates: dict[int, int]) -> list[DependencyTable]:
    """What outputs and what derivatives follow from between events, and what both follow from at the start.

    Without the latter an importer must assume that it is everything, and sees loops where there are none.
    """
    places = {name: place for place, (name, _) in enumerate(declared)}
    outputs = [place for place, (_, meaning) in enumerate(declared) if meaning.causality == "output"]
    known = initial_dependencies(model, declared) | {
        DERIVATIVE_NAME.format(name): [one.rate] for name, one in declared if one.rate
    }
    at_first = {place: [places[one] for one in known[declared[place][0]]] for place in sorted({*outputs, *rates})}
    between = [
        {place: continuous_dependencies(declared, rates, place) for place in unknown} for unknown in (outputs, rates)
    ]
    return [*between, at_first]


def _add_structure(root: Element, model: type[VariableOwner], declared: Variables, rates: dict[int, int]) -> None:
    """ModelStructure: what follows an input or a state at once, and from what each follows at the start."""
    structure = SubElement(root, "ModelStructure")
    outputs, derivatives, at_first = dependency_tables(model, declared, rates)
    kinds = {"Outputs": outputs} | ({"Derivatives": derivatives} if rates else {}) | {"InitialUnknowns": at_first}
    for kind, unknown in kinds.items():
        element = SubElement(structure, kind)
        for place, known in unknown.items():
            dependencies = " ".join(str(one + 1) for one in known)  # the first variable is number 1
            SubElement(element, "Unknown", index=str(place + 1), dependencies=dependencies)
