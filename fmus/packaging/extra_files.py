"""Writes the files of an FMU beside description and code: page, icon, certified result, harness data, terminals.

resources/model_data.json has what the harness reads of an FMU beyond its model description.  terminalsAndIcons.xml (FMI
3.0.2, section 2.4.9) has the flange at which another body can be connected.
"""

import json
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element, SubElement

from ..compiler.equations.model_analysis import ModelAnalysis
from ..compiler.text_output import xml_bytes
from ..runtime.variable_declarations import VariableOwner, exported_name
from .certified_result import find_certified_result, result_files
from .documentation_page import documentation_page
from .fmi_variables import Variables, fixed_choices, mode_names
from .model_description import type_attributes

MODEL_DATA_FILE = "resources/model_data.json"  # harness/simulation/model_data.py reads it
TERMINALS_FOLDER, TERMINALS_FILE = "terminalsAndIcons", "terminalsAndIcons.xml"
CORNERS = {"x1": "-100", "y1": "-100", "x2": "100", "y2": "100"}
FLANGE_CORNERS = {"x1": "90", "y1": "-10", "x2": "110", "y2": "10"}  # on the right
FLANGE_ICON = Path(__file__).with_name("flange.png")
FLANGES = {  # unit of the input -> units of position and speed, and member names
    "N": (("m", "m/s"), ("position", "speed", "force")),
    "N.m": (("rad", "rad/s"), ("angle", "angular_speed", "torque")),
}


def extra_files(
    model: type[VariableOwner],
    path: Path,
    declarations: Variables,
    analysis: ModelAnalysis,
    icon: str = "model.png",
    use: str = "",
) -> dict[str, bytes]:
    """Return the files that FMUs of all kinds have, by path in the FMU.

    Icon (.png) and certified result (.csv) are optional and stand next to the model file at `path`, under the same
    name.  `icon` is the path of the icon in the FMU; `use` is a paragraph of the page on how to run the FMU.
    """
    name, picture = path.stem, path.with_suffix(".png")
    certified_result = find_certified_result(path, model, declarations)
    icon_path = icon if picture.is_file() else ""
    page = documentation_page(model, name, declarations, certified_result, analysis.tables, icon_path, use)
    entries = {"documentation/index.html": page, MODEL_DATA_FILE: model_data(model, declarations, analysis)}
    if certified_result is not None:
        entries |= result_files(name, certified_result, declarations)
    if picture.is_file():
        entries[icon] = picture.read_bytes()
    return entries


def model_data(model: type[VariableOwner], declarations: Variables, analysis: ModelAnalysis) -> bytes:
    """Return the content of resources/model_data.json.

    tables
        Points of the lookup tables.
    contacts
        Name of the mode of each contact, by that of its friction force.
    rate_inputs
        Names of the inputs on which the rate of an input depends, by its name.
    fixed_choices
        Label and number of the method, law or other enumeration that the build fixed, and that is no variable.
    exclusive_bounds
        Names of the attributes `min` and `max` that are exclusive, by variable: FMI has no open bounds.
    """
    bounds = {
        exported_name(name, meaning): [
            attribute
            for attribute, is_open in (("min", meaning.above >= meaning.low), ("max", meaning.below <= meaning.high))
            if is_open and attribute in type_attributes(name, meaning)
        ]
        for name, meaning in declarations
    }
    content: dict[str, Any] = {
        "tables": [table.as_json() for table in analysis.tables],
        "contacts": mode_names(model, declarations),
        "rate_inputs": analysis.rate_inputs,
        "fixed_choices": {
            name: {"label": label, "value": value}
            for name, meaning in fixed_choices(model)
            for label, value, _ in meaning.items
        },
        "exclusive_bounds": {name: attributes for name, attributes in bounds.items() if attributes},
    }
    return (json.dumps(content, indent=1) + "\n").encode()


def terminals(declarations: Variables, is_planar: bool = False) -> dict[str, bytes]:
    """Return the XML file and its icon by path; empty unless the model has one body and one force or torque input.

    A body in a plane has two of each, in this order; the names of their members end in _x and _y.
    """
    names = {meaning.name: name for name, meaning in declarations}
    inputs = [(name, meaning) for name, meaning in declarations if meaning.causality == "input"]
    speeds = [(name, meaning) for name, meaning in declarations if meaning.role == "state" and meaning.rate_of]
    axes = ("_x", "_y") if is_planar else ("",)
    if len(inputs) != len(axes) or len(speeds) != len(axes):
        return {}
    members: list[tuple[str, str, str]] = []  # name, variable, kind
    for axis, (force, load), (speed, meaning) in zip(axes, inputs, speeds, strict=True):
        units, labels = FLANGES.get(load.unit, ((), ()))
        position = names[meaning.rate_of]
        if (dict(declarations)[position].unit, meaning.unit) != units:
            return {}
        variables = (position, "signal"), (speed, "signal"), (force, "inflow")
        members += [(label + axis, *variable) for label, variable in zip(labels, variables, strict=True)]
    root = Element("fmiTerminalsAndIcons", fmiVersion="3.0")
    graphics = SubElement(root, "GraphicalRepresentation")
    SubElement(graphics, "CoordinateSystem", CORNERS, suggestedScalingFactorTo_mm="0.1")
    SubElement(graphics, "Icon", CORNERS)
    attributes = {
        "name": "flange",
        "matchingRule": "plug",
        "description": "the body: its position and speed, and the load on it",
    }
    terminal = SubElement(SubElement(root, "Terminals"), "Terminal", attributes)
    for member, variable, kind in members:
        SubElement(terminal, "TerminalMemberVariable", variableName=variable, memberName=member, variableKind=kind)
    SubElement(terminal, "TerminalGraphicalRepresentation", FLANGE_CORNERS, iconBaseName=FLANGE_ICON.stem)
    return {
        f"{TERMINALS_FOLDER}/{TERMINALS_FILE}": xml_bytes(root),
        f"{TERMINALS_FOLDER}/{FLANGE_ICON.name}": FLANGE_ICON.read_bytes(),
    }
