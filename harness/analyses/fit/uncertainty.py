"""Covariance of fitted values, and its increase by noise that is not white.

Residuals that are not white carry less information than white ones: the covariance is that of the scores summed over
blocks. A quantiser makes errors that depend on the signal: they are computed for signals near the fitted one.

Of parameters that a record does not determine, combinations of two may still be determined.
"""

from dataclasses import dataclass

import numpy as np

from ..estimation.estimate import Estimate, block_scores, student_quantile
from .fit_problem import FitProblem
from .measured_record import correlation_length, significant_correlation
from .residual_dependence import Dependence, find_dependence
from .unknowns import Unknown

STIFF = 100.0  # ratio of the axes of the squares from which one-sided differences are too coarse
INDETERMINATE = 0.5  # relative standard error from which a value counts as not determined
BLOCK_SIZES = (20, 60, 200, 600)
MIN_BLOCKS, MAX_BLOCKS = 12, 400
CORRELATED_DEGREES_OF_FREEDOM = 20  # of the intervals, where residuals are correlated
QUANTISER_DRAWS = 60
INPUT_DRAWS = 12
ROUNDING = float(np.finfo(float).eps)  # of the largest value of a record: smallest standard deviation of its residuals


@dataclass(frozen=True)
class Uncertainty:
    """Uncertainty of the coordinates z (k,) of a minimum.

    Attributes
    ----------
    squares, variance : float
        Sum of squares, and that per degree of freedom; the variance is at least that of rounding errors.
    covariance : numpy.ndarray
        Covariance (k, k) for white noise.
    inflation : numpy.ndarray
        Factors (k,) by which the variances exceed those for white noise.
    indeterminate : numpy.ndarray
        Directions (k, m) that the record does not determine.
    residuals : numpy.ndarray
        Residuals (n,) in units of the noise.
    correlation : float
        Correlation of neighbouring residuals; 0 if they are white.
    input_shift : numpy.ndarray
        Displacements (k,) by the error of the inputs between samples.
    input_noise : float
        Root mean square of the residuals by the noise of the inputs, in units of the noise.
    dependence : Dependence or None
        What explains most of the residuals, if they are not white.
    """

    squares: float
    variance: float
    covariance: np.ndarray
    inflation: np.ndarray
    indeterminate: np.ndarray
    residuals: np.ndarray
    correlation: float
    input_shift: np.ndarray
    input_noise: float = 0.0
    dependence: Dependence | None = None

    @property
    def quantile(self) -> float:
        """Return the quantile of Student's distribution for 95 %."""
        degrees = max(len(self.residuals) - len(self.inflation), 1)
        return student_quantile(min(degrees, CORRELATED_DEGREES_OF_FREEDOM) if self.correlation else degrees)

    def limit(self, i: int) -> float:
        """Return by how much the squares exceed the minimum where the 95 % interval of coordinate i ends."""
        return float(self.variance * self.inflation[i] * self.quantile**2)

    @property
    def deviations(self) -> np.ndarray:
        """Return the standard errors (k,) of the coordinates."""
        return np.asarray(np.sqrt(np.diag(self.covariance) * self.inflation))


def estimate_uncertainty(
    problem: FitProblem, z: np.ndarray, input_error: np.ndarray, min_variance: float
) -> Uncertainty:
    """Return the uncertainty at a minimum; set the steps of differences, and whether they need to be central.

    Parameters
    ----------
    input_error : numpy.ndarray
        Changes (n,) of the residuals by the error of the inputs between samples.
    min_variance : float
        Lower bound of the variance of the residuals: 1 if the noise is known, otherwise 0.
    """
    e = problem.residuals(z, problem.all_samples)
    assert e is not None
    jacobian = problem.choose_steps(z, e)
    variance = max(float(e @ e) / max(len(e) - len(z), 1), min_variance, rounding_variance(problem))
    eigenvalues, axes = np.linalg.eigh(jacobian.T @ jacobian)
    eigenvalues = np.maximum(eigenvalues, max(1e-12 * eigenvalues.max(), 1e-200))
    inverse = axes / eigenvalues @ axes.T
    problem.central = bool(eigenvalues.max() > STIFF**2 * eigenvalues.min())
    white = np.diag(inverse) * variance + 1e-300
    by_record = split_residuals(problem, e)
    correlation = max((significant_correlation(residuals) for residuals in by_record), key=abs)
    inflation = np.ones(len(z))
    if correlation:
        inflation *= max(map(correlation_length, by_record))
        inflation = np.maximum(inflation, score_inflation(e, jacobian, inverse, axes, variance, white))
    if any((record.step > record.scatter / 2).any() for record in problem.records):
        inflation = np.maximum(inflation, quantiser_variance(problem, z, jacobian, inverse, axes, eigenvalues) / white)
    shift = inverse @ (jacobian.T @ input_error)
    draws = INPUT_DRAWS if correlation and any(record.noisy_inputs for record in problem.records) else 0
    noise_shifts, noise_effect = input_noise_effect(problem, z, jacobian, inverse, draws)
    inflation = np.maximum(inflation, 1 + noise_shifts / white) + shift**2 / white
    dependence = find_dependence(problem, e, jacobian) if correlation else None
    if dependence:
        inflation += (inverse @ (jacobian.T @ dependence.change)) ** 2 / white
    deviation = np.sqrt(variance * inflation.max() / eigenvalues)
    indeterminate = axes[:, deviation > INDETERMINATE]
    squares = float(e @ e)
    return Uncertainty(
        squares, variance, inverse * variance, inflation, indeterminate, e, correlation, shift, noise_effect, dependence
    )


def input_noise_effect(
    problem: FitProblem, z: np.ndarray, jacobian: np.ndarray, inverse: np.ndarray, draws: int
) -> tuple[np.ndarray, float]:
    """Return the variances (k,) by the noise of the inputs, and the root mean square of its residuals."""
    random, shifts, squares = np.random.default_rng(0), [np.zeros(len(z))], [0.0]
    for _ in range(draws):
        values = [problem.values(z, i) for i in range(len(problem.records))]
        runs = [(r, r.simulate_noisy_inputs(v, random), r.run(v)) for r, v in zip(problem.records, values, strict=True)]
        parts = [((a - b) / record.noise).ravel() for record, a, b in runs if a is not None and b is not None]
        if len(parts) == len(runs):
            change = np.concatenate(parts)
            shifts.append(inverse @ (jacobian.T @ change))
            squares.append(float(change @ change) / len(change))
    return np.square(shifts).sum(axis=0) / max(len(shifts) - 1, 1), max(squares) ** 0.5


def rounding_variance(problem: FitProblem) -> float:
    """Return the smallest variance that rounding errors of a column can have, in units of its noise."""
    sizes = np.concatenate([np.abs(record.y).max(axis=0) / record.noise for record in problem.records])
    return float((ROUNDING * sizes.min()) ** 2)


def split_residuals(problem: FitProblem, e: np.ndarray) -> list[np.ndarray]:
    """Return the residuals (n, columns) of each record."""
    ends = np.cumsum([record.y.size for record in problem.records])[:-1]
    return [part.reshape(record.y.shape) for part, record in zip(np.split(e, ends), problem.records, strict=True)]


def score_inflation(
    e: np.ndarray, jacobian: np.ndarray, inverse: np.ndarray, axes: np.ndarray, variance: float, white: np.ndarray
) -> np.ndarray:
    """Return the factors (k,) by which the scores, summed over blocks of several sizes, exceed white noise."""
    inflation = np.ones(len(white))
    for count in {int(np.clip(len(e) / size, MIN_BLOCKS, MAX_BLOCKS)) for size in BLOCK_SIZES}:
        scores, factor = block_scores(jacobian, e, count, len(white))
        norms = np.maximum(((jacobian @ axes) ** 2).sum(axis=0), 1e-300)
        typical = np.median(((scores @ axes) ** 2).sum(axis=0) / norms) * factor / variance
        single = ((scores @ inverse) ** 2).sum(axis=0) * factor / white
        inflation = np.maximum(inflation, np.maximum(typical, single))
    return inflation


def quantiser_variance(
    problem: FitProblem,
    z: np.ndarray,
    jacobian: np.ndarray,
    inverse: np.ndarray,
    axes: np.ndarray,
    eigenvalues: np.ndarray,
) -> np.ndarray:
    """Return the variances (k,) by a quantiser: those of the fit of quantised signals near the fitted one."""
    random, shifts = np.random.default_rng(0), []
    reach = np.minimum(np.sqrt(12 * len(jacobian) / eigenvalues / len(z)), 0.05)
    for _ in range(QUANTISER_DRAWS):
        predicted = problem.predict(z + axes @ (reach * random.normal(size=len(z))), problem.all_samples)
        if predicted is None:
            continue
        errors = []
        for y, record in zip(predicted, problem.records, strict=True):
            errors.append((record.quantisation_errors(y) / record.noise).ravel())
        shifts.append(inverse @ (jacobian.T @ np.concatenate(errors)))
    return np.mean(np.square(shifts), axis=0) if shifts else np.zeros(len(z))


MAX_ERROR = INDETERMINATE / 3  # relative standard error of a combination
MIN_GAIN = 5.0  # times less uncertain than either parameter
COMPARABLE = 10.0  # ratio of two parameters whose sum or difference is meaningful


def determined_combinations(
    unknowns: tuple[Unknown, ...], values: np.ndarray, uncertainty: Uncertainty, indeterminate: list[int]
) -> tuple[Estimate, ...]:
    """Return the best known products, quotients, sums and differences of pairs of indeterminate unknowns.

    None of them follows from the others.

    Parameters
    ----------
    unknowns : tuple of Unknown
        The k unknowns of the fit.
    values : numpy.ndarray
        Fitted values (k,).
    uncertainty : Uncertainty
        Uncertainty of their coordinates.
    indeterminate : list of int
        Indices of the unknowns that the record does not determine.
    """
    covariance = uncertainty.covariance * uncertainty.inflation.max()
    pairs = [(i, j) for i in indeterminate for j in indeterminate if i < j and unknowns[i].sign and unknowns[j].sign]
    combinations: list[tuple[Estimate, np.ndarray]] = []
    for i, j in pairs:
        candidates = list_combinations(unknowns[i], unknowns[j], float(values[i]), float(values[j]))
        block = covariance[np.ix_([i, j], [i, j])]
        errors = [float(np.sqrt(weights @ block @ weights)) for *_, weights in candidates]
        best = int(np.argmin(errors))
        name, unit, value, weights = candidates[best]
        if errors[best] < min(MAX_ERROR, float(np.sqrt(np.diag(block)).min()) / MIN_GAIN):
            margin = uncertainty.quantile * errors[best] * abs(value)
            estimate = Estimate(name, value, errors[best] * abs(value), value - margin, value + margin, unit, "")
            row = np.zeros(len(unknowns))
            row[[i, j]] = weights
            combinations.append((estimate, row))
    independent: list[tuple[Estimate, np.ndarray]] = []
    for estimate, row in sorted(combinations, key=lambda pair: pair[0].error / abs(pair[0].value)):
        if np.linalg.matrix_rank([*(other for _, other in independent), row], tol=1e-6) > len(independent):
            independent.append((estimate, row))
    return tuple(estimate for estimate, _ in independent)


def list_combinations(a: Unknown, b: Unknown, p: float, q: float) -> list[tuple[str, str, float, np.ndarray]]:
    """Return name, unit, value and the relative change (2,) with the logarithms of the two values p and q."""
    quotients = [
        (f"{a.name}*{b.name}", combine_units(a.unit, 1, b.unit, 1), p * q, (1, 1)),
        (f"{a.name}/{b.name}", combine_units(a.unit, 1, b.unit, -1), p / q, (1, -1)),
        (f"{a.name}^2/{b.name}", combine_units(a.unit, 2, b.unit, -1), p * p / q, (2, -1)),
        (f"{a.name}/{b.name}^2", combine_units(a.unit, 1, b.unit, -2), p / q / q, (1, -2)),
    ]
    combinations = [(name, unit, value, np.array(weights, dtype=float)) for name, unit, value, weights in quotients]
    if a.unit == b.unit and 1 / COMPARABLE < p / q < COMPARABLE:
        for sign, symbol in ((1, "+"), (-1, "-")):
            value = p + sign * q
            if value:
                combinations.append((f"{a.name} {symbol} {b.name}", a.unit, value, np.array([p, sign * q]) / value))
    return combinations


def combine_units(a: str, power_a: int, b: str, power_b: int) -> str:
    """Return the unit of a product of powers."""
    if a == b:
        power = power_a + power_b
        return "" if not power else unit_power(a, power)
    if power_b > 0:
        return ".".join(filter(None, (unit_power(a, power_a), unit_power(b, power_b))))
    below = unit_power(b, -power_b)
    return "/".join((unit_power(a, power_a) or "1", below)) if below else unit_power(a, power_a)


def unit_power(unit: str, power: int) -> str:
    """Return the power of a unit."""
    is_compound = any(mark in unit for mark in "./")
    base = f"({unit})" if is_compound else unit
    return base if power == 1 or not unit else f"{base}{power}"
