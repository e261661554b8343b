"""Measured records from Python: `read_record`."""

from pathlib import Path
from typing import TYPE_CHECKING

from ..arguments import FINITE, PATH, POSITIVE, QUANTITY, TEXT, check_arguments
from .options import check_time_range

if TYPE_CHECKING:
    from ..records.record import Record


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
