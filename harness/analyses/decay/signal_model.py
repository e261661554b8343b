"""What a sensor records of a free decay, with its derivatives by the unknowns.

    signal = rest + drift (t - middle) + side omega^k d^k y/dtheta^k        k = 0 position, 1 velocity, 2 acceleration

The derivatives by t0 and omega are exact, from the next derivative of y; those by A, zeta, r and b are differences of
series, which are integrated side by side with the motion itself and looked up at the same place of the same half
swing, so that no reversal falls between.
"""

from dataclasses import dataclass

import numpy as np

from .law import AMPLITUDE, DRIFT, OMEGA, REST, T0, ZETA, B, R
from .return_map import chain

SHARE = 0.75  # of the terms of a series are enough for a derivative
LAW = np.array([AMPLITUDE, ZETA, R, B])  # what the half swings depend on


@dataclass(frozen=True)
class SignalModel:
    """How the motion is seen: `side` +1 where it begins above its rest, `order` k of the derivative recorded, `sine`
    for a pendulum, `middle` in s where the drift counts from, and the `floor` below which no swing matters."""

    side: float
    order: int
    is_pendulum: bool
    middle: float
    floor: float

    def perturbed_laws(self, p: np.ndarray, unknowns: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The laws A, zeta, r, b (1 + V, 4) of p and of its V small changes, their places in p (V,) and sizes (V,)."""
        places = unknowns[(unknowns == AMPLITUDE) | (unknowns >= ZETA)]
        a = p[AMPLITUDE]
        sizes = {AMPLITUDE: 1e-6 * a, ZETA: 1e-7, R: 1e-7 * a, B: 1e-6 / a}
        changes = np.array([sizes[place] for place in places.tolist()])
        rows = np.tile(p[LAW], (1 + len(places), 1))
        for row, (place, change) in enumerate(zip(places, changes, strict=True), 1):
            rows[row, place == LAW] += change
        return rows, places, changes

    def __call__(self, p: np.ndarray, unknowns: np.ndarray, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The signal (n,) at rising times t (n,) for the values p of UNKNOWNS, and its Jacobian (n, unknowns)."""
        laws, places, changes = self.perturbed_laws(p, unknowns)
        theta = p[OMEGA] * (t - p[T0])
        found = chain(laws, self.is_pendulum, self.floor, until=float(theta[-1]) if len(t) else 0.0)
        amplitudes, begins, series = found.amplitudes, found.begins, found.series(self.order)
        count = len(amplitudes) - 1

        half = np.searchsorted(begins[:, 0], theta, "right") - 1
        if self.order and count:
            half = np.maximum(half, 0)  # a rate that jumped at t0 would hold it on its side of a sample
        held, left = int(np.searchsorted(half, 0)), int(np.searchsorted(half, count))
        half = half[held:left]
        local = np.maximum(theta[held:left] - begins[half, 0], -1.0)
        stretch = np.maximum(np.searchsorted(found.swings.begins, local, "right") - 1, 0)
        which, h = stretch * count + half, local - found.swings.begins[stretch]
        way = self.side * np.where(half % 2, -1.0, 1.0) * p[OMEGA] ** self.order
        still = self.side * (self.order == 0) * np.array([1.0, (-1.0) ** count])  # before and after the motion

        y, rate = evaluate_with_derivative(series[0], which, h)
        signal = extend_at_rest(held, way * y, len(t) - left, still * amplitudes[[0, -1], 0])
        jacobian = np.zeros((len(t), len(unknowns)))
        column = {place: i for i, place in enumerate(unknowns.tolist())}
        jacobian[held:left, column[T0]] = -p[OMEGA] * way * rate
        jacobian[held:left, column[OMEGA]] = (
            way * rate * (t[held:left] - p[T0]) + self.order / p[OMEGA] * signal[held:left]
        )
        short = series[:, : int(SHARE * series.shape[1])]
        for i, (place, change) in enumerate(zip(places.tolist(), changes.tolist(), strict=True), 1):
            later = (begins[:-1, i] - begins[:-1, 0]) / change
            slope = way * (evaluate_columns((short[i] - short[0]) / change, which, h) - rate * later[half])
            ends = still * (amplitudes[[0, -1], i] - amplitudes[[0, -1], 0]) / change
            jacobian[:, column[place]] = extend_at_rest(held, slope, len(t) - left, ends)
        jacobian[:, column[REST]] = 1.0
        if DRIFT in column:
            jacobian[:, column[DRIFT]] = t - self.middle
        return signal + p[REST] + p[DRIFT] * (t - self.middle), jacobian

    def turns(self, p: np.ndarray, unknowns: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Times (count,) in s and positions (count,) of the turning points after the first, and the Jacobian
        (2, count, unknowns) of both, without that by a drift; NaN after the end of the motion."""
        laws, places, changes = self.perturbed_laws(p, unknowns)
        found = chain(laws, self.is_pendulum, self.floor, count)
        amplitudes, begins = found.amplitudes, found.begins
        missing = count + 1 - len(amplitudes)
        pad = ((0, max(missing, 0)), (0, 0))
        sizes = np.pad(amplitudes, pad, constant_values=np.nan)[1:]
        theta = np.pad(begins, pad, constant_values=np.nan)[1:]
        way = self.side * (-1.0) ** np.arange(1, count + 1)
        times = p[T0] + theta[:, 0] / p[OMEGA]
        jacobian = np.zeros((2, count, len(unknowns)))
        column = {place: i for i, place in enumerate(unknowns.tolist())}
        jacobian[0, :, column[T0]] = 1.0
        jacobian[0, :, column[OMEGA]] = -theta[:, 0] / p[OMEGA] ** 2
        jacobian[1, :, column[REST]] = 1.0
        for variant, (place, change) in enumerate(zip(places.tolist(), changes.tolist(), strict=True), 1):
            jacobian[0, :, column[place]] = (theta[:, variant] - theta[:, 0]) / (change * p[OMEGA])
            jacobian[1, :, column[place]] = way * (sizes[:, variant] - sizes[:, 0]) / change
        return times, p[REST] + p[DRIFT] * (times - self.middle) + way * sizes[:, 0], jacobian


def evaluate_columns(series: np.ndarray, which: np.ndarray, h: np.ndarray) -> np.ndarray:
    """The series in the columns `which` (n,) at h (n,), by Horner's rule."""
    total = series[-1].take(which)
    for term in series[-2::-1]:
        total *= h
        total += term.take(which)
    return total


def evaluate_with_derivative(series: np.ndarray, which: np.ndarray, h: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The same, and the derivatives (n,)."""
    total, slope = series[-1].take(which), np.zeros_like(h)
    for term in series[-2::-1]:
        slope *= h
        slope += total
        total *= h
        total += term.take(which)
    return total, slope


def extend_at_rest(before: int, moving: np.ndarray, after: int, ends: np.ndarray) -> np.ndarray:
    """Values of the motion, with those before and after it, where nothing moves."""
    return np.concatenate([np.full(before, ends[0]), moving, np.full(after, ends[1])])
