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
from .dependencies import at_start
from .document import document
from .further import DERIVATIVE, TIME, Variables, all_variables, exchanged, indicators_of, rates_of
from .units import UNITS, Unit, unit_of

CAPABILITIES = {
    "needsExecutionTool": "false",
    "canHandleVariableCommunicationStepSize": "true",
    "canBeInstantiatedOnlyOncePerProcess": "false",
    "canNotUseMemoryManagementFunctions": "true",
    "canGetAndSetFMUstate": "true",
    "canSerializeFMUstate": "true",
}
SLOPES = {"providesDirectionalDerivative": "true"}
RATES = {"maxOutputDerivativeOrder": "1"}
RAMPS = {"canInterpolateInputs": "true"}  # as polynomials
EXCHANGE = {  # what is said of model exchange: the same, but for the steps
    **{key: able for key, able in CAPABILITIES.items() if "Communication" not in key},
    "completedIntegratorStepNotNeeded": "true",
    **SLOPES,
}
EXPERIMENT = {"stopTime": "stop_time", "tolerance": "tolerance", "stepSize": "step_size"}
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
    root = opened(model, name, "2.0", "guid")
    thing: Any = exchanged(model) if exchanging else model()
    declared = variables(thing)
    if exchanging:  # FMI 2.0 needs no variable for the time, and FMILibrary takes one for a mistake
        declared = [one for one in all_variables(thing) if one[0] != TIME]
        root.set("numberOfEventIndicators", str(len(indicators_of(declared))))
        SubElement(root, "ModelExchange", EXCHANGE, modelIdentifier=name)
    stepping = CAPABILITIES | (SLOPES | RATES if exchanging else {}) | (RAMPS if thing.has_input_derivatives else {})
    SubElement(root, "CoSimulation", stepping, modelIdentifier=name)
    define_units(root, declared)
    _define_types(root, declared)
    log_and_experiment(root, model, "fmi2")
    scalars = SubElement(root, "ModelVariables")
    places = {variable: str(place) for place, (variable, _) in enumerate(declared, 1)}
    for reference, (variable, meaning) in enumerate(declared):
        scalar = SubElement(scalars, "ScalarVariable", part_of_all(variable, meaning, reference))
        of_type = SubElement(scalar, meaning.type, part_of_type(variable, meaning))
        if meaning.rate_of:
            of_type.set("derivative", places[meaning.rate_of])
    rates = rates_of(declared) if exchanging else {}
    tell_states([scalar[0] for scalar in scalars], thing, rates, first=1)
    _structure(root, model, declared, rates)
    return closed(root, "guid", code, date)


def opened(model: type[VariableOwner], name: str, version: str, key: str) -> Element:
    """The root; the attribute `key` is the last to be known."""
    root = Element("fmiModelDescription", {"fmiVersion": version, "modelName": name, key: ""})
    root.set("description", (model.__doc__ or "").strip().splitlines()[0])
    root.attrib |= {"author": "friction-fmus", "version": __version__, "license": "MIT"}
    root.attrib |= {"generationTool": f"friction-fmus {__version__}", "variableNamingConvention": "structured"}
    return root


def closed(root: Element, key: str, code: str, date: datetime) -> bytes:
    """The text; all but the date goes into the attribute `key`."""
    root.set(key, f"{{{uuid5(NAMESPACE_OID, code + tostring(root, 'unicode'))}}}")
    root.set("generationDateAndTime", date.strftime("%Y-%m-%dT%H:%M:%SZ"))
    return document(root)


def log_and_experiment(root: Element, model: type[VariableOwner], fmi: str) -> None:
    """LogCategories, with the prefix of the status names, and DefaultExperiment."""
    categories = SubElement(root, "LogCategories")
    for category, text in LOG_CATEGORIES.items():
        SubElement(categories, "Category", name=category, description=text.format(fmi=fmi))
    experiment = SubElement(root, "DefaultExperiment", startTime="0.0")
    for key, attribute in EXPERIMENT.items():
        experiment.set(key, repr(float(getattr(model, attribute))))


def declared_by(model: type[VariableOwner]) -> Variables:
    """Name and declaration of every variable of a model."""
    return variables(model())


def define_units(root: Element, declared: Variables) -> None:
    """UnitDefinitions: every unit that a variable has, in the order of the table."""
    definitions = SubElement(root, "UnitDefinitions")
    for symbol, unit in units_of(declared):
        powers = {base: str(getattr(unit, base)) for base in ("kg", "m", "s", "rad") if getattr(unit, base)}
        element = SubElement(definitions, "Unit", name=symbol)
        SubElement(element, "BaseUnit", powers)
        if unit.display:
            SubElement(element, "DisplayUnit", name=unit.display, factor=repr(unit.factor))


def _define_types(root: Element, declared: Variables) -> None:
    """TypeDefinitions: a quantity for every unit, and every enumeration with its items."""
    types = SubElement(root, "TypeDefinitions")
    for quantity in quantities(declared):
        element = SubElement(types, "SimpleType", name=quantity["quantity"])
        SubElement(element, "Real", quantity)
    for name, meaning in declared:
        if meaning.items:
            element = SubElement(types, "SimpleType", name=type_name(name), description=meaning.text)
            add_items(SubElement(element, "Enumeration"), meaning)


def quantities(declared: Variables) -> list[dict[str, str]]:
    """What is measured and in which unit, for every unit that a variable has."""
    found = [{"quantity": u.quantity, "unit": symbol, "displayUnit": u.display} for symbol, u in units_of(declared)]
    return [{key: value for key, value in one.items() if value} for one in found]


def units_of(declared: Variables) -> list[tuple[str, Unit]]:
    """Every unit that a variable has: those with a name in the order of the table, then the others."""
    used = {meaning.unit: unit_of(name, meaning.unit) for name, meaning in declared if meaning.type == "Real"}
    return [(symbol, used[symbol]) for symbol in dict.fromkeys((*UNITS, *used)) if symbol in used]


def add_items(element: Element, meaning: VariableDeclaration) -> None:
    """The items of an enumeration."""
    for label, value, text in meaning.items:
        SubElement(element, "Item", name=label, value=str(value), description=text)


def type_name(variable: str) -> str:
    """The name of an enumeration: `solver.method` is of the type SolverMethod."""
    return "".join(word.capitalize() for word in variable.replace(".", "_").split("_"))


def part_of_all(name: str, meaning: VariableDeclaration, reference: int) -> dict[str, str]:
    """The attributes that a variable of any type has."""
    attributes = {"name": name, "valueReference": str(reference), "description": meaning.text}
    attributes |= {"causality": meaning.causality, "variability": meaning.variability}
    return attributes | ({"initial": meaning.initial} if meaning.initial else {})


def part_of_type(name: str, meaning: VariableDeclaration) -> dict[str, str]:
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


def tell_states(elements: list[Element], thing: Any, rates: dict[int, int], first: int) -> None:
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


def depends(declared: Variables, rates: dict[int, int], place: int) -> list[int]:
    """The places of what a variable follows from between events: an output or a derivative.

    A state follows from itself, and a driver's rate from nothing that moves.
    """
    name, meaning = declared[place]
    states = list(rates.values())
    inputs = [other for other, (_, known) in enumerate(declared) if known.causality == "input"]
    if place in states:
        return [place]
    if name.startswith(DERIVATIVE[:4]):
        return []
    return states + inputs * cast(Output, meaning).direct


Followed = dict[int, list[int]]  # the place of a variable -> those of what it follows from


def followed(model: type[VariableOwner], declared: Variables, rates: dict[int, int]) -> list[Followed]:
    """What outputs and what derivatives follow from between events, and what both follow from at the start.

    Without the latter an importer must assume that it is everything, and sees loops where there are none.
    """
    places = {name: place for place, (name, _) in enumerate(declared)}
    outputs = [place for place, (_, meaning) in enumerate(declared) if meaning.causality == "output"]
    known = at_start(model, declared) | {DERIVATIVE.format(name): [one.rate] for name, one in declared if one.rate}
    at_first = {place: [places[one] for one in known[declared[place][0]]] for place in sorted({*outputs, *rates})}
    between = [{place: depends(declared, rates, place) for place in unknown} for unknown in (outputs, rates)]
    return [*between, at_first]


def _structure(root: Element, model: type[VariableOwner], declared: Variables, rates: dict[int, int]) -> None:
    """ModelStructure: what follows an input or a state at once, and from what each follows at the start."""
    structure = SubElement(root, "ModelStructure")
    outputs, derivatives, at_first = followed(model, declared, rates)
    kinds = {"Outputs": outputs} | ({"Derivatives": derivatives} if rates else {}) | {"InitialUnknowns": at_first}
    for kind, unknown in kinds.items():
        element = SubElement(structure, kind)
        for place, known in unknown.items():
            dependencies = " ".join(str(one + 1) for one in known)  # the first variable is number 1
            SubElement(element, "Unknown", index=str(place + 1), dependencies=dependencies)
