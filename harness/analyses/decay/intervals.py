"""Uncertainty of the fitted values: their covariance, and 95 % confidence intervals.

Correlated residuals carry less information than their number suggests.  With the scores g_i = J_i e_i summed over
blocks, the covariance (J'J)^-1 (sum of g g' over blocks) (J'J)^-1 allows for that; of several block lengths, the
largest variance counts.  Slow departures from the law add their variance to that of white residuals.

The intervals of losses near zero, and of losses correlated with them, come from one joint normal measurement of all of
them.  It starts from the values that the fit would have if losses could be negative: one linear step beyond the bound.
These measurements z are in units of their standard errors and have the correlation matrix C.  The interval of the first
mean holds the values m that a likelihood-ratio test accepts.  The test compares the most likely means with that m to
the most likely means of all, and its critical value is the 95 % quantile of random draws from the former.  An interval
therefore contains the most likely value, respects the bounds of the other means, and keeps its coverage at zero.

References
----------
W. K. Newey, K. D. West, Econometrica 55 (1987): the covariance, here with blocks instead of their kernel
G. J. Feldman, R. D. Cousins, Physical Review D 57 (1998), section IV B: the intervals of a single nonnegative mean
C.-S. Chuang, T. L. Lai, Statistica Sinica 10 (2000): the treatment of the other means, hybrid resampling
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache, reduce
from itertools import combinations

import numpy as np
from scipy import optimize, special

from ..estimation.estimate import NORMAL_QUANTILE, UPPER, block_scores, residual_correlation, student_quantile
from . import thresholds
from .decay_problem import DecayProblem, column_norms
from .dependences import Dependences, find_dependences, quarter_width
from .law import OMEGA, ZETA, Terms

N_DRAWS = 1000


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
    unconstrained: np.ndarray
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
    unconstrained = p[unknowns] - inverse @ (jacobian.T @ e) / scale
    return FitUncertainty(
        unknowns,
        special.ndtri(1 - (1 - UPPER) / choices) / NORMAL_QUANTILE * errors,
        to_correlation(inverse),
        unconstrained,
        distance_from_losses(unknowns, unconstrained, np.sqrt(variance) / scale, to_correlation(inverse)),
        rms,
        neighbour_correlation,
        is_correlated,
        degrees_of_freedom,
        dependences,
    )


def distance_from_losses(
    unknowns: np.ndarray, unconstrained: np.ndarray, errors: np.ndarray, correlation: np.ndarray
) -> float:
    """Return the distance of unconstrained values (n,) from nonnegative losses, in standard errors (n,)."""
    losses = np.flatnonzero((unknowns >= ZETA) & (errors > 0))
    z = unconstrained[losses] / errors[losses]
    return float(np.sqrt(NonnegativeCone(correlation[np.ix_(losses, losses)]).nearest(z)[1]))


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
    losses = (unknowns >= ZETA) & (wide > 0)
    z = center / np.where(losses, wide, 1.0)
    near_bound = losses & (z < thresholds.NEGLIGIBLE_BOUND)
    if not losses[i] or not near_bound.any():
        return float(center[i] - NORMAL_QUANTILE * wide[i]), float(center[i] + NORMAL_QUANTILE * wide[i])
    joint = [i, *(j for j in np.flatnonzero(near_bound).tolist() if j != i)]
    low, high = nonnegative_interval(z[joint], correlation[np.ix_(joint, joint)])
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
    """Return the 95 % interval of the first of k nonnegative means.

    Parameters
    ----------
    z : numpy.ndarray
        Measurements (k,) in standard errors.
    correlation : numpy.ndarray
        Correlation matrix (k, k) of the measurements.

    Returns
    -------
    low, high : float
        Bounds in standard errors.
    """
    cone = NonnegativeCone(correlation)
    most_likely, min_distance = cone.nearest(z)
    eigenvalues, axes = np.linalg.eigh(correlation)
    # the symmetric square root does not depend on the signs of the eigenvectors
    draws = axes * np.sqrt(np.maximum(eigenvalues, 0.0)) @ axes.T @ quasirandom_normal(len(z))

    def excess_distance(m: float) -> float:
        """Return by how much z is farther from the means with first mean m than 95 % of the draws from them are."""
        means, square = cone.nearest(z, m)
        points = means[:, None] + draws
        increase = cone.squared_distances(points, m) - cone.squared_distances(points)
        limit = np.partition(increase, int(0.95 * N_DRAWS))[int(0.95 * N_DRAWS)]
        return float(np.sqrt(max(square - min_distance, 0.0)) - np.sqrt(max(limit, 0.0)))

    best, precision = float(most_likely[0]), thresholds.INTERVAL_PRECISION
    high = optimize.brentq(excess_distance, best, best + thresholds.MAX_BOUND, xtol=precision)
    if best == 0 or excess_distance(0.0) <= 0:
        return 0.0, high
    return optimize.brentq(excess_distance, 0.0, best, xtol=precision), high


class NonnegativeCone:
    """The cone of nonnegative means, with the distance that belongs to a correlation matrix (k, k)."""

    def __init__(self, correlation: np.ndarray) -> None:
        k = len(correlation)
        self.faces = []
        for fixed in (list(indices) for size in range(k + 1) for indices in combinations(range(k), size)):
            free = [i for i in range(k) if i not in fixed]
            weight = np.linalg.pinv(correlation[np.ix_(fixed, fixed)])
            self.faces.append((fixed, free, weight, correlation[np.ix_(free, fixed)] @ weight))

    def nearest(self, z: np.ndarray, first: float | None = None) -> tuple[np.ndarray, float]:
        """Return the point of the cone nearest to z (k,) and the squared distance.

        With `first`, the first mean has that value.  Of all faces on which the projection of z is nonnegative, the
        nearest one counts.
        """
        free, moved, squares = min(self.projections(z[:, None], first), key=lambda face: float(face[2][0]))
        means = np.zeros_like(z)
        means[free] = moved[:, 0]
        if first is not None:
            means[0] = first
        return means, float(squares[0])

    def squared_distances(self, z: np.ndarray, first: float | None = None) -> np.ndarray:
        """Return the squared distances (n,) of the points z (k, n) from the cone."""
        return reduce(np.minimum, (squares for _, _, squares in self.projections(z, first)))

    def projections(self, z: np.ndarray, first: float | None) -> Iterator[tuple[list[int], np.ndarray, np.ndarray]]:
        """Yield for each face its free means, their values nearest to z (k, n), and the squared distances (n,).

        The distance is infinite where a free mean would be negative.
        """
        if first is not None:
            z = np.concatenate([z[:1] - first, z[1:]])
        for fixed, free, weight, slope in self.faces:
            if first is None or 0 in fixed:
                offset = z[fixed]
                moved = z[free] - slope @ offset
                yield free, moved, np.where((moved >= 0).all(axis=0), (weight @ offset * offset).sum(axis=0), np.inf)


@cache
def quasirandom_normal(k: int) -> np.ndarray:
    """Return quasi-random draws (k, N_DRAWS) of independent standard normal numbers, the same in every run.

    References
    ----------
    M. Roberts, The unreasonable effectiveness of quasirandom sequences (2018)
    """
    ratio = optimize.brentq(lambda g: g ** (k + 1) - g - 1, 1.0, 2.0, xtol=1e-15)
    uniform = (0.5 + np.outer(ratio ** -np.arange(1.0, k + 1), np.arange(1, N_DRAWS + 1))) % 1
    return np.asarray(special.ndtri(uniform))
