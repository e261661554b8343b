"""Uncertainty of the fitted values: their covariance, and 95 % confidence intervals.

Correlated residuals carry less information than their number suggests.  With the scores g_i = J_i e_i summed over
blocks, the covariance (J'J)^-1 (sum of g g' over blocks) (J'J)^-1 allows for that (W. K. Newey, K. D. West,
Econometrica 55 (1987), with blocks instead of their kernel); of several block lengths, the largest variance counts.

The intervals of losses near zero, and of losses correlated with them, come from nonnegative_intervals.py.  They start
from the values that the fit would have if losses could be negative: one linear step beyond the bound.
"""

from dataclasses import dataclass

import numpy as np

from ..estimation.estimate import NORMAL_QUANTILE, student_quantile
from ..estimation.noise import block_scores, residual_correlation
from . import thresholds
from .fit_problem import FitProblem
from .law import OMEGA, ZETA, Terms
from .least_squares import column_norms
from .nonnegative_intervals import nonnegative_interval


@dataclass(frozen=True)
class FitUncertainty:
    """Uncertainty of a fit, for its n unknowns.

    Attributes
    ----------
    unknowns : (n,) indices in UNKNOWNS
    standard_errors : (n,)
    correlation : (n, n)
    unconstrained : (n,) the values that the fit would have if losses could be negative
    rms : root mean square of the residuals
    neighbour_correlation : correlation of neighbouring residuals
    is_correlated : whether the residuals differ significantly from white noise
    degrees_of_freedom : samples less unknowns
    """

    unknowns: np.ndarray
    standard_errors: np.ndarray
    correlation: np.ndarray
    unconstrained: np.ndarray
    rms: float
    neighbour_correlation: float
    is_correlated: bool
    degrees_of_freedom: int


def estimate_uncertainty(problem: FitProblem, p: np.ndarray, terms: Terms) -> FitUncertainty:
    """Return the uncertainty of the fitted values p of a law with these terms."""
    e, jacobian = problem.residuals(p, terms)
    unknowns, n = problem.unknowns(terms), len(e)
    scale = column_norms(jacobian)
    jacobian = jacobian / scale
    inverse = np.linalg.pinv(jacobian.T @ jacobian, rcond=1e-14)
    degrees_of_freedom = max(n - len(unknowns), 1)
    white = np.diag(inverse) * (float(e @ e) / degrees_of_freedom + problem.residual_floor**2)
    half_period = np.pi / p[OMEGA]
    quarter = max(int(half_period / 4 / float(np.median(np.diff(problem.t)))), 1)
    neighbour_correlation, is_correlated = residual_correlation(e, [quarter])
    variance = white
    if is_correlated:
        half_cycles = (problem.t[-1] - problem.t[0]) / half_period
        counts = {
            int(np.clip(share * half_cycles, thresholds.MIN_BLOCKS, thresholds.MAX_BLOCKS))
            for share in thresholds.BLOCKS_PER_HALF_CYCLE
        }
        variance = np.max([white, *(block_variances(jacobian, e, inverse, count) for count in sorted(counts))], axis=0)
    unconstrained = p[unknowns] - inverse @ (jacobian.T @ e) / scale
    rms = float(np.sqrt(np.mean(e**2)))
    return FitUncertainty(
        unknowns,
        np.sqrt(variance) / scale,
        to_correlation(inverse),
        unconstrained,
        rms,
        neighbour_correlation,
        is_correlated,
        degrees_of_freedom,
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
    unknowns : (n,) indices in UNKNOWNS
    center : (n,) measured values; losses may be negative here
    standard_errors : (n,)
    correlation : (n, n)
    """
    wide = standard_errors * student_quantile(degrees_of_freedom) / NORMAL_QUANTILE
    losses = (unknowns >= ZETA) & (wide > 0)
    z = center / np.where(losses, wide, 1.0)
    near_bound = losses & (z < thresholds.NEGLIGIBLE_BOUND)
    if not losses[i] or not near_bound.any():
        return float(center[i] - NORMAL_QUANTILE * wide[i]), float(center[i] + NORMAL_QUANTILE * wide[i])
    joint = [i, *(j for j in np.flatnonzero(near_bound).tolist() if j != i)]
    low, high = nonnegative_interval(z[joint], correlation[np.ix_(joint, joint)])
    return float(low * wide[i]), float(high * wide[i])
