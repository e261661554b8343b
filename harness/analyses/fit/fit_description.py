"""Conversion of a fit to its result: estimates, combinations, residuals, remarks, and records that were not fitted."""

from collections.abc import Iterator, Sequence
from math import inf, isfinite, nan

import numpy as np

from ...errors import HarnessError
from ...records.extraction import Samples
from ..estimation.estimate import ColumnResiduals, Estimate
from .fit_problem import FitProblem
from .fit_procedure import RawFit
from .measured_record import MeasuredRecord, correlation_length
from .parameter_fit import ParameterFit, Profile, Validation
from .search import ROUGH
from .uncertainty import INDETERMINATE, Uncertainty, determined_combinations, split_residuals

UNFIT_SHARE, UNFIT_NOISE = 0.1, 2.0  # residuals as a share of the range, and in units of the noise
REST_PARTS, MEAN_SHARE = 20, 0.5  # means of noise over so many parts are smaller than this share of it
INPUT_NOISE_SHARE = 0.3  # share of the residuals that the noise of the inputs makes, from which it is named
SHIFT_SHARE = 0.25  # share of a variance that the error of the inputs adds, from which there is a remark


def describe_fit(
    fmu: str, problem: FitProblem, raw_fit: RawFit, notes: Sequence[str], n_runs: int, seconds: float
) -> ParameterFit:
    """Return the result of a fit: estimates with intervals, combinations, residuals and remarks."""
    z, uncertainty = raw_fit.z, raw_fit.uncertainty
    residuals = split_residuals(problem, uncertainty.residuals)
    columns = column_residuals(problem.records, residuals, problem.outputs)
    predictions = problem.predict(z, problem.all_samples)
    assert predictions is not None
    is_unfit = any(
        column.residual > max(UNFIT_SHARE * column.range, UNFIT_NOISE * column.noise) and not is_rest
        for column, is_rest in zip(columns, find_rests(problem.records, predictions, residuals), strict=True)
    )
    estimates, ambiguous = make_estimates(problem, raw_fit, is_unfit)
    undetermined_indices = [i for i, estimate in enumerate(estimates) if not isfinite(estimate.error)]
    values = np.array([estimate.value for estimate in estimates])
    combinations = (
        () if is_unfit else determined_combinations(problem.unknowns, values, uncertainty, undetermined_indices)
    )
    deviations = np.sqrt(np.diag(uncertainty.covariance))
    remarks = (
        unfit_remark(columns, uncertainty)
        if is_unfit
        else fit_remarks(problem, raw_fit, columns, estimates, ambiguous, undetermined_indices)
    )
    return ParameterFit(
        fmu=fmu,
        estimates=estimates,
        combinations=combinations,
        profiles=() if is_unfit else make_profiles(problem, raw_fit),
        correlation=uncertainty.covariance / np.outer(deviations, deviations),
        columns=columns,
        remarks=(*remarks, *raw_fit.doubts),
        notes=tuple(notes),
        describes_record=not is_unfit,
        squares=uncertainty.squares,
        n_independent=count_independent(problem, uncertainty),
        n_searches=raw_fit.n_searches,
        n_runs=n_runs,
        seconds=seconds,
        log=tuple(raw_fit.log),
        records=tuple(record.fitted_record for record in problem.records),
        predictions=tuple(predictions),
    )


def count_independent(problem: FitProblem, uncertainty: Uncertainty) -> float:
    """Return the number of residuals that count as independent."""
    n = len(uncertainty.residuals)
    if not uncertainty.correlation:
        return float(n)
    return n / max(map(correlation_length, split_residuals(problem, uncertainty.residuals)))


def column_residuals(
    records: Sequence[MeasuredRecord], residuals: Sequence[np.ndarray], outputs: Sequence[str]
) -> tuple[ColumnResiduals, ...]:
    """Return the residuals of every observed column of every record, from those in units of the noise."""
    columns = []
    for record, e in zip(records, residuals, strict=True):
        rms = np.sqrt(np.mean(e**2, axis=0)) * record.noise
        for j, name in enumerate(outputs):
            size = float(np.ptp(record.y[:, j]))
            columns.append(ColumnResiduals(record.name, name, "", float(rms[j]), float(record.noise[j]), size))
    return tuple(columns)


def find_rests(
    records: Sequence[MeasuredRecord], predictions: Sequence[np.ndarray], residuals: Sequence[np.ndarray]
) -> list[bool]:
    """Return for every observed column of every record whether it is at rest, in the fit and in the record.

    The range of such a column is that of its noise, so the residuals cannot be small relative to it. A record is at
    rest if its residuals, even those of coloured noise, average out over its parts; residuals of a drift or of a slip
    that the model lacks do not.
    """
    rests = []
    for record, prediction, e in zip(records, predictions, residuals, strict=True):
        means = np.array([part.mean(axis=0) for part in np.array_split(e, REST_PARTS)])
        averages_out = np.sqrt((means**2).mean(axis=0)) < MEAN_SHARE * np.sqrt((e**2).mean(axis=0))
        rests += [*((np.ptp(prediction, axis=0) < record.noise) & averages_out)]
    return rests


def make_estimates(problem: FitProblem, raw_fit: RawFit, is_unfit: bool) -> tuple[tuple[Estimate, ...], list[str]]:
    """Return the estimates, and the names of those whose intervals hold other minima."""
    z, uncertainty, ambiguous, estimates = raw_fit.z, raw_fit.uncertainty, [], []
    loose = uncertainty.deviations > INDETERMINATE
    for i, unknown in enumerate(problem.unknowns):
        value = unknown.to_value(float(z[i]))
        if is_unfit:
            estimates.append(Estimate(unknown.name, value, nan, nan, nan, unknown.unit, ""))
            continue
        sides = {side: raw_fit.ends[i, side] for side in (-1, 1)}
        for minimum in raw_fit.other_minima:
            for side, end in sides.items():
                if end is not None and (minimum[i] - end) * side > 1e-3 * abs(z[i] - end):
                    sides[side] = float(minimum[i])
                    ambiguous.append(unknown.name)
        low, high = unknown.value_interval(sides[-1], sides[1])
        deviation = unknown.error_of(float(uncertainty.deviations[i]), value)
        if low is None or high is None or loose[i]:
            error = inf
        else:
            error = max(deviation, (high - low) / 2 / uncertainty.quantile)
        ends = -inf if low is None else low, inf if high is None else high
        estimates.append(Estimate(unknown.name, value, error, *ends, unknown.unit, ""))
    return tuple(estimates), [*dict.fromkeys(ambiguous)]


def make_profiles(problem: FitProblem, raw_fit: RawFit) -> tuple[Profile, ...]:
    """Return the profiles of the unknowns, where the squares with each value are finite."""
    profiles = []
    for i, unknown in enumerate(problem.unknowns):
        points = sorted(
            (unknown.to_value(coordinate), excess)
            for coordinate, excess in (
                (float(raw_fit.z[i]), 0.0),
                *raw_fit.profiles.get((i, -1), ()),
                *raw_fit.profiles.get((i, 1), ()),
            )
        )
        profiles.append(Profile(unknown.name, *zip(*points, strict=True)))
    return tuple(profiles)


def unfit_remark(columns: Sequence[ColumnResiduals], uncertainty: Uncertainty) -> list[str]:
    """Return the remark on a fit that does not describe the record, and on what explains its residuals."""
    worst = max(columns, key=lambda column: column.residual / column.range)
    return [
        f"The model does not describe {worst.record}: the best values leave residuals of "
        f"{100 * worst.residual / worst.range:.2g} % of the range of {worst.name}; do not rely on these values.",
        *([f"{uncertainty.dependence.text}."] if uncertainty.dependence else []),
    ]


def describe_cause(problem: FitProblem, uncertainty: Uncertainty) -> str:
    """Return the likely cause of residuals that are not white noise."""
    noisy = {name: share for record in problem.records for name, share in record.noisy_inputs.items()}
    rms = float(np.sqrt(np.mean(uncertainty.residuals**2)))
    if noisy and uncertainty.input_noise > INPUT_NOISE_SHARE * rms:
        inputs = " and ".join(f"the input {name}, {100 * share:.2g} % of its range," for name, share in noisy.items())
        return f"the noise of {inputs} makes residuals of this size; filter it, or sample it faster"
    if uncertainty.dependence:
        return uncertainty.dependence.text
    return "the noise is coloured, or the model lacks an effect"


def fit_remarks(
    problem: FitProblem,
    raw_fit: RawFit,
    columns: Sequence[ColumnResiduals],
    estimates: Sequence[Estimate],
    ambiguous: Sequence[str],
    undetermined_indices: Sequence[int],
) -> list[str]:
    """Return the remarks on a fit."""
    uncertainty, remarks = raw_fit.uncertainty, []
    largest = max(columns, key=lambda column: column.residual / column.noise)
    if uncertainty.correlation or largest.residual > ROUGH * largest.noise:
        remarks.append(
            f"The residuals are not white noise (rms {largest.residual / largest.noise:.2g} times the scatter of "
            f"neighbouring samples, correlation {uncertainty.correlation:.2g}): "
            f"{describe_cause(problem, uncertainty)}. The intervals are widened."
        )
    white = np.diag(uncertainty.covariance)
    shifted_names = [
        estimate.name
        for estimate, shift, variance in zip(estimates, uncertainty.input_shift, white, strict=True)
        if shift**2 > SHIFT_SHARE * variance
    ]
    if shifted_names:
        remarks.append(
            f"The inputs between their samples are uncertain, which affects {', '.join(shifted_names)}: sample them "
            "faster."
        )
    if ambiguous:
        remarks.append(f"Other values fit as well; the intervals of {', '.join(ambiguous)} include them.")
    tails = [estimates[i].name for i in dict.fromkeys(raw_fit.flat_tails) if isfinite(estimates[i].error)]
    if tails:
        remarks.append(
            f"Values of {', '.join(tails)} far outside of their intervals fit nearly as well, because a small part of "
            "the record excludes them: do not rely on these intervals, or take a longer record."
        )
    if undetermined_indices:
        names = ", ".join(estimates[i].name for i in undetermined_indices)
        remarks.append(f"The record does not determine {names}.")
    return remarks


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
        prediction = problem.predict_record(raw_fit.z, record, 0, record.all_samples)
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
    return Validation(columns, tuple(record.fitted_record for record in records), tuple(predictions), remarks)


def prepare_record(problem: FitProblem, raw_fit: RawFit, data: Samples) -> MeasuredRecord:
    """Return a record that is averaged and whose inputs are subdivided as those of the first fitted record."""
    fitted_record = problem.records[0]
    record = MeasuredRecord(fitted_record.simulator, data, fitted_record.width > 1)
    if not record.can_be_averaged(problem.values(raw_fit.z, 0)):
        record = MeasuredRecord(fitted_record.simulator, data, is_averaged=False)
    record.noise = np.where(np.ptp(record.y, axis=0) > 0.0, record.noise, fitted_record.noise)  # of a body at rest
    record.subdivide(fitted_record.subdivision)
    return record


def validation_remarks(
    problem: FitProblem, raw_fit: RawFit, columns: Sequence[ColumnResiduals], residuals: Sequence[np.ndarray]
) -> Iterator[str]:
    """Yield a remark for each column whose residuals are much larger than those of the fitted records.

    If the fit is robust, outliers have no effect on either.
    """
    fitted_rms = [root_mean_squares(e) for e in split_residuals(problem, raw_fit.uncertainty.residuals)]
    limits = WORSE * np.maximum(np.max(fitted_rms, axis=0), 1.0)
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
