"""Uncertainty of the fitted values: their covariance, and 95 % confidence intervals.

Correlated residuals carry less information than their number suggests.  With the scores g_i = J_i e_i summed over
blocks, the covariance (J'J)^-1 (sum of g g' over blocks) (J'J)^-1 allows for that; of several block lengths, the
largest variance counts.  Slow departures from the law add their variance to that of white residuals.

The intervals of losses come from one joint normal measurement of all of them: the values that the fit would have if
losses could be negative, one linear step beyond the bound.  The interval of a loss holds the values that a test of the
likelihood ratio accepts, in which the other losses are the most likely ones that are not negative.  At a bound the
ratio exceeds the limit that holds without one in at most six percent of all records instead of five.

References
----------
W. K. Newey, K. D. West, Econometrica 55 (1987): the covariance, here with blocks instead of their kernel
S. G. Self, K.-Y. Liang, Journal of the American Statistical Association 82 (1987): likelihood ratios at bounds
"""

from dataclasses import dataclass

import numpy as np
from scipy import optimize, special

from ..estimation.estimate import NORMAL_QUANTILE, UPPER, block_scores, residual_correlation, student_quantile
from . import thresholds
from .decay_problem import DecayProblem, column_norms
from .dependences import Dependences, find_dependences, quarter_width
from .law import OMEGA, ZETA, Terms


@dataclass(frozen=True)
class FitUncertainty:
    """Uncertainty of a fit, for its n unknowns.

    Attributes
    ----------
    unknowns : numpy.ndarray
        Indices (n,) in UNKNOWNS.
    standard_errors : numpy.ndarray
        Standard errors (n,).
    correlation : numpy.ndarray
        Correlation matrix (n, n).
    unconstrained : numpy.ndarray
        Values (n,) that the fit would have if losses could be negative.
    distance_from_losses : float
        Distance of the unconstrained losses from the nearest that are not negative, in standard errors.
    rms : float
        Root mean square of the residuals.
    neighbour_correlation : float
        Correlation of neighbouring residuals.
    is_correlated : bool
        Whether the residuals differ significantly from white noise.
    degrees_of_freedom : int
        Number of samples less that of unknowns.
    dependences : Dependences
        On what the residuals depend.
    """

    unknowns: np.ndarray
    standard_errors: np.ndarray
    correlation: np.ndarray
    unconstrained_values: np.ndarray
    distance_from_losses: float
    rms: float
    neighbour_correlation: float
    is_correlated: bool
    degrees_of_freedom: int
    dependences: Dependences


def estimate_uncertainty(problem: DecayProblem, p: np.ndarray, terms: Terms, choices: int = 1) -> FitUncertainty:
    """Return the uncertainty of the fitted values p of a law with these terms.

    The errors grow with the number of decays of which this one was chosen, as by Bonferroni's inequality.
    """
    e, jacobian = problem.residuals(p, terms)
    unknowns, n = problem.unknowns(terms), len(e)
    scale = column_norms(jacobian)
    jacobian = jacobian / scale
    inverse = np.linalg.pinv(jacobian.T @ jacobian, rcond=1e-14)
    degrees_of_freedom = max(n - len(unknowns), 1)
    noise = float(e @ e) / degrees_of_freedom + problem.residual_floor**2
    half_period = np.pi / p[OMEGA]
    neighbour_correlation, is_correlated = residual_correlation(e, [quarter_width(problem, p)])
    rms = float(np.sqrt(np.mean(e**2)))
    dependences = find_dependences(problem, p, terms)
    variance = noise * np.diag(inverse)
    if is_correlated:
        half_cycles = (problem.t[-1] - problem.t[0]) / half_period
        counts = {
            int(np.clip(share * half_cycles, thresholds.MIN_BLOCKS, thresholds.MAX_BLOCKS))
            for share in thresholds.BLOCKS_PER_HALF_CYCLE
        }
        variance = np.max(
            [variance, *(block_variances(jacobian, e, inverse, count) for count in sorted(counts))], axis=0
        )
    errors = np.sqrt(np.maximum(variance, noise * np.diag(inverse) + dependences.variances * scale**2)) / scale
    unconstrained_values = p[unknowns] - inverse @ (jacobian.T @ e) / scale
    correlation, losses = to_correlation(inverse), (unknowns >= ZETA) & (variance > 0)
    z = unconstrained_values[losses] * scale[losses] / np.sqrt(variance[losses])
    distance = nearest_means(z, correlation[np.ix_(losses, losses)])[1] if len(z) else 0.0
    if distance > thresholds.NEGATIVE and not dependences.sizes:
        errors = np.where(unknowns >= ZETA, distance * errors, errors)
    return FitUncertainty(
        unknowns,
        special.ndtri(1 - (1 - UPPER) / choices) / NORMAL_QUANTILE * errors,
        correlation,
        unconstrained_values,
        distance,
        rms,
        neighbour_correlation,
        is_correlated,
        degrees_of_freedom,
        dependences,
    )


def to_correlation(covariance: np.ndarray) -> np.ndarray:
    """Return the correlation matrix (n, n) of a covariance matrix (n, n)."""
    variances = np.diag(covariance)
    deviations = np.sqrt(np.where(variances > 0, variances, 1.0))
    return covariance / np.outer(deviations, deviations)


def block_variances(jacobian: np.ndarray, e: np.ndarray, inverse: np.ndarray, count: int) -> np.ndarray:
    """Return the variances of the unknowns, from scores summed over `count` blocks of residuals."""
    scores, factor = block_scores(jacobian, e, count, jacobian.shape[1])
    return np.diag(inverse @ (scores.T @ scores) @ inverse) * factor


def confidence_interval(
    i: int,
    unknowns: np.ndarray,
    center: np.ndarray,
    standard_errors: np.ndarray,
    correlation: np.ndarray,
    degrees_of_freedom: int,
) -> tuple[float, float]:
    """Return the 95 % interval of the i-th unknown.

    Parameters
    ----------
    unknowns : numpy.ndarray
        Indices (n,) in UNKNOWNS.
    center : numpy.ndarray
        Measured values (n,); losses may be negative here.
    standard_errors : numpy.ndarray
        Standard errors (n,).
    correlation : numpy.ndarray
        Correlation matrix (n, n).
    """
    wide = standard_errors * student_quantile(degrees_of_freedom) / NORMAL_QUANTILE
    if unknowns[i] < ZETA or not wide[i] > 0:
        return float(center[i] - NORMAL_QUANTILE * wide[i]), float(center[i] + NORMAL_QUANTILE * wide[i])
    joint = [i, *(j for j in np.flatnonzero((unknowns >= ZETA) & (wide > 0)).tolist() if j != i)]
    low, high = nonnegative_interval(center[joint] / wide[joint], correlation[np.ix_(joint, joint)])
    return float(low * wide[i]), float(high * wide[i])


def extend_interval(value: float, low: float, high: float) -> tuple[float, float]:
    """Return an interval that holds its value inside, unless that is a loss of zero.

    A value is at an end where the bound of another loss acts, so that the interval, which comes from a linear law, may
    lie on the wrong side of it. One without a width is undetermined.
    """
    if not high > low:
        return (0.0 if value >= 0 else -np.inf), np.inf
    if value <= low and value != 0:
        low = value - (high - low) if value < 0 else max(value - (high - low), 0.0)
    return low, value + (high - low) if value >= high else high


def nonnegative_interval(z: np.ndarray, correlation: np.ndarray) -> tuple[float, float]:
    """Return the 95 % interval of the first of k nonnegative means, in standard errors.

    Parameters
    ----------
    z : numpy.ndarray
        Measurements (k,) in standard errors.
    correlation : numpy.ndarray
        Correlation matrix (k, k) of the measurements.
    """
    best, distance = nearest_means(z, correlation)

    def excess(m: float) -> float:
        """Return the likelihood ratio of means with the first mean m, less the limit of the test."""
        return nearest_means(z, correlation, m)[1] ** 2 - distance**2 - NORMAL_QUANTILE**2

    # the squared distance of a convex set grows at least as it does without bounds
    low, high, precision = best[0] - 2 * NORMAL_QUANTILE, best[0] + 2 * NORMAL_QUANTILE, thresholds.INTERVAL_PRECISION
    end = optimize.brentq(excess, best[0], high, xtol=precision)
    if low <= 0 and excess(0.0) <= 0:
        return 0.0, end
    return optimize.brentq(excess, max(low, 0.0), best[0], xtol=precision), end


def nearest_means(z: np.ndarray, correlation: np.ndarray, first: float | None = None) -> tuple[np.ndarray, float]:
    """Return the nonnegative means nearest to measurements z (k,), perhaps with a given first, and their distance.

    The distance is in standard errors of measurements with this correlation matrix (k, k).
    """
    sizes, axes = np.linalg.eigh(correlation)
    weights = axes / np.sqrt(np.maximum(sizes, thresholds.RANK_RTOL)) @ axes.T
    if first is None:
        return optimize.nnls(weights, weights @ z)
    aim = weights @ z - weights[:, 0] * first
    others, distance = optimize.nnls(weights[:, 1:], aim) if len(z) > 1 else (z[1:], float(np.linalg.norm(aim)))
    return np.append(first, others), distance
