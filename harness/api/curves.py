"""Identification of friction over velocity from Python: `identify_curve`."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..arguments import FINITE, FLAG, NONNEGATIVE, POSITIVE, TEXT, Rule, check_arguments
from .options import check_time_range
from .tables import has_columns, is_pair, record_source, to_record

if TYPE_CHECKING:
    from collections.abc import Mapping

    import pandas
    from numpy.typing import ArrayLike

    from ..records.record import Record
    from ..simulation.trajectory import Trajectory
    from ..studies.curve.result import CurveResult


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
