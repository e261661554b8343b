"""A given SSP archive: outputs to record, communication steps, parameters, and the engines that support it."""

import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from shutil import copy

from ...errors import HarnessError, SceneError, first_line
from ...process.temporary_directory import temporary_directory
from ...running.variable_values import REAL_TYPES, effective_value, variable_unit
from .convergence import Convergence
from .engine import ENGINES, UNSUPPORTED
from .system import CoupledSystem, read_system

COARSEST, HALVINGS = 100, 4  # steps of the first run, and number of halvings


@contextmanager
def open_system(archive: Path) -> Iterator[CoupledSystem]:
    """Read the system of an archive; its FMUs exist until the end of the context."""
    with temporary_directory("ssp-") as folder:
        try:
            with zipfile.ZipFile(archive) as content:
                content.extractall(folder)
            system = read_system(folder)
        except HarnessError as error:
            raise HarnessError(f"{archive.name} cannot be run: {error}") from None
        except (OSError, ValueError, zipfile.BadZipFile) as error:
            raise HarnessError(f"{archive.name} cannot be read: {first_line(error)}") from None
        yield system


def read_archive(source: Path, file: Path, stop: float | None) -> Convergence:
    """Copy an archive to `file`; return its study.

    It records the Real output connectors of each component, or all of its Real outputs if it has no output connector.
    """
    if not source.is_file():
        raise SceneError(f"{source} does not exist: give an existing archive, or a scene of `friction-fmus list`")
    copy(source, file)
    with open_system(source) as system:
        with_connectors = {path for path, _ in system.outputs}
        variables = [
            (path, variable)
            for path, component in system.components.items()
            for variable in component.variables.values()
            if variable.causality == "output" and variable.type in REAL_TYPES and not variable.dimensions
            if path not in with_connectors or (path, variable.name) in system.outputs
        ]
    end = stop if stop is not None else system.stop
    if not end:
        raise SceneError(f"{source.name} has no stop time; give one, as in --stop 10")
    if not variables:
        raise HarnessError(f"{source.name} has no component with a Real output")
    return Convergence(
        caption=str(system.name),
        read=tuple((path, variable.name, int(variable.valueReference)) for path, variable in variables),
        labels=tuple(f"{path}.{variable.name}" for path, variable in variables),
        units=tuple(variable_unit(variable) for _, variable in variables),
        steps=tuple(float(end) / COARSEST / 2**i for i in range(HALVINGS + 1)),
        stop=float(end),
        reference="finest run",
        values=next(iter(system.parameter_sets), ""),
        candidates=tuple(ENGINES),
        unsupported={
            engine: f"{engine} does not support {', '.join(sorted(system.features & features))}"
            for engine, features in UNSUPPORTED.items()
            if system.features & features
        },
        ignored=tuple(system.ignored),
    )


def effective_parameters(file: Path) -> dict[str, tuple[object, str]]:
    """Return value and unit of every parameter of the components of an archive."""
    with open_system(file) as system:
        return {
            f"{path}.{name}": (
                effective_value(variable, system.values.get((path, name), variable.start)),
                variable_unit(variable),
            )
            for path, component in system.components.items()
            for name, variable in component.variables.items()
            if variable.causality == "parameter"
        }
