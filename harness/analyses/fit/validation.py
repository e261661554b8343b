"""Validation of a fit: what its values predict for records that were not fitted."""

from collections.abc import Sequence

import numpy as np

from ...errors import HarnessError
from .fit_course import FitCourse
from .fit_description import column_residuals
from .fit_problem import FitProblem
from .measured_record import MeasuredRecord, RecordData
from .parameter_fit import ParameterFit, Validation

WORSE = 2.0  # residuals of a validation record over those of the fitted ones, from which there is a remark


def validate(problem: FitProblem, course: FitCourse, data: Sequence[RecordData]) -> Validation:
    """Return what the fitted values predict for records that were not fitted.

    Raises
    ------
    HarnessError
        If the FMU refuses the values there.
    """
    records, predictions = [], []
    for each in data:
        record = MeasuredRecord(each.name, each.t, each.y, each.inputs, each.sigma, problem.records[0].width > 1)
        record.noise = np.where(record.noise > 0.0, record.noise, problem.records[0].noise)  # of a body at rest
        record.subdivide(problem.records[0].subdivision)
        prediction = problem.predict_record(course.z, record, 0, record.all)
        if prediction is None:
            raise HarnessError(f"the FMU refuses the fitted values in the run of the validation record {each.name}")
        records.append(record)
        predictions.append(prediction)
    residuals = [
        problem.limit_outliers((prediction - record.y) / record.noise)
        for record, prediction in zip(records, predictions, strict=True)
    ]
    return Validation(column_residuals(records, residuals, problem.outputs), tuple(records), tuple(predictions))


def validation_remarks(fit: ParameterFit) -> list[str]:
    """Return a remark for each column that the values predict much worse than they fit the fitted records."""
    remarks, outputs = [], fit.predictions[0].shape[1]
    for i, column in enumerate(fit.validation.columns if fit.validation else ()):
        fitted = max(each.residual / each.noise for each in fit.columns[i % outputs :: outputs])
        ratio = column.residual / column.noise
        if ratio > WORSE * max(fitted, 1.0):
            remarks.append(
                f"The values do not predict {column.name} in {column.record}: its residuals are {ratio:.2g} times the "
                f"noise, and {fitted:.2g} times in the fitted records."
            )
    return remarks
