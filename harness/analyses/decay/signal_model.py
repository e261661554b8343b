"""Model of the signal of a sensor in a free decay, with its derivatives with respect to the unknowns.

    signal = rest + drift (t - t_mid) + sign omega^k d^k y/dtheta^k        k = 0 position, 1 velocity, 2 acceleration

The derivatives with respect to t0 and omega are exact, from the next derivative of y.  Those with respect to A, zeta,
r and b are differences of Taylor series.  The perturbed motions are integrated together with the motion itself and
evaluated in the same segment of the same half cycle, so that no reversal lies between them.
"""

from dataclasses import dataclass

import numpy as np

from .law import AMPLITUDE, DRIFT, OMEGA, REST, T0, ZETA, B, R, iterate_return_map

DERIVATIVE_TERMS = 0.75  # fraction of the terms of a series that suffices for a derivative
LAW = np.array([AMPLITUDE, ZETA, R, B])  # the unknowns that half cycles depend on


@dataclass(frozen=True)
class SignalModel:
    """A sensor of a free decay.

    Attributes
    ----------
    initial_sign : float
        +1 if the motion starts above its rest position, -1 if below.
    order : int
        Order of the derivative of the position that is recorded.
    is_pendulum : bool
        Whether the restoring force is sin y instead of y.
    t_mid : float
        Time in s at which the drift is zero.
    min_amplitude : float
        Amplitude below which half cycles are left out.
    """

    initial_sign: float
    order: int
    is_pendulum: bool
    t_mid: float
    min_amplitude: float

    def perturbed_laws(self, p: np.ndarray, unknowns: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the law of p and V laws with one unknown changed.

        Returns
        -------
        laws : numpy.ndarray
            Rows (1 + V, 4) of A, zeta, r, b.
        changed_unknowns : numpy.ndarray
            Index (V,) in UNKNOWNS of the unknown that each further row changes.
        changes : numpy.ndarray
            Change (V,) of that unknown.
        """
        changed_unknowns = unknowns[(unknowns == AMPLITUDE) | (unknowns >= ZETA)]
        a = p[AMPLITUDE]
        sizes = {AMPLITUDE: 1e-6 * a, ZETA: 1e-7, R: 1e-7 * a, B: 1e-6 / a}
        changes = np.array([sizes[unknown] for unknown in changed_unknowns.tolist()])
        laws = np.tile(p[LAW], (1 + len(changed_unknowns), 1))
        for row, (unknown, change) in enumerate(zip(changed_unknowns, changes, strict=True), 1):
            laws[row, unknown == LAW] += change
        return laws, changed_unknowns, changes

    def __call__(self, p: np.ndarray, unknowns: np.ndarray, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the signal (n,) at rising times t (n,) in s, and its Jacobian (n, k) for k of the UNKNOWNS."""
        laws, changed_unknowns, changes = self.perturbed_laws(p, unknowns)
        theta = p[OMEGA] * (t - p[T0])
        end = float(theta[-1]) if len(t) else 0.0
        sequence = iterate_return_map(laws, self.is_pendulum, self.min_amplitude, end=end)
        amplitudes, starts, series = sequence.amplitudes, sequence.starts, sequence.series(self.order)
        count = len(amplitudes) - 1

        # samples before `first` and from `last` on are at rest, those between are in half cycle `cycle`
        cycle = np.searchsorted(starts[:, 0], theta, "right") - 1
        if self.order and count:
            cycle = np.maximum(cycle, 0)  # a fit could not move a jump at t0 past a sample
        first, last = int(np.searchsorted(cycle, 0)), int(np.searchsorted(cycle, count))
        cycle = cycle[first:last]
        local = np.maximum(theta[first:last] - starts[cycle, 0], -1.0)
        segment_starts = sequence.node_cycles.series_starts
        segment = np.maximum(np.searchsorted(segment_starts, local, "right") - 1, 0)
        column, h = segment * count + cycle, local - segment_starts[segment]
        factor = self.initial_sign * np.where(cycle % 2, -1.0, 1.0) * p[OMEGA] ** self.order
        at_rest = self.initial_sign * (self.order == 0) * np.array([1.0, (-1.0) ** count])  # before and after

        y, rate = evaluate_with_derivative(series[0], column, h)
        signal = extend_at_rest(first, factor * y, len(t) - last, at_rest * amplitudes[[0, -1], 0])
        jacobian = np.zeros((len(t), len(unknowns)))
        jacobian_column = {unknown: i for i, unknown in enumerate(unknowns.tolist())}
        jacobian[first:last, jacobian_column[T0]] = -p[OMEGA] * factor * rate
        jacobian[first:last, jacobian_column[OMEGA]] = (
            factor * rate * (t[first:last] - p[T0]) + self.order / p[OMEGA] * signal[first:last]
        )
        short = series[:, : int(DERIVATIVE_TERMS * series.shape[1])]
        for i, (unknown, change) in enumerate(zip(changed_unknowns.tolist(), changes.tolist(), strict=True), 1):
            delay = (starts[:-1, i] - starts[:-1, 0]) / change
            slope = factor * (evaluate_columns((short[i] - short[0]) / change, column, h) - rate * delay[cycle])
            ends = at_rest * (amplitudes[[0, -1], i] - amplitudes[[0, -1], 0]) / change
            jacobian[:, jacobian_column[unknown]] = extend_at_rest(first, slope, len(t) - last, ends)
        jacobian[:, jacobian_column[REST]] = 1.0
        if DRIFT in jacobian_column:
            jacobian[:, jacobian_column[DRIFT]] = t - self.t_mid
        return signal + p[REST] + p[DRIFT] * (t - self.t_mid), jacobian

    def predict_amplitudes(self, p: np.ndarray, unknowns: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
        """Return amplitudes (count + 1,), repeated after the end of the motion, and their Jacobian (count + 1, k)."""
        laws, changed_unknowns, changes = self.perturbed_laws(p, unknowns)
        sizes = iterate_return_map(laws, self.is_pendulum, self.min_amplitude, count).amplitudes
        sizes = np.pad(sizes, ((0, count + 1 - len(sizes)), (0, 0)), mode="edge")
        jacobian = np.zeros((count + 1, len(unknowns)))
        for i, (unknown, change) in enumerate(zip(changed_unknowns, changes, strict=True), 1):
            jacobian[:, np.flatnonzero(unknowns == unknown)[0]] = (sizes[:, i] - sizes[:, 0]) / change
        return sizes[:, 0], jacobian

    def predict_extrema(
        self, p: np.ndarray, unknowns: np.ndarray, count: int
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the turning points after the start; NaN after the end of the motion.

        Returns
        -------
        times : numpy.ndarray
            Times (count,) in s.
        positions : numpy.ndarray
            Positions (count,).
        jacobian : numpy.ndarray
            Derivatives (2, count, k) of times and positions by k of the UNKNOWNS, without the drift.
        """
        laws, changed_unknowns, changes = self.perturbed_laws(p, unknowns)
        sequence = iterate_return_map(laws, self.is_pendulum, self.min_amplitude, count)
        amplitudes, starts = sequence.amplitudes, sequence.starts
        n_missing = count + 1 - len(amplitudes)
        pad = ((0, max(n_missing, 0)), (0, 0))
        sizes = np.pad(amplitudes, pad, constant_values=np.nan)[1:]
        theta = np.pad(starts, pad, constant_values=np.nan)[1:]
        sign = self.initial_sign * (-1.0) ** np.arange(1, count + 1)
        times = p[T0] + theta[:, 0] / p[OMEGA]
        jacobian = np.zeros((2, count, len(unknowns)))
        column = {unknown: i for i, unknown in enumerate(unknowns.tolist())}
        jacobian[0, :, column[T0]] = 1.0
        jacobian[0, :, column[OMEGA]] = -theta[:, 0] / p[OMEGA] ** 2
        jacobian[1, :, column[REST]] = 1.0
        for variant, (unknown, change) in enumerate(zip(changed_unknowns.tolist(), changes.tolist(), strict=True), 1):
            jacobian[0, :, column[unknown]] = (theta[:, variant] - theta[:, 0]) / (change * p[OMEGA])
            jacobian[1, :, column[unknown]] = sign * (sizes[:, variant] - sizes[:, 0]) / change
        return times, p[REST] + p[DRIFT] * (times - self.t_mid) + sign * sizes[:, 0], jacobian


def evaluate_columns(series: np.ndarray, column: np.ndarray, h: np.ndarray) -> np.ndarray:
    """Evaluate the power series in the columns `column` (n,) at h (n,), by Horner's rule."""
    total = series[-1].take(column)
    for term in series[-2::-1]:
        total *= h
        total += term.take(column)
    return total


def evaluate_with_derivative(series: np.ndarray, column: np.ndarray, h: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Evaluate power series as `evaluate_columns` does, and their derivatives (n,)."""
    total, slope = series[-1].take(column), np.zeros_like(h)
    for term in series[-2::-1]:
        slope *= h
        slope += total
        total *= h
        total += term.take(column)
    return total, slope


def extend_at_rest(before: int, values: np.ndarray, after: int, ends: np.ndarray) -> np.ndarray:
    """Extend values of the motion by `before` and `after` samples at rest, which have the values `ends`."""
    return np.concatenate([np.full(before, ends[0]), values, np.full(after, ends[1])])
