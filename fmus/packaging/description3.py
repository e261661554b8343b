"""The model description of FMI 3.0, for co-simulation and model exchange (FMI 3.0.1, sections 2.4, 3.3 and 4.3).

The declared variables keep the value references they have in FMI 2.0.  Behind them stand those of further.py.
"""

from datetime import datetime
from typing import Any
from xml.etree.ElementTree import Element, SubElement

from ..runtime.variable_declarations import VariableOwner
from . import description
from .further import TO_REST, Variables, all_variables, exchanged, indicators_of, rates_of

TYPES = {"Real": "Float64", "Integer": "Int64", "Enumeration": "Enumeration"}
BOTH = {
    "needsExecutionTool": "false",
    "canBeInstantiatedOnlyOncePerProcess": "false",
    "canGetAndSetFMUState": "true",
    "canSerializeFMUState": "true",
    "providesDirectionalDerivatives": "true",
    "providesAdjointDerivatives": "true",
}
EXCHANGE = {"needsCompletedIntegratorStep": "false"}
STEPPING = {
    "canHandleVariableCommunicationStepSize": "true",
    "hasEventMode": "true",
    "canReturnEarlyAfterIntermediateUpdate": "true",
    "mightReturnEarlyFromDoStep": "true",
    "providesIntermediateUpdate": "true",
    **description.RATES,
}


def describe(model: type[VariableOwner], name: str, code: str, date: datetime) -> bytes:
    """The model description of the FMU `name` as XML; the instantiation token is to it what the guid is in FMI 2.0."""
    root = description.opened(model, name, "3.0", "instantiationToken")
    for interface, abilities in ("ModelExchange", EXCHANGE), ("CoSimulation", STEPPING):
        SubElement(root, interface, {"modelIdentifier": name} | BOTH | abilities)
    thing = exchanged(model)
    declared = all_variables(thing)
    description.define_units(root, declared)
    _define_types(root, declared)
    description.log_and_experiment(root, model, "fmi3")
    rates = rates_of(declared)
    elements = SubElement(root, "ModelVariables")
    for reference, (variable, meaning) in enumerate(declared):
        attributes = description.part_of_all(variable, meaning, reference) | description.part_of_type(variable, meaning)
        if meaning.causality in ("input", "output") and meaning.variability == "continuous":
            attributes["intermediateUpdate"] = "true"
        element = SubElement(elements, TYPES[meaning.type], attributes)
        if meaning.alias:
            SubElement(element, "Alias", name=meaning.alias, description=meaning.text)
    description.tell_states(list(elements), thing, rates, first=0)
    _structure(root, model, thing, declared, rates)
    return description.closed(root, "instantiationToken", code, date)


def _define_types(root: Element, declared: Variables) -> None:
    """TypeDefinitions: a quantity for every unit, and every enumeration with its items."""
    types = SubElement(root, "TypeDefinitions")
    for quantity in description.quantities(declared):
        SubElement(types, "Float64Type", quantity, name=quantity["quantity"])
    for name, meaning in declared:
        if meaning.items:
            words = {"name": description.type_name(name), "description": meaning.text}
            description.add_items(SubElement(types, "EnumerationType", words), meaning)


def _structure(
    root: Element, model: type[VariableOwner], thing: Any, declared: Variables, rates: dict[int, int]
) -> None:
    """ModelStructure: what follows from which states and inputs, and at the start from which parameters.

    Of a smooth model some factors are known: one, and those that parameters make.
    """
    structure, states = SubElement(root, "ModelStructure"), list(rates.values())
    outputs, derivatives, at_first = description.followed(model, declared, rates)
    for place, known in outputs.items():
        _unknown(structure, "Output", place, known)
    for place, known in derivatives.items():
        steady = (
            "" if thing.has_dry_friction else "constant" if place in states else "tunable" if thing.is_linear else ""
        )
        _unknown(structure, "ContinuousStateDerivative", place, known, steady)
    for place, known in at_first.items():
        _unknown(structure, "InitialUnknown", place, known)
    places = {name: place for place, (name, _) in enumerate(declared)}
    inputs = [place for place, (_, meaning) in enumerate(declared) if meaning.causality == "input"]
    slips = [[places[slip]] if slip else states for slip in thing.contacts.values()]
    at_rest = [state for state in states if not thing.rests_when_stuck or [state] not in slips]
    for place, slip in zip(indicators_of(declared), slips * 2, strict=True):
        rests = declared[place][0].startswith(TO_REST)
        _unknown(structure, "EventIndicator", place, slip if rests else at_rest + inputs)


def _unknown(structure: Element, kind: str, reference: int, known: list[int], factors: str = "") -> None:
    """What a variable follows from, and of what kind the factors are, if that is told."""
    words = {"valueReference": str(reference), "dependencies": " ".join(map(str, known))}
    SubElement(structure, kind, words | ({"dependenciesKind": " ".join([factors] * len(known))} if factors else {}))
