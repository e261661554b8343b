"""A coupled scene as an SSP archive (System Structure and Parameterization 1.0), by the package pyssp_standard."""

from pathlib import Path
from typing import Any

from lxml import etree
from pyssp_standard.common_content_ssc import TypeReal
from pyssp_standard.parameter_types import ParameterType
from pyssp_standard.ssd import SSD, Component, Connection, Connector, DefaultExperiment, ParameterBinding, System
from pyssp_standard.ssp import SSP
from pyssp_standard.ssv import Parameter, SSVElem

from ...scenes.coupled.scene import Coupled

COMMON = "http://ssp-standard.org/SSP1/SystemStructureCommon"


class Scaled(Connection):
    """A connection with a linear transformation, which the package reads over and does not write."""

    factor = 1.0

    def as_element(self) -> Any:
        element = super().as_element()
        etree.SubElement(element, etree.QName(COMMON, "LinearTransformation"), factor=repr(self.factor))
        return element


def write(scene: Coupled, path: Path) -> None:
    """Write the archive, FMUs included, and check it against the schemas of the standard."""
    with SSP(path, mode="w") as archive:
        for fmu in sorted({part.fmu for part in scene.parts}):
            archive.add_resource(fmu)
        with archive.system_structure as structure:
            fill(structure, scene)
            structure.__check_compliance__()
        archive.mark_changed()


def fill(structure: SSD, scene: Coupled) -> None:
    """The system, its components and connections."""
    structure.name, structure.version = scene.name, "1.0"
    structure.system = System(name=scene.name)
    for part in scene.parts:
        component = Component()
        component.name, component.source = part.name, f"resources/{part.fmu.name}"
        component.component_type = "application/x-fmu-sharedlibrary"
        wanted = {each.output: "output" for each in scene.connections if each.source == part.name}
        if part.name in [each.sink for each in scene.connections]:
            wanted["F_ext"] = "input"
        wanted |= dict.fromkeys(part.values, "parameter") | {"x": "output"}
        component.connectors = [Connector(None, name, kind, TypeReal(None)) for name, kind in wanted.items()]
        if part.values:
            values = SSVElem(name="initialValues")
            component.parameter_bindings = [ParameterBinding(ssv=values)]
            for name, value in part.values.items():
                kind = ParameterType("Real", {"value": repr(value)})
                del kind.parameter["unit"]  # the package would write the None; without one, the FMU's own holds
                values.parameters.append(Parameter(name=name, type_name="Real", type_value=kind))
        structure.system.elements.append(component)
    for each in scene.connections:
        connection = Scaled(
            start_element=each.source, start_connector=each.output, end_element=each.sink, end_connector="F_ext"
        )
        connection.factor = each.factor
        structure.system.connections.append(connection)
    experiment = DefaultExperiment()
    experiment.start_time, experiment.stop_time = 0.0, scene.stop
    structure.default_experiment = experiment
