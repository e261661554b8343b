"""Checks of outputs and values against the variables of an FMU."""

from typing import Any

from ..errors import SceneError, check_names, format_value
from ..scenes.run_spec import RunSpec
from ..scenes.scene import SHORT_KEYS
from .variable_values import convert_value

REQUIRED_VARIABLES = ("solver.t_next", "solver.steps", "solver.rejected", "solver.evaluations")


def check_fmu(run: RunSpec, variables: dict[str, Any]) -> None:
    """Check that the FMU is one of this project and has the outputs to record."""
    for name in REQUIRED_VARIABLES:
        if name not in variables:
            raise SceneError(f"{run.fmu.name} has no variable {name}: it is not an FMU of this project")
    readable = [name for name, variable in variables.items() if variable.causality in ("output", "local")]
    check_names("output", run.outputs, readable)


def resolve_settings(run: RunSpec, variables: dict[str, Any]) -> list[tuple[Any, float | int]]:
    """Return variables and values to set before the run, checked against their declared ranges."""
    settable = [name for name, variable in variables.items() if variable.causality in ("parameter", "input")]
    for key, name in SHORT_KEYS.items():
        if name in run.values and name not in variables:
            setting = f"{key} = {format_value(run.values[name])}"
            raise SceneError(f"{setting}: {run.model} has no such choice; remove {key}")
    for name, value in run.values.items():
        if name in variables and name not in settable:
            raise SceneError(
                f"{name} = {format_value(value)}: {name} is calculated; to set the start value of a state, "
                f"declare a Fixed in the model and pass it as start=; allowed: {', '.join(sorted(settable))}"
            )
    check_names("name in [values]", run.values, settable)
    return [(variables[name], convert_value(variables[name], value)) for name, value in run.values.items()]
