"""Measured records from Python: `read_record`, what is identified from them, and `measure` for any arrays."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..arguments import (
    FINITE,
    FLAG,
    NONNEGATIVE,
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
from ..errors import SceneError, option_text
from .options import check_time_range, reporter, with_progress_bar
from .tables import RECORD, SIGNAL, has_columns, is_pair, is_signals, record_source, to_record

if TYPE_CHECKING:
    import numpy as np
    import pandas
    from numpy.typing import ArrayLike

    from ..analyses.motion import MotionMeasures
    from ..records.columns import ColumnOptions
    from ..records.record import Record
    from ..simulation.trajectory import Trajectory
    from ..studies.curve.result import CurveResult
    from ..studies.decay.result import DecayResult


@check_arguments(
    source=PATH,
    time=TEXT,
    column=TEXT,
    quantity=QUANTITY,
    unit=TEXT,
    headings=TEXT,
    rate=POSITIVE,
    begin=FINITE,
    end=FINITE,
)
def read_record(
    source: "str | Path",
    *,
    time: str | None = None,
    column: str | None = None,
    quantity: str | None = None,
    unit: str | None = None,
    headings: str | None = None,
    rate: float | None = None,
    begin: float | None = None,
    end: float | None = None,
) -> "Record":
    """Read a measured record from a file; `identify_decay`, `identify_curve`, `fit` and `compare` take what it returns.

    Parameters
    ----------
    source : str or path
        A table in a text file, a spreadsheet, or a .mat, HDF5, Parquet, .npy, .npz or JSON file.
    time, column : str, optional
        Headings of the columns of times and samples, if the table has several. A unit in the heading of the times
        replaces that of the file, as in ``"Zeit [ms]"``, or ``"n [0.01s]"`` for sample numbers.
    quantity : {"position", "velocity", "acceleration"}, optional
        Measured quantity, if it follows neither from the unit nor from the heading.
    unit : str, optional
        Unit of the samples, as ``"mm"``, if the file lacks it, or the size of one count of an encoder, as
        ``"0.36deg"``.
    headings : str, optional
        Headings of a file without any, separated by commas, as ``"t [s],x [mm]"``.
    rate : float, optional
        Sampling rate in Hz, which replaces the times of the file.
    begin, end : float, optional
        Start and end in s of the part to read.

    Returns
    -------
    Record
        The columns of the file, and how they are read. Its motion has times `t` (n,) in s, samples `x` (n,) in `unit`,
        which is an SI unit, and `notes` on what was assumed and left out.

    Raises
    ------
    SceneError
        If the file holds neither a motion over time nor friction over velocity.

    Examples
    --------
    >>> record = read_record("swing.csv", column="laser [mm]")  # doctest: +SKIP
    >>> record.x.max(), record.unit, record.notes  # doctest: +SKIP
    >>> decay = identify_decay(record, mass=0.35)  # doctest: +SKIP
    """
    from ..records.columns import ColumnOptions
    from ..records.record import load_record

    check_time_range(time, rate, begin, end)
    options = ColumnOptions(time, column, quantity, unit, headings, rate, begin, end)
    record = load_record(str(source), options)
    record.check()
    return record


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
    if is_signals(record) and hasattr(record, "parameters") and parameters == KnownParameters():  # a Trajectory
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


def curve_source(value: Any) -> Any:
    """Return a record: a file by its path, columns as they are, and velocities and forces as rows of numbers."""
    if not has_columns(value) and not is_pair(value):
        raise TypeError
    return record_source(value)


CURVE = Rule(
    "a record, a file, a DataFrame, a mapping of columns, a trajectory, or velocities and forces as in (v, F)",
    curve_source,
)


@check_arguments(
    record=CURVE,
    velocity=TEXT,
    position=TEXT,
    force=TEXT,
    current=TEXT,
    constant=TEXT,
    points=FLAG,
    time=TEXT,
    rate=POSITIVE,
    begin=FINITE,
    end=FINITE,
    mass=POSITIVE,
    bias=FINITE,
    backlash=NONNEGATIVE,
)
def identify_curve(
    record: "Record | str | Path | pandas.DataFrame | Mapping[str, ArrayLike] | Trajectory | tuple[ArrayLike, ...]",
    *,
    velocity: str | None = None,
    position: str | None = None,
    force: str | None = None,
    current: str | None = None,
    constant: str | None = None,
    points: bool = False,
    time: str | None = None,
    rate: float | None = None,
    begin: float | None = None,
    end: float | None = None,
    mass: float | None = None,
    bias: float | None = None,
    backlash: float = 0.0,
) -> "CurveResult":
    """Identify friction over velocity from measured points, or from a record over time.

    Parameters
    ----------
    record : Record, str, path, DataFrame, mapping, Trajectory or tuple
        A record of `read_record`; a file with columns; a table, as a DataFrame or a mapping, with units in its headings
        as in ``"v [mm/s]"``; or velocities (n,) in m/s and forces (n,) in N. A table with a column of times is a record
        over time.
    velocity, position : str, optional
        Heading of the velocity, or of the position in a record over time; ``"v [mm/s]"`` sets the unit as well.
    force, current : str, optional
        Heading of the force or torque, or of the current of the motor.
    constant : str, optional
        Force or torque per current, with its unit, as ``"0.12 N.m/A"``.
    points : bool
        Whether each row is a point, even if the table has times.
    time : str, optional
        Heading of the times.
    rate : float, optional
        Sampling rate in Hz, which replaces the times.
    begin, end : float, optional
        Start and end in s of the part of a record over time to use.
    mass : float, optional
        Mass in kg, or moment of inertia in kg.m2, by which inertia is removed from a record over time.
    bias : float, optional
        Known constant force in N or N.m, such as gravity; by default it is identified from both directions.
    backlash : float
        Distance in m or rad after a reversal that is left out of a record over time.

    Returns
    -------
    CurveResult
        Constants of the best law with 95 % intervals (`estimates`), all laws with their BIC (`laws`), points that do
        not fit (`used`), values for models (`models`) and the curve as a table (`table()`).

    Raises
    ------
    SceneError
        If the record cannot be read, or its points do not suffice.
    HarnessError
        If the force is no friction.

    References
    ----------
    B. Armstrong-Helouvry, P. Dupont, C. Canudas de Wit, Automatica 30 (1994) 1083-1138.

    Examples
    --------
    >>> v = [-0.3, -0.1, -0.03, -0.01, 0.01, 0.03, 0.1, 0.3]
    >>> F = [-1.91, -1.49, -1.36, -1.32, 1.32, 1.35, 1.52, 1.9]
    >>> curve = identify_curve((v, F), bias=0.0)
    >>> curve.best.name, round(curve["F_c"].value, 2), round(curve["F_v"].value, 1)
    ('viscous', 1.3, 2.0)
    """
    from ..records.columns import ColumnOptions
    from ..records.friction_curve import CurveColumns
    from ..studies.curve.study import identify_record

    check_time_range(time, rate, begin, end)
    options = ColumnOptions(time=time, rate=rate, begin=begin, end=end)
    if isinstance(record, tuple):
        record = dict(zip(("v [m/s]", "F [N]"), record, strict=True))
    columns = CurveColumns(velocity, position, force, current, constant, points)
    return identify_record(to_record(record, options, needs_times=False), columns, mass, bias, backlash)


@check_arguments(unit=TEXT)
def measure(t: "ArrayLike", x: "ArrayLike", v: "ArrayLike | None" = None, *, unit: str = "m") -> "MotionMeasures":
    """Measure peaks, decrements, rests, slips and steps of a motion, such as the arrays of your own solver.

    Parameters
    ----------
    t : array_like
        Times (n,) in s, which do not fall.
    x : array_like
        Positions (n,).
    v : array_like, optional
        Velocities (n,); by default the differences of the positions, which cannot show whether a body rests exactly.
    unit : str
        Unit of the positions.

    Returns
    -------
    MotionMeasures
        The turning points, the rests, and a table of numbers; `print` shows it.

    Raises
    ------
    SceneError
        If an array is not a row of finite numbers of the same length, or nothing moves.

    Examples
    --------
    >>> from math import pi
    >>> import numpy as np
    >>> t = np.linspace(0.1, 2.1, 201)
    >>> measure(t, np.cos(2.0 * pi * t), -2.0 * pi * np.sin(2.0 * pi * t))["turning_points"]
    4
    """
    import numpy as np

    from ..analyses.motion import measure_motion

    times, positions = read_row("t", t), read_row("x", x)
    velocities = None if v is None else read_row("v", v)
    for name, values in (("x", positions), ("v", velocities)):
        if values is not None and len(values) != len(times):
            raise SceneError(f"{name} has {len(values)} values and t has {len(times)}: give arrays of the same length")
    if (np.diff(times) < 0).any():
        raise SceneError("t falls: sort the samples by time")
    last = np.append(np.diff(times) > 0, True)  # of several samples of one time
    times, positions = times[last], positions[last]
    if len(times) < 3:
        raise SceneError(f"t has {len(times)} different times: give at least 3 samples")
    velocities = np.gradient(positions, times) if velocities is None else velocities[last]
    if not velocities.any():
        raise SceneError("nothing moves: all velocities are 0")
    return measure_motion(times, positions, velocities, unit)


def read_row(name: str, values: "ArrayLike") -> "np.ndarray":
    """Return a row of finite numbers; raise SceneError if the values are none."""
    import numpy as np

    try:
        numbers = np.asarray(values, dtype=float)
    except (TypeError, ValueError, OverflowError):
        raise SceneError(f"{name} must be a row of finite numbers") from None
    if numbers.ndim != 1 or not np.isfinite(numbers).all():
        raise SceneError(f"{name} must be a row of finite numbers")
    return numbers
