"""Rows of recorded values. The variables of an instance are read into one buffer, which is written at once.

So a row in a file survives a crash of the FMU.
"""

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from ctypes import (
    c_bool,
    c_char_p,
    c_double,
    c_float,
    c_int,
    c_int8,
    c_int16,
    c_int32,
    c_int64,
    c_uint,
    c_uint8,
    c_uint16,
    c_uint32,
    c_uint64,
    sizeof,
)
from math import isfinite, prod
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..errors import HarnessError, SceneError, by_interface, check_names
from ..scenes.run_spec import RunSpec
from .fmu_instance import WARNING, FMICallException, FmuInstance, PreparedCall, call_all
from .variable_values import REAL_TYPES, convert_value

C_TYPES: dict[str, Any] = {
    "Real": c_double,
    "Float64": c_double,
    "Float32": c_float,
    "Integer": c_int,
    "Int8": c_int8,
    "UInt8": c_uint8,
    "Int16": c_int16,
    "UInt16": c_uint16,
    "Int32": c_int32,
    "UInt32": c_uint32,
    "Int64": c_int64,
    "UInt64": c_uint64,
    "Boolean": c_bool,
    "Enumeration": c_int64,
    "String": c_int64,  # line number of the string table
}
FMI2_TYPES = {"Boolean": c_int, "Enumeration": c_int}  # other than those of FMI 3.0
COLUMN_TYPES = {**dict.fromkeys(C_TYPES, np.int64), **dict.fromkeys(REAL_TYPES, np.float64), "UInt64": np.uint64}

MAX_COLUMNS = 100_000  # recorded values at each point
MAX_DEFAULT_OUTPUTS = 1000  # values recorded at each point of a run that names no outputs

ShapedVariable = tuple[Any, tuple[int, ...]]  # variable and shape
Columns = dict[str, np.ndarray]  # recorded values (n,) by name


def element_names(name: str, shape: tuple[int, ...]) -> list[str]:
    """Return the names of an array's elements in row-major order from 1, as in turn[1,2]; its name for a scalar."""
    if not shape:
        return [name]
    return [f"{name}[{','.join(str(i + 1) for i in index)}]" for index in np.ndindex(shape)]


def array_shape(variable: Any, values: Mapping[str, Any]) -> tuple[int, ...]:
    """Return the shape of an array, () for a scalar. A dimension may be a structural parameter that is set."""
    sizes = []
    for dimension in variable.dimensions:
        parameter = dimension.variable
        sizes.append(
            convert_value(parameter, values.get(parameter.name, float(parameter.start)))
            if parameter
            else int(dimension.start)
        )
    return tuple(sizes)


def select_variables(spec: RunSpec, variables: Mapping[str, Any], values: Mapping[str, Any]) -> list[ShapedVariable]:
    """Return the variables to record with their shapes; an element selects its whole array."""
    shapes = {name: array_shape(variable, values) for name, variable in variables.items() if variable.type in C_TYPES}
    selected_names = {name if name in shapes else name.rpartition("[")[0] for name in spec.outputs} & {*shapes}
    if (count := sum(prod(shapes[name]) for name in selected_names)) > MAX_COLUMNS:
        raise SceneError(f"{spec.fmu.name}: the outputs have {count} elements; record at most {MAX_COLUMNS}")
    owner = {element: name for name in selected_names for element in (name, *element_names(name, shapes[name]))}
    check_names("output", [name for name in spec.outputs if name not in owner], shapes)
    names = dict.fromkeys(owner[name] for name in spec.outputs)
    return [(variables[name], shapes[name]) for name in names]


def default_outputs(description: Any, values: Mapping[str, Any] | None = None) -> tuple[str, ...]:
    """Return the outputs of an FMU, or its locals if it has none. Arrays are listed by element.

    Parameters
    ----------
    description : ModelDescription
        Model description of the FMU.
    values : mapping, optional
        Values that are set. Structural parameters among them determine the shapes of arrays.

    Raises
    ------
    HarnessError
        If there are too many to record all of them.
    """
    for causality in ("output", "local"):
        shapes = {
            variable.name: array_shape(variable, values or {})
            for variable in description.modelVariables
            if variable.causality == causality and variable.variability != "constant" and variable.type in C_TYPES
        }
        if (count := sum(map(prod, shapes.values()))) > MAX_DEFAULT_OUTPUTS:
            remedy = by_interface(
                "run it as a scene that names those to record, as in outputs = ['x']",
                "name those to record, as in outputs=['x'] of harness.simulate",
            )
            raise HarnessError(
                f"{description.modelName} has {count} {causality}s, more than the {MAX_DEFAULT_OUTPUTS} that are "
                f"recorded by default: {remedy}"
            )
        if count:
            return tuple(element for name, shape in shapes.items() for element in element_names(name, shape))
    return ()


def c_type(variable: Any, is_fmi2: bool) -> Any:
    """Return the type of ctypes of a variable."""
    return (C_TYPES | (FMI2_TYPES if is_fmi2 else {}))[variable.type]


def group_by_type(selection: Sequence[ShapedVariable]) -> Iterator[tuple[str, list[Any], list[str]]]:
    """Yield each type with its variables and the names of their elements, in the order of a row."""
    for type_name in dict.fromkeys(variable.type for variable, _ in selection):
        group = [(variable, shape) for variable, shape in selection if variable.type == type_name]
        names = [name for variable, shape in group for name in element_names(variable.name, shape)]
        yield type_name, [variable for variable, _ in group], names


def row_type(selection: Sequence[ShapedVariable], is_fmi2: bool) -> np.dtype:
    """Return the type of a row: the time in s and the values of each type."""
    types = C_TYPES | (FMI2_TYPES if is_fmi2 else {})
    groups = [(type_name, types[type_name], (len(names),)) for type_name, _, names in group_by_type(selection)]
    return np.dtype([("time", c_double), *groups], align=True)


class ClockedCall(NamedTuple):
    """Call that reads a variable that belongs to clocks."""

    clocks: set[int]  # value references
    call: PreparedCall
    texts: list[tuple[Any, Any]]  # of Strings: pointers and indices


class Recorder:
    """Reads variables of an instance and writes them as a row.

    Parameters
    ----------
    instance : FmuInstance
        Instance whose variables are read.
    selection : sequence of (variable, shape)
        Variables to read, with the shapes of arrays.
    write : callable
        Receives the bytes of each row.
    strings : StringTable, optional
        Required if there are Strings.
    only_finite : bool
        Whether to raise HarnessError, instead of writing the row, if a value is not finite.
    """

    def __init__(
        self,
        instance: FmuInstance,
        selection: Sequence[ShapedVariable],
        write: Callable[[bytearray], object],
        strings: "StringTable | None" = None,
        only_finite: bool = False,
    ) -> None:
        layout = row_type(selection, instance.is_fmi2)
        self.instance, self.row, self.write = instance, bytearray(layout.itemsize), write
        self.strings, self.only_finite = strings, only_finite
        self.time = c_double.from_buffer(self.row)
        self.calls: list[PreparedCall] = []
        self.buffers: list[Any] = []  # of each type
        self.cells: dict[str, tuple[Any, int]] = {}  # of Reals: buffer and index
        self.texts: list[tuple[Any, Any]] = []  # of Strings: pointers and indices
        self.clocked_calls: list[ClockedCall] = []
        for type_name, variables, names in group_by_type(selection):
            kind, offset = layout.fields[type_name][0].base, layout.fields[type_name][1]  # type: ignore[index]
            item = np.ctypeslib.as_ctypes_type(kind)
            buffer = (item * len(names)).from_buffer(self.row, offset)
            self.buffers.append(buffer)
            if type_name in REAL_TYPES:
                self.cells |= {name: (buffer, i) for i, name in enumerate(names)}
            sizes = [prod(shape) for variable, shape in selection if variable.type == type_name]
            groups = [(variables, len(names))]
            if instance.ticks_clocks:
                groups = [([variable], size) for variable, size in zip(variables, sizes, strict=True)]
            for group, size in groups:
                indices = (item * size).from_buffer(self.row, offset)
                offset += size * sizeof(item)
                self.add_call(type_name, group, indices, size)

    def add_call(self, type_name: str, variables: list[Any], buffer: Any, size: int) -> None:
        """Prepare the call that reads variables of one type into a buffer of the row."""
        is_text = type_name == "String"
        values = (c_char_p * size)() if is_text else buffer
        references = (c_uint * len(variables))(*(variable.valueReference for variable in variables))
        count = () if self.instance.is_fmi2 else (size,)
        name = f"Get{self.instance.type_name(variables[0])}"
        call = self.instance.prepare_call(name, references, len(variables), values, *count)
        texts = [(values, buffer)] if is_text else []
        if self.instance.ticks_clocks and variables[0].clocks:
            clocks = {clock.valueReference for clock in variables[0].clocks}
            self.clocked_calls.append(ClockedCall(clocks, call, texts))
        else:
            self.calls.append(call)
            self.texts += texts

    def read_clocked(self, active: set[int]) -> None:
        """Read the variables that belong to an active clock, given by value references; rows repeat their values."""
        for reading in self.clocked_calls:
            if reading.clocks & active:
                self.read([reading.call], reading.texts)

    def read(self, calls: list[PreparedCall], texts: list[tuple[Any, Any]]) -> None:
        """Read variables into the row."""
        for name, function, arguments in calls:  # as `call_all`, without its call: this is done at every point
            status = function(*arguments)
            if status > WARNING:
                raise FMICallException(name, status)
        for pointers, indices in texts:
            assert self.strings
            indices[:] = [self.strings.index_of(text) for text in pointers]

    def read_values(self) -> list[Any]:
        """Return the current values of all variables, which are numbers, in the order of a row."""
        call_all(self.calls)
        return [value for buffer in self.buffers for value in buffer]

    def cell(self, name: str) -> c_double:
        """Return the ctypes object with the last recorded value of a Float64."""
        buffer, i = self.cells[name]
        return c_double.from_buffer(buffer, i * sizeof(c_double))

    def record(self, t: float) -> None:
        """Write a row of the current values at a time in s."""
        self.time.value = t
        self.read(self.calls, self.texts)
        if self.only_finite:
            for name, (buffer, i) in self.cells.items():
                if not isfinite(buffer[i]):
                    raise HarnessError(f"{name} is {buffer[i]} at t = {t:.9g} s")
        self.write(self.row)


class StringTable:
    """Distinct strings, one per line of a file; rows contain line numbers."""

    def __init__(self, path: Path) -> None:
        self.file, self.indices = path.open("w", encoding="utf-8", buffering=1), dict[str, int]()

    def index_of(self, text: bytes | str | None) -> int:
        """Return the line number of a string; append the string if it is new."""
        text = text.decode("utf-8", "replace") if isinstance(text, bytes) else text or ""
        if text not in self.indices:
            self.indices[text] = len(self.indices)
            self.file.write(json.dumps(text) + "\n")
        return self.indices[text]


def read_rows(
    data: bytes | memoryview, selection: Sequence[ShapedVariable], is_fmi2: bool
) -> tuple[np.ndarray, Columns]:
    """Return time (n,) in s and columns of the rows of a run; ignore an incomplete last row."""
    layout = row_type(selection, is_fmi2)
    rows = np.frombuffer(data, layout, count=len(data) // layout.itemsize)
    columns: Columns = {}
    for type_name, _, names in group_by_type(selection):
        values = rows[type_name].astype(COLUMN_TYPES[type_name])
        columns |= zip(names, values.T, strict=True)
    return np.array(rows["time"]), columns
