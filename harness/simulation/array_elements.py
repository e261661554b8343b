"""Elements of parameter arrays, which FMUs of this project have in FMI 3.0, as scalars named as in FMI 2.0: mu.y[1]."""

from collections.abc import Iterable, Mapping
from typing import Any

OWN_TOOL = "friction-fmus"  # begin of the generation tool of FMUs of this project


class ArrayElement:
    """An element of an array with one dimension, as a scalar variable.

    Attributes
    ----------
    array : ModelVariable
        The array, which has all other attributes.
    index : int
        Index of the element from 0.
    """

    def __init__(self, array: Any, index: int) -> None:
        self.array, self.index = array, index
        self.name, self.start = f"{array.name}[{index + 1}]", array.start.split()[index]
        self.dimensions: list[Any] = []

    def __getattr__(self, name: str) -> Any:
        return getattr(self.array, name)


def is_own(description: Any) -> bool:
    """Return whether an FMU is one of this project."""
    return (description.generationTool or "").startswith(OWN_TOOL)


def split_own_arrays(description: Any) -> Any:
    """Replace the parameter arrays of an FMU of this project by their elements; return the description."""
    if is_own(description):
        description.modelVariables[:] = [
            element for variable in description.modelVariables for element in elements_of(variable)
        ]
    return description


def elements_of(variable: Any) -> list[Any]:
    """Return the elements of a parameter array; any other variable as it is."""
    if variable.causality != "parameter" or len(variable.dimensions) != 1:
        return [variable]
    return [ArrayElement(variable, index) for index in range(int(variable.dimensions[0].start))]


def whole_arrays(variables: Mapping[str, Any]) -> dict[str, Any]:
    """Return variables by name, with arrays in place of their elements."""
    whole = (variable.array if isinstance(variable, ArrayElement) else variable for variable in variables.values())
    return {variable.name: variable for variable in whole}


def start_values(array: Any) -> list[float]:
    """Return the start values of an array of Reals."""
    return [*map(float, array.start.split())]


class ArrayValues:
    """Values of arrays that are set by element: FMI 3.0 sets an array as a whole."""

    def __init__(self) -> None:
        self.values: dict[str, list[float]] = {}

    def update(self, element: ArrayElement, value: float) -> list[float]:
        """Set an element; return all values of its array."""
        values = self.values.setdefault(element.array.name, start_values(element.array))
        values[element.index] = value
        return values


def group_elements(variables: Iterable[Any]) -> tuple[list[Any], list[int], list[float]]:
    """Return how scalars are set in one call: the variables, the position of each scalar among all values, the values.

    An array occurs once, and its other elements have their start values.
    """
    settable: dict[str, int] = {}  # position of the first value
    grouped, positions, values = list[Any](), list[int](), list[float]()
    for variable in variables:
        is_element = isinstance(variable, ArrayElement)
        whole, index = (variable.array, variable.index) if is_element else (variable, 0)
        if whole.name not in settable:
            settable[whole.name] = len(values)
            grouped.append(whole)
            values += start_values(whole) if is_element else [0.0]
        positions.append(settable[whole.name] + index)
    return grouped, positions, values
