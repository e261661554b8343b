"""Reader of a system of FMUs in an SSP archive: System Structure and Parameterization 1.0 and 2.0.

Nested systems are flattened: each input of a component has the output that drives it, and a factor and an offset for
units and linear transformations on the way. Parameter bindings are applied from the components to the outermost
system, whose values take priority.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from ...errors import HarnessError
from ...running.array_elements import ArrayElement
from ...running.fmu_archive import read_description
from ...running.variable_values import REAL_TYPES, parse_element, variable_unit

ElementVariable = tuple[str, str, int]  # element of an archive, variable, value reference
Node = tuple[
    str, str
]  # path of an element, as in "plant.motor", and name of a connector; the path of the root is empty

DESCRIPTION = "SystemStructure.ssd"
VERSIONS = ("1.0", "2.0")
BASE_UNITS = ("kg", "m", "s", "A", "K", "mol", "cd", "rad")
MAPPING_TRANSFORMATIONS = ("BooleanMapping", "IntegerMapping", "EnumerationMapping")
FMU_TYPE = "application/x-fmu-sharedlibrary"
# features of a system that other engines do not support
NESTED, TRANSFORMED, UNITS, MAPPED = "nested systems", "linear transformations", "unit conversions", "mapped parameters"
VERSION_2, EXCHANGE = "SSP 2.0", "components for model exchange"
BOUND, OUTER_VALUES = "parameter values outside of resources/parameters.ssv", "values of the system"
ELEMENTS = "values of elements of arrays"
ALL_PARAMETERS = "resources/parameters.ssv"  # all values of an archive of this project, for fmpy


@dataclass(frozen=True)
class Affine:
    """Function factor * value + offset."""

    factor: float = 1.0
    offset: float = 0.0

    def __call__(self, value: float) -> float:
        return self.factor * value + self.offset

    def then(self, other: "Affine") -> "Affine":
        """Return the function that applies this one, then another."""
        return Affine(other.factor * self.factor, other(self.offset))


@dataclass(frozen=True)
class Unit:
    """Unit: its value in base units, and the exponents of these."""

    to_base: Affine
    exponents: tuple[int, ...]


@dataclass(frozen=True)
class Component:
    """FMU of a system: file, variables by name, units of its connectors, and whether it runs by model exchange."""

    file: Path
    variables: dict[str, Any]
    description: Any
    exchange: bool


@dataclass(frozen=True)
class Edge:
    """Connection between two connectors, with its linear transformation."""

    start: Node
    converts_units: bool
    transformation: Affine


@dataclass(frozen=True)
class Link:
    """Input of a component and the output that drives it, both as nodes."""

    start: Node
    end: Node
    convert: Affine


@dataclass
class CoupledSystem:
    """Flattened system.

    Attributes
    ----------
    name : str
    stop : float or None
        Default stop in s.
    components : dict
        Components by path.
    outputs : set of Node
        Output connectors of elements.
    links : list of Link
    values : dict
        Values to set, by node of a component, in the unit of its variable.
    parameter_sets : list of str
        Names of the parameter sets.
    features : set of str
        Features that other engines may not support.
    ignored : list of str
        Parameters that reach no variable of a component, which SSP allows.
    """

    name: str
    stop: float | None
    components: dict[str, Component] = field(default_factory=dict)
    outputs: set[Node] = field(default_factory=set)
    links: list[Link] = field(default_factory=list)
    values: dict[Node, Any] = field(default_factory=dict)
    parameter_sets: list[str] = field(default_factory=list)
    features: set[str] = field(default_factory=set)
    ignored: list[str] = field(default_factory=list)


def read_system(folder: Path) -> CoupledSystem:
    """Read the system of an unpacked archive.

    Raises
    ------
    HarnessError
        If the system uses something that is not supported, or if a file is missing.
    """
    return SystemReader(folder).read()


class SystemReader:
    """Reads the system of an unpacked archive in `folder`."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.root = self.parse(DESCRIPTION)
        version = self.root.get("version", "1.0")
        if version not in VERSIONS:
            raise HarnessError(f"it has SSP version {version}; supported are {' and '.join(VERSIONS)}")
        experiment = self.root.find("{*}DefaultExperiment")
        stop = experiment.get("stopTime") if experiment is not None else None
        self.outer = find_one(self.root, "System")
        self.system = CoupledSystem(self.outer.get("name", ""), float(stop) if stop else None)
        if version == "2.0":
            self.system.features.add(VERSION_2)
        self.units = dict(read_units(self.root))
        self.edges: dict[Node, Edge] = {}  # by the node at their end
        self.connector_units: dict[Node, str] = {}
        self.parameters: dict[Node, tuple[Any, str]] = {}  # value and unit

    def parse(self, name: str) -> ElementTree.Element:
        """Parse an XML file of the archive."""
        file = (self.folder / name).resolve()
        if not file.is_relative_to(self.folder.resolve()) or not file.is_file():
            raise HarnessError(f"it has no file {name}")
        try:
            return ElementTree.parse(file).getroot()
        except ElementTree.ParseError as error:
            raise HarnessError(f"{name} is not valid XML: {error}") from None

    def read(self) -> CoupledSystem:
        """Return the flattened system."""
        self.read_element(self.outer, "")
        system = self.system
        for path, component in system.components.items():
            for name, variable in component.variables.items():
                if (path, name) in self.edges and variable.causality == "input":
                    self.add_link((path, name))
        for node, (value, unit) in self.parameters.items():
            targets = list(self.targets(node))
            if not targets:
                system.ignored.append(join(*node))
            for target, convert in targets:
                variable = system.components[target[0]].variables[target[1]]
                if variable.type in REAL_TYPES:
                    to_node = self.conversion(unit, self.unit_of(node) or self.variable_unit(target), node)
                    value = to_node.then(convert)(float(value))
                if isinstance(variable, ArrayElement):
                    system.features.add(ELEMENTS)
                system.values[target] = value
        return system

    def read_element(self, element: ElementTree.Element, path: str) -> None:
        """Read a system or component; parameters of an element are read after those that it contains."""
        for connector in element.findall("{*}Connectors/{*}Connector"):
            kind = next(
                (child for child in connector if local_name(child) not in ("ConnectorGeometry", "Annotations")), None
            )
            node = path, connector.get("name", "")
            if kind is not None and kind.get("unit"):
                self.connector_units[node] = kind.get("unit", "")
            if connector.get("kind") == "output":
                self.system.outputs.add(node)
        if local_name(element) == "Component":
            self.read_component(element, path)
        elif local_name(element) == "System":
            if path:
                self.system.features.add(NESTED)
            for dictionary in element.findall("{*}SignalDictionaries/{*}SignalDictionary"):
                raise HarnessError(f"it has the signal dictionary {dictionary.get('name')}; they are not supported")
            for child in element.find("{*}Elements") or ():
                self.read_element(child, join(path, child.get("name", "")))
            for connection in element.findall("{*}Connections/{*}Connection"):
                self.read_connection(connection, path)
        else:
            raise HarnessError(f"it has the {local_name(element)} {path}; only systems and components are supported")
        for binding in element.findall("{*}ParameterBindings/{*}ParameterBinding"):
            self.read_binding(binding, path)

    def read_component(self, element: ElementTree.Element, path: str) -> None:
        """Read a component and the description of its FMU."""
        source, kind = element.get("source", ""), element.get("type", FMU_TYPE)
        if kind != FMU_TYPE:
            raise HarnessError(f"the component {path} is of the type {kind}; supported is {FMU_TYPE}")
        file = (self.folder / source).resolve()
        if not source or not file.is_relative_to(self.folder.resolve()) or not file.is_file():
            raise HarnessError(f"the component {path} has no FMU: there is no file {source!r} in the archive")
        description = read_description(file, lenient=True)
        exchange = description.coSimulation is None
        if exchange:
            self.system.features.add(EXCHANGE)
            if description.modelExchange is None:
                raise HarnessError(f"the FMU of {path} offers neither co-simulation nor model exchange")
        variables = {variable.name: variable for variable in description.modelVariables}
        self.system.components[path] = Component(file, variables, description, exchange)
        for unit in description.unitDefinitions:
            if unit.baseUnit and unit.name not in self.units:
                base = unit.baseUnit
                exponents = tuple(int(getattr(base, name) or 0) for name in BASE_UNITS)
                self.units[unit.name] = Unit(Affine(float(base.factor or 1), float(base.offset or 0)), exponents)

    def read_connection(self, element: ElementTree.Element, path: str) -> None:
        """Read a connection of the system at a path."""
        start, end = (
            (join(path, element.get(f"{side}Element", "")), element.get(f"{side}Connector", ""))
            for side in ("start", "end")
        )
        transformation = Affine()
        for child in element:
            if local_name(child).removesuffix("Transformation") in MAPPING_TRANSFORMATIONS:
                raise HarnessError(
                    f"the connection to {'.'.join(end)} has a {local_name(child)}, which is not supported"
                )
            if local_name(child) == "LinearTransformation":
                transformation = Affine(float(child.get("factor", 1)), float(child.get("offset", 0)))
                self.system.features.add(TRANSFORMED)
        if end in self.edges:
            raise HarnessError(f"two connections end at {'.'.join(end)}")
        self.edges[end] = Edge(start, element.get("suppressUnitConversion") not in ("true", "1"), transformation)

    def unit_of(self, node: Node) -> str:
        """Return the unit of a connector: its own, or that of the variable of the FMU; empty without one."""
        if node in self.connector_units:
            return self.connector_units[node]
        return self.variable_unit(node)

    def variable_unit(self, node: Node) -> str:
        """Return the unit of the variable of a component; empty without one."""
        component = self.system.components.get(node[0])
        variable = component.variables.get(node[1]) if component else None
        return "" if variable is None else variable_unit(variable)

    def conversion(self, unit: str, target: str, node: Node) -> Affine:
        """Return the conversion between two units; no conversion if one is missing. Some tools write [m] for m."""
        unit, target = unit.strip("[]"), target.strip("[]")
        if not unit or not target or unit == target:
            return Affine()
        for name in unit, target:
            if name not in self.units:
                raise HarnessError(f"the unit {name} at {'.'.join(node)} is not defined: define it in Units")
        one, two = self.units[unit], self.units[target]
        if one.exponents != two.exponents:
            raise HarnessError(f"{'.'.join(node)}: {unit} cannot be converted to {target}")
        factor = one.to_base.factor / two.to_base.factor
        convert = Affine(factor, (one.to_base.offset - two.to_base.offset) / two.to_base.factor)
        if convert != Affine():
            self.system.features.add(UNITS)
        return convert

    def add_link(self, end: Node) -> None:
        """Trace the connections of an input back to the output of a component; none if they end at an outer input."""
        nodes, edges = [end], list[Edge]()
        while nodes[-1] in self.edges:
            edges.append(self.edges[nodes[-1]])
            nodes.append(edges[-1].start)
            if len(nodes) > len(self.edges) + 1:
                raise HarnessError(f"the connections to {'.'.join(end)} form a circle")
        start = nodes[-1]
        if start[0] not in self.system.components:
            if start[0]:
                raise HarnessError(f"the connection to {'.'.join(end)} starts at {'.'.join(start)}, which is no output")
            return
        for node in start, end:
            variable = self.system.components[node[0]].variables.get(node[1])
            if variable is None:
                raise HarnessError(f"the FMU of {node[0]} has no variable {node[1]}, which is connected")
            if variable.dimensions:
                raise HarnessError(f"{'.'.join(node)} is an array; connections of arrays are not supported")
        self.system.links.append(Link(start, end, self.trace(nodes[::-1], edges[::-1])))

    def trace(self, nodes: list[Node], edges: list[Edge]) -> Affine:
        """Return the function from the first of connected nodes to the last, both in the units of their variables."""
        unit = self.variable_unit(nodes[0]) or self.unit_of(nodes[0])
        convert = self.conversion(unit, self.unit_of(nodes[0]), nodes[0])
        unit = self.unit_of(nodes[0])
        for edge, node in zip(edges, nodes[1:], strict=True):
            target = self.unit_of(node)
            if edge.converts_units:
                convert = convert.then(self.conversion(unit, target, node))
            unit = target or unit
            convert = convert.then(edge.transformation)
        return convert.then(self.conversion(unit, self.variable_unit(nodes[-1]), nodes[-1]))

    def targets(self, node: Node) -> Iterator[tuple[Node, Affine]]:
        """Yield the variables of components that a parameter or input reaches, with the conversion."""
        if node[0] in self.system.components:
            if node[1] in self.system.components[node[0]].variables:
                yield node, self.conversion(self.unit_of(node), self.variable_unit(node), node)
            return
        for end, edge in self.edges.items():
            if edge.start == node:
                convert = (
                    self.conversion(self.unit_of(node), self.unit_of(end), end) if edge.converts_units else Affine()
                )
                for target, rest in self.targets(end):
                    yield target, convert.then(edge.transformation).then(rest)

    def read_binding(self, binding: ElementTree.Element, path: str) -> None:
        """Read a parameter binding of the element at a path."""
        source = binding.get("source")
        if source:
            base = Path(self.component_source(path)).parent if binding.get("sourceBase") == "component" else Path()
            table = self.parse(str(base / source))
        else:
            table = find_one(binding, "ParameterValues/{*}ParameterSet")
        self.system.parameter_sets.append(table.get("name", ""))
        if not (self.folder / ALL_PARAMETERS).is_file():
            self.system.features.add(BOUND)
        if path not in self.system.components:
            self.system.features.add(OUTER_VALUES)
        units = dict(read_units(table))
        self.units |= {name: unit for name, unit in units.items() if name not in self.units}
        values = {}
        for parameter in table.findall("{*}Parameters/{*}Parameter"):
            kind = next(iter(parameter), None)
            if kind is None or kind.get("value") is None:
                raise HarnessError(f"the parameter {parameter.get('name')} of {path or 'the system'} has no value")
            text = kind.get("value", "")
            value = text if local_name(kind) == "String" else parse_element(text)
            values[f"{binding.get('prefix', '')}{parameter.get('name')}"] = value, kind.get("unit", "")
        for name, (value, unit) in self.map_names(binding, values).items():
            self.parameters[self.find_node(path, name)] = value, unit

    def component_source(self, path: str) -> str:
        component = self.system.components.get(path)
        return str(component.file.relative_to(self.folder.resolve())) if component else ""

    def map_names(self, binding: ElementTree.Element, values: dict[str, tuple[Any, str]]) -> dict[str, tuple[Any, str]]:
        """Apply the parameter mapping of a binding: new names, and linear transformations of values."""
        mapping = binding.find("{*}ParameterMapping")
        if mapping is None:
            return values
        self.system.features.add(MAPPED)
        inner = mapping.find("{*}ParameterMapping")
        table = self.parse(mapping.get("source", "")) if mapping.get("source") else mapping if inner is None else inner
        mapped = {}
        for entry in table.findall("{*}MappingEntry"):
            source, target = entry.get("source", ""), entry.get("target", "")
            if source not in values:
                continue
            value, unit = values[source]
            for child in entry:
                if local_name(child) == "LinearTransformation":
                    value = Affine(float(child.get("factor", 1)), float(child.get("offset", 0)))(float(value))
                elif local_name(child).removesuffix("Transformation") in MAPPING_TRANSFORMATIONS:
                    raise HarnessError(f"the mapping to {target} has a {local_name(child)}, which is not supported")
            mapped[target] = value, unit
        return mapped

    def find_node(self, path: str, name: str) -> Node:
        """Return the node that a parameter of an element names: a variable of it, or of an element that it contains."""
        if path in self.system.components:
            return path, name
        inner = [other for other in self.system.components if join(path, name).startswith(f"{other}.")]
        owner = max(inner, key=len, default="")
        if owner:
            return owner, join(path, name)[len(owner) + 1 :]
        return path, name


def read_units(root: ElementTree.Element) -> Iterator[tuple[str, Unit]]:
    """Yield name and definition of the units of a file."""
    for element in root.findall("{*}Units/{*}Unit"):
        base = element.find("{*}BaseUnit")
        if base is not None:
            exponents = tuple(int(base.get(name, 0)) for name in BASE_UNITS)
            yield (
                element.get("name", ""),
                Unit(Affine(float(base.get("factor", 1)), float(base.get("offset", 0))), exponents),
            )


def local_name(element: ElementTree.Element) -> str:
    """Return the name of an element without its namespace."""
    return element.tag.rpartition("}")[2]


def find_one(element: ElementTree.Element, name: str) -> ElementTree.Element:
    """Return an element that must exist."""
    found = element.find(f"{{*}}{name}")
    if found is None:
        raise HarnessError(f"the element {local_name(element)} has no {name.rpartition('}')[2]}")
    return found


def join(path: str, name: str) -> str:
    """Return the path of an element in a system; that of the system itself without a name."""
    return ".".join(filter(None, (path, name)))
