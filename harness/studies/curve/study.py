"""Identification of friction over velocity in a record."""

from ...analyses.curve.identification import identify
from ...analyses.curve.plateaus import build_points
from ...errors import SceneError
from ...records.friction_curve import CurveColumns
from ...records.record import Record
from .result import CurveResult


def identify_record(
    record: Record, columns: CurveColumns, mass: float | None, bias: float | None, backlash: float
) -> CurveResult:
    """Identify the friction in a record.

    Parameters
    ----------
    columns : CurveColumns
        Columns of velocity or position and of force or current.
    mass, bias : float or None
        Known mass in kg or moment of inertia in kg.m2, and known constant force, in the units of the record.
    backlash : float
        Distance in m or rad after a reversal that is left out.
    """
    samples = record.curve(columns)
    if backlash and not len(samples.t):
        raise SceneError("backlash has no effect on points without times")
    return CurveResult(**vars(identify(build_points(samples, mass, backlash), bias, mass)))
