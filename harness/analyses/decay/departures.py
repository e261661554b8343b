"""The test of the residuals of a decay against time: slow departures of phase, amplitude and rest from the law.

The rate of a clock varies, or the loss does, or the rest position drifts: the record is
x = rest + w(t) + (1 + d(t)) u(t + e(t)/omega) with the law u, and d, e or w is a random walk with straight pieces.
Their variances follow from the restricted likelihood of the scores of the residuals, the most likely one first, and the
others from what is left.  A wrong mean rate of the clock is a wrong frequency, so e has no linear trend.
"""

from dataclasses import dataclass

import numpy as np

from . import thresholds
from .decay_problem import DecayProblem, column_norms
from .law import DRIFT, OMEGA, REST, T0


@dataclass(frozen=True)
class Departures:
    """Departures from the law, and the variances that they add.

    Attributes
    ----------
    phase, amplitude, rest : float
        Root mean square of the displacement by each, in the unit of the fit; 0 if it is not proven.
    variances : numpy.ndarray
        Variances (k,) that they add to those of the unknowns.
    """

    phase: float
    amplitude: float
    rest: float
    variances: np.ndarray


def find_departures(
    problem: DecayProblem, p: np.ndarray, e: np.ndarray, jacobian: np.ndarray, inverse: np.ndarray
) -> Departures:
    """Return the departures of a record from the fitted values p.

    Parameters
    ----------
    e : numpy.ndarray
        Residuals (n,), model minus samples.
    jacobian : numpy.ndarray
        Their derivatives (n, k) with respect to the unknowns; the first unknown is t0.
    inverse : numpy.ndarray
        Inverse (k, k) of the normal matrix.
    """
    t = problem.t
    share = (t - t[0]) / (t[-1] - t[0])
    pieces = thresholds.WALK_PIECES
    walk = np.clip(share[:, None] * pieces - np.arange(pieces), 0.0, 1.0)
    trend = np.stack([np.ones_like(share), share], axis=1)
    bridge = walk - trend @ np.linalg.lstsq(trend, walk, rcond=None)[0]
    displacement = problem.x + e - p[REST] - p[DRIFT] * (t - problem.model.t_mid)
    effects = {
        "phase": bridge * (jacobian[:, T0] / p[OMEGA])[:, None],
        "amplitude": walk * displacement[:, None],
        "rest": walk,
    }
    rms, variances, others = dict.fromkeys(effects, 0.0), np.zeros(len(inverse)), jacobian
    while effects:
        found = {name: walk_variance(effect, e, others) for name, effect in effects.items()}
        name, (size, gain) = max(found.items(), key=lambda item: item[1][1])
        if gain < thresholds.PROVEN_WALK:
            break
        effect = effects.pop(name)
        rms[name] = float(np.sqrt(size * np.mean((effect**2).sum(axis=1))))
        variances += size * ((inverse @ (jacobian.T @ effect)) ** 2).sum(axis=1)
        others = np.column_stack([others, effect])
    return Departures(**rms, variances=variances)


def walk_variance(effect: np.ndarray, e: np.ndarray, jacobian: np.ndarray) -> tuple[float, float]:
    """Return the variance of the coefficients of effects (n, m) in the residuals e (n,), and the gain of likelihood."""
    others = jacobian / column_norms(jacobian)
    fitted = np.linalg.lstsq(others, np.column_stack([effect, e]), rcond=thresholds.SEEN_WALK)[0]
    seen, e = effect - others @ fitted[:, :-1], e - others @ fitted[:, -1]
    size, axes = np.linalg.eigh(seen.T @ seen)
    is_seen = size > thresholds.SEEN_WALK * size.max()
    size, scores = size[is_seen], (axes.T @ (seen.T @ e))[is_seen]
    freedom = len(e) - others.shape[1] - len(size)
    noise = max(float(e @ e - (scores**2 / size).sum()), 0.0) / max(freedom, 1)
    if not is_seen.any() or not noise > 0 or freedom < 1:
        return 0.0, 0.0
    ratios = np.concatenate([[0.0], np.logspace(-3, 6, 46) / size.max()])  # of the variance to that of the noise
    spread = 1 + ratios[:, None] * size
    likelihood = -0.5 * (np.log(spread) + scores**2 / (noise * size * spread)).sum(axis=1)
    best = int(np.argmax(likelihood))
    return float(ratios[best] * noise), float(likelihood[best] - likelihood[0])
