"""Energy lost in each half cycle: starting values of the losses, and the loss as a function of the amplitude.

Between turning points of amplitudes a_i and a_(i+1), whose mean is a, the potential energy of a spring, divided by k,
falls by a (a_i - a_(i+1)) = pi zeta a^2 + 2 r a + 4/3 b a^3 (integrals over the undamped motion, so that noise enters
on the left side only), which is linear in the losses.  A pendulum is taken for the spring with the same energies, whose
amplitude is 2 sin(a/2): its losses are starting values of fits only.

The shape of the loss over the amplitude shows which law holds.  As a fraction of the energy, viscous damping takes the
same at every amplitude, dry friction takes more of small amplitudes (1/a) and drag more of large ones (a).

References
----------
J. W. Liang, B. F. Feeny, Nonlinear Dynamics 16 (1998) (decrements); Journal of Sound and Vibration 295 (2006) (energy
balance).  The division by the mean slope, which weights all half cycles alike, is not in these papers.
"""

from dataclasses import dataclass

import numpy as np
from scipy import optimize

from .law import TERMS, Terms


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
    a = 2 * np.sin(a / 2) if is_pendulum else a
    mean = (a[:-1] + a[1:]) / 2
    columns = np.stack([np.pi * mean, np.full_like(mean, 2.0), 4 / 3 * mean**2], axis=1)
    indices = [TERMS.index(term) for term in terms]
    scale = np.linalg.norm(columns[:, indices], axis=0)
    losses = np.zeros(len(TERMS))
    losses[indices] = optimize.nnls(columns[:, indices] / scale, a[:-1] - a[1:])[0] / scale
    return losses


def loss_fractions(a: np.ndarray, is_pendulum: bool) -> tuple[np.ndarray, np.ndarray]:
    """Return mean amplitudes (n,) and losses (n,) of potential energy, from amplitudes a (n + 1,).

    A loss is relative to the mean of the energies at both ends, so it may exceed 1. The last half cycle is left out if
    it ends on the side where it started.
    """
    a = a[: int(np.argmin(a > 0))] if (a <= 0).any() else a
    energy = 2 * np.sin(a / 2) ** 2 if is_pendulum else a * a / 2
    middle = (energy[:-1] + energy[1:]) / 2
    return (a[:-1] + a[1:]) / 2, (energy[:-1] - energy[1:]) / middle
