"""A coupled scene as an SSP archive (System Structure and Parameterization 1.0), by the package pyssp_standard.

It needs of a tool as little as can be: connections without factors, values in files, names that are identifiers, and
the annotation without which OMSimulator does not begin.  Each element is bound to a file of its own, as Ecos and
libcosim read them; the same values are in one file for the whole system, resources/parameters.ssv, which fmpy is given.
"""

from pathlib import Path

from lxml import etree
from pyssp_standard.common_content_ssc import Annotation, TypeReal
from pyssp_standard.parameter_types import ParameterType
from pyssp_standard.ssd import SSD, Component, Connection, Connector, DefaultExperiment, ParameterBinding, System
from pyssp_standard.ssp import SSP
from pyssp_standard.ssv import SSV, Parameter

from ...scenes.coupled.scene import CoupledScene

WHOLE, SET = "parameters", "initialValues"
OMS = "https://raw.githubusercontent.com/OpenModelica/OMSimulator/master/schema/oms.xsd"


def write(scene: CoupledScene, values: dict[str, dict[str, float]], fmus: dict[str, Path], path: Path) -> None:
    """Write the archive of the FMUs of its elements with these values, and check it against the schemas of the
    standard."""
    whole = {f"{element}.{name}": value for element, each in values.items() for name, value in each.items()}
    with SSP(path, mode="w") as archive:
        for fmu in sorted(set(fmus.values())):
            archive.add_resource(fmu)
        for name, each in {WHOLE: whole, **values}.items():
            archive.add_resource(table(each, path.with_name(f"{name}.ssv")))
        with archive.system_structure as structure:
            fill(structure, scene, values, fmus)
            structure.__check_compliance__()
        archive.mark_changed()


def table(values: dict[str, float], path: Path) -> Path:
    """A file of values."""
    with SSV(path, mode="w") as parameters:
        parameters.ssv_elem.name = SET
        for name, value in values.items():
            kind = ParameterType("Real", {"value": repr(value)})
            kind.parameter.pop("unit", None)  # the package would write the None; without one, the FMU's own holds
            parameters.parameters.append(Parameter(name=name, type_name="Real", type_value=kind))
        if path.stem == WHOLE:  # the others have the same values; to read the schema takes longer than all else
            parameters.__check_compliance__()
    return path


def fill(structure: SSD, scene: CoupledScene, values: dict[str, dict[str, float]], fmus: dict[str, Path]) -> None:
    """The system, its components and connections."""
    structure.name, structure.version = scene.identifier, "1.0"
    structure.system = System(name=scene.identifier)
    for name, fmu in fmus.items():
        component = Component()
        component.name, component.source = name, f"resources/{fmu.name}"
        component.component_type = "application/x-fmu-sharedlibrary"
        wanted = {each.output: "output" for each in scene.connections if each.source == name}
        wanted |= {each.input: "input" for each in scene.connections if each.sink == name}
        wanted |= dict.fromkeys(values.get(name, ()), "parameter")
        wanted |= {"x": "output"} if name in [part.name for part in scene.parts] else {}
        component.connectors = [Connector(None, connector, kind, TypeReal(None)) for connector, kind in wanted.items()]
        if name in values:
            component.parameter_bindings = [ParameterBinding(source=f"resources/{name}.ssv")]
        structure.system.elements.append(component)
    for each in scene.connections:
        ends = {"end_element": each.sink, "end_connector": each.input}
        structure.system.connections.append(Connection(start_element=each.source, start_connector=each.output, **ends))
    structure.system.annotations.add_annotation(master(scene.steps[-1]))
    experiment = DefaultExperiment()
    experiment.start_time, experiment.stop_time = 0.0, scene.stop
    structure.default_experiment = experiment


def master(step: float) -> Annotation:
    """What OMSimulator wants to know: equal communication steps, of so many s."""
    told = Annotation("org.openmodelica")
    within = etree.Element(etree.QName(OMS, "Annotations"), nsmap={"oms": OMS})
    information = etree.SubElement(within, etree.QName(OMS, "SimulationInformation"))
    said = {"description": "oms-ma", "stepSize": repr(step), "absoluteTolerance": "1e-4", "relativeTolerance": "1e-4"}
    etree.SubElement(information, etree.QName(OMS, "FixedStepMaster"), said)
    told.add_element(within)
    return told
