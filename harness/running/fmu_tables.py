"""Lookup tables of an FMU, from the file resources/tables.json of FMUs of this project."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from .fmu_archive import cached_by_mtime, read_json_resource

TABLES_FILE = "resources/tables.json"  # fmus/packaging/documentation_page.py writes it
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


@cached_by_mtime
def read_tables(fmu: Path) -> tuple[LookupTable, ...]:
    """Return the tables of an FMU; none for an FMU without the file.

    Raises
    ------
    HarnessError
        If the file is damaged.
    """
    return read_json_resource(fmu, TABLES_FILE, parse_tables) or ()


def read_tables_with(fmu: Path, names: Collection[str], values: Mapping[str, float | str]) -> tuple[LookupTable, ...]:
    """Return the tables of an FMU that depend on parameters of these names, with values of other parameters."""
    tables = [table for table in read_tables(fmu) if {*table.parameters} & {*names}]
    return tuple(replace(table, y=table.y_with(values)) for table in tables)


def parse_tables(content: Sequence[Mapping[str, Any]]) -> tuple[LookupTable, ...]:
    """Return tables from their JSON."""
    return tuple(map(parse_table, content))


def parse_table(content: Mapping[str, Any]) -> LookupTable:
    """Return a table from its JSON."""
    texts = {name: str(content[name]) for name in ("name", "unit_x", "unit_y", "interpolation", "ends")}
    x, y = (tuple(map(float, content[name])) for name in ("x", "y"))
    return LookupTable(x=x, y=y, parameters=tuple(map(str, content["parameters"])), **texts)
