"""Half swings side by side: from a turning point down to the next, by Taylor series in theta.

On the way down s = -1, and the law is smooth: with the speed w = y', G = -g(y) and g(y) = y or sin y,

    w' = G + w d + r,    d = b w - 2 zeta,    G' = -w;    of a pendulum G' = -w C, C' = w G, where C = cos y

The k-th coefficients of these products give the (k + 1)-th of w, G and C, divided by k + 1 (A. Jorba, M. Zou,
Experimental Mathematics 14 (2005), section 3).  A half swing that goes up is the mirror image of one that goes down.
"""

from dataclasses import dataclass

import numpy as np

ORDER = {False: 20, True: 22}  # the series of the pendulum has poles at complex times, that of the spring has none
SMALL = {False: 1e-13, True: 1e-11}  # share of the series that its last terms may be
LONGEST = 1.7  # of a series, in theta
MOST = 100  # series in a half swing
NUMBERS = np.arange(1.0, 1.0 + max(ORDER.values()))[:, None]  # by an array numpy divides sooner than by a number
TURNED = np.stack([-NUMBERS, NUMBERS], axis=1)


@dataclass(frozen=True)
class HalfCycles:
    """L half swings: where they `end` (L,), their `duration` (L,) in theta, and their series (ORDER + 1, S, L), the
    S-th of which holds from begins[S] on."""

    end: np.ndarray
    duration: np.ndarray
    begins: np.ndarray
    series: np.ndarray


def taylor(
    y: np.ndarray, w: np.ndarray, zeta: np.ndarray, r: np.ndarray, b: np.ndarray, is_pendulum: bool
) -> np.ndarray:
    """The series (ORDER + 1, L) about the states y, w (L,) on the way down."""
    order, dragged, d = ORDER[is_pendulum], bool(b.any()), b * w - 2 * zeta
    series, speed = np.empty((order + 1, len(y))), np.empty((order, len(y)))
    factors = np.empty(
        (2 * is_pendulum + dragged, order, len(y))
    )  # of the speed: of a pendulum C and G; d that drag changes
    series[0], speed[0] = y, w
    if is_pendulum:
        factors[:2, 0] = np.cos(y), -np.sin(y)
    if dragged:
        damping = factors[-1]
        damping[0] = d
    for k in range(order - 1):
        n, at = NUMBERS[k], k + 1
        if is_pendulum:
            products = np.einsum("ij,kij->kj", speed[:at], factors[:, k::-1])
            np.divide(products[:2], TURNED[k], out=factors[1::-1, at])
            force = products[2] if dragged else speed[k] * d
            force += factors[1, k]
        else:
            force = np.einsum("ij,ij->j", speed[:at], damping[k::-1]) if dragged else speed[k] * d
            force -= series[k]
            np.divide(speed[k], n, out=series[at])
        if k == 0:
            force += r
        np.divide(force, n, out=speed[at])
        if dragged:
            np.multiply(b, speed[at], out=damping[at])
    left = 0 if is_pendulum else order - 1
    np.divide(speed[left:], NUMBERS[left:order], out=series[left + 1 :])
    return series


def slopes(series: np.ndarray) -> np.ndarray:
    """The derivative of series whose coefficients run along the first axis."""
    powers = np.arange(1, len(series)).reshape(-1, *(1,) * (series.ndim - 1))
    return series[1:] * powers


def powers(h: np.ndarray, count: int) -> np.ndarray:
    """h (L,) to the powers below `count` (count, L)."""
    found = np.empty((count, len(h)))
    found[0], found[1], known = 1.0, h, 2
    while known < count:
        more = min(known - 1, count - known)
        np.multiply(found[known - 1], found[1 : more + 1], out=found[known : known + more])
        known += more
    return found


def value(series: np.ndarray, powers: np.ndarray) -> np.ndarray:
    """Series (K, L) at the places h (L,) of these powers (K or more, L)."""
    return np.asarray(np.einsum("ij,ij->j", series, powers[: len(series)]))


def halves(a: np.ndarray, zeta: np.ndarray, r: np.ndarray, b: np.ndarray, is_pendulum: bool) -> HalfCycles:
    """The half swings from rest at y = a; all arrays (L,).  NaN where one does not come back to rest.

    Those that have ended go on by the law of the way down, so that at any theta all of them are smooth in a.
    """
    y, w = a, np.zeros_like(a)
    end, duration = np.full(len(a), np.nan), np.full(len(a), np.nan)
    at, begins, series = 0.0, [], []
    for _ in range(MOST):
        c = taylor(y, w, zeta, r, b, is_pendulum)
        h = reach(c, SMALL[is_pendulum])
        begins.append(at)
        series.append(c)
        speed, at_end = slopes(c), h ** np.arange(len(c))
        y, w = at_end @ c, at_end[:-1] @ speed
        ends = np.flatnonzero(np.isnan(end) & (w >= 0))
        if len(ends):
            root = standstill(speed[:, ends], h)
            duration[ends], end[ends] = at + root, value(c[:, ends], powers(root, len(c)))
        if not np.isnan(end).any() or not np.isfinite(y).all():
            break
        at += h
    return HalfCycles(end, duration, np.array(begins), np.stack(series, axis=1))


def reach(c: np.ndarray, small: float) -> float:
    """How far all these series are good: where their last two terms are small beside their first three."""
    size = np.abs(c[:3]).max(axis=0)
    last = np.abs(c[-2:]).max(axis=0)
    return min(LONGEST, float(np.min((small * size / (last + 1e-300)) ** (1 / (len(c) - 1)))))


def standstill(speed: np.ndarray, h: float) -> np.ndarray:
    """Where in (0, h] series of speeds, negative before and not at h, are zero: Newton's method from h."""
    slope, root = slopes(speed), np.full(speed.shape[1], h)
    for _ in range(12):
        at = powers(root, len(speed))
        step = value(speed, at) / np.maximum(value(slope, at), 1e-300)
        root = np.minimum(np.maximum(root - step, 0.0), h)
        if np.abs(step).max() < 1e-8:
            break  # the next one would be as small as the square of it
    return root
