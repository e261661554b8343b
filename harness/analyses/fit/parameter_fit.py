"""Fit of the parameters of an FMU to measured records: search, refinement, intervals and remarks."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import inf, isfinite, nan

import numpy as np

from ...errors import HarnessError
from ..estimation.estimate import Estimate
from .combinations import determined_combinations
from .fit_problem import FitProblem, Selection
from .measured_record import MeasuredRecord, Simulate
from .profile_likelihood import profile_bound
from .search import DISTINCT, ROUGH, Minimum, distinct, search
from .uncertainty import INDETERMINATE, Uncertainty, estimate_uncertainty, split_residuals
from .unknowns import Unknown

MIN_REDUCTION = 30.0  # of the squares of a constant, in variances of the residuals and for each unknown
MOTION = 2.0  # rms of a record that moves, in units of its noise
UNFIT_SHARE, UNFIT_NOISE = 0.1, 2.0  # residuals as a share of the range, and in units of the noise
MAX_SUBDIVISION = 32  # of the intervals between samples of inputs
INPUT_CHANGE = 0.1  # of the noise, at which a finer subdivision is not needed
SPLINE_RATIO = 15.0  # differences of splines through half of the samples, in errors of that through all
SHIFTED = 0.25  # share of a variance that the error of the inputs adds before it is remarked
MAX_THIN, THIN = 3000, 2000  # samples above which a search uses fewer, and their number
DRAWS, MAX_RIVALS, DRAW_SIZE = 24, 8, 0.3  # starts for rival minima
ROUNDS = 6  # restarts from better minima


@dataclass(frozen=True)
class ColumnResiduals:
    """Residuals of one observed column: root mean square, noise of the record, and range, in the unit of the FMU."""

    record: str
    name: str
    unit: str
    residual: float
    noise: float
    range: float


@dataclass(frozen=True)
class ParameterFit:
    """Parameters of an FMU that were fitted to measured records.

    Attributes
    ----------
    fmu : str
        Name of the FMU.
    estimates : tuple of Estimate
        Value, standard error and 95 % interval of each unknown; an infinite end where the record sets no bound.
    combinations : tuple of Estimate
        Combinations that the record determines, of parameters that it does not.
    correlation : numpy.ndarray
        Correlation (k, k) of the estimates.
    columns : tuple of ColumnResiduals
    remarks : tuple of str
        Sentences about doubtful results.
    notes : tuple of str
        Assumptions made when reading the records.
    describes_record : bool
        Whether the residuals are small enough to rely on the values.
    bic : float
        Bayesian information criterion, for comparisons of fits to the same records.
    n_searches, n_runs : int
    seconds : float
        Processor time.
    log : tuple of str
        Course of the search.
    records : tuple of MeasuredRecord
    predictions : tuple of numpy.ndarray
        Fitted signals (n, columns) of each record at its times.
    """

    fmu: str
    estimates: tuple[Estimate, ...]
    combinations: tuple[Estimate, ...]
    correlation: np.ndarray
    columns: tuple[ColumnResiduals, ...]
    remarks: tuple[str, ...]
    notes: tuple[str, ...]
    describes_record: bool
    bic: float
    n_searches: int
    n_runs: int
    seconds: float
    log: tuple[str, ...]
    records: tuple[MeasuredRecord, ...]
    predictions: tuple[np.ndarray, ...]

    @property
    def values(self) -> dict[str, float]:
        """Return the fitted values by name."""
        return {estimate.name: estimate.value for estimate in self.estimates}

    def __getitem__(self, name: str) -> Estimate:
        """Return the estimate of an unknown or of a combination."""
        return next(each for each in (*self.estimates, *self.combinations) if each.name == name)

    @property
    def undetermined(self) -> tuple[str, ...]:
        """Return the names of the unknowns that the records do not determine."""
        return tuple(estimate.name for estimate in self.estimates if not isfinite(estimate.error))


@dataclass(frozen=True)
class RecordData:
    """A record in the units of the FMU: times (n,) in s, observed columns (n, columns), inputs (n,) by name, and the
    standard deviation of the noise of each column, if it is known."""

    name: str
    t: np.ndarray
    y: np.ndarray
    inputs: Mapping[str, np.ndarray]
    sigma: tuple[float | None, ...]


@dataclass
class FitCourse:
    """Intermediate results of a fit."""

    z: np.ndarray
    uncertainty: Uncertainty
    ends: dict[tuple[int, int], float | None]
    rivals: list[np.ndarray]
    doubts: list[str]
    log: list[str]
    n_searches: int


def fit_records(
    simulate: Simulate,
    data: Sequence[RecordData],
    outputs: Sequence[str],
    unknowns: Sequence[Unknown],
    fixed: Mapping[str, float],
    robust: bool,
    report: Callable[[float], None],
) -> tuple[FitProblem, FitCourse]:
    """Fit the unknowns; long records are fitted as means of neighbouring samples where that changes nothing.

    Raises
    ------
    HarnessError
        If a record shows no motion or the FMU refuses all values.
    """
    for each in data:
        if not np.ptp(each.y, axis=0).all():
            raise HarnessError(f"{each.name} shows no motion in a column: nothing can be determined from it")
    warm: np.ndarray | None = None
    for binned in (True, False):
        records = [MeasuredRecord(each.name, each.t, each.y, each.inputs, each.sigma, binned) for each in data]
        problem = FitProblem(simulate, records, outputs, unknowns, fixed, robust)
        course = find_course(problem, warm, any(any(each.sigma) for each in data), report)
        values = [problem.values(course.z, i) for i in range(len(records))]
        if all(record.means_hold(simulate, each, outputs) for record, each in zip(records, values, strict=True)):
            break
        warm = course.z
    return problem, course


def find_course(
    problem: FitProblem, warm: np.ndarray | None, noise_is_known: bool, report: Callable[[float], None]
) -> FitCourse:
    """Search, refine and find intervals; start again wherever a better minimum appears."""
    starts = starting_points(problem, warm)
    thin = thin_selection(problem)
    result = search(problem, thin, starts, lambda share: report(0.5 * share))
    if result.best is None:
        raise HarnessError("the FMU refuses all values that were tried: give other ranges, as in --free k=10:1000")
    doubts = []
    if not result.is_agreed:
        doubts.append(
            f"Only one of {result.n_searches} searches ended at these values: narrow the ranges, or give start values."
        )
    z, input_error = result.best[1], subdivide_inputs(problem, result.best[1])
    ends: dict[tuple[int, int], float | None] = {}
    rivals: list[Minimum] = []
    sides = [(i, side) for i in range(len(z)) for side in (-1, 1)]
    for _ in range(ROUNDS):
        squares, z = problem.minimize(z, problem.all, 30, 1e-9, central=True)
        check_motion(problem, squares)
        uncertainty = estimate_uncertainty(problem, z, input_error, float(noise_is_known))
        report(0.6)
        rivals = find_rivals(problem, z, uncertainty, result.minima, squares)
        if rivals and rivals[0][0] < squares - 0.1 * uncertainty.variance:
            z = rivals[0][1]
            continue
        ends, better = {}, None
        for n, (i, side) in enumerate(sides):
            report(0.7 + 0.3 * n / len(sides))
            bound = profile_bound(problem, z, uncertainty, i, side)
            ends[i, side], better = bound.end, bound.better
            if better is not None:
                z = better
                break
        if better is None:
            break
    else:
        doubts.append("The sum of squares has many shallow minima here: the values may lie anywhere in the intervals.")
        wide = uncertainty.quantile * uncertainty.deviations
        ends = {(i, side): float(z[i] + side * wide[i]) for i, side in sides}
    others = [there for _, there in rivals if np.abs(there - z).max() > DISTINCT]
    extend_ends(problem, z, uncertainty, ends, others)
    return FitCourse(z, uncertainty, ends, others, doubts, result.log, result.n_searches)


def starting_points(problem: FitProblem, warm: np.ndarray | None) -> np.ndarray:
    """Return the coordinates (m, k) of given start values and of an earlier fit."""
    middle = (problem.low + problem.high) / 2
    given = [
        middle[i] if unknown.start is None else unknown.to_coordinate(unknown.start)
        for i, unknown in enumerate(problem.unknowns)
    ]
    has_start = any(unknown.start is not None for unknown in problem.unknowns)
    starts = ([np.array(given)] if has_start else []) + ([] if warm is None else [warm])
    return np.array(starts).reshape(len(starts), len(problem.unknowns))


def thin_selection(problem: FitProblem) -> Selection:
    """Return all samples of short records and evenly spaced ones of long records."""
    return tuple(
        index if len(index) < MAX_THIN else np.unique(np.linspace(0, len(index) - 1, THIN).astype(int))
        for index in problem.all
    )


def check_motion(problem: FitProblem, squares: float) -> None:
    """Raise HarnessError if the records show no motion, or the fit describes them hardly better than a constant."""
    constant = sum(float(np.sum(((r.y - r.y.mean(axis=0)) / r.noise) ** 2)) for r in problem.records)
    variance = squares / max(problem.n_samples - len(problem.unknowns), 1)
    if problem.robust or constant - squares > MIN_REDUCTION * variance * len(problem.unknowns):
        return
    names = ", ".join(record.name for record in problem.records)
    if constant < MOTION**2 * problem.n_samples:
        raise HarnessError(f"{names} shows no motion beyond its noise: nothing can be determined from it")
    raise HarnessError(
        f"no values describe {names} better than a constant does: check the model, the observed columns and the ranges"
    )


def subdivide_inputs(problem: FitProblem, z: np.ndarray) -> np.ndarray:
    """Divide the intervals between samples until inputs that are constant in each part are fine enough.

    Returns
    -------
    numpy.ndarray
        Changes (n,) of the residuals by the error of the splines through the samples of the inputs.
    """
    none = np.zeros(problem.n_samples)
    if not any(record.inputs for record in problem.records):
        return none
    before = problem.residuals(z, problem.all)
    parts = 1
    while parts < MAX_SUBDIVISION:
        parts *= 2
        for record in problem.records:
            record.subdivide(parts)
        now = problem.residuals(z, problem.all)
        is_fine = before is not None and now is not None and np.abs(now - before).max() < INPUT_CHANGE
        before = now
        if is_fine:
            break
    for record in problem.records:
        record.subdivide(parts, every=2)
    coarse = problem.residuals(z, problem.all)
    for record in problem.records:
        record.subdivide(parts)
    return none if coarse is None or before is None else (coarse - before) / SPLINE_RATIO


def find_rivals(
    problem: FitProblem, z: np.ndarray, uncertainty: Uncertainty, minima: list[Minimum], squares: float
) -> list[Minimum]:
    """Return minima about as low as that at z (k,), found from those of the search and from draws around z."""
    limit, random = (
        uncertainty.variance * uncertainty.inflation.max() * uncertainty.quantile**2,
        np.random.default_rng(0),
    )
    starts = [there for value, there in distinct(minima, MAX_RIVALS) if value < squares + 3 * limit]
    eigenvalues, axes = np.linalg.eigh(uncertainty.covariance * uncertainty.inflation.mean())
    reach = 2 * np.minimum(np.sqrt(np.maximum(eigenvalues, 0.0)), DRAW_SIZE)
    starts += [z + axes @ (reach * random.normal(size=len(z))) for _ in range(DRAWS)]
    found = [problem.minimize(start, problem.all, 25 if problem.central else 12, 1e-6) for start in starts]
    return distinct([each for each in found if each[0] < squares + limit], len(found))


def extend_ends(
    problem: FitProblem,
    z: np.ndarray,
    uncertainty: Uncertainty,
    ends: dict[tuple[int, int], float | None],
    rivals: list[np.ndarray],
) -> None:
    """Follow the profile on from the rival that lies farthest out, if it lies where an interval ends or beyond."""
    for (i, side), end in ends.items():
        farthest = max(rivals, key=lambda there: side * float(there[i]), default=z)
        if end is not None and side * (farthest[i] - z[i]) > 0.5 * abs(end - z[i]):
            other = profile_bound(problem, farthest, uncertainty, i, side).end
            ends[i, side] = None if other is None else side * max(side * other, side * end)


def describe_fit(
    fmu: str, problem: FitProblem, course: FitCourse, notes: Sequence[str], n_runs: int, seconds: float
) -> ParameterFit:
    """Return the result of a fit: estimates with intervals, combinations, residuals and remarks."""
    z, uncertainty = course.z, course.uncertainty
    columns = column_residuals(problem, uncertainty)
    is_unfit = any(each.residual > max(UNFIT_SHARE * each.range, UNFIT_NOISE * each.noise) for each in columns)
    estimates, several = make_estimates(problem, course, is_unfit)
    undetermined = [i for i, estimate in enumerate(estimates) if not isfinite(estimate.error)]
    values = np.array([estimate.value for estimate in estimates])
    combinations = () if is_unfit else determined_combinations(problem.unknowns, values, uncertainty, undetermined)
    deviations = np.sqrt(np.diag(uncertainty.covariance))
    n, squares = len(uncertainty.residuals), uncertainty.squares
    remarks = (
        unfit_remark(columns) if is_unfit else fit_remarks(problem, course, columns, estimates, several, undetermined)
    )
    predictions = problem.predict(z, problem.all)
    assert predictions is not None
    return ParameterFit(
        fmu=fmu,
        estimates=estimates,
        combinations=combinations,
        correlation=uncertainty.covariance / np.outer(deviations, deviations),
        columns=columns,
        remarks=(*remarks, *course.doubts),
        notes=tuple(notes),
        describes_record=not is_unfit,
        bic=float(n * np.log(max(squares, 1e-300) / n) + len(z) * np.log(n)),
        n_searches=course.n_searches,
        n_runs=n_runs,
        seconds=seconds,
        log=tuple(course.log),
        records=problem.records,
        predictions=tuple(predictions),
    )


def column_residuals(problem: FitProblem, uncertainty: Uncertainty) -> tuple[ColumnResiduals, ...]:
    """Return the residuals of every observed column of every record."""
    found = []
    for record, e in zip(problem.records, split_residuals(problem, uncertainty.residuals), strict=True):
        rms = np.sqrt(np.mean(e**2, axis=0)) * record.noise
        for j, name in enumerate(problem.outputs):
            size = float(np.ptp(record.y[:, j]))
            found.append(ColumnResiduals(record.name, name, "", float(rms[j]), float(record.noise[j]), size))
    return tuple(found)


def make_estimates(problem: FitProblem, course: FitCourse, is_unfit: bool) -> tuple[tuple[Estimate, ...], list[str]]:
    """Return the estimates, and the names of those whose intervals hold other minima."""
    z, uncertainty, several, estimates = course.z, course.uncertainty, [], []
    loose = uncertainty.deviations > INDETERMINATE
    for i, unknown in enumerate(problem.unknowns):
        value = unknown.to_value(float(z[i]))
        if is_unfit:
            estimates.append(Estimate(unknown.name, value, nan, nan, nan, unknown.unit, ""))
            continue
        sides = {side: course.ends[i, side] for side in (-1, 1)}
        for rival in course.rivals:
            for side, end in sides.items():
                if end is not None and (rival[i] - end) * side > 1e-3 * abs(z[i] - end):
                    sides[side] = float(rival[i])
                    several.append(unknown.name)
        low, high = unknown.value_interval(sides[-1], sides[1])
        deviation = unknown.error_of(float(uncertainty.deviations[i]), value)
        if low is None or high is None or loose[i]:
            error = inf
        else:
            error = max(deviation, (high - low) / 2 / uncertainty.quantile)
        ends = -inf if low is None else low, inf if high is None else high
        estimates.append(Estimate(unknown.name, value, error, *ends, unknown.unit, ""))
    return tuple(estimates), [*dict.fromkeys(several)]


def unfit_remark(columns: Sequence[ColumnResiduals]) -> list[str]:
    """Return the remark on a fit that does not describe the record."""
    worst = max(columns, key=lambda each: each.residual / each.range)
    return [
        f"The model does not describe {worst.record}: the best values leave residuals of "
        f"{100 * worst.residual / worst.range:.2g} % of the range of {worst.name}; do not rely on these values."
    ]


def fit_remarks(
    problem: FitProblem,
    course: FitCourse,
    columns: Sequence[ColumnResiduals],
    estimates: Sequence[Estimate],
    several: Sequence[str],
    undetermined: Sequence[int],
) -> list[str]:
    """Return the remarks on a fit."""
    uncertainty, remarks = course.uncertainty, []
    largest = max(columns, key=lambda each: each.residual / each.noise)
    if uncertainty.correlation or largest.residual > ROUGH * largest.noise:
        remarks.append(
            f"The residuals are not white noise (rms {largest.residual / largest.noise:.2g} times the scatter of "
            f"neighbouring samples, correlation {uncertainty.correlation:.2g}): the noise is coloured, or the model "
            "lacks an effect. The intervals are widened."
        )
    white = np.diag(uncertainty.covariance)
    shifted = [
        estimate.name
        for estimate, shift, variance in zip(estimates, uncertainty.input_shift, white, strict=True)
        if shift**2 > SHIFTED * variance
    ]
    if shifted:
        remarks.append(
            f"The inputs between their samples are uncertain, which affects {', '.join(shifted)}: sample them faster."
        )
    if several:
        remarks.append(f"Other values fit as well; the intervals of {', '.join(several)} include them.")
    if undetermined:
        names = ", ".join(estimates[i].name for i in undetermined)
        remarks.append(f"The record does not determine {names}.")
    return remarks
