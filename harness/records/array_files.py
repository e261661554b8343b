"""Readers of named arrays with units from .npy, .npz, .mat, HDF5, Parquet and JSON files.

Each reader returns a dictionary of arrays, texts and dictionaries, nested as in the file. The unit of an array is a
text in the same dictionary: `x_unit` for `x`, `units` for all arrays, or `unit` for a single array.
"""

import io
import json
import re
import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any
from zipfile import ZipFile

import numpy as np

from ..errors import SceneError
from ..process.temporary_directory import temporary_directory
from .size_limits import check_size, check_zip

UNIT_KEYS = ("unit", "units")
VALUE_KEYS = ("value", "values", "data", "signal")  # an only array of such a name has the name of its dictionary
NUMERIC = "fiub"
TIME_KINDS = "mM"  # durations and calendar times
MAX_DEPTH = 20  # of dictionaries


@dataclass(frozen=True)
class ArrayColumn:
    """Column of an array file: name, values (numbers or texts) and unit."""

    name: str
    values: Any
    unit: str | None

    def heading(self, prefix: str) -> str:
        """Return the heading, with the unit in brackets."""
        name = self.name.removeprefix(prefix)
        return f"{name} [{self.unit}]" if self.unit else name


def read_npy(data: bytes, name: str) -> dict[str, Any]:
    """Return the array of a .npy file: a column, a matrix or named fields."""
    array = np.load(io.BytesIO(data), allow_pickle=False)
    return {key: array[key] for key in array.dtype.names} if array.dtype.names else {"": array}


def read_npz(data: bytes, name: str) -> dict[str, Any]:
    """Return the arrays of a .npz file."""
    with ZipFile(io.BytesIO(data)) as archive:
        check_zip(archive, name)
    with np.load(io.BytesIO(data), allow_pickle=False) as file:
        return {key: file[key] for key in file.files}


def read_mat(data: bytes, name: str) -> dict[str, Any]:
    """Return the variables of a .mat file; version 7.3 is HDF5 after a header of 512 bytes."""
    if data[512:516] == b"\x89HDF":
        return read_hdf5(data, name)
    from scipy.io import loadmat

    variables = loadmat(io.BytesIO(data), simplify_cells=True)
    if "__function_workspace__" in variables:  # has objects, such as a table
        return read_matlab_objects(data)
    return {key: value for key, value in variables.items() if key[:2] != "__"}


def read_matlab_objects(data: bytes) -> dict[str, Any]:
    """Return the variables of a .mat file with tables and timetables."""
    with warnings.catch_warnings(), temporary_directory("mat-") as folder:
        warnings.simplefilter("ignore")  # the library sets an option of pandas that is deprecated
        import matio

        path = folder / "record.mat"
        path.write_bytes(data)
        variables = matio.load_from_mat(str(path), add_table_attrs=True)
    return {key: columns_of_frame(value) if hasattr(value, "columns") else value for key, value in variables.items()}


def columns_of_frame(frame: Any) -> dict[str, Any]:
    """Return the columns of a DataFrame, its times first, with the units that MATLAB stores in its attributes."""
    columns: dict[str, Any] = {}
    if frame.index.dtype.kind in TIME_KINDS:
        columns[str(frame.index.name or "Time")] = np.asarray(frame.index)
    units = [str(unit) for unit in frame.attrs.get("varUnits", frame.attrs.get("VariableUnits", ()))]
    for i, key in enumerate(frame.columns):
        columns[str(key)] = np.asarray(frame[key])
        if i < len(units) and units[i]:
            columns[f"{key}_units"] = units[i]
    return columns


def read_hdf5(data: bytes, name: str) -> dict[str, Any]:
    """Return the numeric data sets of an HDF5 file, such as a .mat file of version 7.3, with their units."""
    import h5py

    tree: dict[str, Any] = {}
    size = 0.0

    def visit(path: str, item: Any) -> None:
        nonlocal size
        if not isinstance(item, h5py.Dataset) or path.startswith("#"):
            return
        if item.dtype.kind not in NUMERIC and not item.dtype.names:
            return
        size += item.nbytes
        check_size(size, name)
        *folders, key = path.split("/")
        branch = tree
        for folder in folders:
            branch = branch.setdefault(folder, {})
        is_text = item.attrs.get("MATLAB_class") == b"char"
        values = item[()]
        branch[key] = "".join(map(chr, values.ravel().tolist())) if is_text else values
        if item.dtype.names:
            branch[key] = {field: values[field] for field in item.dtype.names}
        for attribute, value in item.attrs.items():
            if attribute.lower() in UNIT_KEYS:
                branch[f"{key}_units"] = value

    with h5py.File(io.BytesIO(data), "r") as file:
        if "#subsystem#" in file:  # has objects, such as a table
            check_size(sum(item.nbytes for item in walk_datasets(file)), name)
            return read_matlab_objects(data)
        file.visititems(visit)
    return tree


def walk_datasets(file: Any) -> list[Any]:
    """Return all data sets of an HDF5 file."""
    import h5py

    items: list[Any] = []
    file.visititems(lambda path, item: items.append(item) if isinstance(item, h5py.Dataset) else None)
    return items


def read_parquet(data: bytes, name: str) -> dict[str, Any]:
    """Return the columns of a Parquet file that are numbers or times, its index first, with their units."""
    from pyarrow import parquet, types

    file = parquet.ParquetFile(io.BytesIO(data))
    check_size(8 * file.metadata.num_rows * max(file.metadata.num_columns, 1), name)
    metadata = {key.decode(): value for key, value in (file.schema_arrow.metadata or {}).items()}
    index = [key for key in json.loads(metadata.get("pandas", "{}")).get("index_columns", ()) if isinstance(key, str)]
    units = json.loads(metadata.get("PANDAS_ATTRS", "{}")).get("units", {})
    is_read = (types.is_integer, types.is_floating, types.is_boolean, types.is_timestamp, types.is_duration)
    names = [field.name for field in file.schema_arrow if any(is_type(field.type) for is_type in is_read)]
    columns: dict[str, Any] = {}
    for key in sorted(names, key=lambda name: name not in index):
        column = file.read([key]).column(0)
        columns["index" if key.startswith("__index_level_") else key] = column.to_numpy()
        field = {k.decode().lower(): v.decode() for k, v in (file.schema_arrow.field(key).metadata or {}).items()}
        unit = next((field[k] for k in UNIT_KEYS if k in field), units.get(key))
        if unit:
            columns[f"{key}_units"] = unit
    return columns


def read_json(text: str) -> dict[str, Any] | None:
    """Return the arrays of a JSON text, or of lines of JSON; None if it is neither."""
    try:
        value = json.loads(text)
    except ValueError:
        try:
            value = [json.loads(line) for line in text.splitlines() if line.strip()]
        except ValueError:
            return None
    if isinstance(value, dict) and isinstance(value.get("columns"), list) and isinstance(value.get("data"), list):
        names = [str(name) for name in value["columns"]]  # the orientation `split` of pandas
        value = [dict(zip(names, row, strict=True)) for row in value["data"]]
    value = arrays_of_json(value)
    return value if isinstance(value, dict) else {"": value}


def arrays_of_json(value: Any, depth: int = 0) -> Any:
    """Return a JSON value with its lists as arrays, and lists of objects as objects of arrays."""
    if depth > MAX_DEPTH:
        raise SceneError(f"the file nests its values deeper than {MAX_DEPTH} levels")
    if isinstance(value, dict):
        return {key: arrays_of_json(item, depth + 1) for key, item in value.items()}
    if not isinstance(value, list) or not value:
        return value
    if all(isinstance(item, dict) for item in value):
        return {key: arrays_of_json([item.get(key) for item in value], depth + 1) for key in value[0]}
    if all(item is None or isinstance(item, int | float) for item in value):
        return np.array(value, float)
    if all(isinstance(item, list) and len(item) == len(value[0]) for item in value):
        columns = [arrays_of_json(list(column), depth + 1) for column in zip(*value, strict=True)]
        return {f"column {i}": column for i, column in enumerate(columns, 1)}
    return value


READERS = {"mat": read_mat, "hdf5": read_hdf5, "parquet": read_parquet, "npy": read_npy, "npz": read_npz}


def list_columns(values: Mapping[str, Any], prefix: str = "", unit: str | None = None) -> list[ArrayColumn]:
    """Return the columns of nested arrays by name, those in dictionaries as dictionary.name."""
    columns = []
    arrays = [key for key, value in values.items() if is_array(value)]
    common_unit = next((value for key, value in values.items() if key.lower() in UNIT_KEYS), None)
    texts = unit_texts(common_unit)
    for key, value in values.items():
        column_unit = unit_text(values.get(f"{key}_unit", values.get(f"{key}_units")))
        if isinstance(common_unit, Mapping):
            column_unit = column_unit or unit_text(common_unit.get(key))
        elif key in arrays and len(texts) == len(arrays):
            column_unit = column_unit or texts[arrays.index(key)]
        name = prefix.rstrip(".") if prefix and len(arrays) == 1 and key.lower() in VALUE_KEYS else prefix + key
        if isinstance(value, Mapping):
            if key.lower() not in UNIT_KEYS:
                columns += list_columns(value, f"{prefix}{key}.", column_unit)
        elif is_array(value):
            columns += split_array(name, value, column_unit or unit, unit_texts(values.get(f"{key}_units")))
    return columns


def split_array(name: str, values: Any, unit: str | None, units: list[str]) -> list[ArrayColumn]:
    """Return the columns of an array: one for a vector, several for a matrix. Times become seconds from the first."""
    if isinstance(values, list):
        return [ArrayColumn(name, [str(cell) for cell in values], unit)]
    if values.dtype.kind in TIME_KINDS:
        return [ArrayColumn(name, to_seconds(values), "s")]
    values = values.astype(float)
    if values.ndim == 1 or min(values.shape) == 1:
        return [ArrayColumn(name, values.ravel(), unit)]
    matrix = values if values.shape[0] >= values.shape[1] else values.T
    units = units if len(units) == matrix.shape[1] else [unit or ""] * matrix.shape[1]
    name = name or "column "
    return [ArrayColumn(f"{name}{i + 1}", matrix[:, i], units[i]) for i in range(matrix.shape[1])]


def to_seconds(times: np.ndarray) -> np.ndarray:
    """Return durations or calendar times (n,) in s, counted from the first; NaN for missing ones."""
    first = next((time for time in times if not np.isnat(time)), np.zeros(1, times.dtype)[0])
    return np.asarray((times - first) / np.timedelta64(1, "ns") * 1e-9, float)


def is_array(value: Any) -> bool:
    """Return whether a value can be a column or a matrix."""
    if isinstance(value, list):
        return len(value) > 2 and all(isinstance(cell, str) and re.match(r"[\d+-]", cell) for cell in value)
    if not isinstance(value, np.ndarray) or not value.size:
        return False
    is_number = value.dtype.kind in NUMERIC and value.ndim in (1, 2)
    return is_number or (value.dtype.kind in TIME_KINDS and value.ndim == 1)


def as_list(values: Any) -> list[Any]:
    """Return the values of a column as a list."""
    return values if isinstance(values, list) else list(values.tolist())


def unit_text(value: Any) -> str | None:
    """Return a unit as text, or None."""
    texts = unit_texts(value)
    return texts[0] if len(texts) == 1 and texts[0] else None


def unit_texts(value: Any) -> list[str]:
    """Return the units in a text, in bytes, or in an array or list of these, as texts."""
    items = np.ravel(value).tolist() if isinstance(value, np.ndarray | list | tuple) else [value]
    texts = [item.decode("utf-8", "replace") if isinstance(item, bytes) else item for item in items]
    return [text.strip() for text in texts] if all(isinstance(text, str) for text in texts) else []
