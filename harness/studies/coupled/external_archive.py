"""An SSP archive that somebody else wrote: what can be read of it, and in which steps it is run."""

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
from ...running.description import declared_parameters, read_description
from ...running.variable_values import REAL_TYPES, parse_element, variable_unit
from .convergence import Convergence

COARSEST, HALVINGS = 100, 4  # communication steps of the first run


def read_archive(source: Path, file: Path, stop: float | None) -> Convergence:
    """What is to be run: every real output that the archive names, of every component; `file` becomes a copy that any
    library can read."""
    if not source.is_file():
        raise SceneError(f"there is no {source}: name an archive that is here, or a scene of `python -m harness list`")
    copy(source, file)
    try:
        with SSP(file, mode="r") as archive, archive.system_structure as structure:
            system, experiment = structure.system, structure.default_experiment
            found = [
                (each.name, variable)
                for each in components(system)
                for variable in outputs(each, archive.unpacked_path)
            ]
            sets = [name for part in (system, *components(system)) for name, _ in bound(part, archive.unpacked_path)]
    except (OSError, KeyError, ValueError, AttributeError, zipfile.BadZipFile, etree.LxmlError) as error:
        raise HarnessError(f"{source.name} cannot be read: {first_line(error)}") from None
    end = stop if stop is not None else experiment and experiment.stop_time
    if not end:
        raise SceneError(f"{source.name} names no stop time; name one, as in --stop 10")
    if not found:
        raise HarnessError(f"{source.name} has no component with a real output")
    return Convergence(
        title=str(system.name),
        read=tuple((name, variable.name, int(variable.valueReference)) for name, variable in found),
        labels=tuple(f"{name}.{variable.name}" for name, variable in found),
        units=tuple(variable_unit(variable) for _, variable in found),
        steps=tuple(float(end) / COARSEST / 2**i for i in range(HALVINGS + 1)),
        stop=float(end),
        reference="finest run",
        values=sets[0] if sets else "",
    )


def outputs(part: Component, folder: Path) -> list[Any]:
    """The real variables of a component's FMU that are output connectors."""
    named = [each.name for each in part.connectors if each.kind == "output"]
    variables = read_description(folder / part.source).modelVariables if named else []
    return [each for each in variables if each.name in named and each.type in REAL_TYPES]


def components(system: Any) -> list[Component]:
    return [each for each in system.elements if isinstance(each, Component)]


def bound(part: Any, folder: Path) -> Iterator[tuple[str, dict[str, Any]]]:
    """The name of each set of parameters that a part of an archive binds, and the values in it."""
    for binding in part.parameter_bindings or ():
        if binding.ssv is not None:
            table = binding.ssv
        else:
            with SSV(folder / binding.source, mode="r") as file:
                table = file.ssv_elem
        values = {each["name"]: each["type_value"].parameter.get("value", "") for each in table.parameters}
        yield str(table.name), {f"{binding.prefix or ''}{name}": value for name, value in values.items()}


def effective_parameters(file: Path) -> dict[str, tuple[object, str]]:
    """Every parameter of the components of an archive, as its sets say, those of the whole last, and its unit."""
    with SSP(file, mode="r") as archive, archive.system_structure as structure:
        folder, parts = archive.unpacked_path, components(structure.system)
        found = {
            f"{each.name}.{name}": told
            for each in parts
            for name, told in declared_parameters(folder / each.source).items()
        }
        for part, own in [*((each, f"{each.name}.") for each in parts), (structure.system, "")]:
            for _, values in bound(part, folder):
                for name, value in values.items():
                    if own + name in found:
                        found[own + name] = parse_element(value), found[own + name][1]
    return found
