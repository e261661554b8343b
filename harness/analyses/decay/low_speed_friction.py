"""Friction that rises at low speed (Stribeck): whether a record shows it, and which rise it cannot exclude.

With the friction r + d exp(-|v|/v_s) a half cycle of amplitude a loses more energy, 2 a d h(u) for the ratio u of its
peak speed to v_s, where h(u) = 1/2 int exp(-u sin phi) sin phi dphi over [0, pi].  To first order in d, this lost
amplitude decays as every small change of the amplitude does, so the signal changes by a known function of time times d.
The values of the law and d >= 0 are fitted to the residuals at once by one linear step with nonnegative losses, for
several v_s.  A ratio of likelihoods decides whether the record shows a rise; correlated residuals reduce it.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy import optimize

from ..estimation.estimate import NORMAL_QUANTILE, Estimate
from ..estimation.noise import block_scores
from . import thresholds
from .estimates import unit_scales
from .fit_problem import FitProblem, column_norms
from .intervals import FitUncertainty
from .law import AMPLITUDE, UNKNOWNS, ZETA
from .model_selection import FittedLaw
from .return_map import iterate_return_map


@dataclass(frozen=True)
class LowSpeedRise:
    """A rise of friction at low speed, in the units of the problem.

    Attributes
    ----------
    speed : float
        Speed v_s relative to the peak speed of the first half cycle.
    size : float
        Friction at standstill less that at high speed, over stiffness.
    deviance : float
        Decrease of n ln(squares) of the fit, of n independent residuals.
    losses : dict
        Losses by name that fit together with the rise.
    intervals : dict
        95 % intervals of the losses by name, over all speeds for which the record shows a rise.
    limit : float
        Rise with a v_s of LIMIT_SPEED that the record would show in five of six cases.
    """

    speed: float
    size: float
    deviance: float
    losses: dict[str, float]
    intervals: dict[str, tuple[float, float]]
    limit: float

    @property
    def is_shown(self) -> bool:
        """Whether the record shows the rise; without friction at high speed it would be no rise."""
        return self.deviance > thresholds.SHOWN_RISE and self.size < thresholds.MAX_RISE * self.losses["r"]


def signal_changes(problem: FitProblem, p: np.ndarray, slope: np.ndarray, speeds: np.ndarray) -> np.ndarray:
    """Return the changes (n, k) of the signal by a unit rise at k relative speeds.

    Parameters
    ----------
    slope : numpy.ndarray
        Derivative (n,) of the signal by the first amplitude.
    """
    amplitudes, starts = problem.half_cycles(p)
    laws, _, changes = problem.model.perturbed_laws(p, np.array([AMPLITUDE]))
    is_pendulum = problem.model.is_pendulum
    both = iterate_return_map(laws, is_pendulum, problem.model.min_amplitude, len(amplitudes) - 1).amplitudes
    sensitivity = np.maximum((both[:, 1] - both[:, 0]) / changes[0], thresholds.MIN_SENSITIVITY)
    peak = 2 * np.sin(amplitudes / 2) if is_pendulum else amplitudes
    phi = np.linspace(0.0, np.pi, 65)
    u = (peak[:-1] / peak[0])[:, None, None] / speeds[:, None]
    share = 0.5 * np.trapezoid(np.exp(-u * np.sin(phi)) * np.sin(phi), phi, axis=-1)
    middle = (amplitudes[:-1] + amplitudes[1:]) / 2
    force = np.sinc(middle / np.pi) if is_pendulum else np.ones_like(middle)  # sin a/a
    lost = 2 * share / force[:, None] / sensitivity[1:, None]
    total = np.concatenate([np.zeros((1, len(speeds))), -np.cumsum(lost, axis=0)])
    return np.stack([slope * np.interp(problem.t, starts, column) for column in total.T], axis=1)


def find_low_speed_rise(problem: FitProblem, full: FittedLaw, uncertainty: FitUncertainty) -> LowSpeedRise | None:
    """Return the rise that fits best to the residuals of the full law; None if there are too few half cycles."""
    p, unknowns = full.p, uncertainty.unknowns
    if "r" not in full.terms or len(problem.half_cycles(p)[0]) < thresholds.MIN_RISE_HALF_CYCLES:
        return None
    e, jacobian = problem.residuals(p, full.terms)
    speeds = np.array(thresholds.RISE_SPEEDS)
    changes = signal_changes(problem, p, jacobian[:, np.flatnonzero(unknowns == AMPLITUDE)[0]], speeds)
    n, floor = len(e), len(e) * problem.residual_floor**2
    low = np.append(np.where(unknowns >= ZETA, -p[unknowns], -np.inf), 0.0)
    rises = []
    for speed, change in zip(speeds.tolist(), changes.T, strict=True):
        columns = np.column_stack([jacobian, change])
        scale = column_norms(columns)
        columns = columns / scale
        triangle = np.asarray(np.linalg.qr(np.column_stack([columns, e]), mode="r"))
        step = optimize.lsq_linear(triangle[:, :-1], -triangle[:, -1], (low * scale, np.inf)).x
        rest = e + columns @ step
        squares = max(float(rest @ rest), floor)
        alone = columns[:, -1] - columns[:, :-1] @ np.linalg.lstsq(columns[:, :-1], columns[:, -1], rcond=None)[0]
        white = squares / n * float(alone @ alone)
        variance = white  # of the score of the rise
        for count in thresholds.RISE_BLOCKS:
            scores, factor = block_scores(alone[:, None], rest, count, len(unknowns) + 1)
            variance = max(variance, float((scores**2).sum()) * factor)
        deviance = n * float(np.log(max(float(e @ e), floor) / squares)) * white / variance
        error = np.sqrt(variance) / float(alone @ alone) / scale[-1]
        limit = (np.sqrt(thresholds.SHOWN_RISE) + 1) * error
        spread = np.diag(np.linalg.pinv(columns.T @ columns)) * squares / n * variance / white
        margins = NORMAL_QUANTILE * np.sqrt(spread) / scale
        values = {UNKNOWNS[at]: i for i, at in enumerate(unknowns.tolist()) if at >= ZETA}
        losses = {name: float(p[unknowns[i]] + step[i] / scale[i]) for name, i in values.items()}
        intervals = {
            name: (losses[name] - float(margins[i]), losses[name] + float(margins[i])) for name, i in values.items()
        }
        rises.append(LowSpeedRise(speed, float(step[-1] / scale[-1]), deviance, losses, intervals, limit))
    best = max(rises, key=lambda rise: (rise.is_shown, rise.deviance))
    shown = [rise.intervals for rise in rises if rise.is_shown]
    intervals = {
        name: (min(each[name][0] for each in shown), max(each[name][1] for each in shown))
        for name in full.terms
        if shown
    }
    limit = rises[thresholds.RISE_SPEEDS.index(thresholds.LIMIT_SPEED)].limit
    return replace(best, intervals=intervals, limit=limit)


def widen_losses(estimates: tuple[Estimate, ...], problem: FitProblem, rise: LowSpeedRise) -> tuple[Estimate, ...]:
    """Return the estimates; the intervals of the losses cover those with the rise too."""
    widened = list(estimates)
    for i, estimate in enumerate(estimates):
        if estimate.name in rise.intervals:
            scale = unit_scales(problem)[UNKNOWNS.index(estimate.name)]
            below, above = (value * scale for value in rise.intervals[estimate.name])
            error = max(estimate.error, abs(rise.losses[estimate.name] * scale - estimate.value))
            low, high = min(estimate.low, max(below, 0.0)), max(estimate.high, above)
            widened[i] = replace(estimate, error=error, low=low, high=high)
    return tuple(widened)
