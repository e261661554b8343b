"""Validation of a fit by records that were not fitted."""

from collections.abc import Iterator, Sequence

import numpy as np

from ...errors import HarnessError
from ...records.extraction import Samples
from ..estimation.estimate import ColumnResiduals
from .fit_description import column_residuals
from .fit_problem import FitProblem
from .fit_procedure import RawFit
from .measured_record import MeasuredRecord
from .parameter_fit import Validation
from .uncertainty import split_residuals

WORSE = 2.0  # ratio of the residuals of validation and fitted records from which there is a remark


def validate(problem: FitProblem, raw_fit: RawFit, data: Sequence[Samples]) -> Validation:
    """Predict records that were not fitted with the fitted values.

    Raises
    ------
    HarnessError
        If the FMU refuses the values there.
    """
    records, predictions = [], []
    for record_data in data:
        record = prepare_record(problem, raw_fit, record_data)
        prediction = problem.predict_record(raw_fit.z, record, 0, record.all)
        if prediction is None:
            raise HarnessError(
                f"the FMU refuses the fitted values in the run of the validation record {record_data.name}"
            )
        records.append(record)
        predictions.append(prediction)
    residuals = [
        (prediction - record.y) / record.noise for record, prediction in zip(records, predictions, strict=True)
    ]
    columns = column_residuals(records, residuals, problem.outputs)
    remarks = tuple(validation_remarks(problem, raw_fit, columns, residuals))
    return Validation(columns, tuple(record.fitted for record in records), tuple(predictions), remarks)


def prepare_record(problem: FitProblem, raw_fit: RawFit, data: Samples) -> MeasuredRecord:
    """Return a record that is averaged and whose inputs are subdivided as those of the first fitted record."""
    fitted = problem.records[0]
    record = MeasuredRecord(fitted.simulator, data, fitted.width > 1)
    if not record.can_be_averaged(problem.values(raw_fit.z, 0)):
        record = MeasuredRecord(fitted.simulator, data, binned=False)
    record.noise = np.where(np.ptp(record.y, axis=0) > 0.0, record.noise, fitted.noise)  # of a body at rest
    record.subdivide(fitted.subdivision)
    return record


def validation_remarks(
    problem: FitProblem, raw_fit: RawFit, columns: Sequence[ColumnResiduals], residuals: Sequence[np.ndarray]
) -> Iterator[str]:
    """Yield a remark for each column whose residuals are much larger than those of the fitted records.

    If the fit is robust, outliers have no effect on either.
    """
    fitted = [root_mean_squares(e) for e in split_residuals(problem, raw_fit.uncertainty.residuals)]
    limits = WORSE * np.maximum(np.max(fitted, axis=0), 1.0)
    ratios = np.concatenate([root_mean_squares(problem.limit_outliers(e)) for e in residuals])
    for column, ratio, limit in zip(columns, ratios, np.tile(limits, len(residuals)), strict=True):
        if ratio > limit:
            yield (
                f"The values do not predict {column.name} in {column.record}: its residuals are {ratio:.2g} times the "
                f"noise, and at most {limit / WORSE:.2g} times in the fitted records."
            )


def root_mean_squares(e: np.ndarray) -> np.ndarray:
    """Return the root mean square of each column."""
    return np.asarray(np.sqrt(np.mean(e**2, axis=0)))
