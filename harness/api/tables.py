"""Conversion of DataFrames, trajectories and arrays to the tables that records are read from."""

from typing import TYPE_CHECKING, Any

from ..errors import SceneError

if TYPE_CHECKING:
    import numpy as np

    from ..records.table_files import Table


def convert_to_table(source: Any) -> "Table | None":
    """Return the table in a trajectory or a DataFrame, with units in its headings; None for any other source.

    A DataFrame has its units in ``attrs["units"]``. A named index is a column.

    Raises
    ------
    SceneError
        If a column is not a row of numbers or texts.
    """
    import numpy as np

    from ..results.files import column_heading
    from ..running.trajectory import Trajectory

    if isinstance(source, Trajectory):
        return build_table({"t": source.time, **source.columns}, {"t": "s", **source.units})
    if hasattr(source, "columns"):
        frame = source if source.index.name is None else source.reset_index()
        units = {str(name): str(unit) for name, unit in frame.attrs.get("units", {}).items()}
        columns = {str(name): np.asarray(frame[name]) for name in frame.columns}
        return build_table({column_heading(name, units.get(name, "")): column for name, column in columns.items()}, {})
    return None


def build_table(columns: "dict[str, np.ndarray]", units: dict[str, str]) -> "Table":
    """Return a table of columns (n,) by name; texts are parsed like those in a file."""
    from ..records.table_files import Table
    from ..results.files import column_heading

    cells = []
    for name, column in columns.items():
        if column.ndim != 1 or len(column) != len(next(iter(columns.values()))):
            raise SceneError(f"{name} has the shape {column.shape}: times and samples must be rows of the same length")
        cells.append(column.astype(float) if column.dtype.kind in "fiub" else [str(cell) for cell in column])
    return Table("the record", tuple(column_heading(name, units.get(name, "")) for name in columns), tuple(cells))
