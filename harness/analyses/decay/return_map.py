"""Return map of a free decay: the next amplitude and the duration of a half cycle, as functions of its amplitude.

    a -> (next a, duration)        tabulated at Chebyshev nodes between the sticking limit and the first amplitude

A half cycle depends on its amplitude alone.  The table costs one vectorised integration over its nodes; after that,
each half cycle is one Chebyshev interpolation, whatever the law.  The Taylor series of the motion are smooth in the
amplitude too and are interpolated with the same weights.

The half cycles from the nodes are integrated from one turning point to the next by Taylor series in theta.  Downward
s = -1 and the law is smooth.  With the velocity w = y', G = -g(y) and g(y) = y or sin y,

    w' = G + w d + r,    d = b w - 2 zeta,    G' = -w;    for a pendulum G' = -w C, C' = w G, where C = cos y

The k-th coefficients of these products, divided by k + 1, are the (k + 1)-th coefficients of w, G and C.  A half cycle
upward is the mirror image of one downward.

References
----------
A. Jorba, M. Zou, Experimental Mathematics 14 (2005), section 3: integration by Taylor series
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from .law import sticking_limit

# indexed by is_pendulum: the series of the pendulum has poles at complex times, that of the spring has none
ORDER = {False: 20, True: 22}
TOLERANCE = {False: 1e-13, True: 1e-11}  # of the last terms of a series, relative to the first ones
MAX_SEGMENT = 1.7  # length of a segment in theta
MAX_SEGMENTS = 100  # in a half cycle
INDICES = np.arange(1.0, 1.0 + max(ORDER.values()))[:, None]  # numpy divides faster by an array than by a number
SIGNED_INDICES = np.stack([-INDICES, INDICES], axis=1)
NODES_LINEAR, NODES_DRAG = 2, 32  # of a spring, without and with quadratic drag
NODES_PENDULUM, NODES_LARGE = 40, 80  # of a pendulum, up to and beyond LARGE_ANGLE
LARGE_ANGLE = 2.0  # rad
MAX_HALF_CYCLES = 1_000_000
CACHED_TABLES = 4  # the last iterations of a fit, and its evaluation afterwards, use the same tables


@dataclass(frozen=True)
class HalfCycles:
    """L half cycles, each one or more segments with a Taylor series of their own.

    Attributes
    ----------
    end : numpy.ndarray
        Displacement (L,) at the end.
    duration : numpy.ndarray
        Duration (L,) in theta.
    series_starts : numpy.ndarray
        Start (S,) of each segment in theta.
    series : numpy.ndarray
        Taylor coefficients (ORDER + 1, S, L).
    """

    end: np.ndarray
    duration: np.ndarray
    series_starts: np.ndarray
    series: np.ndarray


@dataclass(frozen=True)
class HalfCycleSequence:
    """The N half cycles of P laws.

    Attributes
    ----------
    amplitudes : numpy.ndarray
        Amplitudes (N + 1, P) at the starts; the last row is the end of the last half cycle.
    starts : numpy.ndarray
        Start (N + 1, P) of each half cycle in theta.
    weights : numpy.ndarray
        Interpolation weights (P, N, M) of the M nodes.
    node_cycles : HalfCycles
        Half cycles from the nodes, all nodes of the first law first.
    """

    amplitudes: np.ndarray
    starts: np.ndarray
    weights: np.ndarray
    node_cycles: HalfCycles

    def series(self, order: int) -> np.ndarray:
        """Return the Taylor coefficients of a derivative of the motion.

        Returns
        -------
        coefficients : numpy.ndarray
            Coefficients (P, terms, S N); column s N + n is segment s of half cycle n, valid from series_starts[s] on.
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
    laws : numpy.ndarray
        Rows (P, 4) of A, zeta, r, b.
    min_amplitude : float
        Half cycles from a smaller amplitude, or from one that friction holds, are left out.
    max_count : int
        Maximum number of half cycles.
    end : float
        Half cycles that start later, in theta, are left out.
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


def taylor_coefficients(
    y: np.ndarray, w: np.ndarray, zeta: np.ndarray, r: np.ndarray, b: np.ndarray, is_pendulum: bool
) -> np.ndarray:
    """Return the Taylor coefficients (ORDER + 1, L) of y about the states y, w (L,) of downward motion."""
    order, has_drag, d = ORDER[is_pendulum], bool(b.any()), b * w - 2 * zeta
    series, velocity = np.empty((order + 1, len(y))), np.empty((order, len(y)))
    # factors of the velocity: for a pendulum C and G; with drag also the damping d, which is then not constant
    factors = np.empty((2 * is_pendulum + has_drag, order, len(y)))
    series[0], velocity[0] = y, w
    if is_pendulum:
        factors[:2, 0] = np.cos(y), -np.sin(y)
    if has_drag:
        damping = factors[-1]
        damping[0] = d
    for k in range(order - 1):
        n, at = INDICES[k], k + 1
        if is_pendulum:
            products = np.einsum("ij,kij->kj", velocity[:at], factors[:, k::-1])
            np.divide(products[:2], SIGNED_INDICES[k], out=factors[1::-1, at])
            force = products[2] if has_drag else velocity[k] * d
            force += factors[1, k]
        else:
            force = np.einsum("ij,ij->j", velocity[:at], damping[k::-1]) if has_drag else velocity[k] * d
            force -= series[k]
            np.divide(velocity[k], n, out=series[at])
        if k == 0:
            force += r
        np.divide(force, n, out=velocity[at])
        if has_drag:
            np.multiply(b, velocity[at], out=damping[at])
    missing = 0 if is_pendulum else order - 1
    np.divide(velocity[missing:], INDICES[missing:order], out=series[missing + 1 :])
    return series


def differentiate_series(series: np.ndarray) -> np.ndarray:
    """Return the derivative of power series whose coefficients are along the first axis."""
    powers = np.arange(1, len(series)).reshape(-1, *(1,) * (series.ndim - 1))
    return series[1:] * powers


def compute_powers(h: np.ndarray, count: int) -> np.ndarray:
    """Return h (L,) to the powers 0 to count - 1, as (count, L)."""
    result = np.empty((count, len(h)))
    result[0], result[1], n_powers = 1.0, h, 2
    while n_powers < count:
        batch = min(n_powers - 1, count - n_powers)
        np.multiply(result[n_powers - 1], result[1 : batch + 1], out=result[n_powers : n_powers + batch])
        n_powers += batch
    return result


def evaluate_series(series: np.ndarray, powers: np.ndarray) -> np.ndarray:
    """Return the values (L,) of the series (K, L), from the powers (K or more, L) of their arguments."""
    return np.asarray(np.einsum("ij,ij->j", series, powers[: len(series)]))


def integrate_half_cycles(
    a: np.ndarray, zeta: np.ndarray, r: np.ndarray, b: np.ndarray, is_pendulum: bool
) -> HalfCycles:
    """Integrate half cycles from rest at y = a; all arrays (L,).  NaN where one does not come back to rest.

    Half cycles that have ended are continued by the downward law, so that at any theta all are smooth in a.
    """
    y, w = a, np.zeros_like(a)
    end, duration = np.full(len(a), np.nan), np.full(len(a), np.nan)
    at, starts, series = 0.0, [], []
    for _ in range(MAX_SEGMENTS):
        c = taylor_coefficients(y, w, zeta, r, b, is_pendulum)
        h = segment_length(c, TOLERANCE[is_pendulum])
        starts.append(at)
        series.append(c)
        velocity, powers = differentiate_series(c), h ** np.arange(len(c))
        with np.errstate(invalid="ignore", over="ignore"):  # beyond any motion of the law; the loop ends below
            y, w = powers @ c, powers[:-1] @ velocity
        ends = np.flatnonzero(np.isnan(end) & (w >= 0))
        if len(ends):
            root = time_to_standstill(velocity[:, ends], h)
            duration[ends], end[ends] = at + root, evaluate_series(c[:, ends], compute_powers(root, len(c)))
        if not np.isnan(end).any() or not np.isfinite(y).all():
            break
        at += h
    return HalfCycles(end, duration, np.array(starts), np.stack(series, axis=1))


def segment_length(c: np.ndarray, tolerance: float) -> float:
    """Return the length over which all series c (K, L) are accurate: their last two terms are small relative to the
    first three."""
    size = np.abs(c[:3]).max(axis=0)
    last = np.abs(c[-2:]).max(axis=0)
    return min(MAX_SEGMENT, float(np.min((tolerance * size / (last + 1e-300)) ** (1 / (len(c) - 1)))))


def time_to_standstill(velocity: np.ndarray, h: float) -> np.ndarray:
    """Return the zeros in (0, h] of velocity series that are negative at 0 and not at h, by Newton's method from h."""
    slope, root = differentiate_series(velocity), np.full(velocity.shape[1], h)
    for _ in range(12):
        at = compute_powers(root, len(velocity))
        step = evaluate_series(velocity, at) / np.maximum(evaluate_series(slope, at), 1e-300)
        root = np.minimum(np.maximum(root - step, 0.0), h)
        if np.abs(step).max() < 1e-8:
            break  # convergence is quadratic: the next step is negligible
    return root
