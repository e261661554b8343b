"""Second estimate of the losses, from the swings between neighbouring turning points alone.

A swing is the sum of two amplitudes, so a drift of the rest position or of the frequency, an error of the clock, or a
restoring force of another form do not enter.  The amplitudes follow the return map of the law, with an error of each
half cycle that is noise, and with losses that depart from the law by a slowly varying fraction:

    a_(j+1) = map(a_j) - e_j (a_j - a_(j+1)),      covariance of e_i and e_j:  q^2 exp(-|i - j|/length)

The variances of noise and of e follow from the restricted likelihood.  If q is proven, the variances of the losses are
those of an e that varies over the whole record, because windows of one record show no less.

References
----------
H. D. Patterson, R. Thompson, Biometrika 58 (1971): restricted likelihood
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy import linalg

from . import thresholds
from .decay_problem import DecayProblem, FitError, column_norms, least_squares
from .extrema import Extrema
from .intervals import confidence_interval, to_correlation
from .law import AMPLITUDE, UNKNOWNS, Terms


@dataclass(frozen=True)
class SwingFit:
    """Losses from the swings, in the units of the problem.

    Attributes
    ----------
    values, errors : dict
        Value and standard error by index in UNKNOWNS.
    intervals : dict
        95 % intervals.
    departure : float
        Fraction of the loss by which it departs from the law, if that is proven, or 0.
    """

    values: dict[int, float]
    errors: dict[int, float]
    intervals: dict[int, tuple[float, float]]
    departure: float


def fit_swings(problem: DecayProblem, extrema: Extrema, p: np.ndarray, terms: Terms) -> SwingFit | None:
    """Fit the law to the swings of a record, from the values p of the whole signal.

    Returns None if the swings do not determine the losses.
    """
    times = extrema.t - problem.time_origin
    is_used = (times >= problem.t[0]) & (times <= problem.t[-1])
    size = np.abs(np.diff(extrema.x[is_used])) / problem.scale
    count = min(len(size), thresholds.MAX_FITTED_SWINGS)
    unknowns = np.array([AMPLITUDE, *(UNKNOWNS.index(term) for term in terms)])
    if count < max(thresholds.MIN_FITTED_SWINGS, 2 * len(unknowns)):
        return None
    size = size[:count]
    problem, start = problem.start_near(p, float(times[is_used][0]))
    model = replace(problem.model, min_amplitude=0.0)

    def residuals(q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        a, jacobian = model.predict_amplitudes(q, unknowns, count)
        return a[:-1] + a[1:] - size, jacobian[:-1] + jacobian[1:]

    try:
        p, _ = least_squares(residuals, start, unknowns)
    except FitError:
        return None
    e, jacobian = residuals(p)
    a, slopes = model.predict_amplitudes(p, unknowns, count)
    if not (np.isfinite(jacobian).all() and (a[:-1] > 0).all() and (slopes[:, 0] > 0).all()):
        return None
    scale = column_norms(jacobian)
    jacobian = jacobian / scale
    if np.linalg.cond(jacobian) > thresholds.MAX_CONDITION:
        return None
    covariance, correction, departure = estimate_covariance(jacobian, -e, a, slopes[:, 0])
    errors, correlation = np.sqrt(np.diag(covariance)) / scale, to_correlation(covariance)
    center = p[unknowns] + correction / scale
    dof = count - len(unknowns)
    values, intervals, standard_errors = {}, {}, {}
    for i, unknown in enumerate(unknowns.tolist()):
        if unknown != AMPLITUDE:
            values[unknown], standard_errors[unknown] = float(p[unknown]), float(errors[i])
            intervals[unknown] = confidence_interval(i, unknowns, center, errors, correlation, dof)
    return SwingFit(values, standard_errors, intervals, departure)


def estimate_covariance(
    jacobian: np.ndarray, e: np.ndarray, a: np.ndarray, slope: np.ndarray
) -> tuple[np.ndarray, np.ndarray, float]:
    """Return the covariance (k, k) of the unknowns, their generalised least-squares step (k,), and a proven departure.

    Parameters
    ----------
    jacobian : numpy.ndarray
        Derivatives (n, k) of the swings.
    e : numpy.ndarray
        Measured minus fitted swings (n,).
    a, slope : numpy.ndarray
        Amplitudes (n + 1,) and their derivatives (n + 1,) with respect to the first amplitude.
    """
    n, k = jacobian.shape
    noise = np.eye(n) + 0.5 * (np.eye(n, k=1) + np.eye(n, k=-1))  # neighbouring swings share a turning point
    response = np.tril(np.outer(slope, (a[:-1] - a[1:]) / slope[1:]), -1)  # of the amplitudes to a lost fraction
    response = response[:-1] + response[1:]
    distance = np.abs(np.subtract.outer(np.arange(n), np.arange(n)))
    longest = max(n / 3, 1.0)
    departures = {
        length: response @ np.exp(-distance / length) @ response.T
        for length in sorted({1.0, min(4.0, longest), min(16.0, longest), longest})
    }
    unit = np.trace(noise) / n
    best = None
    for matrix in departures.values():
        ratio_unit = unit / (np.trace(matrix) / n)
        for ratio in [0.0, *np.logspace(-2, 5, 8)] if best is None else np.logspace(-2, 5, 8):
            total = noise + ratio * ratio_unit * matrix
            factor = linalg.cho_factor(total + thresholds.RIDGE * np.trace(total) / n * np.eye(n), lower=True)
            weighted = linalg.cho_solve(factor, jacobian)
            normal = jacobian.T @ weighted
            step = np.linalg.pinv(normal) @ (weighted.T @ e)
            rest = e - jacobian @ step
            variance = float(rest @ linalg.cho_solve(factor, rest)) / (n - k)
            likelihood = -0.5 * (n - k) * np.log(max(variance, 1e-300)) - np.log(np.diag(factor[0])).sum()
            likelihood -= 0.5 * np.linalg.slogdet(normal)[1]
            q = np.sqrt(ratio * ratio_unit * variance)
            if best is None:
                white = likelihood
            if best is None or likelihood > best[0]:
                best = likelihood, variance, q, weighted, normal, step
    assert best is not None
    likelihood, variance, q, weighted, normal, step = best
    is_proven = likelihood - white > thresholds.PROVEN_DEPARTURE and q > thresholds.SMALL_DEPARTURE
    inverse = np.linalg.pinv(normal)
    covariance = inverse * variance
    if is_proven:
        covariance = covariance + inverse @ (weighted.T @ departures[longest] @ weighted) @ inverse * q**2
    return covariance, step, float(q) if is_proven else 0.0
