"""The chain of half swings: a half swing depends on its amplitude alone, so two numbers of it make a table.

    a -> (a next, duration)        at Chebyshev nodes between where friction holds and the first amplitude

The table costs one vectorised march over its nodes; after that a half swing is one look into it, whatever the law.
"""

import numpy as np

from .halves import halves
from .law import at_rest

NODES, NODES_SINE, NODES_WIDE = 32, 40, 80  # of a spring, a pendulum, and one beyond WIDE rad
WIDE = 2.0


def chain(laws: np.ndarray, sine: bool, most: int, floor: float) -> tuple[np.ndarray, np.ndarray]:
    """Amplitudes and begins in theta, (N + 1, P) each, of the half swings of P laws with rows A, zeta, r, b (P, 4).

    The first law decides how many there are: no more than `most`, none from an amplitude that friction holds or that
    is below `floor`.  The last row is where the motion has got to, or has ended.
    """
    first, zeta, r, b = laws.T
    low = at_rest(r, sine)
    count = NODES if not sine else NODES_WIDE if first.max() > WIDE else NODES_SINE
    order = np.arange(count)
    angle = np.pi * (order + 0.5) / count
    nodes = low[:, None] + (first - low)[:, None] * (np.cos(angle) + 1) / 2
    swings = halves(nodes.ravel(), np.repeat(zeta, count), np.repeat(r, count), np.repeat(b, count), sine)
    table = np.stack([-swings.end, swings.duration], axis=1).reshape(len(laws), count, 2)
    weights = np.cos(np.outer(order, angle)) * 2 / count
    weights[0] /= 2
    coefficients = np.einsum("km,pmj->pkj", weights, table)
    amplitudes, durations, scale = [first], [np.zeros(len(laws))], 2 / (first - low)
    for _ in range(most):
        a = amplitudes[-1]
        if not a[0] > low[0] + floor:
            break
        share = np.minimum(np.maximum((a - low) * scale - 1, -1), 1)
        looked_up = np.matmul(np.cos(np.arccos(share)[:, None, None] * order), coefficients)[:, 0]
        amplitudes.append(looked_up[:, 0])
        durations.append(looked_up[:, 1])
    return np.array(amplitudes), np.cumsum(durations, axis=0)
