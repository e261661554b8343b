"""The test of the residuals of a decay against time, phase, speed and direction.

The rate of a clock varies, or the loss does, or the rest position drifts: the record is
x = rest + w(t) + (1 + d(t)) u(t + e(t)/omega) with the law u, and d, e or w is a random walk with straight pieces.  A
wrong mean rate of the clock is a wrong frequency, so e has no linear trend.  A spring or a sensor that differs between
the sides adds the second harmonic of u, in proportion to the square of the amplitude.

With the friction r + d exp(-|v|/v_s) a half cycle of amplitude a loses more energy, 2 a d h(u) for the ratio u of its
peak speed to v_s, where h(u) = 1/2 int exp(-u sin phi) sin phi dphi over [0, pi].  To first order in d, this lost
amplitude decays as every small change of the amplitude does, so the signal changes by a known function of time times d.
This function is one effect for each of several v_s.

The coefficients of each cause are normal with one variance, which follows from the restricted likelihood of the scores
of the residuals, the most likely cause first, and the others from what is left.
"""

from dataclasses import dataclass

import numpy as np

from . import thresholds
from .decay_problem import DecayProblem, column_norms
from .law import AMPLITUDE, DRIFT, OMEGA, REST, T0, ZETA, Terms

CAUSES = {
    "phase": "a clock whose rate varies",
    "amplitude": "a loss that follows another law",
    "rest": "a sensor that drifts",
    "direction": "a spring or a sensor that differs between the sides",
    "speed": "friction that rises at low speed",
}


@dataclass(frozen=True)
class Dependences:
    """On what the residuals depend, and the variances that this adds.

    Attributes
    ----------
    sizes : dict
        Root mean square of the displacement by each proven cause, in the unit of the fit, by its name in CAUSES.
    variances : numpy.ndarray
        Variances (k,) that these add to those of the unknowns.
    """

    sizes: dict[str, float]
    variances: np.ndarray


def find_dependences(problem: DecayProblem, p: np.ndarray, terms: Terms) -> Dependences:
    """Return on what the residuals of the fitted values p of a law with these terms depend."""
    e, jacobian = problem.residuals(p, terms)
    e, width = -e, quarter_width(problem, p)
    scale = column_norms(jacobian)
    inverse = np.linalg.pinv((jacobian / scale).T @ (jacobian / scale), rcond=1e-14) / np.outer(scale, scale)
    effects = signal_effects(problem, p, e, jacobian)
    if "r" in terms and len(problem.half_cycles(p)[0]) >= thresholds.MIN_SPEED_HALF_CYCLES:
        effects["speed"] = speed_effects(problem, p, terms, jacobian)
    unknowns = problem.unknowns(terms)
    sizes: dict[str, float] = {}
    variances, columns = np.zeros(len(inverse)), jacobian
    free = orthonormal(jacobian[:, (unknowns < ZETA) | (p[unknowns] > 0)])  # without losses at their bounds
    while effects:
        basis = orthonormal(columns)
        candidates = {
            name: effect_variance(effect, e, free if name == "speed" else basis, width)
            for name, effect in effects.items()
        }
        if not sizes and max(gain for _, gain in candidates.values()) < thresholds.MIN_GAIN:
            # a loss at its bound hides no departure that only its negative value would follow
            candidates = {name: effect_variance(effect, e, free, width) for name, effect in effects.items()}
        name, (variance, gain) = max(candidates.items(), key=lambda item: item[1][1])
        if gain < thresholds.MIN_GAIN:
            break
        effect = effects.pop(name)
        effects.pop("speed", None)  # it follows what any other cause leaves, so that it counts as the first one only
        variances += variance * ((inverse @ (jacobian.T @ effect)) ** 2).sum(axis=1)
        columns = np.column_stack([columns, effect])
        sizes[name] = float(np.sqrt(variance * np.mean((effect**2).sum(axis=1))))
    return Dependences(sizes, variances)


def quarter_width(problem: DecayProblem, p: np.ndarray) -> int:
    """Return the number of samples in a quarter of a half cycle."""
    return max(int(np.pi / p[OMEGA] / 4 / float(np.median(np.diff(problem.t)))), 1)


def orthonormal(columns: np.ndarray) -> np.ndarray:
    """Return an orthonormal basis (n, r) of the columns (n, k)."""
    axes, size, _ = np.linalg.svd(columns / column_norms(columns), full_matrices=False)
    return np.asarray(axes[:, size > thresholds.RANK_RTOL * size[0]])


def noise_variance(e: np.ndarray, width: int, freedom: int) -> float:
    """Return the variance of residuals e (n,), or of their sums over `width` samples if these exceed white noise."""
    sums = np.add.reduceat(e, np.arange(0, len(e), width))
    return max(float(e @ e), float(sums @ sums) / width) / max(freedom, 1)


def signal_effects(problem: DecayProblem, p: np.ndarray, e: np.ndarray, jacobian: np.ndarray) -> dict[str, np.ndarray]:
    """Return the changes (n, m) of the signal by walks of phase, amplitude and rest over time, and by direction."""
    t = problem.t
    share = (t - t[0]) / (t[-1] - t[0])
    pieces = thresholds.WALK_PIECES
    walk = np.clip(share[:, None] * pieces - np.arange(pieces), 0.0, 1.0)
    trend = np.stack([np.ones_like(share), share], axis=1)
    bridge = walk - trend @ np.linalg.lstsq(trend, walk, rcond=None)[0]
    displacement = problem.x - e - p[REST] - p[DRIFT] * (t - problem.model.t_mid)
    rate = jacobian[:, T0] / p[OMEGA]
    harmonic = (displacement + 1j * rate) ** 2
    return {
        "phase": bridge * rate[:, None],
        "amplitude": walk * displacement[:, None],
        "rest": walk,
        "direction": np.stack([harmonic.real, harmonic.imag], axis=1),
    }


def effect_variance(effect: np.ndarray, e: np.ndarray, basis: np.ndarray, width: int) -> tuple[float, float]:
    """Return the variance of the coefficients of effects (n, m) in residuals e (n,), and the gain of likelihood.

    The part of an effect in the basis (n, k) is that of the unknowns, or of effects before.
    """
    remainder, e = (values - basis @ (basis.T @ values) for values in (effect, e))
    size, axes = np.linalg.eigh(remainder.T @ remainder)
    is_seen = size > thresholds.RANK_RTOL * max(size.max(), float(np.sum(effect**2)))
    size, axes = size[is_seen], remainder @ axes[:, is_seen]
    scores = axes.T @ e
    noise = noise_variance(e - axes @ (scores / size), width, len(e) - basis.shape[1] - len(size))
    if not is_seen.any() or not noise > 0:
        return 0.0, 0.0
    ratios = np.concatenate([[0.0], np.logspace(-3, 6, 46) / size.max()])  # of the variance to that of the noise
    spread = 1 + ratios[:, None] * size
    likelihood = -0.5 * (np.log(spread) + scores**2 / (noise * size * spread)).sum(axis=1)
    best = int(np.argmax(likelihood))
    return float(ratios[best] * noise), float(likelihood[best] - likelihood[0])


def speed_effects(problem: DecayProblem, p: np.ndarray, terms: Terms, jacobian: np.ndarray) -> np.ndarray:
    """Return the changes (n, m) of the signal by a unit rise of friction at each of the m RISE_SPEEDS."""
    amplitudes, starts = problem.half_cycles(p)
    speeds, is_pendulum = np.array(thresholds.RISE_SPEEDS), problem.model.is_pendulum
    slope = jacobian[:, np.flatnonzero(problem.unknowns(terms) == AMPLITUDE)[0]]
    _, sensitivity = problem.model.predict_amplitudes(p, np.array([AMPLITUDE]), len(amplitudes) - 1)
    sensitivity = np.maximum(sensitivity[1:], thresholds.MIN_SENSITIVITY)
    peak = 2 * np.sin(amplitudes / 2) if is_pendulum else amplitudes
    phi = np.linspace(0.0, np.pi, 65)
    u = (peak[:-1] / peak[0])[:, None, None] / speeds[:, None]
    share = 0.5 * np.trapezoid(np.exp(-u * np.sin(phi)) * np.sin(phi), phi, axis=-1)
    middle = (amplitudes[:-1] + amplitudes[1:]) / 2
    force = np.sinc(middle / np.pi) if is_pendulum else np.ones_like(middle)  # sin a/a
    losses = 2 * share / force[:, None] / sensitivity
    total = np.concatenate([np.zeros((1, len(speeds))), -np.cumsum(losses, axis=0)])
    return np.stack([slope * np.interp(problem.t, starts, column) for column in total.T], axis=1)
