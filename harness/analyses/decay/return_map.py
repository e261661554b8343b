"""Return map of a free decay: the next amplitude and the duration of a half cycle, as functions of its amplitude.

    a -> (next a, duration)        tabulated at Chebyshev nodes between the sticking limit and the first amplitude

A half cycle depends on its amplitude alone.  The table costs one vectorised integration over its nodes; after that,
each half cycle is one Chebyshev interpolation, whatever the law.  The Taylor series of the motion are smooth in the
amplitude too and are interpolated with the same weights.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from .half_cycle import HalfCycles, differentiate_series, integrate_half_cycles
from .law import sticking_limit

NODES_LINEAR, NODES_DRAG = 2, 32  # of a spring, without and with quadratic drag
NODES_PENDULUM, NODES_LARGE = 40, 80  # of a pendulum, up to and beyond LARGE_ANGLE
LARGE_ANGLE = 2.0  # rad
MAX_HALF_CYCLES = 1_000_000
CACHED_TABLES = 4  # the last iterations of a fit, and its evaluation afterwards, use the same tables


@dataclass(frozen=True)
class HalfCycleSequence:
    """The N half cycles of P laws.

    Attributes
    ----------
    amplitudes : (N + 1, P); the last row is the end of the last half cycle
    starts : (N + 1, P) start of each half cycle in theta
    weights : (P, N, M) interpolation weights of the M nodes
    node_cycles : half cycles from the nodes, all nodes of the first law first
    """

    amplitudes: np.ndarray
    starts: np.ndarray
    weights: np.ndarray
    node_cycles: HalfCycles

    def series(self, order: int) -> np.ndarray:
        """Return the Taylor coefficients of a derivative of the motion.

        Returns
        -------
        coefficients : (P, terms, S N); column s N + n is segment s of half cycle n, valid from series_starts[s] on
        """
        laws, _, nodes = self.weights.shape
        at_nodes = self.node_cycles.series
        for _ in range(order):
            at_nodes = differentiate_series(at_nodes)
        terms = len(at_nodes)
        by_law = at_nodes.reshape(-1, laws, nodes).transpose(1, 0, 2)
        return np.matmul(by_law, self.weights.transpose(0, 2, 1)).reshape(laws, terms, -1)


def iterate_return_map(
    laws: np.ndarray,
    is_pendulum: bool,
    min_amplitude: float,
    max_count: int = MAX_HALF_CYCLES,
    end: float = np.inf,
) -> HalfCycleSequence:
    """Return the half cycles of several laws; the first law decides how many.

    Parameters
    ----------
    laws : (P, 4) rows of A, zeta, r, b
    min_amplitude : half cycles from a smaller amplitude, or from one that friction holds, are left out
    max_count : maximum number of half cycles
    end : half cycles that start later, in theta, are left out
    """
    first, _, r, b = laws.T
    low = sticking_limit(r, is_pendulum)
    n_small, n_large = (NODES_PENDULUM, NODES_LARGE) if is_pendulum else (NODES_LINEAR, NODES_DRAG)
    count = n_large if (first.max() > LARGE_ANGLE if is_pendulum else b.any()) else n_small
    order = np.arange(float(count))
    angle = np.pi * (order + 0.5) / count
    scale = 2 / (first - low)
    nodes = low[:, None] + (np.cos(angle) + 1) / scale[:, None]
    node_cycles = tabulate(nodes.tobytes(), laws.tobytes(), is_pendulum)
    next_share = (-node_cycles.end.reshape(-1, count) - low[:, None]) * scale[:, None] - 1  # mapped to [-1, 1]
    weights = np.cos(np.outer(order, angle)) * 2 / count
    weights[0] /= 2
    coefficients = np.stack([next_share, node_cycles.duration.reshape(-1, count)]) @ weights.T
    ones = np.ones(len(laws))
    shares, durations, min_share, at = [ones], [np.zeros(len(laws))], min_amplitude * scale[0] - 1, 0.0
    polynomials: list[np.ndarray] = []
    while first[0] > low[0] and len(polynomials) < max_count and shares[-1][0] > min_share and at <= end:
        angle = np.arccos(np.minimum(np.maximum(shares[-1], -ones), ones))
        polynomials.append(np.cos(np.multiply.outer(angle, order)))
        share, duration = np.vecdot(polynomials[-1], coefficients)
        shares.append(share)
        durations.append(duration)
        at += float(duration[0])
    by_law = np.array(polynomials).reshape(len(polynomials), len(laws), count).transpose(1, 0, 2)
    amplitudes = low + (np.array(shares) + 1) / scale
    return HalfCycleSequence(amplitudes, np.cumsum(durations, axis=0), np.matmul(by_law, weights), node_cycles)


@lru_cache(CACHED_TABLES)
def tabulate(nodes: bytes, laws: bytes, is_pendulum: bool) -> HalfCycles:
    """Return the half cycles from the nodes (P, M) of the laws (P, 4), both given as bytes for the cache."""
    a, rows = np.frombuffer(nodes), np.frombuffer(laws).reshape(-1, 4)
    _, zeta, r, b = np.repeat(rows.T, len(a) // len(rows), axis=1)
    return integrate_half_cycles(a, zeta, r, b, is_pendulum)
