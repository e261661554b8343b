"""Writer of a coupled scene as an SSP archive (System Structure and Parameterization 1.0), with pyssp_standard.

For compatibility, connections have no factors, values are in files, names are identifiers, and the archive has the
annotation that OMSimulator requires.  Each element has its own parameter file for Ecos and libcosim;
resources/parameters.ssv holds the same values for the whole system, for fmpy.
"""

from pathlib import Path

from lxml import etree
from pyssp_standard.common_content_ssc import Annotation, TypeReal
from pyssp_standard.parameter_types import ParameterType
from pyssp_standard.ssd import SSD, Component, Connection, Connector, DefaultExperiment, ParameterBinding, System
from pyssp_standard.ssp import SSP
from pyssp_standard.ssv import SSV, Parameter

from ...scenes.coupled.scene import CoupledScene

ALL_PARAMETERS, SET_NAME = "parameters", "initialValues"
OMS = "https://raw.githubusercontent.com/OpenModelica/OMSimulator/master/schema/oms.xsd"


def write(
    scene: CoupledScene,
    values: dict[str, dict[str, float]],
    fmus: dict[str, Path],
    recorded: dict[str, list[str]],
    path: Path,
) -> None:
    """Write the archive with the FMUs, values and recorded outputs of the elements; validate it against the schemas."""
    all_values = {
        f"{element}.{name}": value
        for element, element_values in values.items()
        for name, value in element_values.items()
    }
    with SSP(path, mode="w") as archive:
        for fmu in sorted(set(fmus.values())):
            archive.add_resource(fmu)
        for name, element_values in {ALL_PARAMETERS: all_values, **values}.items():
            archive.add_resource(write_parameters(element_values, path.with_name(f"{name}.ssv")))
        with archive.system_structure as structure:
            fill_structure(structure, scene, values, fmus, recorded)
            structure.__check_compliance__()
        archive.mark_changed()


def write_parameters(values: dict[str, float], path: Path) -> Path:
    """Write a parameter file."""
    with SSV(path, mode="w") as parameters:
        parameters.ssv_elem.name = SET_NAME
        for name, value in values.items():
            kind = ParameterType("Real", {"value": repr(value)})
            kind.parameter.pop("unit", None)  # the package would write None; without a unit that of the FMU applies
            parameters.parameters.append(Parameter(name=name, type_name="Real", type_value=kind))
        if path.stem == ALL_PARAMETERS:  # the other files have the same values, and validation is slow
            parameters.__check_compliance__()
    return path


def fill_structure(
    structure: SSD,
    scene: CoupledScene,
    values: dict[str, dict[str, float]],
    fmus: dict[str, Path],
    recorded: dict[str, list[str]],
) -> None:
    """Add the system, its components and connections."""
    structure.name, structure.version = scene.identifier, "1.0"
    structure.system = System(name=scene.identifier)
    for name, fmu in fmus.items():
        component = Component()
        component.name, component.source = name, f"resources/{fmu.name}"
        component.component_type = "application/x-fmu-sharedlibrary"
        connectors = {connection.output: "output" for connection in scene.connections if connection.source == name}
        connectors |= {connection.input: "input" for connection in scene.connections if connection.sink == name}
        connectors |= dict.fromkeys(values.get(name, ()), "parameter")
        connectors |= dict.fromkeys(recorded.get(name, ()), "output")
        component.connectors = [
            Connector(None, connector, kind, TypeReal(None)) for connector, kind in connectors.items()
        ]
        if name in values:
            component.parameter_bindings = [ParameterBinding(source=f"resources/{name}.ssv")]
        structure.system.elements.append(component)
    for connection in scene.connections:
        ends = {"end_element": connection.sink, "end_connector": connection.input}
        structure.system.connections.append(
            Connection(start_element=connection.source, start_connector=connection.output, **ends)
        )
    structure.system.annotations.add_annotation(master_annotation(scene.steps[-1]))
    experiment = DefaultExperiment()
    experiment.start_time, experiment.stop_time = 0.0, scene.stop
    structure.default_experiment = experiment


def master_annotation(step: float) -> Annotation:
    """Return the annotation of OMSimulator for fixed communication steps in s."""
    annotation = Annotation("org.openmodelica")
    annotations = etree.Element(etree.QName(OMS, "Annotations"), nsmap={"oms": OMS})
    information = etree.SubElement(annotations, etree.QName(OMS, "SimulationInformation"))
    settings = {
        "description": "oms-ma",
        "stepSize": repr(step),
        "absoluteTolerance": "1e-4",
        "relativeTolerance": "1e-4",
    }
    etree.SubElement(information, etree.QName(OMS, "FixedStepMaster"), settings)
    annotation.add_element(annotations)
    return annotation
