"""95 % intervals of means that cannot be negative, from one normal measurement of all of them.

The measurements z are counted in their errors and have the correlation C.  A value m of the first mean is accepted
where the likelihood of z, with that m and the likeliest means of the others, falls no farther below that with the
likeliest means of all than it does in 95 % of the draws which just these means would give.  Of one mean alone these
are the intervals of G. J. Feldman and R. D. Cousins, Physical Review D 57 (1998), section IV B; what is taken for the
others is the hybrid resampling of C.-S. Chuang and T. L. Lai, Statistica Sinica 10 (2000).  So an interval holds the
likeliest value, knows what the others cannot be, and holds the truth also where that is zero.
"""

from collections.abc import Callable, Iterator
from functools import cache, reduce
from itertools import combinations
from statistics import NormalDist

import numpy as np

N_DRAWS = 1000
NEGLIGIBLE_BOUND = 4.0  # errors above zero: a bound so far away is none
WIDEST = 8.0  # errors above the likeliest value: nothing there is accepted
CLOSE, STEPS = 2e-3, 40  # errors, of the ends, and how long they are looked for


def nonnegative_interval(z: np.ndarray, correlation: np.ndarray) -> tuple[float, float]:
    """The interval, in errors, of the first of k means measured as z (k,) with the correlation (k, k)."""
    cone = NonnegativeCone(correlation)
    likeliest, least = cone.nearest(z)
    squares, axes = np.linalg.eigh(correlation)
    draws = axes * np.sqrt(np.maximum(squares, 0.0)) @ axes.T @ normal(len(z))  # the same whatever signs axes have

    def beyond(m: float) -> float:
        """How much farther z is from the means with that m than 95 % of their draws."""
        means, square = cone.nearest(z, m)
        drawn = means[:, None] + draws
        farther = cone.squares(drawn, m) - cone.squares(drawn)
        limit = np.partition(farther, int(0.95 * N_DRAWS))[int(0.95 * N_DRAWS)]
        return float(np.sqrt(max(square - least, 0.0)) - np.sqrt(max(limit, 0.0)))

    best = float(likeliest[0])
    high = root(beyond, best, best + WIDEST)
    return (0.0 if best == 0 or beyond(0.0) <= 0 else root(lambda m: -beyond(m), 0.0, best)), high


class NonnegativeCone:
    """The means that are not negative, and their distances from points by the correlation (k, k)."""

    def __init__(self, correlation: np.ndarray) -> None:
        k = len(correlation)
        self.faces = []
        for held in (list(some) for size in range(k + 1) for some in combinations(range(k), size)):
            free = [i for i in range(k) if i not in held]
            weight = np.linalg.pinv(correlation[np.ix_(held, held)])
            self.faces.append((held, free, weight, correlation[np.ix_(free, held)] @ weight))

    def nearest(self, z: np.ndarray, first: float | None = None) -> tuple[np.ndarray, float]:
        """The means (k,) nearest to the point z (k,), those with that `first` one if it is given, and the square of
        their distance: of all faces on whose own side the nearest point lies the best."""
        free, moved, squares = min(self.sides(z[:, None], first), key=lambda side: float(side[2][0]))
        means = np.zeros_like(z)
        means[free] = moved[:, 0]
        if first is not None:
            means[0] = first
        return means, float(squares[0])

    def squares(self, z: np.ndarray, first: float | None = None) -> np.ndarray:
        """The squares (n,) of such distances of points z (k, n)."""
        return reduce(np.minimum, (squares for _, _, squares in self.sides(z, first)))

    def sides(self, z: np.ndarray, first: float | None) -> Iterator[tuple[list[int], np.ndarray, np.ndarray]]:
        """Of each face the means that it leaves free, these nearest to the points z (k, n), and the squares of the
        distances (n,), infinite where the nearest point does not lie on its own side."""
        if first is not None:
            z = np.concatenate([z[:1] - first, z[1:]])
        for held, free, weight, slope in self.faces:
            if first is None or 0 in held:
                off = z[held]
                moved = z[free] - slope @ off
                yield free, moved, np.where((moved >= 0).all(axis=0), (weight @ off * off).sum(axis=0), np.inf)


@cache
def normal(k: int) -> np.ndarray:
    """Draws (k, DRAWS) of independent normal numbers, evenly spread (M. Roberts, The unreasonable effectiveness of
    quasirandom sequences (2018)), so that nothing here is left to chance."""
    ratio = 2.0
    for _ in range(50):
        ratio = (1 + ratio) ** (1 / (k + 1))
    even = (0.5 + np.outer(ratio ** -np.arange(1.0, k + 1), np.arange(1, N_DRAWS + 1))) % 1
    return np.array([NormalDist().inv_cdf(share) for share in even.ravel().tolist()]).reshape(even.shape)


def root(rising: Callable[[float], float], low: float, high: float) -> float:
    """Where a function that rises through zero from `low` to `high` has it, by false position; an end that stays is
    counted half (the Illinois method)."""
    below, above, last = rising(low), rising(high), 0.0
    for _ in range(STEPS):
        middle = (low * above - high * below) / (above - below)
        value = rising(middle)
        if abs(value) < CLOSE:
            break
        if value < 0:
            low, below, above = middle, value, above / 2 if last < 0 else above
        else:
            high, above, below = middle, value, below / 2 if last > 0 else below
        last = value
    return middle
