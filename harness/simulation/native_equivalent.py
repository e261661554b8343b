"""Native FMU of the model of a Python FMU, built on demand."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import fmpy
import numpy as np

from ..errors import HarnessError, SceneError, format_value
from ..process.subprocess_runner import SubprocessTimeoutError, run_module
from ..process.temporary_directory import temporary_directory
from ..scenes.fmu_files import FOLDERS, MORE, check_built
from ..scenes.run_spec import RunSpec
from .fmu_archive import PROCESS_RESOURCES, default_stop, is_python_fmu, read_description, unpack_once
from .fmu_variables import LAW
from .model_data import read_model_data
from .mtime_cache import cached_by_mtime
from .variable_values import enumeration_labels
from .variational import has_derivatives
from .whole_run import open_simulator, real_variables

BUILD_TIMEOUT = 300.0  # s
HYBRID = "hybrid"  # the friction law with events
COMPARED_POINTS, AGREEMENT = 51, 1e-6  # of the run by which two FMUs are compared


@cached_by_mtime
def native_equivalent(fmu: Path) -> Path:
    """Return the native FMU of the same model, or the FMU itself if there is none.

    It is read from the subfolder native, or built from the model file in the same folder or of this project. In both
    cases it must be the same model.
    """
    if not is_python_fmu(unpack_once(fmu)):
        return fmu
    native_fmu = fmu.parent / "native" / fmu.name
    if native_fmu.is_file() and is_same_model(fmu, native_fmu):
        return native_fmu
    candidates = (fmu.with_suffix(".py"), *(folder / f"{fmu.stem}.py" for folder in (*FOLDERS, *MORE)))
    source = next(filter(Path.is_file, candidates), None)
    if source is None:
        return fmu
    folder = PROCESS_RESOURCES.enter_context(temporary_directory("native-"))
    platform = ("--platform", fmpy.platform) if fmpy.platform in ("linux64", "win64", "darwin64") else ()
    arguments = (str(source), "--native", *platform, "--out", str(folder))
    try:
        build = run_module("build_fmus", *arguments, timeout=BUILD_TIMEOUT)
    except SubprocessTimeoutError:
        return fmu
    native_fmu = folder / fmu.name
    return native_fmu if not build.returncode and native_fmu.is_file() and is_same_model(fmu, native_fmu) else fmu


def native_with_derivatives(fmu: Path) -> Path:
    """Return the native FMU of the same model, which must have directional derivatives.

    Raises
    ------
    HarnessError
        If it has no derivatives for model exchange.
    """
    check_built(fmu, SceneError)
    fmu = native_equivalent(fmu)
    if not has_derivatives(unpack_once(fmu)):
        raise HarnessError(
            f"{fmu.name} has no directional derivatives for model exchange; native FMUs of this project have them: "
            "build one with `friction-fmus build --native`"
        )
    return fmu


def check_has_events(fmu: Path, variables: Mapping[str, Any], values: Mapping[str, Any]) -> None:
    """Raise HarnessError for a friction law that has no events, and so no derivatives."""
    label = read_model_data(fmu).fixed_choices.get(LAW, (HYBRID, 0))[0]
    if LAW in variables:
        label = enumeration_labels(variables[LAW])[int(values.get(LAW, variables[LAW].start))]
    if label != HYBRID:
        reason = "its solution chatters, and has no derivatives"
        raise HarnessError(f"{LAW} = {format_value(label)}: {reason}; choose {HYBRID!r}")


def is_same_model(fmu: Path, other: Path) -> bool:
    """Return whether an FMU declares all variables of another, and its outputs are the same in a run with start values.

    A native FMU declares derivatives in addition.
    """
    if not declared_variables(fmu) <= declared_variables(other):
        return False
    variables = real_variables(read_description(fmu))
    outputs = tuple(name for name, variable in variables.items() if variable.causality == "output")
    times = np.linspace(0.0, default_stop(read_description(fmu)) or 1.0, COMPARED_POINTS)
    runs = []
    for path in (fmu, other):
        with open_simulator(RunSpec(path, outputs, times=times, follow=False)) as simulator:
            runs.append(simulator.prepare(simulator.spec)({}))
    values, other_values = runs
    return (
        values is not None
        and other_values is not None
        and np.allclose(values, other_values, rtol=AGREEMENT, atol=AGREEMENT)
    )


def declared_variables(fmu: Path) -> set[tuple[Any, ...]]:
    """Return name, type, causality, start value, bounds and unit of every variable."""
    fields = ("name", "type", "causality", "variability", "start", "min", "max", "unit")
    return {tuple(getattr(variable, field) for field in fields) for variable in read_description(fmu).modelVariables}
