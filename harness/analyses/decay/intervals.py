"""How sure the values are: their covariance, and 95 % intervals of what cannot be negative.

Residuals that resemble their neighbours carry less than their number says.  With the scores g_i = J_i e_i summed over
blocks, the covariance (J'J)^-1 (sum of g g' over blocks) (J'J)^-1 allows for that (W. K. Newey, K. D. West,
Econometrica 55 (1987), with blocks for their kernel); of several lengths of blocks the widest is taken.

Of losses near zero, and of those beside them, bounded.py tells the intervals, from where the fit would be if losses
could be negative: one linear step beyond the bound.
"""

from dataclasses import dataclass
from statistics import NormalDist

import numpy as np

from .fit_problem import FitProblem
from .law import OMEGA, ZETA, Terms
from .least_squares import column_norms
from .nonnegative_intervals import NEGLIGIBLE_BOUND, nonnegative_interval

NORMAL = NormalDist()
SIDE = NORMAL.inv_cdf(0.975)
FEW = (12.706, 4.303, 3.182, 2.776, 2.571, 2.447, 2.365, 2.306, 2.262)  # Student's t at 97.5 %, 1 to 9 degrees
BLOCKS = (1.0, 0.3, 0.1, 0.03)  # to a half swing
FEWEST_BLOCKS, MOST_BLOCKS = 24, 400
ALIKE = 4.5  # standard deviations of the correlation of white residuals


@dataclass(frozen=True)
class FitUncertainty:
    """Of the `unknowns` (n,): standard `errors`, their `correlation` (n, n), and `free`, where they would be if losses
    could be negative.  Of the residuals: rms, correlation `rho` of neighbours, and whether they are `alike`."""

    unknowns: np.ndarray
    errors: np.ndarray
    correlation: np.ndarray
    free: np.ndarray
    rms: float
    rho: float
    alike: bool
    freedom: int


def spread(problem: FitProblem, p: np.ndarray, terms: Terms) -> FitUncertainty:
    """The spread of the values p of a law fitted to the problem."""
    e, jacobian = problem.off(p, terms)
    unknowns, n = problem.unknowns(terms), len(e)
    scale = column_norms(jacobian)
    jacobian = jacobian / scale
    inverse = np.linalg.pinv(jacobian.T @ jacobian, rcond=1e-14)
    freedom = max(n - len(unknowns), 1)
    white = np.diag(inverse) * (float(e @ e) / freedom + problem.exact**2)
    swing = np.pi / p[OMEGA]
    rho, alike = likeness(e, max(int(swing / 4 / float(np.median(np.diff(problem.t)))), 1))
    variance = white
    if alike:
        swings = (problem.t[-1] - problem.t[0]) / swing
        counts = {int(np.clip(share * swings, FEWEST_BLOCKS, MOST_BLOCKS)) for share in BLOCKS}
        variance = np.max([white, *(by_blocks(jacobian, e, inverse, count) for count in sorted(counts))], axis=0)
    free = p[unknowns] - inverse @ (jacobian.T @ e) / scale
    rms = float(np.sqrt(np.mean(e**2)))
    return FitUncertainty(unknowns, np.sqrt(variance) / scale, correlated(inverse), free, rms, rho, alike, freedom)


def correlated(covariance: np.ndarray) -> np.ndarray:
    """The correlations (n, n) in a covariance (n, n)."""
    squares = np.diag(covariance)
    sizes = np.sqrt(np.where(squares > 0, squares, 1.0))
    return covariance / np.outer(sizes, sizes)


def likeness(e: np.ndarray, width: int) -> tuple[float, bool]:
    """The correlation of neighbouring residuals, and whether they, or their sums over `width`, are no white noise."""
    squares = float(e @ e)
    if squares == 0:
        return 0.0, False
    n = len(e)
    rho = float(e[:-1] @ e[1:]) / squares
    sums = np.add.reduceat(e, np.arange(0, n, width))
    ratio = float(np.mean(sums**2)) / (width * squares / n)
    return rho, abs(rho) > ALIKE / np.sqrt(n) or ratio > 1 + 5 * np.sqrt(2 * width / n)


def by_blocks(jacobian: np.ndarray, e: np.ndarray, inverse: np.ndarray, count: int) -> np.ndarray:
    """Variances from scores summed over `count` blocks of residuals."""
    edges = np.unique(np.linspace(0, len(e), count + 1).astype(int))[:-1]
    scores = np.add.reduceat(jacobian * e[:, None], edges, axis=0)
    free = max(len(edges) - jacobian.shape[1], 1)
    return np.diag(inverse @ (scores.T @ scores) @ inverse) * len(edges) / free


def student_t_quantile(freedom: int) -> float:
    """Student's t at 97.5 %, by the series of Abramowitz and Stegun (26.7.5) from ten degrees of freedom on."""
    if freedom <= len(FEW):
        return FEW[freedom - 1] if freedom > 0 else float("nan")
    z, v = SIDE, float(freedom)
    first, second = (z**3 + z) / 4, (5 * z**5 + 16 * z**3 + 3 * z) / 96
    third = (3 * z**7 + 19 * z**5 + 17 * z**3 - 15 * z) / 384
    return z + first / v + second / v**2 + third / v**3


def interval(
    i: int, unknowns: np.ndarray, free: np.ndarray, errors: np.ndarray, correlation: np.ndarray, freedom: int
) -> tuple[float, float]:
    """The 95 % interval of the i-th of the `unknowns` (places in UNKNOWNS) that were measured as `free`."""
    wide = errors * student_t_quantile(freedom) / SIDE
    losses = (unknowns >= ZETA) & (wide > 0)
    z = free / np.where(losses, wide, 1.0)
    near = losses & (z < NEGLIGIBLE_BOUND)
    if not losses[i] or not near.any():
        return float(free[i] - SIDE * wide[i]), float(free[i] + SIDE * wide[i])
    some = [i, *(j for j in np.flatnonzero(near).tolist() if j != i)]
    low, high = nonnegative_interval(z[some], correlation[np.ix_(some, some)])
    return float(low * wide[i]), float(high * wide[i])
