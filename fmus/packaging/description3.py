"""The model description of FMI 3.0, for co-simulation and model exchange (FMI 3.0.1, sections 2.4, 3.3 and 4.3).

The declared variables keep the value references they have in FMI 2.0.  Behind them stand the time, the event
indicators and the rate of a driver (runtime/variables3.py).
"""

from datetime import datetime
from typing import Any, cast
from xml.etree.ElementTree import Element, SubElement

from ..runtime.declare import Declaring, Output
from ..runtime.variables3 import DERIVATIVE, TO_BREAK_AWAY, TO_REST, further
from . import BuildError
from .dependencies import at_start
from .description import (
    Variables,
    add_items,
    closed,
    declared_by,
    define_units,
    log_and_experiment,
    opened,
    part_of_all,
    part_of_type,
    quantities,
    type_name,
)
from .written import beside as beside_it

TYPES = {"Real": "Float64", "Integer": "Int64", "Enumeration": "Enumeration"}
BOTH = {
    "needsExecutionTool": "false",
    "canBeInstantiatedOnlyOncePerProcess": "false",
    "canGetAndSetFMUState": "true",
    "canSerializeFMUState": "true",
}
EXCHANGE = {"needsCompletedIntegratorStep": "false"}
STEPPING = {
    "canHandleVariableCommunicationStepSize": "true",
    "hasEventMode": "false",
    "mightReturnEarlyFromDoStep": "false",
}


def describe(model: type[Declaring], name: str, code: str, date: datetime) -> bytes:
    """The model description of the FMU `name` as XML; the instantiation token is to it what the guid is in FMI 2.0."""
    root = opened(model, name, "3.0", "instantiationToken")
    for interface, abilities in ("ModelExchange", EXCHANGE), ("CoSimulation", STEPPING):
        SubElement(root, interface, {"modelIdentifier": name} | BOTH | abilities)
    declared = declared_by(model)
    if sum(meaning.role == "contact" for _, meaning in declared) > 1:
        raise BuildError(f"{name} has several contacts, and so far FMI 3.0 is for one: leave out --fmi 3.")
    declared = declared + further(model, declared)
    define_units(root, declared)
    _define_types(root, declared)
    log_and_experiment(root, model, "fmi3")
    rates = _rates(declared)
    elements = SubElement(root, "ModelVariables")
    for reference, (variable, meaning) in enumerate(declared):
        attributes = part_of_all(variable, meaning, reference) | part_of_type(variable, meaning)
        SubElement(elements, TYPES[meaning.type], attributes)
    _tell_states(list(elements), model, rates)
    _structure(root, model, declared, rates)
    return closed(root, "instantiationToken", code, date)


def _define_types(root: Element, declared: Variables) -> None:
    """TypeDefinitions: a quantity for every unit, and every enumeration with its items."""
    types = SubElement(root, "TypeDefinitions")
    for quantity in quantities(declared):
        SubElement(types, "Float64Type", quantity, name=quantity["quantity"])
    for name, meaning in declared:
        if meaning.items:
            add_items(SubElement(types, "EnumerationType", name=type_name(name), description=meaning.text), meaning)


def _rates(declared: Variables) -> dict[int, int]:
    """The references of the derivatives, each with that of its state: states as declared, then drivers."""
    names = {name: reference for reference, (name, _) in enumerate(declared)}
    rates = {names[meaning.rate_of]: names[name] for name, meaning in declared if meaning.rate_of}
    of_state = {state: rate for state, rate in rates.items() if declared[state][1].role == "state"}
    drivers = {names[name]: names[DERIVATIVE.format(name)] for name, meaning in declared if meaning.rate}
    return {rate: state for state, rate in (of_state | drivers).items()}


def _of(declared: Variables, causality: str) -> list[int]:
    return [reference for reference, (_, meaning) in enumerate(declared) if meaning.causality == causality]


def _tell_states(elements: list[Element], model: type[Declaring], rates: dict[int, int]) -> None:
    """Derivatives name their states; a state has a nominal value, and the speed may be put to zero at an event."""
    thing: Any = model()
    for (rate, state), size in zip(rates.items(), beside_it(model, "runtime.exchange").nominals(thing), strict=True):
        elements[rate].set("derivative", str(state))
        elements[state].set("nominal", repr(size))
    if thing.dry:
        _, speed, *_ = rates.values()
        elements[speed].set("reinit", "true")


def _structure(root: Element, model: Any, declared: Variables, rates: dict[int, int]) -> None:
    """ModelStructure: what follows from which states and inputs, and at the start from which parameters.

    A state follows from itself.  Of a smooth model some factors are known: one, and those that parameters make.
    """
    structure = SubElement(root, "ModelStructure")
    states, inputs, outputs = list(rates.values()), _of(declared, "input"), _of(declared, "output")
    _, speed, *_ = states
    for reference in outputs:
        direct = cast(Output, declared[reference][1]).direct
        _unknown(structure, "Output", reference, [reference] if reference in states else states + inputs * direct)
    to_speed, to_acceleration, *to_driver = rates
    _unknown(structure, "ContinuousStateDerivative", to_speed, [speed], "" if model.dry else "constant")
    factors = "tunable" if model.linear and not model.dry else ""
    _unknown(structure, "ContinuousStateDerivative", to_acceleration, states + inputs, factors)
    for reference in to_driver:
        _unknown(structure, "ContinuousStateDerivative", reference, [])
    references = {name: reference for reference, (name, _) in enumerate(declared)}
    drivers = {DERIVATIVE.format(name): [meaning.rate] for name, meaning in declared if meaning.rate}
    followed = at_start(model, declared) | drivers
    for reference in sorted({*outputs, *rates}):
        name, _ = declared[reference]
        _unknown(structure, "InitialUnknown", reference, [references[known] for known in followed[name]])
    at_rest = [state for state in states if state != speed]
    for reference, (name, _) in enumerate(declared):
        if name in (TO_REST, TO_BREAK_AWAY):
            _unknown(structure, "EventIndicator", reference, [speed] if name == TO_REST else at_rest + inputs)


def _unknown(structure: Element, kind: str, reference: int, known: list[int], factors: str = "") -> None:
    """What a variable follows from, and of what kind the factors are, if that is told."""
    words = {"valueReference": str(reference), "dependencies": " ".join(map(str, known))}
    SubElement(structure, kind, words | ({"dependenciesKind": " ".join([factors] * len(known))} if factors else {}))
