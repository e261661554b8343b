"""What an FMU says of itself."""

from pathlib import Path
from typing import Any
from xml.etree import ElementTree
from zipfile import ZipFile

import fmpy
from fmpy.model_description import ValidationError

from ..errors import HarnessError, SceneError, first_line
from ..scenes.fmu_files import check_built
from .cached_by_mtime import cached_by_mtime
from .run_spec import RunSpec
from .variable_values import effective_value, variable_unit

MAX_LISTED_FAULTS = 50  # faults that are told


def read_description(path: Path, lenient: bool = False) -> Any:
    """What an FMU says of itself; HarnessError if it cannot be read, is of a version that nobody here runs, or, unless
    one is lenient, breaks the standard."""
    check_built(path, SceneError)
    return validate_description(path, lenient)


@cached_by_mtime
def validate_description(path: Path, lenient: bool) -> Any:
    """The same, of a file that is there."""
    try:
        old = read_fmi_version(path)
        found = None if old.startswith("1.") else fmpy.read_model_description(path, validate=not lenient)
    except ValidationError as error:
        faults = [" ".join(fault.split()) for fault in error.problems]
        told = "\n- ".join(
            faults[:MAX_LISTED_FAULTS]
            + [f"and {len(faults) - MAX_LISTED_FAULTS} more"] * (len(faults) > MAX_LISTED_FAULTS)
        )
        count = "1 place" if len(faults) == 1 else f"{len(faults)} places"
        raise HarnessError(
            f"{path.name} breaks the FMI standard in {count}:\n- {told}\n"
            "--lenient (run, compare) or lenient = true (a scene) runs it all the same, where it can run"
        ) from None
    except (AttributeError, IndexError, TypeError) as error:  # of fmpy, which looks for what is not there
        lacks = f"its modelDescription.xml lacks what it names, or a version of FMI ({first_line(error)})"
        raise HarnessError(f"{path.name} cannot be read: {lacks}") from None
    except Exception as error:  # fmpy raises bare Exceptions, and those of zip and XML readers
        raise HarnessError(
            f"{path.name} cannot be read: {first_line(error)}; export it anew, or name another file"
        ) from None
    if found is None:
        raise HarnessError(f"{path.name} is an FMU of FMI {old}; FMI 2.0 and 3.0 are run here: export it anew as one")
    return found


def declared_parameters(fmu: Path) -> dict[str, tuple[object, str]]:
    """The start value of every parameter of an FMU, and its unit."""
    found = [each for each in read_description(fmu, lenient=True).modelVariables if each.causality == "parameter"]
    return {each.name: (effective_value(each, each.start), variable_unit(each)) for each in found}


def resolve_time_span(spec: RunSpec, found: Any) -> tuple[float, float]:
    """Start and stop of a run in s, the FMU's own where none are wanted; SceneError if nothing lies between."""
    own = found.defaultExperiment
    start, stop = spec.start, resolve_stop(spec, found)
    if start is None:
        start = float(own.startTime or 0.0) if own else 0.0
    if stop is None:
        raise SceneError(f"{spec.fmu.name} names no stop time; name one, as in --stop 10")
    if not stop > start:
        raise SceneError(f"stop = {stop!r} s is not after start = {start!r} s")
    return start, stop


def resolve_stop(spec: RunSpec, found: Any) -> float | None:
    """Where a run stops, in s; None if nobody says."""
    own = found.defaultExperiment.stopTime if found.defaultExperiment else None
    return spec.stop if spec.stop is not None else None if own is None else float(own)


def read_fmi_version(path: Path) -> str:
    """The version of FMI that the file names."""
    with ZipFile(path) as archive, archive.open("modelDescription.xml") as file:
        return next(ElementTree.iterparse(file, ["start"]))[1].get("fmiVersion", "")
