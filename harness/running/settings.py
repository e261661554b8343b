"""What a run sets and records, checked against the variables that the FMU declares."""

from typing import Any

from ..errors import SceneError, shown, unknown
from ..scenes.schema import is_number
from .specification import SHORT, Specification

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


def accepted(variable: Any, value: Any) -> float | int:
    """The number that stands for a value; SceneError if the variable does not allow it."""
    if variable.type == "Enumeration":
        items = labels(variable)
        numbers = {label: number for number, label in items.items()}
        number = numbers.get(value) if isinstance(value, str) else value
        if not is_number(number) or number not in items:
            raise SceneError(unknown(f"value of {variable.name}", value, numbers))
        return number
    low, high = bound(variable.min), bound(variable.max)
    if not is_number(value) or (low is not None and value < low) or (high is not None and value > high):
        words = [f"{word} {limit!r}" for word, limit in (("at least", low), ("at most", high)) if limit is not None]
        unit = f" {variable.unit}" if variable.unit not in (None, "1") else ""
        allowed = " and ".join(words) + unit if words else "any finite number"
        raise SceneError(f"{variable.name} = {shown(value)} is outside its range; allowed: {allowed}")
    return float(value)


def bound(text: str | None) -> float | None:
    """A bound from the XML, if there is one."""
    return None if text is None else float(text)


def labels(variable: Any) -> dict[int, str]:
    """The names of an enumeration's values."""
    return {int(item.value): item.name for item in variable.declaredType.items}


def unit(variable: Any) -> str:
    """The unit that a variable or its type names; without one for counts, modes and ratios."""
    found = variable.unit or (variable.declaredType.unit if variable.declaredType is not None else None)
    return "" if found in (None, "1") else found
