"""Identification of a decay from Python: `identify_decay`."""

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..arguments import (
    FINITE,
    FLAG,
    PATH,
    POSITIVE,
    PROGRESS,
    QUANTITY,
    TEXT,
    Progress,
    Rule,
    check_arguments,
    row,
)
from ..errors import SceneError
from .options import QUIET, check_time_range
from .tables import build_table, convert_to_table

if TYPE_CHECKING:
    import pandas
    from numpy.typing import ArrayLike

    from ..records.record import Record
    from ..running.trajectory import Trajectory
    from ..studies.decay.result import DecayResult


def record_source(value: Any) -> Any:
    """Return a file, a table, a trajectory, or times as a row of numbers."""
    from ..running.trajectory import Trajectory

    if isinstance(value, str | Path):
        return PATH.convert(value)
    return value if isinstance(value, Trajectory) or hasattr(value, "columns") else row(value)


RECORD = Rule("a file, a DataFrame, a trajectory, or a row of times in s", record_source)
SAMPLES = Rule("a row of numbers", row)


@check_arguments(
    record=RECORD,
    x=SAMPLES,
    unit=TEXT,
    quantity=QUANTITY,
    time=TEXT,
    column=TEXT,
    k=POSITIVE,
    m=POSITIVE,
    pendulum=FLAG,
    drag=FLAG,
    drift=FLAG,
    begin=FINITE,
    end=FINITE,
    rate=POSITIVE,
    progress=PROGRESS,
)
def identify_decay(
    record: "str | Path | pandas.DataFrame | Trajectory | ArrayLike",
    x: "ArrayLike | None" = None,
    *,
    unit: str | None = None,
    quantity: str | None = None,
    time: str | None = None,
    column: str | None = None,
    k: float | None = None,
    m: float | None = None,
    pendulum: bool = False,
    drag: bool = True,
    drift: bool = False,
    begin: float | None = None,
    end: float | None = None,
    rate: float | None = None,
    progress: Progress | None = None,
) -> "DecayResult":
    """Identify viscous damping, dry friction and quadratic drag from a free decay.

    Parameters
    ----------
    record : str, path, DataFrame, Trajectory or array_like
        A file with columns, a table, a trajectory, or the times (n,) in s of the samples `x`.
    x : array_like, optional
        The samples (n,), if `record` holds their times.
    unit : str, optional
        Unit of the samples, as ``"mm"``, ``"deg/s"`` or ``"g"``; required for arrays, otherwise that of the heading.
    quantity : {"position", "velocity", "acceleration"}, optional
        Measured quantity, if it follows neither from the unit nor from the name of the column.
    time, column : str, optional
        Headings of the columns of times and samples, if the table has several.
    k, m : float, optional
        Stiffness in N/m or mass in kg (N.m/rad or kg.m2 for a rotation). Give one of them to obtain forces in N.
    pendulum : bool
        Whether the restoring torque is k sin(theta).
    drag : bool
        Whether to try laws with quadratic drag, too.
    drift : bool
        Whether the rest position drifts at a constant rate.
    begin, end : float, optional
        Start and end in s of the part of the record to use.
    rate : float, optional
        Sampling rate in Hz, which replaces the times of a file or table.
    progress : callable, optional
        Receives the progress from 0 to 1.

    Returns
    -------
    DecayResult
        Estimates with 95 % intervals (`estimates`), the fitted laws and remarks.

    Raises
    ------
    SceneError
        If the record cannot be read.
    HarnessError
        If the record is not the free decay of one oscillator.

    References
    ----------
    J. W. Liang, B. F. Feeny, Nonlinear Dynamics 16 (1998) 337-347.
    """
    from math import inf

    from ..analyses.decay.estimates import KnownParameters
    from ..analyses.decay.identification import fit_decay
    from ..records.columns import ColumnOptions, read_record
    from ..running.trajectory import Trajectory
    from ..studies.decay.result import DecayResult

    if k is not None and m is not None:
        raise SceneError("k and m are both given: leave one out, because the frequency determines it")
    check_time_range(time, rate, begin, end)
    columns = ColumnOptions(
        time=time,
        position=column,
        quantity=quantity,
        unit=unit,
        rate=rate,
        begin=-inf if begin is None else begin,
        end=inf if end is None else end,
    )
    is_table = isinstance(record, str | Path | Trajectory) or hasattr(record, "columns")
    if is_table and x is not None:
        raise SceneError("x has no effect, because the record has columns: leave it out, or name one by `column`")
    for name, heading in (("time", time), ("column", column)) if not is_table else ():
        if heading is not None:
            raise SceneError(f"{name} = {heading!r} has no effect on arrays, which have no headings: leave it out")
    if isinstance(record, str | Path):
        source = str(record)
        loaded = read_record(source, columns, Path(source).stem)
    else:
        loaded = to_record(record, x, columns)
    return DecayResult(**vars(fit_decay(loaded, KnownParameters(k, m, pendulum), drag, drift, progress or QUIET)))


def to_record(source: Any, x: Any, columns: Any) -> "Record":
    """Return the record in a DataFrame, a trajectory or two arrays."""
    import numpy as np

    from ..records.columns import parse_record
    from ..running.trajectory import Trajectory

    name, table = "the record", convert_to_table(source)
    if isinstance(source, Trajectory):
        name = source.spec.model
        if columns.position is None and columns.quantity is None:
            if "position" not in source.spec.motion_outputs:
                raise SceneError(f"{name} records no position: add it to the outputs, or name a column")
            columns = replace(columns, position=source.spec.motion_outputs["position"])
    elif table is None:
        if x is None:
            raise SceneError("x is missing: identify_decay takes a file, a table, or times and samples, as in (t, x)")
        if columns.unit is None:
            raise SceneError("unit is missing: name the unit of the samples, as in unit='mm'")
        table = build_table({"t": np.asarray(source), "signal": np.asarray(x)}, {"t": "s"})
        columns = replace(columns, position="signal")
    assert table is not None
    return parse_record(replace(table, name=name), columns, name)
