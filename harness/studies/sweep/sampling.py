"""Points of a sweep: a full grid, or a Latin hypercube, over numbers or labels of enumerations."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from math import isfinite, log, prod
from typing import Any

import numpy as np

from ...arguments import MAX_RUNS, to_array
from ...errors import MAX_VALUE_LENGTH, SceneError, by_interface, format_value, unknown_name_message
from ...scenes.run_spec import RunSpec
from ...simulation.fmu_archive import read_description
from ...simulation.variable_values import enumeration_labels

Labels = Mapping[str, Mapping[str, int]]  # numbers of the labels of each enumeration
SPANS = "as in 1:2:11, 10:1000:31:log, 0.1,0.2,0.4 or, with samples, 1:2"


@dataclass(frozen=True)
class SweepAxis:
    """A parameter with its `values`, or with its two bounds for a random sample; `log`: logarithmic spacing."""

    name: str
    values: tuple[float, ...]
    log: bool = False

    def __str__(self) -> str:
        """Describe the axis in words; `sweep.nc` holds all values."""
        return f"{len(self.values)} values, {self.values[0]!r} to {self.values[-1]!r}{', logarithmic' * self.log}"


def read_axis(name: str, values: Any, random: bool, labels: Labels) -> SweepAxis:
    """Return the axis of a parameter from numbers, labels of an enumeration, or a text as on the command line."""
    if isinstance(values, str):
        return parse_axis(name, replace_labels_in_text(name, values, labels), random)
    return axis_from_numbers(name, replace_labels(name, values, labels), random)


def parse_axis(name: str, text: str, random: bool) -> SweepAxis:
    """Parse a range or a list of values; SceneError if it is invalid."""
    label = by_interface(f"--vary {name}={text}", f"grid: {name} = {text!r}")[:MAX_VALUE_LENGTH]
    invalid = SceneError(f"{label} is invalid; write it {SPANS}")
    words = text.split(":")
    is_log = words[-1] == "log"
    words = words[: len(words) - is_log]
    try:
        if len(words) == 1 and not (random or is_log):
            values = tuple(map(float, text.split(",")))
        elif len(words) == 2 and random:
            values = (float(words[0]), float(words[1]))
        elif len(words) == 3 and not random:
            values = evenly_spaced(float(words[0]), float(words[1]), int(words[2]), is_log)
        else:
            raise invalid
    except (ValueError, OverflowError):
        raise invalid from None
    if not name or not all(map(isfinite, values)) or (random and not values[0] < values[1]):
        raise invalid
    if is_log and not min(values) > 0:
        raise SceneError(f"{label}: a logarithmic axis needs bounds above 0")
    return SweepAxis(name, check_distinct(values, label), is_log)


def axis_from_numbers(name: str, column: Any, random: bool) -> SweepAxis:
    """Return the axis of a parameter from an array of its values; SceneError if it is invalid."""
    try:
        numbers = np.atleast_1d(to_array(column))
    except (OverflowError, TypeError, ValueError):  # nested sequences of different lengths
        numbers = np.zeros((0, 0))
    if numbers.ndim != 1 or (len(numbers) and numbers.dtype.kind not in "fiu"):
        raise SceneError(f"grid: {name} = {format_value(column)} must be numbers, one or a row")
    values = tuple(numbers.astype(float).tolist())
    if not values:
        raise SceneError(f"grid: {name} has no values: give at least one")
    if not all(map(isfinite, values)):
        raise SceneError(f"grid: {name} has a value that is not a finite number")
    if random and (len(values) != 2 or not values[0] < values[1]):
        raise SceneError(f"{name} has {len(values)} values: with samples give its lower and its upper bound")
    return SweepAxis(name, check_distinct(values, f"grid: {name}"))


def check_distinct(values: tuple[float, ...], label: str) -> tuple[float, ...]:
    """Return the values; SceneError if one of them occurs twice."""
    if len(set(values)) < len(values):
        raise SceneError(f"{label}: a value occurs twice")
    return values


def evenly_spaced(low: float, high: float, count: int, ratio: bool) -> tuple[float, ...]:
    """Return `count` values from low to high, both included."""
    if not 1 <= count <= MAX_RUNS:
        raise ValueError
    if ratio and low > 0 and high > 0:
        return tuple(np.geomspace(low, high, count).tolist())
    with np.errstate(all="ignore"):  # the caller rejects values that are not finite
        return tuple(np.linspace(low, high, count).tolist())


@dataclass(frozen=True)
class SweepPoints:
    """Points of a sweep: a grid, or `random` points of a Latin hypercube.

    Grid points are computed on demand, with the last axis fastest; random points are held in memory.

    References
    ----------
    M. D. McKay, R. J. Beckman, W. J. Conover, Technometrics 21 (1979).
    """

    axes: tuple[SweepAxis, ...]
    random: int | None = None
    seed: int = 1

    def __post_init__(self) -> None:
        if self.n_runs > MAX_RUNS:
            raise SceneError(f"{self.n_runs} runs exceed the maximum of {MAX_RUNS}; reduce the number of values")

    @property
    def names(self) -> tuple[str, ...]:
        """Return the names of the varied parameters."""
        return tuple(axis.name for axis in self.axes)

    @property
    def n_runs(self) -> int:
        """Return the number of points; unlike len(), also a number that is too large."""
        return prod(len(axis.values) for axis in self.axes) if self.random is None else self.random

    def __len__(self) -> int:
        return self.n_runs

    def coordinates(self, first: int, last: int) -> np.ndarray:
        """Return the points from number `first` to before `last`, (last - first, axes)."""
        if self.random is not None:
            return self.sample[first:last]
        indices = np.unravel_index(np.arange(first, last), [len(axis.values) for axis in self.axes])
        return np.column_stack([np.array(axis.values)[index] for axis, index in zip(self.axes, indices, strict=True)])

    @cached_property
    def sample(self) -> np.ndarray:
        from scipy.stats import qmc

        points: np.ndarray = qmc.LatinHypercube(len(self.axes), rng=self.seed).random(self.random)
        for axis, column in zip(self.axes, points.T, strict=True):
            low, high = map(log, axis.values) if axis.log else axis.values
            column[:] = np.exp(low + column * (high - low)) if axis.log else low + column * (high - low)
        return points


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


def replace_labels_in_text(name: str, text: str, labels: Labels) -> str:
    """Return a list of values in a text with the numbers of its labels, as 1,3 for hybrid,threshold."""
    numbers = labels.get(name, {})
    return ",".join(str(numbers.get(word.strip(), word)) for word in text.split(","))


def describe_labels(variable: Any) -> str:
    """Return the labels of an enumeration in parentheses; empty for any other variable."""
    if variable.type != "Enumeration":
        return ""
    return f" ({', '.join(f'{number} = {label}' for number, label in enumeration_labels(variable).items())})"
