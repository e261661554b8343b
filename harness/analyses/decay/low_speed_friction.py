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

from ..estimation.estimate import NORMAL_QUANTILE, Estimate, block_scores
from . import thresholds
from .decay_problem import DecayProblem, column_norms
from .estimates import unit_scales
from .law import AMPLITUDE, UNKNOWNS, ZETA, R, Terms


@dataclass(frozen=True)
class LowSpeedRise:
    """A rise of friction at low speed, in the units of the record.

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
        Rise with a v_s of LIMIT_SPEED that the record would show in five of six cases; infinite if any may be hidden.
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


def signal_changes(problem: DecayProblem, p: np.ndarray, slope: np.ndarray, speeds: np.ndarray) -> np.ndarray:
    """Return the changes (n, k) of the signal by a unit rise at k relative speeds.

    Parameters
    ----------
    slope : numpy.ndarray
        Derivative (n,) of the signal by the first amplitude.
    """
    amplitudes, starts = problem.half_cycles(p)
    is_pendulum = problem.model.is_pendulum
    _, sensitivity = problem.model.predict_amplitudes(p, np.array([AMPLITUDE]), len(amplitudes) - 1)
    sensitivity = np.maximum(sensitivity[1:], thresholds.MIN_SENSITIVITY)
    peak = 2 * np.sin(amplitudes / 2) if is_pendulum else amplitudes
    phi = np.linspace(0.0, np.pi, 65)
    u = (peak[:-1] / peak[0])[:, None, None] / speeds[:, None]
    share = 0.5 * np.trapezoid(np.exp(-u * np.sin(phi)) * np.sin(phi), phi, axis=-1)
    middle = (amplitudes[:-1] + amplitudes[1:]) / 2
    force = np.sinc(middle / np.pi) if is_pendulum else np.ones_like(middle)  # sin a/a
    lost = 2 * share / force[:, None] / sensitivity
    total = np.concatenate([np.zeros((1, len(speeds))), -np.cumsum(lost, axis=0)])
    return np.stack([slope * np.interp(problem.t, starts, column) for column in total.T], axis=1)


def find_low_speed_rise(problem: DecayProblem, p: np.ndarray, terms: Terms) -> LowSpeedRise | None:
    """Return the rise that fits best to the residuals of a law with the values p; None if there are too few half
    cycles."""
    if "r" not in terms or len(problem.half_cycles(p)[0]) < thresholds.MIN_RISE_HALF_CYCLES:
        return None
    unknowns = problem.unknowns(terms)
    e, jacobian = problem.residuals(p, terms)
    speeds = np.array(thresholds.RISE_SPEEDS)
    changes = signal_changes(problem, p, jacobian[:, np.flatnonzero(unknowns == AMPLITUDE)[0]], speeds)
    rises = [
        fit_rise(problem, p, unknowns, e, jacobian, speed, change)
        for speed, change in zip(speeds.tolist(), changes.T, strict=True)
    ]
    best = max(rises, key=lambda rise: (rise.is_shown, rise.deviance))
    shown = [rise.intervals for rise in rises if rise.is_shown]
    intervals = {
        name: (min(each[name][0] for each in shown), max(each[name][1] for each in shown)) for name in terms if shown
    }
    return replace(best, intervals=intervals, limit=rises[thresholds.RISE_SPEEDS.index(thresholds.LIMIT_SPEED)].limit)


def fit_rise(
    problem: DecayProblem,
    p: np.ndarray,
    unknowns: np.ndarray,
    e: np.ndarray,
    jacobian: np.ndarray,
    speed: float,
    change: np.ndarray,
) -> LowSpeedRise:
    """Fit the law and a rise at one relative speed by one linear step.

    Parameters
    ----------
    p, unknowns : numpy.ndarray
        Values of the law, and the positions (m,) of those that are fitted.
    e, jacobian : numpy.ndarray
        Residuals (n,) of the law, and their derivatives (n, m).
    speed : float
        Relative speed v_s.
    change : numpy.ndarray
        Change (n,) of the signal by a unit rise.
    """
    n, floor = len(e), len(e) * problem.residual_floor**2
    columns = np.column_stack([jacobian, change])
    scale = column_norms(columns)
    columns = columns / scale
    triangle = np.asarray(np.linalg.qr(np.column_stack([columns, e]), mode="r"))
    low = np.append(np.where(unknowns >= ZETA, -p[unknowns], -np.inf), 0.0) * scale
    law_step = optimize.lsq_linear(triangle[:, :-2], -triangle[:, -1], (low[:-1], np.inf)).x
    step = optimize.lsq_linear(triangle[:, :-1], -triangle[:, -1], (low, np.inf)).x
    law_rest, rest = e + columns[:, :-1] @ law_step, e + columns @ step
    law_squares = max(min(float(e @ e), float(law_rest @ law_rest)), floor)
    squares = max(float(rest @ rest), floor)
    alone = columns[:, -1] - columns[:, :-1] @ np.linalg.lstsq(columns[:, :-1], columns[:, -1], rcond=None)[0]
    information = float(alone @ alone)
    white = squares / n * information
    variance = white  # of the score of the rise
    for count in thresholds.RISE_BLOCKS:
        scores, factor = block_scores(alone[:, None], rest, count, len(unknowns) + 1)
        variance = max(variance, float((scores**2).sum()) * factor)
    deviance = n * float(np.log(law_squares / squares)) * white / variance
    limit = (np.sqrt(thresholds.SHOWN_RISE) + 1) * np.sqrt(variance) / information / scale[-1]
    spread = np.diag(np.linalg.pinv(columns.T @ columns)) * squares / n * variance / white
    values = np.append(p[unknowns], 0.0) + step / scale
    margins = NORMAL_QUANTILE * np.sqrt(spread) / scale
    units = unit_scales(problem)
    at = {UNKNOWNS[unknown]: (i, units[unknown]) for i, unknown in enumerate(unknowns.tolist()) if unknown >= ZETA}
    losses = {name: float(unit * values[i]) for name, (i, unit) in at.items()}
    intervals = {
        name: (losses[name] - float(unit * margins[i]), losses[name] + float(unit * margins[i]))
        for name, (i, unit) in at.items()
    }
    return LowSpeedRise(speed, float(units[R] * values[-1]), deviance, losses, intervals, float(units[R] * limit))


def widen_losses(estimates: tuple[Estimate, ...], rise: LowSpeedRise) -> tuple[Estimate, ...]:
    """Return the estimates; the intervals of the losses cover those with the rise too."""
    widened = list(estimates)
    for i, estimate in enumerate(estimates):
        if estimate.name in rise.intervals:
            low, high = rise.intervals[estimate.name]
            error = abs(rise.losses[estimate.name] - estimate.value)
            widened[i] = estimate.widen(error, max(low, 0.0), high)
    return tuple(widened)
