"""Model descriptions of FMUs: reading, validation, parameters and default times."""

from pathlib import Path
from typing import Any
from xml.etree import ElementTree
from zipfile import ZipFile

import fmpy
from fmpy.model_description import ValidationError

from ..errors import HarnessError, SceneError, first_line
from ..scenes.fmu_files import check_built
from ..scenes.run_spec import RunSpec
from .cached_by_mtime import cached_by_mtime
from .variable_values import effective_value, variable_unit

DESCRIPTION_FILE = "modelDescription.xml"
MAX_LISTED_FAULTS = 50  # violations listed in a message
REQUIRED_VARIABLES = ("solver.t_next", "solver.steps", "solver.rejected", "solver.evaluations")  # of this project


def read_description(path: Path, lenient: bool = False) -> Any:
    """Return the model description of an FMU.

    Raises
    ------
    SceneError
        If there is no such file.
    HarnessError
        If the file cannot be read, has an unsupported FMI version, or violates the standard and `lenient` is false.
    """
    check_built(path, SceneError)
    return validate_description(path, lenient)


@cached_by_mtime
def validate_description(path: Path, lenient: bool) -> Any:
    """Read and validate the model description of an existing file."""
    try:
        fmi_version = read_fmi_version(path)
        description = None if fmi_version.startswith("1.") else fmpy.read_model_description(path, validate=not lenient)
    except ValidationError as error:
        violations = [" ".join(fault.split()) for fault in error.problems]
        listed = "\n- ".join(
            violations[:MAX_LISTED_FAULTS]
            + [f"and {len(violations) - MAX_LISTED_FAULTS} more"] * (len(violations) > MAX_LISTED_FAULTS)
        )
        count = "1 place" if len(violations) == 1 else f"{len(violations)} places"
        raise HarnessError(
            f"{path.name} violates the FMI standard in {count}:\n- {listed}\n"
            "--lenient (run, compare) or lenient = true (a scene) runs it anyway, if possible"
        ) from None
    except (AttributeError, IndexError, TypeError) as error:  # fmpy reads elements and attributes that are missing
        problem = f"its modelDescription.xml lacks a required element or the FMI version ({first_line(error)})"
        raise HarnessError(f"{path.name} cannot be read: {problem}") from None
    except Exception as error:  # fmpy raises bare Exceptions, and those of zip and XML readers
        raise HarnessError(
            f"{path.name} cannot be read: {first_line(error)}; export it again, or specify another file"
        ) from None
    if description is None:
        raise HarnessError(f"{path.name} has FMI version {fmi_version}; supported are 2.0 and 3.0: export it again")
    return description


def exposes_solver_steps(description: Any) -> bool:
    """Return whether an FMU exposes the steps of its solver, as those of this project do in FMI 2.0."""
    names = [variable.name for variable in description.modelVariables]
    return (
        description.fmiVersion == "2.0"
        and description.coSimulation is not None
        and all(name in names for name in REQUIRED_VARIABLES)
    )


def declared_parameters(fmu: Path) -> dict[str, tuple[object, str]]:
    """Return start value and unit of every parameter of an FMU, by name."""
    parameters = [
        parameter
        for parameter in read_description(fmu, lenient=True).modelVariables
        if parameter.causality == "parameter"
    ]
    return {
        parameter.name: (effective_value(parameter, parameter.start), variable_unit(parameter))
        for parameter in parameters
    }


def resolve_time_span(spec: RunSpec, description: Any) -> tuple[float, float]:
    """Return start and stop of a run in s, by default those of the FMU. Raise SceneError if the interval is empty."""
    experiment = description.defaultExperiment
    start, stop = spec.start, resolve_stop(spec, description)
    if start is None:
        start = float(experiment.startTime or 0.0) if experiment else 0.0
    if stop is None:
        raise SceneError(f"{spec.fmu.name} has no default stop time; set one, as in --stop 10")
    if not stop > start:
        raise SceneError(f"stop = {stop!r} s is not after start = {start!r} s")
    return start, stop


def resolve_stop(spec: RunSpec, description: Any) -> float | None:
    """Return the stop time of a run in s, or None if neither the specification nor the FMU has one."""
    default_stop = description.defaultExperiment.stopTime if description.defaultExperiment else None
    return spec.stop if spec.stop is not None else None if default_stop is None else float(default_stop)


def read_fmi_version(path: Path) -> str:
    """Return the FMI version in the model description; raise ValueError if there are several."""
    with ZipFile(path) as archive, archive.open(DESCRIPTION_FILE) as file:
        if (count := archive.namelist().count(DESCRIPTION_FILE)) > 1:
            raise ValueError(f"it holds {DESCRIPTION_FILE} {count} times, and which one counts is not defined")
        return next(ElementTree.iterparse(file, ["start"]))[1].get("fmiVersion", "")
