"""Enumerations that a sweep varies by their labels, as in friction=hybrid,threshold."""

from collections.abc import Mapping
from typing import Any

from ...errors import SceneError, unknown_name_message
from ...scenes.run_spec import RunSpec
from ...simulation.fmu_archive import read_description
from ...simulation.variable_values import enumeration_labels

Labels = Mapping[str, Mapping[str, int]]  # numbers of the labels of each enumeration


def read_labels(run: RunSpec) -> Labels:
    """Return the labels of all enumerations of the FMU of a run."""
    variables = read_description(run.fmu, run.lenient).modelVariables
    tables = {variable.name: enumeration_labels(variable) for variable in variables if variable.type == "Enumeration"}
    return {name: {label: number for number, label in table.items()} for name, table in tables.items()}


def replace_labels(name: str, values: Any, labels: Labels) -> Any:
    """Return the values of a parameter with the numbers of its labels; SceneError for an unknown label."""
    items = list_labels(values)
    if not any(isinstance(item, str) for item in items):
        return values
    if name not in labels:
        raise SceneError(f"grid: {name} = {values!r} must be numbers, because {name} is no enumeration")
    numbers = labels[name]
    for item in items:
        if isinstance(item, str) and item not in numbers:
            raise SceneError(unknown_name_message(f"label of {name}", item, numbers))
    return [numbers[item] if isinstance(item, str) else item for item in items]


def list_labels(values: Any) -> list[Any]:
    """Return a label, or the items of a sequence or of an array of texts; empty for other values."""
    if isinstance(values, str):
        return [values]
    if isinstance(values, list | tuple):
        return list(values)
    kind = getattr(getattr(values, "dtype", None), "kind", "")
    return list(values) if kind in ("U", "O", "T") and getattr(values, "ndim", 0) == 1 else []


def replace_labels_in_text(text: str, labels: Labels) -> str:
    """Return an argument of --vary with the numbers of its labels, as friction=1,3 for friction=hybrid,threshold."""
    name, equals, span = text.partition("=")
    numbers = labels.get(name.strip(), {})
    words = (str(numbers.get(word.strip(), word)) for word in span.split(","))
    return f"{name}{equals}{','.join(words)}"


def describe_labels(variable: Any) -> str:
    """Return the labels of an enumeration in parentheses; empty for any other variable."""
    if variable.type != "Enumeration":
        return ""
    return f" ({', '.join(f'{number} = {label}' for number, label in enumeration_labels(variable).items())})"
