"""The energy lost in a half swing against its amplitude: by its shape one sees which law it is.

As a share of the energy, viscous damping takes the same at every amplitude, dry friction more of small swings (1/a),
and drag more of large ones (a).
"""

from dataclasses import dataclass

import numpy as np

from .identification import DecayIdentification
from .law import Terms


@dataclass(frozen=True)
class EnergyLoss:
    """Mean amplitudes (n,) of half swings and the `share` (n,) of the energy they lost, as the turning points show it;
    and the same for each law as `curves`."""

    amplitude: np.ndarray
    fraction: np.ndarray
    curves: dict[Terms, tuple[np.ndarray, np.ndarray]]


def measure_energy_loss(found: DecayIdentification) -> EnergyLoss:
    """The losses between the turning points of a record, and those of each law fitted to it."""
    problem = found.problem
    seen = np.zeros((2, 0))
    if not found.record.order:
        off = found.extrema.x - found.rest(found.best, found.extrema.t)
        way = np.sign(off[0]) * (-1.0) ** np.arange(len(off))
        seen = np.array(loss_fractions(way * off, problem.model.is_pendulum))
    curves = {}
    for law in found.laws:
        amplitudes, begins = problem.half_cycles(law.p)
        curves[law.terms] = loss_fractions(
            amplitudes[begins <= problem.t[-1]] * problem.scale, problem.model.is_pendulum
        )
    return EnergyLoss(seen[0], seen[1], curves)


def loss_fractions(a: np.ndarray, is_pendulum: bool) -> tuple[np.ndarray, np.ndarray]:
    """Mean amplitudes of successive ones a (n + 1,), and the share of the potential energy that is lost (n,).

    Without the last half swing where it ends on the side it came from.
    """
    a = a[: int(np.argmin(a > 0))] if (a <= 0).any() else a
    energy = 2 * np.sin(a / 2) ** 2 if is_pendulum else a * a / 2
    middle = (energy[:-1] + energy[1:]) / 2
    return (a[:-1] + a[1:]) / 2, (energy[:-1] - energy[1:]) / middle
