"""The chain of half swings: a half swing depends on its amplitude alone, so two numbers of it make a table.

    a -> (a next, duration)        at Chebyshev nodes between where friction holds and the first amplitude

The table costs one vectorised march over its nodes; after that a half swing is one look into it, whatever the law.
The series of the motion itself are smooth in the amplitude too, and are looked up at the same places.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from .half_cycle import HalfCycles, halves, slopes
from .law import sticking_limit

STRAIGHT, NODES, NODES_SINE, NODES_WIDE = 2, 32, 40, 80  # of a spring without drag, with it, a pendulum, beyond WIDE
WIDE = 2.0  # rad
MOST = 1_000_000  # half swings
RECENT = 4  # tables kept: a fit that has arrived asks for the same ones again, and so does who judges it


@dataclass(frozen=True)
class HalfCycleSequence:
    """Amplitudes and begins in theta, (N + 1, P) each, of the half swings of P laws; the last row is where the motion
    has got to, or has ended.  `weights` (P, N, M) of the M nodes, whose `swings` are one law after the other."""

    amplitudes: np.ndarray
    begins: np.ndarray
    weights: np.ndarray
    swings: HalfCycles

    def series(self, order: int) -> np.ndarray:
        """Of the derivative of that order of the motion, (P, terms, S N): the S-th of the N-th half swing, which holds
        from swings.begins[S] on, is in column S N + n."""
        laws, _, nodes = self.weights.shape
        at_nodes = self.swings.series
        for _ in range(order):
            at_nodes = slopes(at_nodes)
        terms = len(at_nodes)
        by_law = at_nodes.reshape(-1, laws, nodes).transpose(1, 0, 2)
        return np.matmul(by_law, self.weights.transpose(0, 2, 1)).reshape(laws, terms, -1)


def chain(
    laws: np.ndarray, is_pendulum: bool, floor: float, most: int = MOST, until: float = np.inf
) -> HalfCycleSequence:
    """The half swings of laws with rows A, zeta, r, b (P, 4).

    The first law decides how many there are: no more than `most`, none that begins after `until` in theta, none from an
    amplitude that friction holds or that is below `floor`.
    """
    first, _, r, b = laws.T
    low = sticking_limit(r, is_pendulum)
    plain, curved = (NODES_SINE, NODES_WIDE) if is_pendulum else (STRAIGHT, NODES)
    count = curved if (first.max() > WIDE if is_pendulum else b.any()) else plain
    order = np.arange(float(count))
    angle = np.pi * (order + 0.5) / count
    scale = 2 / (first - low)
    nodes = low[:, None] + (np.cos(angle) + 1) / scale[:, None]
    swings = table(nodes.tobytes(), laws.tobytes(), is_pendulum)
    next_share = (-swings.end.reshape(-1, count) - low[:, None]) * scale[:, None] - 1  # as shares, from -1 to 1
    weights = np.cos(np.outer(order, angle)) * 2 / count
    weights[0] /= 2
    coefficients = np.stack([next_share, swings.duration.reshape(-1, count)]) @ weights.T
    ones = np.ones(len(laws))
    shares, durations, least, at = [ones], [np.zeros(len(laws))], floor * scale[0] - 1, 0.0
    looks: list[np.ndarray] = []
    while first[0] > low[0] and len(looks) < most and shares[-1][0] > least and at <= until:
        angle = np.arccos(np.minimum(np.maximum(shares[-1], -ones), ones))
        looks.append(np.cos(np.multiply.outer(angle, order)))
        share, duration = np.vecdot(looks[-1], coefficients)
        shares.append(share)
        durations.append(duration)
        at += float(duration[0])
    found = np.array(looks).reshape(len(looks), len(laws), count).transpose(1, 0, 2)
    amplitudes = low + (np.array(shares) + 1) / scale
    return HalfCycleSequence(amplitudes, np.cumsum(durations, axis=0), np.matmul(found, weights), swings)


@lru_cache(RECENT)
def table(nodes: bytes, laws: bytes, is_pendulum: bool) -> HalfCycles:
    """The half swings from the nodes (P, M) of the laws (P, 4)."""
    a, rows = np.frombuffer(nodes), np.frombuffer(laws).reshape(-1, 4)
    _, zeta, r, b = np.repeat(rows.T, len(a) // len(rows), axis=1)
    return halves(a, zeta, r, b, is_pendulum)
