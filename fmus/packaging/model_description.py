"""Writes `modelDescription.xml` from the declared variables (FMI 2.0.4, sections 2.2, 3.3 and 4.3).

Python FMUs support co-simulation; native FMUs also model exchange, with additional variables (fmi_variables.py).
Functions that do not depend on the FMI version are shared with model_description_fmi3.py.
"""

from collections.abc import Sequence
from datetime import datetime
from math import isfinite
from typing import Any
from uuid import NAMESPACE_OID, uuid5
from xml.etree.ElementTree import Element, SubElement, tostring

from ..compiler import __version__
from ..compiler.equations.model_declaration import OPTIONS
from ..compiler.text_output import xml_bytes
from ..compiler.units import BASE_UNITS, UNITS, Unit, unit_of
from ..runtime.variable_access import SETTABLE_CAUSALITIES
from ..runtime.variable_declarations import VariableDeclaration, VariableOwner, exported_name
from .dependencies import output_dependencies
from .fmi_variables import (
    DERIVATIVE_NAME,
    TIME,
    Variables,
    all_variables,
    declared_variables,
    derivative_indices,
    event_indicator_indices,
    has_step_events,
    interpolated_inputs,
)

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
INPUT_INTERPOLATION = {"canInterpolateInputs": "true"}  # linearly
EXCHANGE_CAPABILITIES = {  # for model exchange: the same without communication steps
    **{key: able for key, able in STEPPING_CAPABILITIES.items() if "Communication" not in key},
    **DIRECTIONAL_DERIVATIVES,
}
REAL_ONLY_HINT = (  # in the description of every other FMU
    "For hosts that read or set every variable as a Real, build it with --real-only; for hosts without Python, with "
    "--native."
)
EXPERIMENT_ATTRIBUTES = {"stopTime": "stop_time", "tolerance": "tolerance", "stepSize": "step_size"}
LOG_CATEGORIES = {
    "logStatusWarning": "Messages with status {fmi}Warning.",
    "logStatusDiscard": "Messages with status {fmi}Discard.",
    "logStatusError": "Messages with status {fmi}Error: invalid values and calls, with the allowed range or order.",
    "logStatusFatal": "Messages with status {fmi}Fatal.",
    "logAll": "All messages.",
}


def describe(model: Any, name: str, code: str, date: datetime, nominals: Sequence[float] = ()) -> bytes:
    """Return the FMI 2.0 model description of the FMU `name` as XML.

    Parameters
    ----------
    code
        Digest of the embedded sources.  The GUID is computed from it and from the description without the date, so
        equal GUIDs mean equal content.
    nominals
        Nominal values of the continuous states, if the FMU supports model exchange.
    """
    root = create_root(model, name, "2.0", "guid")
    has_model_exchange = len(nominals) > 0
    declarations = declared_variables(model)
    if has_model_exchange:  # FMI 2.0 needs no time variable, and FMILibrary rejects one
        declarations = [pair for pair in all_variables(model) if pair[0] != TIME]
        root.set("numberOfEventIndicators", str(len(event_indicator_indices(declarations))))
        step_report = {} if has_step_events(model) else {"completedIntegratorStepNotNeeded": "true"}
        SubElement(root, "ModelExchange", EXCHANGE_CAPABILITIES | step_report, modelIdentifier=name)
    inputs = [name for name, meaning in declarations if meaning.causality == "input"]
    capabilities = (
        STEPPING_CAPABILITIES
        | (DIRECTIONAL_DERIVATIVES | OUTPUT_DERIVATIVES if has_model_exchange else {})
        | (INPUT_INTERPOLATION if has_model_exchange and inputs and interpolated_inputs(model) == inputs else {})
    )
    SubElement(root, "CoSimulation", capabilities, modelIdentifier=name)
    add_units(root, declarations)
    _add_types(root, declarations)
    add_log_categories_and_experiment(root, model, "fmi2")
    scalars = SubElement(root, "ModelVariables")
    positions = {variable: str(number) for number, (variable, _) in enumerate(declarations, 1)}
    for reference, (variable, meaning) in enumerate(declarations):
        scalar = SubElement(scalars, "ScalarVariable", common_attributes(variable, meaning, reference))
        of_type = SubElement(scalar, meaning.type, type_attributes(variable, meaning))
        if meaning.rate_of:
            of_type.set("derivative", positions[meaning.rate_of])
    rates = derivative_indices(declarations) if has_model_exchange else {}
    mark_states([scalar[0] for scalar in scalars], model, rates, nominals, first=1)
    _add_structure(root, model, declarations, rates)
    return serialize(root, "guid", code, date)


def create_root(model: Any, name: str, version: str, key: str) -> Element:
    """Create the root element; `serialize` sets the attribute `key` last."""
    root = Element("fmiModelDescription", {"fmiVersion": version, "modelName": name, key: ""})
    sentence = (model.__doc__ or "").strip().splitlines()[0]
    root.set("description", sentence if model.real_only else f"{sentence} {REAL_ONLY_HINT}")
    root.attrib |= {"author": "friction-fmus", "version": __version__, "license": "MIT"}
    root.attrib |= {"generationTool": f"friction-fmus {__version__}", "variableNamingConvention": "structured"}
    return root


def serialize(root: Element, key: str, code: str, date: datetime) -> bytes:
    """Return the XML; the attribute `key` is a UUID of all content except the date."""
    root.set(key, f"{{{uuid5(NAMESPACE_OID, code + tostring(root, 'unicode'))}}}")
    root.set("generationDateAndTime", date.strftime("%Y-%m-%dT%H:%M:%SZ"))
    return xml_bytes(root)


def add_log_categories_and_experiment(root: Element, model: type[VariableOwner], fmi: str) -> None:
    """Add LogCategories and DefaultExperiment; `fmi` is the prefix of the status names."""
    categories = SubElement(root, "LogCategories")
    for category, text in LOG_CATEGORIES.items():
        SubElement(categories, "Category", name=category, description=text.format(fmi=fmi))
    experiment = SubElement(root, "DefaultExperiment", startTime="0.0")
    for key, attribute in EXPERIMENT_ATTRIBUTES.items():
        experiment.set(key, repr(float(getattr(model, attribute))))


def add_units(root: Element, declarations: Variables) -> None:
    """Add UnitDefinitions for all units in use."""
    definitions = SubElement(root, "UnitDefinitions")
    for symbol, unit in used_units(declarations):
        powers = {base: str(getattr(unit, base)) for base in BASE_UNITS if getattr(unit, base)}
        element = SubElement(definitions, "Unit", name=symbol)
        SubElement(element, "BaseUnit", powers)
        if unit.display:
            SubElement(element, "DisplayUnit", name=unit.display, factor=repr(unit.factor))


def _add_types(root: Element, declarations: Variables) -> None:
    """Add TypeDefinitions: a quantity for every unit, and every enumeration with its items."""
    types = SubElement(root, "TypeDefinitions")
    for quantity in quantities(declarations):
        element = SubElement(types, "SimpleType", name=quantity["quantity"])
        SubElement(element, "Real", quantity)
    for name, meaning in declarations:
        if meaning.items:
            element = SubElement(types, "SimpleType", name=type_name(name), description=meaning.text)
            add_enumeration_items(SubElement(element, "Enumeration"), meaning)


def quantities(declarations: Variables) -> list[dict[str, str]]:
    """Return quantity, unit and display unit for every unit in use."""
    quantity_attributes = [
        {"quantity": u.quantity, "unit": symbol, "displayUnit": u.display} for symbol, u in used_units(declarations)
    ]
    return [{key: value for key, value in attributes.items() if value} for attributes in quantity_attributes]


def used_units(declarations: Variables) -> list[tuple[str, Unit]]:
    """Return all units in use: named ones in the order of the table, then the others."""
    units = {meaning.unit: unit_of(name, meaning.unit) for name, meaning in declarations if meaning.type == "Real"}
    return [(symbol, units[symbol]) for symbol in dict.fromkeys((*UNITS, *units)) if symbol in units]


def add_enumeration_items(element: Element, meaning: VariableDeclaration) -> None:
    """Add the items of an enumeration."""
    for label, value, text in meaning.items:
        SubElement(element, "Item", name=label, value=str(value), description=text)


def type_name(variable: str) -> str:
    """Return the type name of an enumeration: SolverMethod for `solver.method`."""
    return "".join(word.capitalize() for word in variable.replace(".", "_").split("_"))


def common_attributes(name: str, meaning: VariableDeclaration, reference: int) -> dict[str, str]:
    """Return the XML attributes common to variables of all types."""
    attributes = {"name": exported_name(name, meaning), "valueReference": str(reference), "description": meaning.text}
    attributes |= {"causality": meaning.causality, "variability": meaning.variability}
    return attributes | ({"initial": meaning.initial} if meaning.initial else {})


def type_attributes(name: str, meaning: VariableDeclaration) -> dict[str, str]:
    """Return the XML attributes that depend on the type.  FMI has no open bounds: `above` becomes min."""
    attributes: dict[str, str] = {}
    if meaning.items:
        attributes["declaredType"] = type_name(name)
    if meaning.type == "Real":
        unit = unit_of(name, meaning.unit, meaning.display)
        attributes |= {"declaredType": unit.quantity, "unit": meaning.unit}
        if unit.display:
            attributes["displayUnit"] = unit.display
        attributes |= {
            option.attribute: str(vars(meaning)[name])
            for name, option in OPTIONS.items()
            if option.attribute and vars(meaning).get(name, "") != ""
        }
    number = float if meaning.type == "Real" else int
    for key, bound in ("min", max(meaning.low, meaning.above)), ("max", min(meaning.high, meaning.below)):
        if isfinite(bound):
            attributes[key] = repr(number(bound))
    if meaning.causality in SETTABLE_CAUSALITIES:
        attributes["start"] = repr(number(meaning.start))
    return attributes


def mark_states(
    elements: list[Element], model: Any, rates: dict[int, int], nominals: Sequence[float], first: int
) -> None:
    """Set `derivative`, `nominal` and `reinit`; variables are numbered from `first`.

    Slip speeds have reinit, because events may set them to zero.
    """
    if not rates:
        return
    for (rate, state), size in zip(rates.items(), nominals, strict=True):
        elements[rate].set("derivative", str(state + first))
        elements[state].set("nominal", repr(size))
    slips = [slip for slip in model.contacts.values() if slip]
    if len(slips) < len(model.contacts):  # the slip of a contact is an expression: any speed may be set
        slips = [name for name in model.states if name in model.states.values()] or list(model.states)
    for slip in slips:
        elements[list(rates.values())[list(model.states).index(slip)]].set("reinit", "true")


DependencyTable = dict[int, list[int]]  # index of a variable -> indices of the variables that it depends on


def dependency_tables(
    model: type[VariableOwner], declarations: Variables, rates: dict[int, int], causalities: tuple[str, ...]
) -> list[DependencyTable]:
    """Return the dependencies of outputs and of derivatives after initialization, and of both at initialization.

    Without the last table importers must assume dependence on everything and find algebraic loops that do not exist.

    Parameters
    ----------
    causalities
        Those of the knowns after initialization, besides the states: inputs (FMI 2.0, section 2.2.8), in FMI 3.0 also
        parameters (section 2.4.8).
    """
    indices = {name: index for index, (name, _) in enumerate(declarations)}
    outputs = [index for index, (_, meaning) in enumerate(declarations) if meaning.causality == "output"]
    driver_rates = {DERIVATIVE_NAME.format(name): [meaning.rate] for name, meaning in declarations if meaning.rate}
    later_knowns = {index for index, (_, meaning) in enumerate(declarations) if meaning.causality in causalities}
    tables = []
    for unknowns, at_start, knowns in (
        (outputs, False, later_knowns.union(rates.values())),
        (rates, False, later_knowns.union(rates.values())),
        (sorted({*outputs, *rates}), True, {*indices.values()}),
    ):
        names = output_dependencies(model, declarations, at_start) | driver_rates
        tables.append(
            {unknown: sorted({indices[n] for n in names[declarations[unknown][0]]} & knowns) for unknown in unknowns}
        )
    return tables


def _add_structure(root: Element, model: type[VariableOwner], declarations: Variables, rates: dict[int, int]) -> None:
    """Add ModelStructure: Outputs, Derivatives and InitialUnknowns with their dependencies."""
    structure = SubElement(root, "ModelStructure")
    outputs, derivatives, at_first = dependency_tables(model, declarations, rates, ("input",))
    kinds = {"Outputs": outputs} | ({"Derivatives": derivatives} if rates else {}) | {"InitialUnknowns": at_first}
    for kind, unknown in kinds.items():
        element = SubElement(structure, kind)
        for index, knowns in unknown.items():
            dependencies = " ".join(str(known + 1) for known in knowns)  # FMI 2.0 counts from 1
            SubElement(element, "Unknown", index=str(index + 1), dependencies=dependencies)
