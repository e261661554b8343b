"""95 % confidence intervals of nonnegative means, from one joint normal measurement of all of them.

The measurements z are in units of their standard errors and have the correlation matrix C.  The interval of the first
mean holds the values m that a likelihood-ratio test accepts.  The test compares the most likely means with that m to
the most likely means of all, and its critical value is the 95 % quantile of random draws from the former.  An interval
therefore contains the most likely value, respects the bounds of the other means, and keeps its coverage at zero.

References
----------
G. J. Feldman, R. D. Cousins, Physical Review D 57 (1998), section IV B: the intervals of a single mean
C.-S. Chuang, T. L. Lai, Statistica Sinica 10 (2000): the treatment of the other means, hybrid resampling
"""

from collections.abc import Iterator
from functools import cache, reduce
from itertools import combinations

import numpy as np
from scipy import optimize, special

from . import thresholds

N_DRAWS = 1000


def nonnegative_interval(z: np.ndarray, correlation: np.ndarray) -> tuple[float, float]:
    """Return the 95 % interval of the first of k nonnegative means.

    Parameters
    ----------
    z : (k,) measurements in standard errors
    correlation : (k, k) correlation of the measurements

    Returns
    -------
    low, high : bounds in standard errors
    """
    cone = NonnegativeCone(correlation)
    most_likely, min_distance = cone.nearest(z)
    eigenvalues, axes = np.linalg.eigh(correlation)
    # the symmetric square root does not depend on the signs of the eigenvectors
    draws = axes * np.sqrt(np.maximum(eigenvalues, 0.0)) @ axes.T @ quasirandom_normal(len(z))

    def excess_distance(m: float) -> float:
        """Return how much farther z is from the means with first mean m than 95 % of the draws from them."""
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
        for held in (list(indices) for size in range(k + 1) for indices in combinations(range(k), size)):
            free = [i for i in range(k) if i not in held]
            weight = np.linalg.pinv(correlation[np.ix_(held, held)])
            self.faces.append((held, free, weight, correlation[np.ix_(free, held)] @ weight))

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
        for held, free, weight, slope in self.faces:
            if first is None or 0 in held:
                offset = z[held]
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
