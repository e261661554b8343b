"""Runs any FMU: one of ours at its solver's own steps, somebody else's until two results agree."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from ..errors import HarnessError
from .description import read_description
from .external import simulation as foreign
from .external.sample_rows import ROW_FORMATS, element_names
from .fmi2 import ProgressCallback, simulate
from .run_spec import RunSpec
from .settings import REQUIRED_VARIABLES
from .trajectory import Trajectory

DEFAULT_COMMUNICATION_STEPS = 512  # communication steps of a run from which nothing else is asked


def run(spec: RunSpec, report: ProgressCallback) -> Trajectory:
    """The run that is wanted, of every output if none is named; HarnessError if it fails with nothing to show."""
    found = read_description(spec.fmu, spec.lenient)
    spec = replace(spec, outputs=spec.outputs or default_outputs(found, spec.values))
    if not spec.outputs:
        raise HarnessError(f"{spec.fmu.name} has no variable that changes: there is nothing to record")
    ours = exposes_solver_steps(found) and not spec.exchange
    return simulate(spec, report) if ours else foreign.simulate(spec, found, report)


def exposes_solver_steps(found: Any) -> bool:
    """Whether an FMU tells the steps of its solver, as ours of FMI 2.0 do."""
    names = [variable.name for variable in found.modelVariables]
    return (
        found.fmiVersion == "2.0"
        and found.coSimulation is not None
        and all(name in names for name in REQUIRED_VARIABLES)
    )


def default_outputs(found: Any, values: Mapping[str, Any] | None = None) -> tuple[str, ...]:
    """The outputs of an FMU with such values, arrays by their elements; without any, what it computes inside."""
    for causality in ("output", "local"):
        names = [
            element
            for variable in found.modelVariables
            if variable.causality == causality and variable.variability != "constant" and variable.type in ROW_FORMATS
            for element in element_names(variable.name, foreign.array_shape(variable, values or {}))
        ]
        if names:
            return tuple(names)
    return ()
