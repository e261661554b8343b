"""An SSP archive that somebody else wrote: what can be read of it, and in which steps it is run."""

import zipfile
from pathlib import Path
from shutil import copy
from typing import Any

from lxml import etree
from pyssp_standard.ssd import Component
from pyssp_standard.ssp import SSP
from pyssp_standard.ssv import SSV

from ...errors import HarnessError, SceneError, reason
from ...running.description import description
from ...running.values import REALS, unit
from .convergence import Convergence

COARSEST, HALVINGS = 100, 4  # communication steps of the first run


def asked(source: Path, file: Path, stop: float | None) -> Convergence:
    """What is to be run: every real output that the archive names, of every component; `file` becomes a copy that any
    library can read."""
    if not source.is_file():
        raise SceneError(f"there is no {source}")
    copy(source, file)
    try:
        with SSP(file, mode="r") as archive, archive.system_structure as structure:
            system, experiment = structure.system, structure.default_experiment
            parts = [each for each in system.elements if isinstance(each, Component)]
            found = [(each.name, variable) for each in parts for variable in outputs(each, archive.unpacked_path)]
            values = bound(system, archive.unpacked_path)
    except (OSError, KeyError, ValueError, AttributeError, zipfile.BadZipFile, etree.LxmlError) as error:
        raise HarnessError(f"{source.name} cannot be read: {reason(error)}") from None
    end = stop if stop is not None else experiment and experiment.stop_time
    if not end:
        raise SceneError(f"{source.name} names no stop time; name one, as in --stop 10")
    if not found:
        raise HarnessError(f"{source.name} has no component with a real output")
    return Convergence(
        title=str(system.name),
        read=tuple((name, variable.name, int(variable.valueReference)) for name, variable in found),
        labels=tuple(f"{name}.{variable.name}" for name, variable in found),
        units=tuple(unit(variable) for _, variable in found),
        steps=tuple(float(end) / COARSEST / 2**i for i in range(HALVINGS + 1)),
        stop=float(end),
        reference="finest run",
        values=values,
    )


def outputs(part: Component, folder: Path) -> list[Any]:
    """The real variables of a component's FMU that are output connectors."""
    named = [each.name for each in part.connectors if each.kind == "output"]
    variables = description(folder / part.source).modelVariables if named else []
    return [each for each in variables if each.name in named and each.type in REALS]


def bound(system: Any, folder: Path) -> str:
    """The name of the first set of parameters that an archive binds; empty if there is none."""
    for element in (system, *system.elements):
        for binding in getattr(element, "parameter_bindings", None) or ():
            if binding.ssv is not None:
                return str(binding.ssv.name)
            with SSV(folder / binding.source, mode="r") as table:
                return str(table.ssv_elem.name)
    return ""
