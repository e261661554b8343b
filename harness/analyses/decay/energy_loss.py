"""Energy lost in each half cycle: starting values of the losses, and the loss as a function of the amplitude.

Between turning points of amplitudes a_i and a_(i+1), whose mean is a, the potential energy (divided by k) falls by

    V(a_i) - V(a_(i+1)) = 2 zeta I2(a) + 2 a r + b I3(a),      I2 = int y'^2 dtheta,  I3 = int |y'|^3 dtheta

which is linear in the losses zeta, r and b.  The integrals are those of the undamped motion, so that noise enters on
the left side only: for a spring I2 = pi a^2/2 and I3 = 4 a^3/3; for a pendulum by Gaussian quadrature, with
sin(y/2) = sin(a/2) sin(phi).

The shape of the loss over the amplitude shows which law holds.  As a fraction of the energy, viscous damping takes the
same at every amplitude, dry friction takes more of small amplitudes (1/a) and drag more of large ones (a).

References
----------
J. W. Liang, B. F. Feeny, Nonlinear Dynamics 16 (1998) (decrements); Journal of Sound and Vibration 295 (2006) (energy
balance).  The division by the mean slope, which weights all half cycles alike, is not in these papers.
"""

from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy import optimize

from .law import TERMS, Terms

QUADRATURE_POINTS = 40


@dataclass(frozen=True)
class EnergyLoss:
    """Energy lost per half cycle.

    Attributes
    ----------
    amplitude : numpy.ndarray
        Mean amplitudes (n,) of the half cycles between the turning points of the record.
    fraction : numpy.ndarray
        Energy (n,) that each half cycle loses, relative to the mean of its energies at both ends.
    curves : dict
        Amplitudes (m,) and fractions (m,) for each law.
    """

    amplitude: np.ndarray
    fraction: np.ndarray
    curves: dict[Terms, tuple[np.ndarray, np.ndarray]]


def estimate_losses(a: np.ndarray, terms: Terms, is_pendulum: bool) -> np.ndarray:
    """Return nonnegative zeta, r and b (3,) from successive amplitudes a (n,); those not in `terms` are zero."""
    mean = (a[:-1] + a[1:]) / 2
    if is_pendulum:
        nodes, weights = gauss_nodes()
        phi, weights = (nodes + 1) * np.pi / 4, weights * np.pi / 4
        k = np.sin(mean / 2)[:, None]
        speed = 2 * k * np.cos(phi)
        stretch = 1 / np.sqrt(1 - (k * np.sin(phi)) ** 2)  # dtheta = stretch dphi
        squared, cubed = 2 * (speed**2 * stretch) @ weights, 2 * (speed**3 * stretch) @ weights
        energy_loss, slope = np.cos(a[1:]) - np.cos(a[:-1]), np.maximum(np.sin(mean), 1e-2)
    else:
        squared, cubed = np.pi / 2 * mean**2, 4 / 3 * mean**3
        energy_loss, slope = mean * (a[:-1] - a[1:]), mean
    columns = np.stack([2 * squared, 2 * mean, cubed], axis=1) / slope[:, None]
    indices = [TERMS.index(term) for term in terms]
    scale = np.linalg.norm(columns[:, indices], axis=0)
    losses = np.zeros(len(TERMS))
    losses[indices] = optimize.nnls(columns[:, indices] / scale, energy_loss / slope)[0] / scale
    return losses


@cache
def gauss_nodes() -> tuple[np.ndarray, np.ndarray]:
    """Return nodes and weights (QUADRATURE_POINTS,) of Gauss-Legendre quadrature."""
    return np.polynomial.legendre.leggauss(QUADRATURE_POINTS)


def loss_fractions(a: np.ndarray, is_pendulum: bool) -> tuple[np.ndarray, np.ndarray]:
    """Return mean amplitudes (n,) and losses (n,) of potential energy, from amplitudes a (n + 1,).

    A loss is relative to the mean of the energies at both ends, so it may exceed 1. The last half cycle is left out if
    it ends on the side where it started.
    """
    a = a[: int(np.argmin(a > 0))] if (a <= 0).any() else a
    energy = 2 * np.sin(a / 2) ** 2 if is_pendulum else a * a / 2
    middle = (energy[:-1] + energy[1:]) / 2
    return (a[:-1] + a[1:]) / 2, (energy[:-1] - energy[1:]) / middle
