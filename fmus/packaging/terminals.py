"""Writes terminalsAndIcons.xml (FMI 3.0.2, section 2.4.9): the flange at which another body can be connected."""

from pathlib import Path
from xml.etree.ElementTree import Element, SubElement

from ..compiler.text_output import xml_bytes
from .fmi_variables import Variables

FOLDER, FILE = "terminalsAndIcons", "terminalsAndIcons.xml"
CORNERS = {"x1": "-100", "y1": "-100", "x2": "100", "y2": "100"}
EDGE = {"x1": "90", "y1": "-10", "x2": "110", "y2": "10"}  # on the right
ICON = Path(__file__).with_name("flange.png")
FLANGES = {  # unit of the input -> units of position and speed, and member names
    "N": (("m", "m/s"), ("position", "speed", "force")),
    "N.m": (("rad", "rad/s"), ("angle", "angular_speed", "torque")),
}


def terminals(declared: Variables) -> dict[str, bytes]:
    """Return the XML file and its icon by path; empty unless the model has one body and one force or torque input."""
    names = {meaning.name: name for name, meaning in declared}
    inputs = [(name, meaning) for name, meaning in declared if meaning.causality == "input"]
    moving = [(name, meaning) for name, meaning in declared if meaning.role == "state" and meaning.rate_of]
    if len(inputs) != 1 or len(moving) != 1 or inputs[0][1].unit not in FLANGES:
        return {}
    ((force, load),), ((speed, meaning),) = inputs, moving
    position = names[meaning.rate_of]
    units, members = FLANGES[load.unit]
    if (dict(declared)[position].unit, meaning.unit) != units:
        return {}
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
    for member, variable in zip(members, (position, speed, force), strict=True):
        kind = "inflow" if variable == force else "signal"
        SubElement(terminal, "TerminalMemberVariable", variableName=variable, memberName=member, variableKind=kind)
    SubElement(terminal, "TerminalGraphicalRepresentation", EDGE, iconBaseName=ICON.stem)
    return {f"{FOLDER}/{FILE}": xml_bytes(root), f"{FOLDER}/{ICON.name}": ICON.read_bytes()}
