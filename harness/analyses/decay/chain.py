"""The chain of half swings: a half swing depends on its amplitude alone, so two numbers of it make a table.

    a -> (a next, duration)        at Chebyshev nodes between where friction holds and the first amplitude

The table costs one vectorised march over its nodes; after that a half swing is one look into it, whatever the law.
The series of the motion itself are smooth in the amplitude too, and are looked up at the same places.
"""

from dataclasses import dataclass

import numpy as np

from .halves import Halves, halves, slopes
from .law import at_rest

NODES, NODES_SINE, NODES_WIDE = 32, 40, 80  # of a spring, a pendulum, and one beyond WIDE rad
WIDE = 2.0
MOST = 1_000_000  # half swings


@dataclass(frozen=True)
class Chain:
    """Amplitudes and begins in theta, (N + 1, P) each, of the half swings of P laws; the last row is where the motion
    has got to, or has ended.  `weights` (P, N, M) of the M nodes, whose `swings` are one law after the other."""

    amplitudes: np.ndarray
    begins: np.ndarray
    weights: np.ndarray
    swings: Halves

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


def chain(laws: np.ndarray, sine: bool, floor: float, most: int = MOST, until: float = np.inf) -> Chain:
    """The half swings of laws with rows A, zeta, r, b (P, 4).

    The first law decides how many there are: no more than `most`, none that begins after `until` in theta, none from an
    amplitude that friction holds or that is below `floor`.
    """
    first, zeta, r, b = laws.T
    low = at_rest(r, sine)
    count = NODES if not sine else NODES_WIDE if first.max() > WIDE else NODES_SINE
    order = np.arange(float(count))
    angle = np.pi * (order + 0.5) / count
    nodes = low[:, None] + (first - low)[:, None] * (np.cos(angle) + 1) / 2
    swings = halves(nodes.ravel(), np.repeat(zeta, count), np.repeat(r, count), np.repeat(b, count), sine)
    table = np.stack([-swings.end, swings.duration], axis=1).reshape(len(laws), count, 2)
    weights = np.cos(np.outer(order, angle)) * 2 / count
    weights[0] /= 2
    coefficients = np.matmul(weights, table)
    amplitudes, durations, looks, scale = [first], [np.zeros(len(laws))], [], 2 / (first - low)
    at = 0.0
    for _ in range(most):
        a = amplitudes[-1]
        if not (a[0] > low[0] + floor and at <= until):
            break
        share = np.minimum(np.maximum((a - low) * scale - 1, -1), 1)
        looks.append(np.cos(np.arccos(share)[:, None] * order))
        looked_up = np.matmul(looks[-1][:, None], coefficients)[:, 0]
        amplitudes.append(looked_up[:, 0])
        durations.append(looked_up[:, 1])
        at += float(looked_up[0, 1])
    found = np.array(looks).reshape(len(looks), len(laws), count).transpose(1, 0, 2)
    return Chain(np.array(amplitudes), np.cumsum(durations, axis=0), np.matmul(found, weights), swings)
