"""Problem of a decay: a record in the units of the fit, starting values of its unknowns, and their least squares.

Times count from the start of the record, values from a point near the rest position.  The law of a spring has no
length scale, so positions are in units of the first amplitude; those of a pendulum are in radians.  The sum of
squares is minimised by scipy over some of the unknowns, with nonnegative losses.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Self

import numpy as np
from scipy import optimize

from ...errors import HarnessError, command_text
from ...records.motion import MIN_SAMPLES, Motion, selection_text
from . import thresholds
from .law import (
    AMPLITUDE,
    DRIFT,
    MAX_HALF_CYCLES,
    OMEGA,
    REST,
    T0,
    TERMS,
    UNKNOWNS,
    ZETA,
    R,
    Terms,
    estimate_losses,
    iterate_return_map,
    unknown_indices,
)
from .samples import Extrema
from .signal_model import LAW, SignalModel

Minimum = tuple[np.ndarray, float]  # the values of UNKNOWNS, and the sum of squares
Residual = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]


@dataclass(frozen=True)
class DecayProblem:
    """Samples of a record and the model to be fitted to them.

    Attributes
    ----------
    t, x : numpy.ndarray
        Times (n,) in s and values (n,), in the units of the fit.
    model : SignalModel
        Model of the samples.
    time_origin, offset, scale : float
        The record has the time t + time_origin in s and the value x scale + offset in its unit.
    noise : float
        Standard deviation of a sample, in the unit of the fit.
    drift : bool
        Whether the drift of the rest position is fitted.
    half_period : float
        Half period in s.
    quantiser_step : float
        Step of the quantiser in the unit of the record; 0 if it does not exceed the noise.
    cache : dict
        Residuals and Jacobians of the last two evaluations.
    """

    t: np.ndarray
    x: np.ndarray
    model: SignalModel
    time_origin: float
    offset: float
    scale: float
    noise: float
    drift: bool
    half_period: float
    quantiser_step: float

    @property
    def residual_floor(self) -> float:
        """Residuals below which no fit is better than another."""
        return thresholds.MODEL_ACCURACY * float(np.std(self.x))

    @property
    def signal_rms(self) -> float:
        """Root mean square of the samples about their mean."""
        return float(np.sqrt(np.mean((self.x - self.x.mean()) ** 2)))

    def unknowns(self, terms: Terms) -> np.ndarray:
        """Return the indices in UNKNOWNS of the values to fit."""
        return unknown_indices(terms, self.drift)

    def subset(self, keep: np.ndarray | slice) -> Self:
        """Return the problem with some of its samples; FitError if these are too few."""
        problem = replace(self, t=self.t[keep], x=self.x[keep])
        if not len(problem.t):
            raise FitError(
                "is not a free decay of one oscillator: no sample follows the law that fits its turning points",
                f"select the free decay with {selection_text()}, or use {command_text('fit', 'stickslip')} "
                "for a driven motion",
            )
        if len(problem.t) < MIN_SAMPLES:
            raise FitError(
                f"has only {len(problem.t)} samples in a row that follow the free decay of one oscillator, and "
                f"{MIN_SAMPLES} are needed",
                f"sample finer, or select the free decay with {selection_text()}",
            )
        return problem

    def residuals(self, p: np.ndarray, terms: Terms) -> tuple[np.ndarray, np.ndarray]:
        """Return the residuals (n,), model minus samples, and their Jacobian (n, k).

        They are NaN far from the frequency of the record: its half cycles, and so the cost, would be without limit.
        """
        change = p[OMEGA] * self.half_period / np.pi
        if not 1 / thresholds.MAX_FREQUENCY_CHANGE < change < thresholds.MAX_FREQUENCY_CHANGE:
            return np.full(len(self.t), np.nan), np.full((len(self.t), len(self.unknowns(terms))), np.nan)
        signal, jacobian = self.model(p, self.unknowns(terms), self.t)
        return signal - self.x, jacobian

    def fit(self, p: np.ndarray, terms: Terms, max_steps: int = 30) -> Minimum:
        """Fit the law with these terms, from the starting values p."""
        unknowns, stride = self.unknowns(terms), len(self.t) // thresholds.MAX_COARSE_SAMPLES
        if stride > 1:
            coarse = self.subset(slice(None, None, stride))
            p, _ = least_squares(lambda q: coarse.residuals(q, terms), p, unknowns, max_steps)
        return least_squares(lambda q: self.residuals(q, terms), p, unknowns, max_steps)

    def fit_growing_windows(self, p: np.ndarray, terms: Terms) -> np.ndarray:
        """Return the values of UNKNOWNS after fits to growing windows, none shorter than five half cycles."""
        min_size = int(np.searchsorted(self.t, self.t[0] + thresholds.MIN_WINDOW * self.half_period))
        for share in thresholds.FIT_WINDOWS:
            size = max(int(share * len(self.t)), min(len(self.t), min_size))
            p, _ = self.subset(slice(size)).fit(p, terms, thresholds.FIT_WINDOW_STEPS)
        return p

    def exceeds_noise(self, cost: float) -> bool:
        """Return whether a sum of squares is larger than noise explains."""
        return cost > len(self.t) * (thresholds.UNEXPLAINED_RATIO * self.noise) ** 2

    def half_cycles(self, p: np.ndarray, max_count: int = MAX_HALF_CYCLES) -> tuple[np.ndarray, np.ndarray]:
        """Return amplitudes and start times (N + 1,), in s, of the half cycles up to the end of the samples."""
        end = p[OMEGA] * (self.t[-1] - p[T0])
        sequence = iterate_return_map(p[None, LAW], self.model.is_pendulum, self.model.min_amplitude, max_count, end)
        return sequence.amplitudes[:, 0], p[T0] + sequence.starts[:, 0] / p[OMEGA]

    def skip_half_cycles(self, p: np.ndarray, count: int) -> tuple[Self, np.ndarray]:
        """Return the problem and its values p for the same motion started `count` half cycles later."""
        amplitudes, starts = self.half_cycles(p, max_count=count)
        p = p.copy()
        p[AMPLITUDE], p[T0] = amplitudes[count], starts[count]
        model = replace(self.model, initial_sign=self.model.initial_sign * (-1) ** count)
        return replace(self, model=model), p

    def start_near(self, p: np.ndarray, t: float) -> tuple[Self, np.ndarray]:
        """Return the problem and its values p for the same motion started at the turning point nearest to t, in s."""
        _, starts = self.half_cycles(p)
        return self.skip_half_cycles(p, int(np.argmin(np.abs(starts - t))))


def prepare_problem(record: Motion, extrema: Extrema, pendulum: bool, drift: bool) -> tuple[DecayProblem, np.ndarray]:
    """Return the fit problem of a record, and the values of the full law that fit its turning points best."""
    time_origin = float(record.t[0])
    times, first = extrema.t - time_origin, extrema.t_start - time_origin
    rest = extrema.rest_positions(drift or record.order > 0)
    initial_sign = -float(np.sign(extrema.x[0] - rest[0]))
    a = np.abs(extrema.x - rest)
    scale = 1.0 if pendulum else float(a.max())
    offset = float(rest[-1]) if record.order == 0 else float(np.median(record.x))
    a, positions, error = a / scale, (extrema.x - rest) / scale, extrema.error / scale
    noise = max(extrema.noise / scale, thresholds.MIN_NOISE * float(np.ptp(record.x)) / scale)
    omega = np.pi / extrema.half_period * (1 + float(np.median(a)) ** 2 / 16 if pendulum else 1.0)
    error = max(error, 1e-9)
    t_mid = float(record.t[-1] - time_origin) / 2
    model = SignalModel(initial_sign, record.order, pendulum, t_mid, max(1e-3 * error, 1e-6 * float(a.max())))

    start = np.zeros(len(UNKNOWNS))
    start[T0], start[OMEGA] = first, omega
    start[ZETA:] = estimate_losses(a, TERMS, pendulum) if len(a) > 3 else (0.01, 0.0, 0.0)
    zeta, r, b = start[ZETA:]
    start[AMPLITUDE] = a[0] + max(2 * r + np.pi * zeta * a[0] + 4 / 3 * b * a[0] ** 2, 0.0)
    if pendulum:
        start[AMPLITUDE] = min(start[AMPLITUDE], 3.1)
    position_model = replace(model, order=0)
    p = fit_numbered_extrema(position_model, start, times, positions, a * omega / (3 * error), error)
    if record.order:
        p[REST] = p[DRIFT] = 0.0
    elif drift and len(rest) > 1 and times[-1] > times[0]:
        slope = (rest[-1] - rest[0]) / (times[-1] - times[0]) / scale
        p[DRIFT] += slope
        p[REST] += slope * (model.t_mid - times[-1])
    t, x = record.t - time_origin, (record.x - offset) / scale
    problem = DecayProblem(
        t, x, model, time_origin, offset, scale, noise, drift, extrema.half_period, extrema.quantiser_step
    )
    return problem, p


def fit_numbered_extrema(
    model: SignalModel, start: np.ndarray, times: np.ndarray, positions: np.ndarray, weights: np.ndarray, error: float
) -> np.ndarray:
    """Fit the turning points and return the values of UNKNOWNS.

    The turning points are matched by number, so the fit cannot be wrong by whole cycles.

    Parameters
    ----------
    start : numpy.ndarray
        Starting values (8,) of UNKNOWNS.
    times, positions : numpy.ndarray
        Times (n,) in s and positions (n,) of the measured turning points.
    weights : numpy.ndarray
        Weights (n,) of the times, in 1/s.
    error : float
        Standard error of the positions.
    """
    unknowns = unknown_indices(TERMS, False)
    if 2 * len(times) <= len(unknowns):
        return start

    def residuals(p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        at, x, jacobian = model.predict_extrema(p, unknowns, len(times))
        is_reached = np.isfinite(at)
        in_time = np.where(is_reached, (np.where(is_reached, at, 0.0) - times) * weights, thresholds.UNREACHED_RESIDUAL)
        in_position = np.where(
            is_reached, (np.where(is_reached, x, 0.0) - positions) / error, thresholds.UNREACHED_RESIDUAL
        )
        slopes = (
            np.where(is_reached[None, :, None], jacobian, 0.0)
            * np.stack([weights, np.full_like(weights, 1 / error)])[..., None]
        )
        return np.concatenate([in_time, in_position]), slopes.reshape(-1, len(unknowns))

    return least_squares(residuals, start, unknowns)[0]


class FitError(HarnessError):
    """No law fits the record.

    The text continues a sentence that starts with the name of the record; `advice` says what to do.
    """

    def __init__(self, text: str, advice: str = "") -> None:
        super().__init__(text)
        self.advice = advice or f"select the free decay with {selection_text()}"


def least_squares(
    residual: Residual, p: np.ndarray, unknowns: np.ndarray, max_steps: int = 30
) -> tuple[np.ndarray, float]:
    """Minimise the sum of squared residuals over some of the UNKNOWNS.

    Parameters
    ----------
    residual : callable
        Function of p that returns residuals (n,) and their Jacobian (n, k).
    p : numpy.ndarray
        Starting values (8,) of all UNKNOWNS.
    unknowns : numpy.ndarray
        Indices (k,) of the unknowns to fit.

    Returns
    -------
    p : numpy.ndarray
        Values (8,) of all UNKNOWNS.
    sum_of_squares : float
        Sum of the squared residuals.

    Raises
    ------
    FitError
        If the starting values give no motion.
    """
    start = p[unknowns]

    @lru_cache(maxsize=2)
    def evaluate(values: bytes) -> tuple[np.ndarray, np.ndarray, int]:
        """Return residuals and Jacobian with the same sums of squares and products, and the number of residuals.

        Their k + 1 rows are faster to decompose; einsum needs no threads for them, unlike BLAS.  scipy refuses a step
        to values that are not finite.
        """
        q, nan_jacobian = p.copy(), np.full((len(unknowns) + 1, len(unknowns)), np.nan)
        q[unknowns] = np.frombuffer(values)
        if not (np.array_equal(q, p) or is_admissible(q, p)):  # before its cost, which may be large
            return nan_jacobian[:, 0], nan_jacobian, 0
        r, jacobian = residual(q)
        rows = np.column_stack([jacobian, r])
        if not jacobian.any() or not np.isfinite(rows).all():
            return nan_jacobian[:, 0], nan_jacobian, len(r)
        scale = column_norms(rows)
        sizes, axes = np.linalg.eigh(np.einsum("ij,ik->jk", rows / scale, rows / scale))
        root = np.sqrt(np.maximum(sizes, 0.0))[:, None] * axes.T * scale
        return root[:, -1], root[:, :-1], len(r)

    lowest = np.where(unknowns >= ZETA, 0.0, -np.inf)
    with np.errstate(all="ignore"):
        r, _, n = evaluate(start.tobytes())
    if not np.isfinite(r).all():
        raise FitError("does not have the turning points of a free decay of one oscillator")
    degrees_of_freedom = max(n - len(unknowns), 1)
    with np.errstate(all="ignore"):
        fit = optimize.least_squares(
            lambda values: evaluate(values.tobytes())[0],
            start,
            lambda values: evaluate(values.tobytes())[1],
            bounds=(lowest, np.inf),
            x_scale="jac",
            ftol=thresholds.CONVERGED_GAIN / degrees_of_freedom,
            xtol=thresholds.CONVERGED_CHANGE,
            gtol=None,
            max_nfev=max_steps + 1,
        )
    p = p.copy()
    p[unknowns] = fit.x
    # the method approaches a bound but does not reach it, and a law without a loss is recognised by its zero
    scale = column_norms(fit.jac)
    inverse = np.linalg.pinv((fit.jac / scale).T @ (fit.jac / scale))
    errors = np.sqrt(np.diag(inverse) * 2 * fit.cost / degrees_of_freedom) / scale
    is_zero = (lowest == 0) & (fit.x <= thresholds.ABSENT_LOSS * errors) & (fit.grad >= 0)
    if not is_zero.any():
        return p, 2 * float(fit.cost)
    p[unknowns[is_zero]] = 0.0

    def residual_of_others(q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        r, jacobian = residual(q)
        return r, jacobian[:, ~is_zero]

    return least_squares(residual_of_others, p, unknowns[~is_zero], max_steps)


def column_norms(jacobian: np.ndarray) -> np.ndarray:
    """Return the norms of the columns, 1 for a column of zeros."""
    norms = np.linalg.norm(jacobian, axis=0)
    return np.where(norms == 0, 1.0, norms)


def is_admissible(p: np.ndarray, start: np.ndarray) -> bool:
    """Return whether the motion with the values p oscillates, at about the time and the frequency of the start."""
    change = p[OMEGA] / start[OMEGA]
    return bool(
        1 / thresholds.MAX_FREQUENCY_CHANGE < change < thresholds.MAX_FREQUENCY_CHANGE
        and abs(p[T0] - start[T0]) * start[OMEGA] < thresholds.MAX_PHASE_CHANGE
        and p[ZETA] < thresholds.MAX_DAMPING_RATIO
        and max(p[R], 0.0) < p[AMPLITUDE]
    )
