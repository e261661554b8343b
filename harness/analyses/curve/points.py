"""Points of friction over velocity, and what their force may depend on besides the velocity."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple, Self

import numpy as np

MIN_POWER = 0.02  # share of the power of a column: a dependence with less left by the law cannot be separated from it
SCORE = 5.0  # standard deviations of a dependence beyond chance
PRESLIDING = np.geomspace(1e-4, 1e-2, 9)  # distances over the stroke
ROUNDOFF, SWEEP_PRECISION = 1e-12, 1e-4  # relative to the largest force
NODES, WEIGHTS = np.polynomial.legendre.leggauss(3)
VISIBLE, MIN_VISIBLE = 0.1, 4  # share of presliding in a point, and points that have it


class Effect(NamedTuple):
    """A force that is no friction over velocity: the name of its constant, and the reach of presliding in m or rad."""

    name: str
    reach: float = 0.0

    @property
    def is_positive(self) -> bool:
        """Return whether only a positive constant has a meaning."""
        return not self.name.startswith("drift")


@dataclass(frozen=True)
class CurvePoints:
    """Points of friction over velocity.

    Attributes
    ----------
    name : str
        Name of the record.
    v, force : numpy.ndarray
        Velocities and forces (n,) in SI units; a driving force, with the sign of the velocity.
    velocity_unit, force_unit : str
        m/s or rad/s, and N or N.m.
    labels : tuple of str
        Name of each point: its row in the table, or its times.
    notes : tuple of str
        Assumptions made when reading.
    elapsed : numpy.ndarray
        Times (n,) in s from the middle of the record; empty for points without times.
    span : numpy.ndarray
        Half of the change (n,) of the velocity within a point of a sweep; empty otherwise, as the next ones.
    a, slope, travelled : numpy.ndarray
        Accelerations (n,), rates of the force in N/s, and distances since the last reversal in m or rad.
    half_step : float
        Half a step of a velocity whose code has no zero; 0 otherwise.
    """

    name: str
    v: np.ndarray
    force: np.ndarray
    velocity_unit: str = "m/s"
    force_unit: str = "N"
    labels: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    elapsed: np.ndarray = field(default_factory=lambda: np.zeros(0), repr=False)
    span: np.ndarray = field(default_factory=lambda: np.zeros(0), repr=False)
    a: np.ndarray = field(default_factory=lambda: np.zeros(0), repr=False)
    slope: np.ndarray = field(default_factory=lambda: np.zeros(0), repr=False)
    travelled: np.ndarray = field(default_factory=lambda: np.zeros(0), repr=False)
    half_step: float = 0.0

    def select(self, mask: np.ndarray) -> Self:
        """Return the points of a mask (n,)."""
        labels = self.labels or [f"point {i + 1}" for i in range(len(mask))]
        names = ("v", "force", "elapsed", "span", "a", "slope", "travelled")
        parts = {name: values[mask] if len(values := getattr(self, name)) else values for name in names}
        return replace(self, labels=tuple(np.array(labels, object)[mask]), **parts)

    @property
    def precision(self) -> float:
        """Return the force below which residuals are errors of rounding, or of the means of a sweep."""
        return (SWEEP_PRECISION if len(self.span) else ROUNDOFF) * float(np.abs(self.force).max())

    @property
    def units(self) -> dict[str, str]:
        """Return the unit of each constant."""
        force, velocity = self.force_unit, self.velocity_unit
        viscous = f"{force}.s/{velocity.removesuffix('/s')}"
        mass = "kg" if force == "N" else "kg.m2"
        constants = {"F_c": force, "F_s": force, "F_v": viscous, "v_s": velocity, "bias": force}
        drifts = {f"drift of {name}": f"{constants[name]}/s" for name in ("F_c", "F_v", "bias")}
        return constants | drifts | {"lag": "s", "inertia": mass, "presliding": force}

    @property
    def nodes(self) -> tuple[np.ndarray, np.ndarray]:
        """Return velocities (k, n) within each point, and their weights (k,), whose mean force is that of the point."""
        if not len(self.span):
            return self.v[None], np.ones(1)
        return self.v + NODES[:, None] * self.span, WEIGHTS / 2

    def find_effects(self) -> list[Effect]:
        """Return the effects that the points may show."""
        effects = []
        if len(self.elapsed) and np.ptp(self.elapsed) > 0:
            effects = [Effect("drift of F_c"), Effect("drift of F_v"), Effect("drift of bias")]
        if len(self.slope):
            stroke = float(self.travelled[np.isfinite(self.travelled)].max(initial=0.0))
            presliding = [Effect("presliding", float(share * stroke)) for share in PRESLIDING if stroke]
            visible = [e for e in presliding if (np.abs(self.column(e)) > VISIBLE).sum() >= MIN_VISIBLE]
            effects += [Effect("lag"), Effect("inertia"), *visible]
        return effects

    def column(self, effect: Effect) -> np.ndarray:
        """Return the force (n,) of an effect per unit of its constant."""
        sign, elapsed = np.sign(self.v), self.elapsed
        match effect.name:
            case "drift of F_c":
                return sign * elapsed
            case "drift of F_v":
                return self.v * elapsed
            case "drift of bias":
                return elapsed
            case "lag":
                return -self.slope
            case "inertia":
                return self.a
        return -sign * np.exp(-self.travelled / effect.reach)


def find_dependences(
    points: CurvePoints, residuals: np.ndarray, jacobian: np.ndarray, fitted_effects: Sequence[Effect]
) -> list[Effect]:
    """Return the effects on which residuals depend beyond chance.

    The score of an effect is Student's t of a further unknown of the fit: the residuals (n,) are compared with the part
    of its force that the derivatives (n, p) of the law do not absorb.
    """
    q, _ = np.linalg.qr(jacobian / (np.linalg.norm(jacobian, axis=0) + 1e-300))
    squares, dependences = float(residuals @ residuals), []
    freedom = max(len(residuals) - jacobian.shape[1] - 1, 1)
    for effect in points.find_effects():
        column = points.column(effect)
        remainder = column - q @ (q.T @ column)
        power, gain = float(remainder @ remainder), float(remainder @ residuals)
        if power <= MIN_POWER * float(column @ column) or effect.name in [other.name for other in fitted_effects]:
            continue
        rest = max(squares - gain**2 / power, len(residuals) * points.precision**2)
        score = gain / float(np.sqrt(power * rest / freedom + 1e-300))
        if score > SCORE or (score < -SCORE and not effect.is_positive):
            dependences.append(effect)
    return dependences
