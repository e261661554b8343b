"""What a run sets and records, checked against the variables that the FMU declares."""

from typing import Any

from ..errors import SceneError, shown, unknown
from .specification import SHORT, Specification
from .values import accepted

NEEDED = ("solver.t_next", "solver.steps", "solver.rejected", "solver.evaluations")


def check_fmu(run: Specification, variables: dict[str, Any]) -> None:
    """It is one of these FMUs, and every output to record is one of its outputs or locals."""
    for name in NEEDED:
        if name not in variables:
            raise SceneError(f"{run.fmu.name} has no variable {name}; the harness runs the FMUs of this project only")
    readable = [name for name, variable in variables.items() if variable.causality in ("output", "local")]
    for name in run.outputs:
        if name not in readable:
            raise SceneError(unknown("output", name, readable))


def settings(run: Specification, variables: dict[str, Any]) -> list[tuple[Any, float | int]]:
    """The variables to set before the run and their values, each within its declared range."""
    settable = [name for name, variable in variables.items() if variable.causality in ("parameter", "input")]
    keys = {name: key for key, name in SHORT.items()}
    for name, value in run.values.items():
        if name in keys and name not in variables:
            key = keys[name]
            raise SceneError(f"{key} = {shown(value)}: {run.model} has nothing to choose there; leave {key} out")
        if name not in settable:
            raise SceneError(unknown("name in [values]", name, settable))
    return [(variables[name], accepted(variables[name], value)) for name, value in run.values.items()]
