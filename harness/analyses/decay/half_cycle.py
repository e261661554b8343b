"""Half cycles of a free decay, integrated from one turning point to the next by Taylor series in theta.

Downward s = -1 and the law is smooth.  With the velocity w = y', G = -g(y) and g(y) = y or sin y,

    w' = G + w d + r,    d = b w - 2 zeta,    G' = -w;    for a pendulum G' = -w C, C' = w G, where C = cos y

The k-th coefficients of these products, divided by k + 1, are the (k + 1)-th coefficients of w, G and C.  A half cycle
upward is the mirror image of one downward.

References
----------
A. Jorba, M. Zou, Experimental Mathematics 14 (2005), section 3
"""

from dataclasses import dataclass

import numpy as np

# indexed by is_pendulum: the series of the pendulum has poles at complex times, that of the spring has none
ORDER = {False: 20, True: 22}
TOLERANCE = {False: 1e-13, True: 1e-11}  # of the last terms of a series, relative to the first ones
MAX_SEGMENT = 1.7  # length of a segment in theta
MAX_SEGMENTS = 100  # in a half cycle
INDICES = np.arange(1.0, 1.0 + max(ORDER.values()))[:, None]  # numpy divides faster by an array than by a number
SIGNED_INDICES = np.stack([-INDICES, INDICES], axis=1)


@dataclass(frozen=True)
class HalfCycles:
    """L half cycles, each one or more segments with a Taylor series of their own.

    Attributes
    ----------
    end : (L,) displacement at the end
    duration : (L,) in theta
    series_starts : (S,) start of each segment in theta
    series : (ORDER + 1, S, L) Taylor coefficients
    """

    end: np.ndarray
    duration: np.ndarray
    series_starts: np.ndarray
    series: np.ndarray


def taylor_coefficients(
    y: np.ndarray, w: np.ndarray, zeta: np.ndarray, r: np.ndarray, b: np.ndarray, is_pendulum: bool
) -> np.ndarray:
    """Return the Taylor coefficients (ORDER + 1, L) of y about the states y, w (L,) of downward motion."""
    order, has_drag, d = ORDER[is_pendulum], bool(b.any()), b * w - 2 * zeta
    series, velocity = np.empty((order + 1, len(y))), np.empty((order, len(y)))
    # what multiplies the velocity: for a pendulum C and G; with drag, the damping d, which is then not constant
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
    """Return how far all series c (K, L) are accurate: their last two terms are small relative to the first three."""
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
