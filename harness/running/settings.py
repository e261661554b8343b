"""What a run sets and records, checked against the variables that the FMU declares."""

from typing import Any

from ..errors import SceneError, check_names, format_value
from .run_spec import SHORT_KEYS, RunSpec
from .variable_values import convert_value

REQUIRED_VARIABLES = ("solver.t_next", "solver.steps", "solver.rejected", "solver.evaluations")


def check_fmu(run: RunSpec, variables: dict[str, Any]) -> None:
    """It is one of these FMUs, and every output to record is one of its outputs or locals."""
    for name in REQUIRED_VARIABLES:
        if name not in variables:
            raise SceneError(f"{run.fmu.name} has no variable {name}; the harness runs the FMUs of this project only")
    readable = [name for name, variable in variables.items() if variable.causality in ("output", "local")]
    check_names("output", run.outputs, readable)


def resolve_settings(run: RunSpec, variables: dict[str, Any]) -> list[tuple[Any, float | int]]:
    """The variables to set before the run and their values, each within its declared range."""
    settable = [name for name, variable in variables.items() if variable.causality in ("parameter", "input")]
    for key, name in SHORT_KEYS.items():
        if name in run.values and name not in variables:
            asked = f"{key} = {format_value(run.values[name])}"
            raise SceneError(f"{asked}: {run.model} has nothing to choose there; leave {key} out")
    check_names("name in [values]", run.values, settable)
    return [(variables[name], convert_value(variables[name], value)) for name, value in run.values.items()]
