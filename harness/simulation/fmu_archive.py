"""Archive of an FMU: reads and validates the model description, and unpacks the files.

The libraries of pythonfmu 0.7.0 and pythonfmu3 0.3.4 decode only %20 in the URI of the resources; other escapes, and a
missing directory, crash or hang. Therefore the paths of temporary files need no escape in a URI, and Python FMUs that
lack required files are refused.
"""

import atexit
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from inspect import signature
from pathlib import Path
from shutil import disk_usage
from typing import Any
from xml.etree import ElementTree
from zipfile import ZipFile

import fmpy
from fmpy.model_description import SimpleType, ValidationError
from lxml import etree

from ..errors import HarnessError, SceneError, by_interface, first_line, option_text
from ..process.temporary_directory import has_plain_uri, temporary_directory
from ..scenes.fmu_files import check_built
from ..scenes.run_spec import RunSpec
from .model_data import read_model_data
from .mtime_cache import cached_by_mtime
from .variable_values import ExclusiveBound, effective_value, variable_unit

DESCRIPTION_FILE = "modelDescription.xml"
MAX_LISTED_FAULTS = 50  # violations listed in a message
OWN_TOOL = "friction-fmus"  # begin of the generation tool of FMUs of this project
REQUIRED_VARIABLES = ("solver.t_next", "solver.steps", "solver.rejected", "solver.evaluations")  # of this project
# file with the name of the script of a Python FMU; the libraries of both packages contain this file name
SCRIPT_NAME_FILE = "slavemodule.txt"
# variabilities for which fmpy knows whether a variable has a start value, if the attribute `initial` is missing
VARIABILITIES = {
    "parameter": ("fixed", "tunable"),
    "structuralParameter": ("fixed", "tunable"),
    "calculatedParameter": ("fixed", "tunable"),
    "input": ("discrete", "continuous"),
    "output": ("constant", "discrete", "continuous"),
    "local": ("constant", "fixed", "tunable", "discrete", "continuous"),
    "independent": ("continuous",),
}
SET_CAUSALITIES = ("parameter", "structuralParameter", "input")
FMI2_TYPES = ("Real", "Integer", "Boolean", "String", "Enumeration")
PROCESS_RESOURCES = ExitStack()  # directories that exist until the process ends
atexit.register(PROCESS_RESOURCES.close)


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


def describe_lenient() -> str:
    """Return how to run an FMU that violates the standard."""
    in_scene = "lenient = true in a scene"
    return by_interface(
        f"use --lenient (run, compare, sweep), or {in_scene}",
        f"use lenient=True (harness.simulate, harness.compare, harness.sweep), or {in_scene}",
    )


def is_own(description: Any) -> bool:
    """Return whether an FMU is one of this project."""
    return (description.generationTool or "").startswith(OWN_TOOL)


@cached_by_mtime
def validate_description(path: Path, lenient: bool) -> Any:
    """Read and validate the model description of an existing file."""
    try:
        fmi_version = read_fmi_version(path)
        read = read_leniently if lenient else fmpy.read_model_description
        description = None if fmi_version.startswith("1.") else read(path)
        if description and is_own(description):
            mark_exclusive_bounds(description, path)
    except ValidationError as error:
        violations = [" ".join(fault.split()) for fault in error.problems]
        list_text = "\n- ".join(
            violations[:MAX_LISTED_FAULTS]
            + [f"and {len(violations) - MAX_LISTED_FAULTS} more"] * (len(violations) > MAX_LISTED_FAULTS)
        )
        count = "1 place" if len(violations) == 1 else f"{len(violations)} places"
        raise HarnessError(
            f"{path.name} violates the FMI standard in {count}:\n- {list_text}\nto try to run it, {describe_lenient()}"
        ) from None
    except (AttributeError, IndexError, TypeError) as error:  # fmpy reads elements and attributes that are missing
        problem = f"its modelDescription.xml lacks a required element or the FMI version ({first_line(error)})"
        raise HarnessError(f"{path.name} cannot be read: {problem}") from None
    except HarnessError:
        raise
    except Exception as error:  # fmpy raises bare Exceptions, and those of zip and XML readers
        raise HarnessError(
            f"{path.name} cannot be read: {first_line(error)}; export it again, or specify another file"
        ) from None
    if description is None:
        raise HarnessError(f"{path.name} has FMI version {fmi_version}; supported are 2.0 and 3.0: export it again")
    return description


def mark_exclusive_bounds(description: Any, path: Path) -> None:
    """Mark those of the attributes `min` and `max` that an FMU of this project excludes."""
    exclusive_bounds = read_model_data(path).exclusive_bounds
    for variable in description.modelVariables:
        for attribute in exclusive_bounds.get(variable.name, ()):
            if (value := getattr(variable, attribute)) is not None:
                setattr(variable, attribute, ExclusiveBound(value))


def read_leniently(path: Path) -> Any:
    """Read the model description of an FMU or of a folder without validation.

    If fmpy cannot read it, parts that a run does not need are removed: declared types, units and entries of the model
    structure that refer to something undefined, unknown attributes of types, and variables without a type.
    """
    try:
        return fmpy.read_model_description(path, validate=False)
    except Exception as error:  # fmpy raises bare Exceptions
        with ExitStack() as stack:
            if path.is_dir():
                file: Any = str(path / DESCRIPTION_FILE)
            else:
                file = stack.enter_context(stack.enter_context(ZipFile(path)).open(DESCRIPTION_FILE))
            tree = etree.parse(file)
            repair_description(tree.getroot())
            repaired_file = stack.enter_context(temporary_directory("xml-")) / DESCRIPTION_FILE
            tree.write(str(repaired_file))
            try:
                return fmpy.read_model_description(str(repaired_file), validate=False)
            except Exception:
                raise error from None  # of the file as it is


def repair_description(root: Any) -> None:
    """Remove the parts of a model description that fmpy cannot read and a run does not need."""
    version = root.get("fmiVersion", "")
    root.set("fmiVersion", "2.0" if version.startswith("2.") else version)
    type_attributes = {*signature(SimpleType).parameters} - {"type", "items"}
    types: set[str | None] = {None}
    for element in root.findall("TypeDefinitions/*"):
        inner = element[0] if element.tag == "SimpleType" and len(element) else element
        for name in {*inner.attrib} - type_attributes:
            del inner.attrib[name]
        for item in inner.findall("Item"):
            for name in {*item.attrib} - {"name", "value", "description"}:
                del item.attrib[name]
        if element.tag == "SimpleType" and not len(element):
            element.getparent().remove(element)
        else:
            types.add(element.get("name"))
    variables = root.find("ModelVariables")
    for variable in variables.findall("ScalarVariable"):
        if not any(
            child.tag in FMI2_TYPES for child in variable
        ):  # an entry of the list remains: indices count entries
            variable.insert(0, etree.Element("String"))
            variable.set("causality", "local")
    references = {variable.get("valueReference") for variable in variables}
    defined_references = references if version.startswith("3.") else {str(i + 1) for i in range(len(variables))}
    for element in variables.iter():
        if element.get("declaredType") not in types:
            del element.attrib["declaredType"]
        for name in "derivative", "clocks":
            if not defined_references.issuperset(element.get(name, "").split()):
                del element.attrib[name]
    for variable in variables:
        if variable.get("initial") is None:  # its default is defined for the combinations that the standard allows
            causality, variability = variable.get("causality", "local"), variable.get("variability", "continuous")
            if variability not in VARIABILITIES.get(causality, ()):
                variable.set("initial", "exact" if causality in SET_CAUSALITIES else "calculated")
    for unknown in root.findall("ModelStructure//*[@index]") + root.findall("ModelStructure/*[@valueReference]"):
        if (unknown.get("index") or unknown.get("valueReference")) not in defined_references:
            unknown.getparent().remove(unknown)
        elif not defined_references.issuperset(unknown.get("dependencies", "").split()):
            del unknown.attrib["dependencies"]
            unknown.attrib.pop("dependenciesKind", None)


def exposes_solver_steps(description: Any) -> bool:
    """Return whether an FMU for co-simulation exposes the steps of its solver, as those of this project do."""
    names = [variable.name for variable in description.modelVariables]
    return description.coSimulation is not None and all(name in names for name in REQUIRED_VARIABLES)


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
        raise SceneError(f"{spec.fmu.name} has no default stop time; set one, as in {option_text('stop', 10)}")
    if not stop > start:
        raise SceneError(f"stop = {stop!r} s is not after start = {start!r} s")
    return start, stop


def resolve_stop(spec: RunSpec, description: Any) -> float | None:
    """Return the stop time of a run in s, or None if neither the specification nor the FMU has one."""
    if spec.stop is None and len(spec.times):
        return float(spec.times[-1])
    return default_stop(description) if spec.stop is None else spec.stop


def default_stop(description: Any) -> float | None:
    """Return the stop time of an FMU in s, or None if it has none."""
    experiment = description.defaultExperiment
    return None if experiment is None or experiment.stopTime is None else float(experiment.stopTime)


def read_fmi_version(path: Path) -> str:
    """Return the FMI version in the model description; raise ValueError if there are several."""
    with ZipFile(path) as archive, archive.open(DESCRIPTION_FILE) as file:
        if (count := archive.namelist().count(DESCRIPTION_FILE)) > 1:
            raise ValueError(
                f"it holds {DESCRIPTION_FILE} {count} times, and the standard does not define which one applies"
            )
        return next(ElementTree.iterparse(file, ["start"]))[1].get("fmiVersion", "")


@contextmanager
def unpack(fmu: Path) -> Iterator[Path]:
    """Unpack an FMU and remove its files on exit.

    Raises
    ------
    HarnessError
        If the FMU cannot be unpacked, or its library would crash.
    """
    check_built(fmu)
    with temporary_directory() as directory:
        try:
            with ZipFile(fmu) as archive:
                size = sum(member.file_size for member in archive.infolist())
            if size > disk_usage(directory).free:
                raise OSError(f"its {size:.3g} bytes do not fit into the temporary directory")
            fmpy.extract(fmu, directory)
        except Exception as error:  # fmpy raises bare Exceptions, and those of zip readers
            raise HarnessError(f"{fmu.name} cannot be unpacked: {first_line(error)}") from None
        if is_python_fmu(directory):
            check_python_fmu(fmu, directory)
        yield directory


@cached_by_mtime
def unpack_once(fmu: Path) -> Path:
    """Unpack an FMU; its files exist until the process ends."""
    return PROCESS_RESOURCES.enter_context(unpack(fmu))


def is_python_fmu(directory: Path) -> bool:
    """Return whether an unpacked FMU uses the library of pythonfmu or pythonfmu3."""
    libraries = directory.glob("binaries/*/*.*")
    return any(SCRIPT_NAME_FILE.encode() in library.read_bytes() for library in libraries if library.is_file())


def check_python_fmu(fmu: Path, directory: Path) -> None:
    """Check the files that the library of a Python FMU requires but does not check."""
    if not has_plain_uri(directory):
        raise HarnessError(
            f"{fmu.name} is a Python FMU, which cannot be run from {directory}: its library reads plain characters "
            "only; set another temporary directory, as in TMPDIR=/tmp"
        )
    name_file = directory / "resources" / SCRIPT_NAME_FILE
    script = name_file.read_text(encoding="utf-8", errors="replace").split("\n")[0] if name_file.is_file() else ""
    if not script or not (name_file.parent / f"{script}.py").is_file():
        missing_file = f"resources/{script}.py" if script else f"resources/{SCRIPT_NAME_FILE}"
        raise HarnessError(f"{fmu.name} lacks {missing_file}, without which a Python FMU crashes: build it again")
