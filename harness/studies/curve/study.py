"""Study that identifies friction over velocity in a file, and writes the result folder."""

from pathlib import Path

from ...analyses.curve.identification import identify
from ...analyses.curve.plateaus import build_points
from ...errors import SceneError
from ...records.columns import ColumnOptions
from ...records.friction_curve import CurveColumns
from ...records.record import Record, load_record
from ...results import provenance
from ...results.folder import replace_folder
from ...results.registry import find_study
from ...results.summary import write_summary
from .result import CurveResult

STUDY = find_study("curve")


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


def identify_file(
    source: str,
    options: ColumnOptions,
    columns: CurveColumns,
    mass: float | None,
    bias: float | None,
    backlash: float,
    out: Path,
) -> tuple[CurveResult, Path]:
    """Identify the friction in a file, and write the results to out/curve/<name>."""
    record = load_record(source, options)
    folder = out / STUDY.name / record.name
    source_text = provenance.describe_sources(source)
    with replace_folder(folder, STUDY.files, source_text) as new_folder:
        result = identify_record(record, columns, mass, bias, backlash)
        result.write(new_folder)
        files = () if source == "-" else (Path(source),)
        scene = vars(options) | vars(columns) | {"mass": mass, "bias": bias, "backlash": backlash}
        provenance.write_provenance(new_folder, files=files, scene=scene, source=source_text)
        write_summary(new_folder, result.summary())
    return result, folder
