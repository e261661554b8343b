"""Data of an FMU of this project that its model description cannot state, from its file resources/model_data.json."""

import json
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any
from zipfile import BadZipFile, ZipFile

import numpy as np

from ..errors import HarnessError
from .mtime_cache import cached_by_mtime

MODEL_DATA_FILE = "resources/model_data.json"  # fmus/packaging/extra_files.py writes it
PCHIP = "pchip"
CURVE_POINTS = 200  # of a table that is not linear


@dataclass(frozen=True)
class LookupTable:
    """Lookup table of an FMU: a function of one variable, given by points.

    Attributes
    ----------
    name : str
        Name of the table in the model file.
    unit_x, unit_y : str
        Units of both axes.
    x, y : tuple of float
        Points; values of y that are parameters have their start values.
    parameters : tuple of str
        Name of the parameter for each value of y; empty for a number.
    interpolation, ends : str
        "linear" or "pchip", and "hold", "continue" or "refuse".
    """

    name: str
    unit_x: str
    unit_y: str
    x: tuple[float, ...]
    y: tuple[float, ...]
    parameters: tuple[str, ...]
    interpolation: str
    ends: str

    def y_with(self, values: Mapping[str, float | str]) -> tuple[float, ...]:
        """Return y with values of the parameters, by name; others have their start values."""
        return tuple(
            float(values.get(name, start)) if name else start
            for name, start in zip(self.parameters, self.y, strict=True)
        )

    def curve(self, y: Sequence[float]) -> tuple[np.ndarray, np.ndarray]:
        """Return the points of the curve between the first and the last point of the table."""
        if self.interpolation != PCHIP:
            return np.array(self.x), np.array(y)
        from scipy.interpolate import PchipInterpolator

        x = np.linspace(self.x[0], self.x[-1], CURVE_POINTS)
        return x, PchipInterpolator(self.x, y)(x)


@dataclass(frozen=True)
class ModelData:
    """Data of an FMU of this project; all empty for another FMU.

    Attributes
    ----------
    tables : tuple of LookupTable
        Lookup tables.
    contacts : dict
        Name of the mode of each contact, by that of its friction force.
    rate_inputs : dict
        Names of the inputs on which the rate of an input depends, by its name.
    fixed_choices : dict
        Label and number of each method, law or other enumeration that the build fixed, by `--method`, `--law` or
        `--real-only`: the FMU has no such variable.
    exclusive_bounds : dict
        Names of the attributes `min` and `max` that are exclusive, by variable.
    """

    tables: tuple[LookupTable, ...] = ()
    contacts: dict[str, str] = field(default_factory=dict)
    rate_inputs: dict[str, tuple[str, ...]] = field(default_factory=dict)
    fixed_choices: dict[str, tuple[str, int]] = field(default_factory=dict)
    exclusive_bounds: dict[str, tuple[str, ...]] = field(default_factory=dict)


@cached_by_mtime
def read_model_data(fmu: Path) -> ModelData:
    """Return the data of an FMU; empty for an FMU without the file.

    Raises
    ------
    HarnessError
        If the file is damaged.
    """
    try:
        with ZipFile(fmu) as archive:
            if MODEL_DATA_FILE not in archive.namelist():
                return ModelData()
            return parse_model_data(json.loads(archive.read(MODEL_DATA_FILE)))
    except (OSError, BadZipFile, ValueError, TypeError, KeyError, AttributeError):
        raise HarnessError(f"{fmu.name} cannot be read: its {MODEL_DATA_FILE} is damaged; build it again") from None


def parse_model_data(content: Mapping[str, Any]) -> ModelData:
    """Return the data from its JSON."""
    return ModelData(
        tuple(map(parse_table, content["tables"])),
        {str(force): str(mode) for force, mode in content["contacts"].items()},
        {str(name): tuple(map(str, inputs)) for name, inputs in content["rate_inputs"].items()},
        {str(name): (str(choice["label"]), int(choice["value"])) for name, choice in content["fixed_choices"].items()},
        {str(name): tuple(map(str, attributes)) for name, attributes in content["exclusive_bounds"].items()},
    )


def parse_table(content: Mapping[str, Any]) -> LookupTable:
    """Return a table from its JSON."""
    texts = {name: str(content[name]) for name in ("name", "unit_x", "unit_y", "interpolation", "ends")}
    x, y = (tuple(map(float, content[name])) for name in ("x", "y"))
    return LookupTable(x=x, y=y, parameters=tuple(map(str, content["parameters"])), **texts)


def read_tables_with(fmu: Path, names: Collection[str], values: Mapping[str, float | str]) -> tuple[LookupTable, ...]:
    """Return the tables of an FMU that depend on parameters of these names, with values of other parameters."""
    tables = [table for table in read_model_data(fmu).tables if {*table.parameters} & {*names}]
    return tuple(replace(table, y=table.y_with(values)) for table in tables)
