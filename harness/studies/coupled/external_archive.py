"""Reader of a given SSP archive: outputs to record, communication steps and parameters."""

import zipfile
from collections.abc import Iterator
from pathlib import Path
from shutil import copy
from typing import Any

from lxml import etree
from pyssp_standard.ssd import Component
from pyssp_standard.ssp import SSP
from pyssp_standard.ssv import SSV

from ...errors import HarnessError, SceneError, first_line
from ...running.fmu_archive import declared_parameters, read_description
from ...running.variable_values import REAL_TYPES, parse_element, variable_unit
from .convergence import Convergence

COARSEST, HALVINGS = 100, 4  # steps of the first run, and number of halvings


def read_archive(source: Path, file: Path, stop: float | None) -> Convergence:
    """Copy an archive to `file`; return its study, which records every Real output of every component."""
    if not source.is_file():
        raise SceneError(f"{source} does not exist: give an existing archive, or a scene of `friction-fmus list`")
    copy(source, file)
    try:
        with SSP(file, mode="r") as archive, archive.system_structure as structure:
            system, experiment = structure.system, structure.default_experiment
            variables = [
                (component.name, variable)
                for component in components(system)
                for variable in outputs(component, archive.unpacked_path)
            ]
            sets = [
                name
                for part in (system, *components(system))
                for name, _ in parameter_sets(part, archive.unpacked_path)
            ]
    except (OSError, KeyError, ValueError, AttributeError, zipfile.BadZipFile, etree.LxmlError) as error:
        raise HarnessError(f"{source.name} cannot be read: {first_line(error)}") from None
    end = stop if stop is not None else experiment and experiment.stop_time
    if not end:
        raise SceneError(f"{source.name} has no stop time; give one, as in --stop 10")
    if not variables:
        raise HarnessError(f"{source.name} has no component with a Real output")
    return Convergence(
        caption=str(system.name),
        read=tuple((name, variable.name, int(variable.valueReference)) for name, variable in variables),
        labels=tuple(f"{name}.{variable.name}" for name, variable in variables),
        units=tuple(variable_unit(variable) for _, variable in variables),
        steps=tuple(float(end) / COARSEST / 2**i for i in range(HALVINGS + 1)),
        stop=float(end),
        reference="finest run",
        values=sets[0] if sets else "",
    )


def outputs(part: Component, folder: Path) -> list[Any]:
    """Return the Real variables of a component that are output connectors."""
    names = [variable.name for variable in part.connectors if variable.kind == "output"]
    variables = read_description(folder / part.source).modelVariables if names else []
    return [variable for variable in variables if variable.name in names and variable.type in REAL_TYPES]


def components(system: Any) -> list[Component]:
    return [element for element in system.elements if isinstance(element, Component)]


def parameter_sets(part: Any, folder: Path) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield name and values of each parameter set that a part of an archive binds."""
    for binding in part.parameter_bindings or ():
        if binding.ssv is not None:
            table = binding.ssv
        else:
            with SSV(folder / binding.source, mode="r") as file:
                table = file.ssv_elem
        values = {
            parameter["name"]: parameter["type_value"].parameter.get("value", "") for parameter in table.parameters
        }
        yield str(table.name), {f"{binding.prefix or ''}{name}": value for name, value in values.items()}


def effective_parameters(file: Path) -> dict[str, tuple[object, str]]:
    """Return value and unit of every parameter, with the sets of the components and then of the system applied."""
    with SSP(file, mode="r") as archive, archive.system_structure as structure:
        folder, parts = archive.unpacked_path, components(structure.system)
        values_by_name = {
            f"{part.name}.{name}": value
            for part in parts
            for name, value in declared_parameters(folder / part.source).items()
        }
        for part, prefix in [*((component, f"{component.name}.") for component in parts), (structure.system, "")]:
            for _, values in parameter_sets(part, folder):
                for name, value in values.items():
                    if prefix + name in values_by_name:
                        values_by_name[prefix + name] = parse_element(value), values_by_name[prefix + name][1]
    return values_by_name
