"""Friction laws over velocity, each linear in its forces once the Stribeck velocity v_s is given.

    F(v) = sign(v) (F_c + (F_s - F_c) g(|v|/v_s)) + F_v v + bias

The decrease g is exp(-r) (A. Tustin, IEE Journal 94 (1947) 143-151), or exp(-r^2) (B. Armstrong-Helouvry, Control of
Machines with Friction, Kluwer (1991)). In an asymmetric law each direction has its own constants, and a bias is part of
their Coulomb friction.
"""

from dataclasses import dataclass

import numpy as np

ONE = np.ones(1)
RESIDUE = 0.01  # of the decrease at the lowest speed: with a smaller v_s the measurement does not show the decrease


@dataclass(frozen=True)
class Law:
    """A friction law.

    Attributes
    ----------
    name, text : str
        Name, and description in words.
    exponent : int
        Exponent of the decrease at low speed; 0 without one.
    is_viscous : bool
        Whether the friction has a part proportional to the velocity.
    is_symmetric : bool
        Whether both directions have the same constants.
    """

    name: str
    text: str
    exponent: int
    is_viscous: bool
    is_symmetric: bool

    @property
    def symbols(self) -> tuple[str, ...]:
        """Return the linear constants of one direction."""
        return (
            "F_c",
            *(["F_s"] if self.exponent else []),
            *(["F_v"] if self.is_viscous else []),
        )

    def design(self, v: np.ndarray, v_s: np.ndarray, has_bias: bool, weights: np.ndarray = ONE) -> np.ndarray:
        """Return the matrices (len(v_s), n, constants) of the law, at velocities v (n,) for each v_s.

        Their columns belong to the `symbols`, and to the bias.  Of velocities (k, n), the law has the mean with
        `weights` (k,).
        """
        v = np.atleast_2d(v)
        fall = sum(weight * self.decrease(np.abs(part) / v_s[:, None]) for weight, part in zip(weights, v, strict=True))
        v = weights @ v
        sign = np.sign(v) * np.ones((len(v_s), 1))
        columns = [sign * (1.0 - fall)]
        columns += [sign * fall] if self.exponent else []
        columns += [v * np.ones_like(sign)] if self.is_viscous else []
        columns += [np.ones_like(sign)] if has_bias else []
        return np.stack(columns, axis=-1)

    def decrease(self, ratio: np.ndarray) -> np.ndarray:
        """Return the share of F_s - F_c that is left at a speed of `ratio` v_s."""
        return np.exp(-(ratio**self.exponent)) if self.exponent else np.zeros_like(ratio)

    def stribeck_range(self, speeds: np.ndarray) -> tuple[float, float]:
        """Return the range of v_s that measured speeds (n,) can show."""
        reach = float(np.log(1.0 / RESIDUE)) ** (1.0 / max(self.exponent, 1))
        return float(speeds.min()) / reach, float(speeds.max())


LAWS = (
    Law("coulomb", "Coulomb friction", 0, False, True),
    Law("viscous", "Coulomb and viscous friction", 0, True, True),
    Law("tustin", "Coulomb, Stribeck (exponent 1, Tustin) and viscous friction", 1, True, True),
    Law("stribeck", "Coulomb, Stribeck (exponent 2) and viscous friction", 2, True, True),
    Law("asymmetric-coulomb", "Coulomb friction, different in each direction", 0, False, False),
    Law("asymmetric-viscous", "Coulomb and viscous friction, different in each direction", 0, True, False),
    Law("asymmetric-tustin", "Coulomb, Tustin and viscous friction, different in each direction", 1, True, False),
    Law("asymmetric-stribeck", "Coulomb, Stribeck and viscous friction, different in each direction", 2, True, False),
)
BY_NAME = {law.name: law for law in LAWS}
