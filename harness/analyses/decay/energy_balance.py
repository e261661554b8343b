"""The start of the fits: what each half swing loses.

Between turning points of amplitudes a_i and a_(i+1), whose mean is a, the potential energy (over k) falls by

    V(a_i) - V(a_(i+1)) = 2 zeta I2(a) + 2 a r + b I3(a),      I2 = int y'^2 dtheta,  I3 = int |y'|^3 dtheta

which is linear in the losses.  The integrals are those of the motion without losses, so that noise enters on the left
alone: of a spring I2 = pi a^2/2, I3 = 4 a^3/3; of a pendulum with sin(y/2) = sin(a/2) sin(phi), by Gauss's rule.
J. W. Liang, B. F. Feeny, Nonlinear Dynamics 16 (1998) (decrements) and Journal of Sound and Vibration 295 (2006)
(energy balance); the division by the mean slope, which weighs all half swings alike, is ours.
"""

from functools import cache

import numpy as np

from .law import TERMS, Terms, sublaws

POINTS = 40  # of Gauss's rule


def estimate_losses(a: np.ndarray, terms: Terms, is_pendulum: bool) -> np.ndarray:
    """zeta, r and b (3,), none negative and those not in `terms` zero, from successive amplitudes a (n,)."""
    mean = (a[:-1] + a[1:]) / 2
    if is_pendulum:
        nodes, weights = gauss_nodes()
        phi, weights = (nodes + 1) * np.pi / 4, weights * np.pi / 4
        k = np.sin(mean / 2)[:, None]
        speed = 2 * k * np.cos(phi)
        stretch = 1 / np.sqrt(1 - (k * np.sin(phi)) ** 2)  # dtheta = stretch dphi
        squared, cubed = 2 * (speed**2 * stretch) @ weights, 2 * (speed**3 * stretch) @ weights
        lost, slope = np.cos(a[1:]) - np.cos(a[:-1]), np.maximum(np.sin(mean), 1e-2)
    else:
        squared, cubed = np.pi / 2 * mean**2, 4 / 3 * mean**3
        lost, slope = mean * (a[:-1] - a[1:]), mean
    columns = np.stack([2 * squared, 2 * mean, cubed], axis=1) / slope[:, None]
    return nonnegative_least_squares(columns, lost / slope, terms)


@cache
def gauss_nodes() -> tuple[np.ndarray, np.ndarray]:
    """Nodes and weights (POINTS,) of Gauss's rule."""
    return np.polynomial.legendre.leggauss(POINTS)


def nonnegative_least_squares(columns: np.ndarray, right: np.ndarray, terms: Terms) -> np.ndarray:
    """Least squares with values >= 0: the best of the few sets of columns whose own solution is so."""
    best, least = np.zeros(len(TERMS)), float(right @ right)
    for law in sublaws(terms):
        places = [TERMS.index(term) for term in law]
        scale = np.linalg.norm(columns[:, places], axis=0)
        found = np.linalg.lstsq(columns[:, places] / scale, right, rcond=1e-12)[0] / scale
        left = right - columns[:, places] @ found
        if (found >= 0).all() and left @ left < least:
            best, least = np.zeros(len(TERMS)), float(left @ left)
            best[places] = found
    return best
