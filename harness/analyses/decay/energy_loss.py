"""Energy lost in each half cycle as a function of its amplitude; the shape shows which law holds.

As a fraction of the energy, viscous damping takes the same at every amplitude, dry friction takes more of small
amplitudes (1/a) and drag more of large ones (a).
"""

from dataclasses import dataclass

import numpy as np

from .identification import DecayIdentification
from .law import Terms


@dataclass(frozen=True)
class EnergyLoss:
    """Energy lost per half cycle.

    Attributes
    ----------
    amplitude : (n,) mean amplitudes of the half cycles between the turning points of the record
    fraction : (n,) energy that each of them loses, relative to the mean of its energies at both ends
    curves : amplitudes and fractions for each law
    """

    amplitude: np.ndarray
    fraction: np.ndarray
    curves: dict[Terms, tuple[np.ndarray, np.ndarray]]


def measure_energy_loss(identification: DecayIdentification) -> EnergyLoss:
    """Return the energy lost between the turning points of a record, and by each law fitted to it."""
    problem = identification.problem
    points = np.zeros((2, 0))
    if not identification.record.order:
        extrema = identification.extrema
        displacement = extrema.x - identification.rest(identification.best, extrema.t)
        sign = np.sign(displacement[0]) * (-1.0) ** np.arange(len(displacement))
        points = np.array(loss_fractions(sign * displacement, problem.model.is_pendulum))
    curves = {}
    for law in identification.laws:
        amplitudes, starts = problem.half_cycles(law.p)
        during_record = amplitudes[starts <= problem.t[-1]] * problem.scale
        curves[law.terms] = loss_fractions(during_record, problem.model.is_pendulum)
    return EnergyLoss(points[0], points[1], curves)


def loss_fractions(a: np.ndarray, is_pendulum: bool) -> tuple[np.ndarray, np.ndarray]:
    """Return mean amplitudes (n,) and losses (n,) of potential energy, from amplitudes a (n + 1,).

    A loss is relative to the mean of the energies at both ends, so it may exceed 1. The last half cycle is left out if
    it ends on the side where it started.
    """
    a = a[: int(np.argmin(a > 0))] if (a <= 0).any() else a
    energy = 2 * np.sin(a / 2) ** 2 if is_pendulum else a * a / 2
    middle = (energy[:-1] + energy[1:]) / 2
    return (a[:-1] + a[1:]) / 2, (energy[:-1] - energy[1:]) / middle
