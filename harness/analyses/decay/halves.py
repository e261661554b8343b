"""Half swings side by side: from a turning point down to the next, by Taylor series in theta.

On the way down s = -1, and the law is smooth:

    y'' = -g(y) - 2 zeta y' + b y'^2 + r,            g(y) = y or sin y

With w = y' the coefficients of y = sum c_k h^k follow from each other, (k + 1)(k + 2) c_(k+2) being the k-th
coefficient of the right-hand side, and those of S = sin y, C = cos y from S' = w C, C' = -w S (A. Jorba, M. Zou,
Experimental Mathematics 14 (2005), section 3).  A half swing that goes up is the mirror image of one that goes down.
"""

from dataclasses import dataclass

import numpy as np

ORDER = {False: 20, True: 22}  # the series of the pendulum has poles at complex times, that of the spring has none
SMALL = {False: 1e-13, True: 1e-11}  # share of the series that its last terms may be
LONGEST = 1.7  # of a series, in theta
MOST = 100  # series in a half swing


@dataclass(frozen=True)
class Halves:
    """L half swings: where they `end` (L,), their `duration` (L,) in theta, and their series (ORDER + 1, S, L), the
    S-th of which holds from begins[S] on."""

    end: np.ndarray
    duration: np.ndarray
    begins: np.ndarray
    series: np.ndarray


def product(one: np.ndarray, two: np.ndarray, k: int) -> np.ndarray:
    """The k-th coefficients (..., L) of the products of series (K, L) and others (..., K, L)."""
    return np.einsum("ij,...ij->...j", one[: k + 1], two[..., k::-1, :])


def taylor(y: np.ndarray, w: np.ndarray, zeta: np.ndarray, r: np.ndarray, b: np.ndarray, sine: bool) -> np.ndarray:
    """The series (ORDER + 1, L) about the states y, w (L,) on the way down."""
    order = ORDER[sine]
    c, speed = np.empty((order + 1, len(y))), np.empty((order, len(y)))
    c[0], c[1], speed[0] = y, w, w
    restoring = c
    if sine:
        both = restoring, cosine = np.empty((2, *speed.shape))
        restoring[0], cosine[0] = np.sin(y), np.cos(y)
    drag, twice = bool(b.any()), 2 * zeta
    for k in range(order - 1):
        force = twice * speed[k]
        force += restoring[k]
        if k == 0:
            force -= r
        if drag:
            force -= b * product(speed, speed, k)
        if sine:
            fall, rise = product(speed, both, k)
            np.divide(rise, k + 1, out=restoring[k + 1])
            np.divide(fall, -(k + 1), out=cosine[k + 1])
        np.divide(force, -(k + 1) * (k + 2), out=c[k + 2])
        np.multiply(c[k + 2], k + 2, out=speed[k + 1])
    return c


def slopes(series: np.ndarray) -> np.ndarray:
    """The derivative of series whose coefficients run along the first axis."""
    powers = np.arange(1, len(series)).reshape(-1, *(1,) * (series.ndim - 1))
    return series[1:] * powers


def with_slopes(series: np.ndarray) -> np.ndarray:
    """Series (K, L), and beside them their derivatives (K, 2, L)."""
    both = np.zeros((len(series), 2, series.shape[1]))
    both[:, 0], both[:-1, 1] = series, slopes(series)
    return both


def value(series: np.ndarray, h: np.ndarray | float) -> np.ndarray:
    """Series at h, by Horner's rule."""
    total = series[-1].copy()
    for term in series[-2::-1]:
        total *= h
        total += term
    return total


def halves(a: np.ndarray, zeta: np.ndarray, r: np.ndarray, b: np.ndarray, sine: bool) -> Halves:
    """The half swings from rest at y = a; all arrays (L,).  NaN where one does not come back to rest.

    Those that have ended go on by the law of the way down, so that at any theta all of them are smooth in a.
    """
    y, w = a, np.zeros_like(a)
    end, duration = np.full(len(a), np.nan), np.full(len(a), np.nan)
    at, begins, series = 0.0, [], []
    for _ in range(MOST):
        c = taylor(y, w, zeta, r, b, sine)
        h = reach(c, SMALL[sine])
        begins.append(at)
        series.append(c)
        both = with_slopes(c)
        y, w = value(both, h)
        ends = np.flatnonzero(np.isnan(end) & (w >= 0))
        if len(ends):
            root = standstill(both[:-1, 1, ends], h)
            duration[ends], end[ends] = at + root, value(c[:, ends], root)
        if not np.isnan(end).any() or not np.isfinite(y).all():
            break
        at += h
    return Halves(end, duration, np.array(begins), np.stack(series, axis=1))


def reach(c: np.ndarray, small: float) -> float:
    """How far all these series are good: where their last two terms are small beside their first three."""
    size = np.abs(c[:3]).max(axis=0)
    last = np.abs(c[-2:]).max(axis=0)
    return min(LONGEST, float(np.min((small * size / (last + 1e-300)) ** (1 / (len(c) - 1)))))


def standstill(speed: np.ndarray, h: float) -> np.ndarray:
    """Where in (0, h] series of speeds, negative before and not at h, are zero: Newton's method from h."""
    both, root = with_slopes(speed), np.full(speed.shape[1], h)
    for _ in range(12):
        w, slope = value(both, root)
        step = w / np.where(slope > 1e-300, slope, 1e-300)
        root = np.clip(root - step, 0, h)
        if np.abs(step).max() < 1e-8:
            break  # the next one would be as small as the square of it
    return root
