"""Identification of a decay from Python: `identify_decay`."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..arguments import (
    FINITE,
    FLAG,
    POSITIVE,
    PROGRESS,
    QUANTITY,
    TEXT,
    Progress,
    Rule,
    check_arguments,
    row,
)
from ..errors import SceneError, option_text
from .options import check_time_range, reporter, with_progress_bar
from .tables import RECORD, SIGNAL, has_columns, is_signals, to_record

if TYPE_CHECKING:
    import pandas
    from numpy.typing import ArrayLike

    from ..records.columns import ColumnOptions
    from ..records.record import Record
    from ..simulation.trajectory import Trajectory
    from ..studies.decay.result import DecayResult


SAMPLES = Rule("a row of numbers", row)


@check_arguments(
    record=RECORD,
    x=SAMPLES,
    unit=TEXT,
    quantity=QUANTITY,
    time=TEXT,
    column=TEXT,
    k=POSITIVE,
    mass=POSITIVE,
    pendulum=FLAG,
    drag=FLAG,
    drift=FLAG,
    begin=FINITE,
    end=FINITE,
    rate=POSITIVE,
    progress=PROGRESS,
)
@with_progress_bar
def identify_decay(
    record: "Record | str | Path | pandas.DataFrame | pandas.Series | Mapping[str, ArrayLike] | Trajectory | ArrayLike",
    x: "ArrayLike | None" = None,
    *,
    unit: str | None = None,
    quantity: str | None = None,
    time: str | None = None,
    column: str | None = None,
    k: float | None = None,
    mass: float | None = None,
    pendulum: bool = False,
    drag: bool = True,
    drift: bool = False,
    begin: float | None = None,
    end: float | None = None,
    rate: float | None = None,
    progress: Progress | bool | None = None,
) -> "DecayResult":
    """Identify viscous damping, dry friction and quadratic drag from a free decay.

    Parameters
    ----------
    record : Record, str, path, DataFrame, Series, Dataset, mapping, Trajectory, tuple or array_like
        A record of `read_record`; a file with columns; a table, as a DataFrame, whose index may be the time in s, or a
        mapping; a Series over time in s or time deltas; a trajectory; times and samples, as in ``(t, x)``; or the
        samples (n,), with their `rate`.
    x : array_like, optional
        The samples (n,), if `record` holds their times (n,) in s.
    unit : str, optional
        Unit of the samples, as ``"mm"``, ``"deg/s"`` or ``"g"``, or the size of one count of an encoder, as
        ``"0.36deg"``; required for arrays, otherwise that of the heading.
    quantity : {"position", "velocity", "acceleration"}, optional
        Measured quantity, if it follows neither from the unit nor from the name of the column.
    time, column : str, optional
        Headings of the columns of times and samples, if the table has several.
    k, mass : float, optional
        Stiffness in N/m or mass in kg (N.m/rad or kg.m2 for a rotation). Give one of them to obtain forces in N.
        A Trajectory has the stiffness of its model.
    pendulum : bool
        Whether the restoring torque is k sin(theta).
    drag : bool
        Whether to try laws with quadratic drag, too.
    drift : bool
        Whether the rest position drifts at a constant rate.
    begin, end : float, optional
        Start and end in s of the part of the record to use.
    rate : float, optional
        Sampling rate in Hz, which replaces the times of a file or table, and is required for samples without times.
    progress : callable or False, optional
        Receives the progress from 0 to 1. By default a terminal or a notebook shows a bar after two seconds; False
        switches it off.

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
    from ..analyses.decay.estimates import KnownParameters
    from ..analyses.decay.identification import fit_decay
    from ..records.columns import ColumnOptions
    from ..studies.decay.result import DecayResult
    from ..studies.decay.study import read_parameters

    if k is not None and mass is not None:
        raise SceneError(
            f"{option_text('k')} and {option_text('mass')} are both given: leave one out, because the frequency "
            "determines it"
        )
    check_time_range(time, rate, begin, end)
    columns = ColumnOptions(
        time=time,
        column=column,
        quantity=quantity,
        unit=unit,
        rate=rate,
        begin=begin,
        end=end,
    )
    if x is not None:
        if has_columns(record):
            raise SceneError("x has no effect, because the record has columns: leave it out, or name one by `column`")
        if isinstance(record, tuple):
            raise SceneError("x has no effect, because the record holds times and samples: leave it out")
        record = (record, x)
    for name, heading in (("time", time), ("column", column)) if not has_columns(record) else ():
        if heading is not None:
            raise SceneError(f"{name} = {heading!r} has no effect on arrays, which have no headings: leave it out")
    motion = find_record(record, columns).motion
    parameters = KnownParameters(k, mass, pendulum)
    if hasattr(record, "parameters") and parameters == KnownParameters():  # a Trajectory
        parameters = read_parameters(record)  # type: ignore[arg-type]
    return DecayResult(**vars(fit_decay(motion, parameters, drag, drift, reporter(progress))))


def find_record(source: Any, options: "ColumnOptions") -> "Record":
    """Return the record of a decay."""
    if has_columns(source):
        record = to_record(source, options)
        if is_signals(source) and options.column is None and options.quantity is None:
            if "position" not in source.motion_outputs:
                raise SceneError(f"{source.name} records no position: add it to the outputs, or name a column")
            return replace(record, options=replace(options, column=source.motion_outputs["position"]))
        return record
    if not isinstance(source, tuple) and options.rate is None:
        raise SceneError(
            "x is missing: identify_decay takes a record, a file, a table, times and samples, as in (t, x), or samples "
            "with their rate in Hz"
        )
    if options.unit is None:
        raise SceneError("unit is missing: name the unit of the samples, as in unit='mm'")
    return to_record(source, replace(options, column=SIGNAL))
