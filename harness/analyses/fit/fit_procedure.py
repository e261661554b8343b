"""Procedure of a fit: search, refinement, other minima and intervals."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ...errors import HarnessError, SceneError, option_text
from ...records.extraction import Samples
from ...simulation.derivative_runs import DerivativeRuns
from ...simulation.whole_run import Simulator
from .fit_problem import FitProblem, Selection
from .measured_record import MeasuredRecord
from .profile_likelihood import profile_bound, search_bound
from .search import DISTINCT, Minimum, search, select_distinct
from .uncertainty import Uncertainty, estimate_uncertainty
from .unknowns import Unknown

MIN_SIGMA, MAX_SIGMA = 1e-50, 1e50  # of the range of the samples; squares of residuals are finite
MIN_REDUCTION = 30.0  # of the squares of a constant, in variances of the residuals and for each unknown
MOTION = 2.0  # rms of a record that moves, in units of its noise
MAX_SUBDIVISION = 32  # of the intervals between samples of inputs
INPUT_CHANGE = 0.1  # of the noise, at which a finer subdivision is not needed
SPLINE_RATIO = 15.0  # differences of splines through half of the samples, in errors of that through all
MAX_THIN, THIN = 3000, 2000  # samples above which a search uses fewer, and their number
DRAWS, MAX_OTHER_MINIMA, DRAW_SIZE = 24, 8, 0.3  # starts for other minima
COARSE_SAMPLES = 500  # of each record, used for the first search for other minima
ROUNDS = 6  # starts, all but the first from better minima
MAX_AVERAGING_SHIFT = 0.2  # of the values, in standard errors, by the means of neighbouring samples
SHALLOW = 0.1  # variances of the residuals by which a minimum must be lower to count as better


@dataclass
class RawFit:
    """Fit in the coordinates of the unknowns, before `describe_fit` converts it to their values.

    Attributes
    ----------
    z : numpy.ndarray
        Coordinates (k,) of the minimum.
    uncertainty : Uncertainty
        Uncertainty of these coordinates.
    ends : dict
        End of the 95 % interval by index of the unknown and side (-1 or 1); None if there is none.
    profiles : dict
        Coordinates and excess of the squares along each profile, by index of the unknown and side.
    flat_tails : list of int
        Indices of the unknowns of which values far outside of the interval fit nearly as well.
    other_minima : list of numpy.ndarray
        Coordinates (k,) of minima that are about as low.
    doubts : list of str
        Remarks on the search.
    log : list of str
        A line for each search.
    n_searches : int
        Number of searches.
    """

    z: np.ndarray
    uncertainty: Uncertainty
    ends: dict[tuple[int, int], float | None]
    profiles: dict[tuple[int, int], tuple[tuple[float, float], ...]]
    flat_tails: list[int]
    other_minima: list[np.ndarray]
    doubts: list[str]
    log: list[str]
    n_searches: int


def fit_records(
    simulator: Simulator,
    data: Sequence[Samples],
    unknowns: Sequence[Unknown],
    fixed_values: Mapping[str, float],
    robust: bool,
    report: Callable[[float], None],
    averages: bool = True,
    derivatives: DerivativeRuns | None = None,
) -> tuple[FitProblem, RawFit]:
    """Fit the unknowns.

    Parameters
    ----------
    averages : bool
        Whether long records are fitted as means of neighbouring samples, if these are the signal at their mean times.
    derivatives : DerivativeRuns, optional
        Runs with derivatives.

    Raises
    ------
    HarnessError
        If a record shows no motion or the FMU refuses all values.
    """
    for record_data in data:
        sizes = np.ptp(record_data.y, axis=0)
        if not sizes.all():
            raise HarnessError(f"{record_data.name} shows no motion in a column: nothing can be determined from it")
        for name, size in zip(record_data.columns, sizes.tolist(), strict=True):
            smallest, largest = MIN_SIGMA * size, MAX_SIGMA * size
            if not smallest <= record_data.sigma.get(name, size) <= largest:
                raise SceneError(
                    f"sigma of {name} is {record_data.sigma[name]!r}, and the samples of {record_data.name} span "
                    f"{size:.3g}: give the standard deviation of the noise, from {smallest:.3g} to {largest:.3g}"
                )
    warm_start: np.ndarray | None = None
    for is_averaged in (True, False) if averages else (False,):
        records = [MeasuredRecord(simulator, record_data, is_averaged) for record_data in data]
        problem = FitProblem(records, simulator.spec.outputs, unknowns, fixed_values, robust, derivatives)
        raw_fit = search_and_refine(problem, warm_start, any(record_data.sigma for record_data in data), report)
        if is_averaging_negligible(problem, raw_fit):
            break
        warm_start = raw_fit.z
    return problem, raw_fit


def is_averaging_negligible(problem: FitProblem, raw_fit: RawFit) -> bool:
    """Return whether a fit of means of neighbouring samples has nearly the values of a fit of all samples.

    The scatter of the record decides, and not a noise that the user states: it moves no values.
    """
    z, uncertainty, errors = raw_fit.z, raw_fit.uncertainty, []
    for i, record in enumerate(problem.records):
        record_errors = record.averaging_errors(problem.values(z, i))
        if record_errors is None or not record.is_averaging_error_small(record_errors):
            return False
        errors.append(record_errors.ravel())
    if not any(map(np.any, errors)):
        return True  # nothing was averaged
    jacobian = problem.jacobian(z, uncertainty.residuals, problem.all_samples, np.arange(len(z)), central=True)
    shift = np.linalg.lstsq(jacobian, np.concatenate(errors), rcond=None)[0]
    residual_variance = uncertainty.squares / max(len(uncertainty.residuals) - len(z), 1)
    deviations = uncertainty.deviations * (residual_variance / uncertainty.variance) ** 0.5
    return bool((np.abs(shift) <= MAX_AVERAGING_SHIFT * deviations).all())


def search_and_refine(
    problem: FitProblem, warm_start: np.ndarray | None, is_noise_known: bool, report: Callable[[float], None]
) -> RawFit:
    """Search, refine and find intervals; start again at each better minimum."""
    starts = starting_points(problem, warm_start)
    selection = thin_selection(problem)
    result = search(problem, selection, starts, lambda share: report(0.5 * share))
    if result.best is None:
        example = option_text("free", {"k": (10, 1000)})
        raise HarnessError(f"the FMU refuses all values that were tried: give other ranges, as in {example}")
    doubts = []
    if not result.is_agreed:
        doubts.append(
            f"Only {result.n_hits} of {result.n_searches} searches ended at these values: narrow the ranges, or give "
            "start values."
        )
    z, input_error = result.best[1], subdivide_inputs(problem, result.best[1])
    ends: dict[tuple[int, int], float | None] = {}
    profiles: dict[tuple[int, int], tuple[tuple[float, float], ...]] = {}
    minima: list[Minimum] = []
    sides = [(i, side) for i in range(len(z)) for side in (-1, 1)]
    searched_squares = np.inf  # at the last search for other minima
    for remaining_rounds in reversed(range(ROUNDS)):
        squares, z = problem.minimize(z, problem.all_samples, 30, 1e-9, central=True)
        check_motion(problem, squares)
        uncertainty = estimate_uncertainty(problem, z, input_error, 0.0)
        report(0.6)
        if squares < searched_squares - uncertainty.variance:
            minima = find_other_minima(problem, z, uncertainty, result.minima, squares)
            searched_squares = squares
            if remaining_rounds and minima and minima[0][0] < squares - SHALLOW * uncertainty.variance:
                z = minima[0][1]
                continue
        better, flat_tails = None, []
        for n, (i, side) in enumerate(sides):
            report(0.7 + 0.3 * n / len(sides))
            bound = search_bound(problem, z, uncertainty, i, side, ends_at_better=remaining_rounds > 0)
            ends[i, side], profiles[i, side] = bound.end, bound.profile
            flat_tails += [i] * bound.has_flat_tail
            better = bound.better if better is None else better
            if remaining_rounds and better is not None:
                z = better
                break
        if better is None:
            break
    else:
        doubts.append("The sum of squares has many shallow minima here: the values may lie anywhere in the intervals.")
    if is_noise_known and uncertainty.variance < 1.0:  # residuals below the noise: the intervals are those of the noise
        uncertainty = estimate_uncertainty(problem, z, input_error, 1.0)
        minima, flat_tails = find_other_minima(problem, z, uncertainty, result.minima, squares), []
        for i, side in sides:
            bound = search_bound(problem, z, uncertainty, i, side, ends_at_better=False)
            ends[i, side], profiles[i, side] = bound.end, bound.profile
            flat_tails += [i] * bound.has_flat_tail
    others = [minimum for minimum in minima if np.abs(minimum[1] - z).max() > DISTINCT]
    extend_ends(problem, z, uncertainty, ends, others)
    other_minima = [position for _, position in others]
    return RawFit(z, uncertainty, ends, profiles, flat_tails, other_minima, doubts, result.log, result.n_searches)


def starting_points(problem: FitProblem, warm_start: np.ndarray | None) -> np.ndarray:
    """Return the coordinates (m, k) of given start values and of an earlier fit."""
    middle = (problem.low + problem.high) / 2
    start_values = [
        middle[i] if unknown.start is None else unknown.to_coordinate(unknown.start)
        for i, unknown in enumerate(problem.unknowns)
    ]
    has_start = any(unknown.start is not None for unknown in problem.unknowns)
    starts = ([np.array(start_values)] if has_start else []) + ([] if warm_start is None else [warm_start])
    return np.array(starts).reshape(len(starts), len(problem.unknowns))


def thin_selection(problem: FitProblem) -> Selection:
    """Return all samples of short records and evenly spaced ones of long records."""
    return tuple(
        index if len(index) < MAX_THIN else np.unique(np.linspace(0, len(index) - 1, THIN).astype(int))
        for index in problem.all_samples
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
    no_change = np.zeros(problem.n_samples)
    if not any(record.inputs for record in problem.records):
        return no_change
    before = problem.residuals(z, problem.all_samples)
    parts = 1
    while parts < MAX_SUBDIVISION:
        parts *= 2
        for record in problem.records:
            record.subdivide(parts)
        after = problem.residuals(z, problem.all_samples)
        limit = INPUT_CHANGE * problem.scatter
        is_fine = before is not None and after is not None and np.abs(after - before).max() < limit
        before = after
        if is_fine:
            break
    for record in problem.records:
        record.subdivide(parts, stride=2)
    coarse = problem.residuals(z, problem.all_samples)
    for record in problem.records:
        record.subdivide(parts)
    return no_change if coarse is None or before is None else (coarse - before) / SPLINE_RATIO


def find_other_minima(
    problem: FitProblem, z: np.ndarray, uncertainty: Uncertainty, minima: list[Minimum], squares: float
) -> list[Minimum]:
    """Return minima about as low as that at z (k,), from the minima of the search and from draws around z."""
    limit = max(map(uncertainty.limit, range(len(z))))
    random = np.random.default_rng(0)
    starts = [position for value, position in select_distinct(minima, MAX_OTHER_MINIMA) if value < squares + 3 * limit]
    eigenvalues, axes = np.linalg.eigh(uncertainty.covariance * uncertainty.inflation.mean())
    reach = 2 * np.minimum(np.sqrt(np.maximum(eigenvalues, 0.0)), DRAW_SIZE)
    starts += [z + axes @ (reach * random.normal(size=len(z))) for _ in range(DRAWS)]
    steps = 25 if problem.central else 12
    if problem.n_samples > 2 * COARSE_SAMPLES * len(problem.records):
        sparse = tuple(
            np.unique(np.linspace(0, index[-1], COARSE_SAMPLES).astype(int)) for index in problem.all_samples
        )
        coarse = select_distinct([problem.minimize(start, sparse, steps, 1e-4) for start in starts], len(starts))
        starts = [position for value, position in coarse if value < coarse[0][0] + 3 * limit]
    ends = [problem.minimize(start, problem.all_samples, steps, 1e-6) for start in starts]
    return select_distinct([end for end in ends if end[0] < squares + limit], len(ends))


def extend_ends(
    problem: FitProblem,
    z: np.ndarray,
    uncertainty: Uncertainty,
    ends: dict[tuple[int, int], float | None],
    other_minima: list[Minimum],
) -> None:
    """Extend each interval by the profile from the farthest minimum, if that is near its end or beyond."""
    for (i, side), end in ends.items():
        below = [(max(squares - uncertainty.squares, 0.0), position) for squares, position in other_minima]
        below = [minimum for minimum in below if minimum[0] < uncertainty.limit(i)]
        excess, farthest = max(below, key=lambda minimum: side * float(minimum[1][i]), default=(0.0, z))
        if end is not None and side * (farthest[i] - z[i]) > 0.5 * abs(end - z[i]):
            other = profile_bound(problem, farthest, uncertainty, i, side, ends_at_better=False, excess=excess).end
            ends[i, side] = None if other is None else side * max(side * other, side * end)
