"""Writes the model description of FMI 3.0 for co-simulation and model exchange (FMI 3.0.1, sections 2.4, 3.3, 4.3).

Declared variables keep their value references of FMI 2.0; the variables of fmi_variables.py follow.
"""

from collections.abc import Sequence
from datetime import datetime
from typing import Any
from xml.etree.ElementTree import Element, SubElement

from ..runtime.variable_access import SETTABLE_CAUSALITIES
from ..runtime.variable_declarations import VariableOwner
from . import model_description as shared
from .fmi_variables import (
    TO_BREAK_AWAY,
    TO_REST,
    Variables,
    all_variables,
    derivative_indices,
    event_indicator_indices,
    has_step_events,
)

TYPE_ELEMENTS = {"Real": "Float64", "Integer": "Int64", "Enumeration": "Enumeration"}
COMMON_CAPABILITIES = {
    "needsExecutionTool": "false",
    "canBeInstantiatedOnlyOncePerProcess": "false",
    "canGetAndSetFMUState": "true",
    "canSerializeFMUState": "true",
    "providesDirectionalDerivatives": "true",
    "providesAdjointDerivatives": "true",
}
STEPPING_CAPABILITIES = {
    "canHandleVariableCommunicationStepSize": "true",
    "hasEventMode": "true",
    "canReturnEarlyAfterIntermediateUpdate": "true",
    "mightReturnEarlyFromDoStep": "true",
    "providesIntermediateUpdate": "true",
    **shared.OUTPUT_DERIVATIVES,
}


def describe(
    model: type[VariableOwner],
    name: str,
    code: str,
    date: datetime,
    nominals: Sequence[float],
) -> bytes:
    """Return the FMI 3.0 model description of the FMU `name` as XML; the token is computed like the GUID of FMI 2.0.

    `nominals` are the nominal values of the continuous states.
    """
    root = shared.create_root(model, name, "3.0", "instantiationToken")
    declarations = all_variables(model)
    step_report = {"needsCompletedIntegratorStep": "true" if has_step_events(model) else "false"}
    for interface, abilities in ("ModelExchange", step_report), ("CoSimulation", STEPPING_CAPABILITIES):
        SubElement(root, interface, {"modelIdentifier": name} | COMMON_CAPABILITIES | abilities)
    shared.add_units(root, declarations)
    _add_types(root, declarations)
    shared.add_log_categories_and_experiment(root, model, "fmi3")
    rates = derivative_indices(declarations)
    parent, elements = SubElement(root, "ModelVariables"), list[Element]()
    for reference, (variable, meaning) in enumerate(declarations):
        attributes = shared.common_attributes(variable, meaning, reference) | shared.type_attributes(variable, meaning)
        if meaning.causality in ("input", "output") and meaning.variability == "continuous":
            attributes["intermediateUpdate"] = "true"
        elements.append(SubElement(parent, TYPE_ELEMENTS[meaning.type], attributes))
    shared.mark_states(elements, model, rates, nominals, first=0)
    _add_structure(root, model, declarations, rates)
    return shared.serialize(root, "instantiationToken", code, date)


def _add_types(root: Element, declarations: Variables) -> None:
    """Add TypeDefinitions: a quantity for every unit, and every enumeration with its items."""
    types = SubElement(root, "TypeDefinitions")
    for quantity in shared.quantities(declarations):
        SubElement(types, "Float64Type", quantity, name=quantity["quantity"])
    for name, meaning in declarations:
        if meaning.items:
            # without its optional description, which fmpy before 0.3.26 cannot read; the variable has the same one
            element = SubElement(types, "EnumerationType", name=shared.type_name(name))
            shared.add_enumeration_items(element, meaning)


def _add_structure(root: Element, model: Any, declarations: Variables, rates: dict[int, int]) -> None:
    """Add ModelStructure with all dependencies; for smooth models also dependenciesKind constant or tunable."""
    structure, states = SubElement(root, "ModelStructure"), list(rates.values())
    outputs, derivatives, at_first = shared.dependency_tables(model, declarations, rates, SETTABLE_CAUSALITIES)
    for index, knowns in outputs.items():
        _add_unknown(structure, "Output", index, knowns)
    for index, knowns in derivatives.items():
        kind_of_factors = (
            "" if model.has_dry_friction else "constant" if index in states else "tunable" if model.is_linear else ""
        )
        kinds = [
            "dependent" if declarations[known][1].causality == "parameter" else kind_of_factors for known in knowns
        ]
        _add_unknown(structure, "ContinuousStateDerivative", index, knowns, kinds if kind_of_factors else [])
    for index, knowns in at_first.items():
        _add_unknown(structure, "InitialUnknown", index, knowns)
    indices = {name: index for index, (name, _) in enumerate(declarations)}
    inputs = [index for index, (_, meaning) in enumerate(declarations) if meaning.causality == "input"]
    slips = [[indices[slip]] if slip else states for slip in model.contacts.values()]
    at_rest = [state for state in states if not model.rests_when_stuck or [state] not in slips]
    # indicators of coming to rest are first
    slip_of = dict(zip(event_indicator_indices(declarations), slips, strict=False))
    for index in event_indicator_indices(declarations):
        name, _ = declarations[index]
        knowns = slip_of[index] if name.startswith(TO_REST) else at_rest if name.startswith(TO_BREAK_AWAY) else states
        _add_unknown(structure, "EventIndicator", index, knowns if name.startswith(TO_REST) else knowns + inputs)


def _add_unknown(structure: Element, kind: str, reference: int, knowns: list[int], factors: Sequence[str] = ()) -> None:
    """Add an unknown with its dependencies and, if given, their kinds."""
    attributes = {"valueReference": str(reference), "dependencies": " ".join(map(str, knowns))}
    SubElement(structure, kind, attributes | ({"dependenciesKind": " ".join(factors)} if factors else {}))
