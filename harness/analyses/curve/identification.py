"""Identification of friction over velocity: law, constants, outliers and remarks."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ...arguments import TEXT, check_arguments
from ...errors import HarnessError, SceneError, check_names, option_text
from ..estimation.estimate import Estimate
from .law_fit import LawFit, count_speeds, fit_law, group_speeds
from .laws import LAWS
from .outliers import find_outliers

MIN_POINTS = 6
OUTLIER_COST = 3.0  # unknowns for which an outlier counts: its size, and twice the choice of the point among n
MIN_SIZE, MAX_SIZE = 1e-100, 1e100  # of the largest velocity or force; their squares are finite
MAX_BIAS = 1e3  # of the largest force
CLEAR_DIFFERENCE = 6.0  # of two BIC
SIGNIFICANT_RUNS = 0.002  # probability of as few runs of signs in independent residuals


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
        Name of each point: its row in the table, or the times of its plateau.
    notes : tuple of str
        Assumptions made when reading.
    """

    name: str
    v: np.ndarray
    force: np.ndarray
    velocity_unit: str = "m/s"
    force_unit: str = "N"
    labels: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()

    @property
    def units(self) -> dict[str, str]:
        """Return the unit of each constant."""
        force, velocity = self.force_unit, self.velocity_unit
        viscous = f"{force}.s/{velocity.removesuffix('/s')}"
        return {"F_c": force, "F_s": force, "F_v": viscous, "v_s": velocity, "bias": force}


@dataclass(frozen=True)
class CurveIdentification:
    """Friction over velocity that was identified from points.

    Attributes
    ----------
    points : CurvePoints
        All points.
    used : numpy.ndarray
        Mask (n,) of the points that the laws are fitted to.
    laws : tuple of LawFit
        Fitted laws, best first.
    unavailable : mapping
        Reason why a law was not fitted, by its name.
    mass : float or None
        Known mass in kg, or moment of inertia in kg.m2.
    remarks : tuple of str
        Reasons to doubt the result.
    """

    points: CurvePoints
    used: np.ndarray
    laws: tuple[LawFit, ...]
    unavailable: Mapping[str, str] = field(default_factory=dict)
    mass: float | None = None
    remarks: tuple[str, ...] = ()

    @property
    def best(self) -> LawFit:
        """Return the law with the smallest BIC."""
        return self.laws[0]

    @property
    def estimates(self) -> tuple[Estimate, ...]:
        """Return the constants of the best law."""
        return self.best.estimates

    @property
    def residuals(self) -> np.ndarray:
        """Return the residuals (n,) of all points."""
        return self.points.force - self.best.force(self.points.v)

    @property
    def sentence(self) -> str:
        """Return the choice of the law in a sentence."""
        best, others = self.best, self.laws[1:]
        text = f"The law {best.name} describes the points best: {best.law.text}"
        if not others:
            return f"{text}."
        difference = others[0].bic - best.bic
        closeness = "" if difference >= CLEAR_DIFFERENCE else ", which is no clear difference"
        return f"{text}. The BIC of the next law, {others[0].name}, is larger by {difference:.1f}{closeness}."

    @check_arguments(name=TEXT)
    def find_law(self, name: str) -> LawFit | None:
        """Return the fit of a law, or None if it was not fitted."""
        return next((fit for fit in self.laws if fit.name == name), None)

    def __getitem__(self, name: str) -> Any:
        """Return the estimate of a constant of the best law."""
        by_name = {estimate.name: estimate for estimate in self.estimates}
        check_names("estimate", [name], by_name)
        return by_name[name]


def identify(points: CurvePoints, bias: float | None = None, mass: float | None = None) -> CurveIdentification:
    """Fit all laws to points, and sort them by their BIC.

    Parameters
    ----------
    bias : float, optional
        Known constant force in the unit of the points; by default it is fitted.
    mass : float, optional
        Mass in kg, or moment of inertia in kg.m2, for the values of models.

    Raises
    ------
    SceneError
        If the points do not suffice.
    HarnessError
        If the force does not oppose the velocity.
    """
    points, bias = check_points(points, bias)
    used = find_used_points(points, bias)
    fits, unavailable = [], {}
    for law in LAWS:
        fit = fit_law(law, points.v[used], points.force[used], bias, points.units)
        if isinstance(fit, str):
            unavailable[law.name] = fit
        else:
            fits.append(fit)
    fits.sort(key=lambda fit: fit.bic)
    result = CurveIdentification(points, used, tuple(fits), unavailable, mass)
    return replace(result, remarks=tuple(find_remarks(result)))


def check_points(points: CurvePoints, bias: float | None) -> tuple[CurvePoints, float | None]:
    """Return the points with velocity, with forces that have its sign, and the known bias with the same sign.

    Raises
    ------
    SceneError
        If they are too few, at one velocity, or of one direction without a known bias.
    HarnessError
        If the force does not reverse with the velocity, or with the known bias.
    """
    moving, name = points.v != 0.0, points.name
    for label, values, unit in (
        ("velocity", points.v, points.velocity_unit),
        ("force", points.force, points.force_unit),
    ):
        if (size := float(np.abs(values).max(initial=0.0))) and not MIN_SIZE <= size <= MAX_SIZE:
            span = f"{MIN_SIZE:g} to {MAX_SIZE:g}"
            raise SceneError(f"{name}: the largest {label} is {size:.3g} {unit}, outside {span}: check its unit")
    count = int((~moving).sum())
    notes = [f"{count} points have the velocity 0 and are left out."] if count else []
    v, force = points.v[moving], points.force[moving]
    if len(v) < MIN_POINTS:
        raise SceneError(f"{name} has {len(v)} points with velocity; at least {MIN_POINTS} are required")
    if count_speeds(v) < 2:
        raise SceneError(
            f"{name}: all points have the speed {np.abs(v).mean():.4g} {points.velocity_unit}; measure at several"
        )
    is_forward = v > 0
    if bias is None and len(set(is_forward)) == 1:
        direction = "forward" if is_forward[0] else "backward"
        raise SceneError(
            f"{name} has only {direction} motion, so that a constant bias cannot be separated from friction: "
            f"measure both directions, or give the known bias, as in {option_text('bias', 0)}"
        )
    if float(np.ptp(force)) == 0.0:
        raise HarnessError(f"{name}: the force is {force[0]:.4g} {points.force_unit} at all points")
    if drives_backward(is_forward, force, bias, points):
        force, bias = -force, None if bias is None else -bias
        notes.append("The force opposes the velocity; its sign is reversed, so that it drives the motion.")
    all_labels = points.labels or [f"point {i + 1}" for i in range(len(moving))]
    labels = tuple(label for label, is_kept in zip(all_labels, moving, strict=True) if is_kept)
    units = points.velocity_unit, points.force_unit
    return CurvePoints(name, v, force, *units, labels, (*points.notes, *notes)), bias


def drives_backward(is_forward: np.ndarray, force: np.ndarray, bias: float | None, points: CurvePoints) -> bool:
    """Return whether the forces (n,) have the sign opposite to the velocity; HarnessError if they have no such sign."""
    directions = [(sign, mask) for sign, mask in ((1, is_forward), (-1, ~is_forward)) if mask.any()]
    friction = [float(sign * (force[mask] - (bias or 0.0)).mean()) for sign, mask in directions]
    if bias is None:
        return sum(friction) < 0
    if abs(bias) > MAX_BIAS * float(np.abs(force).max()) or min(friction) < 0 < max(friction):
        raise HarnessError(
            f"{points.name}: with the bias {bias:.4g} {points.force_unit} friction would drive the motion in one "
            "direction: give another bias, or omit it to identify it from both directions"
        )
    return max(friction) < 0


def find_used_points(points: CurvePoints, bias: float | None) -> np.ndarray:
    """Return the mask (n,) of the points without the outliers of the law that describes the points best.

    An outlier counts as further unknowns, so that a law that needs many outliers does not win.
    """
    n, best = len(points.v), (np.inf, np.ones(len(points.v), bool))
    for law in LAWS:
        found = find_outliers(law, points.v, points.force, bias, points.units)
        if isinstance(found, str):
            continue
        fit, used = found
        count = len(fit.estimates) + OUTLIER_COST * (n - fit.points)
        criterion = float(n * np.log(fit.sum_of_squares / n) + count * np.log(n))
        if criterion < best[0]:
            best = criterion, used
    if not np.isfinite(best[0]):
        raise HarnessError(f"{points.name}: no law can be fitted to {n} points; measure at more velocities")
    return best[1]


def find_remarks(result: CurveIdentification) -> list[str]:
    """Return the reasons to doubt a result."""
    best, points, used = result.best, result.points, result.used
    v, residuals = points.v[used], result.residuals[used]
    remarks = []
    outliers = np.flatnonzero(~used)
    if len(outliers):
        listed = ", ".join(describe_point(result, int(i)) for i in outliers)
        remarks.append(f"{len(outliers)} of {len(v) + len(outliers)} points do not fit and are left out: {listed}.")
    for name in ("v_s", "v_s+", "v_s-"):
        if name in best.values and not np.isfinite(result[name].high):
            remarks.append(
                f"{name} is not determined: friction still falls at the largest speed, {np.abs(v).max():.4g} "
                f"{points.velocity_unit}; measure at larger speeds."
            )
        elif name in best.values and result[name].low == 0.0:
            remarks.append(
                f"{name} and {name.replace('v_s', 'F_s')} have no limit at one side: the decrease is over at the "
                f"lowest speed, {np.abs(v).min():.4g} {points.velocity_unit}; measure at smaller speeds."
            )
    for estimate in best.estimates:
        if estimate.name.startswith("F_c") and estimate.value < 0:
            remarks.append(f"{estimate.name} is negative: the points are not those of a friction force.")
        if estimate.name.startswith("F_v") and estimate.high < 0:
            remarks.append(f"{estimate.name} is negative: friction falls with the speed; no model takes such a value.")
    if not best.law.is_symmetric:
        remarks.append(
            "The directions differ by more than a constant bias; half of the difference of their Coulomb friction may "
            "be a bias, which the points cannot separate."
        )
    if has_few_runs(v, residuals):
        remarks.append(
            "Residuals of neighbouring points have the same sign: no law follows the curve, and the intervals are too "
            "narrow; use the table."
        )
    return remarks


def describe_point(result: CurveIdentification, i: int) -> str:
    """Return the name of a point, with its values."""
    points = result.points
    return (
        f"{points.labels[i]} ({points.v[i]:.4g} {points.velocity_unit}, {points.force[i]:.4g} {points.force_unit}, "
        f"{result.residuals[i]:+.2g} {points.force_unit} from the law)"
    )


def has_few_runs(v: np.ndarray, residuals: np.ndarray) -> bool:
    """Return whether residuals (n,) over the velocity v (n,) change their sign too seldom for independent ones."""
    from scipy.special import ndtr

    groups = group_speeds(v)
    means = [residuals[group[np.sign(v[group]) == sign]] for sign in (-1, 1) for group in groups]
    signs = np.sign([float(values.mean()) for values in means if len(values)])
    positive, negative = int((signs > 0).sum()), int((signs < 0).sum())
    n = positive + negative
    if min(positive, negative) < 4:
        return False
    runs = 1 + int((np.diff(signs) != 0).sum())
    mean = 1 + 2 * positive * negative / n
    deviation = np.sqrt((mean - 1) * (mean - 2) / (n - 1))
    return bool(ndtr((runs + 0.5 - mean) / deviation) < SIGNIFICANT_RUNS)
