"""Identification of friction over velocity: law, constants, outliers and remarks."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ...arguments import TEXT, check_arguments
from ...errors import HarnessError, SceneError, check_names, option_text
from ..estimation.estimate import Estimate
from .law_fit import LAWS, Law, LawFit, count_speeds, fit_law, linearise
from .outliers import find_outliers
from .points import CurvePoints, Effect, find_dependences

MIN_POINTS = 6
OUTLIER_COST = 3.0  # unknowns for which an outlier counts: its size, and twice the choice of the point among n
MIN_SIZE, MAX_SIZE = 1e-100, 1e100  # of the largest velocity or force; their squares are finite
MAX_BIAS = 1e3  # of the largest force
CLEAR_DIFFERENCE = 6.0  # of two BIC
SIGNIFICANT_CORRELATION = 3.1  # standard deviations of the correlation of independent neighbours
MAX_EFFECTS = 4
MAX_LISTED = 5  # points that do not fit
DRAWS = 39  # of velocities that read the same: their range holds a further draw in 38 of 40 cases
SAME_LEVEL = 0.02  # half steps between the means of plateaus of one level, which noise of the code moves
EFFECTS = {
    "drift": "{constant} drifts by {change:+.2g} {unit} over the record, as with friction or a sensor that warms up; "
    "its value is that in the middle of the record.",
    "lag": "The force lags the velocity by {value:.3g} s, as behind a filter; the fit contains this lag.",
    "inertia": "The force rises with the acceleration, as that of {value:.3g} {unit} of inertia or of a lag; the fit "
    "contains this part, and {mass} removes it before.",
    "presliding": "After a reversal the force is lower than friction, over about {length}, as in presliding or "
    "backlash; {backlash} leaves it out.",
}
REACHES = 5.0  # reaches of presliding after which less than 1 % of it is left


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
        nodes, weights = self.points.nodes
        return np.asarray(self.points.force - weights @ [self.best.force(v) for v in nodes])

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
    points, effects, remark = leave_out_presliding(points, bias)
    effects = find_effects(points.select(find_fitting_points(points, bias, effects)), bias)
    is_used = find_fitting_points(points, bias, effects)
    fitted_points = points.select(is_used)
    fits, unavailable = fit_laws(fitted_points, bias, effects)
    fits.sort(key=lambda fit: fit.bic)
    best = fits[0]
    widening = widen_by_neighbours(fitted_points, linearise(best, fitted_points)[0])
    full = (fit_law(fit.law, fitted_points, bias, effects, True, widening) for fit in fits)
    complete = [fit for fit in full if isinstance(fit, LawFit)]
    if points.half_step:
        complete = widen_by_steps(complete, fitted_points, bias, effects)
    corrected_points = replace(points, force=points.force - best.effect_force(points))
    result = CurveIdentification(corrected_points, is_used, tuple(complete), unavailable, mass)
    return replace(result, remarks=(*remark, *find_remarks(result, widening)))


def fit_laws(
    points: CurvePoints, bias: float | None, effects: Sequence[Effect], laws: Sequence[Law] = LAWS
) -> tuple[list[LawFit], dict[str, str]]:
    """Return the fits of laws without intervals, and the reasons why the others are not fitted."""
    results = {law.name: fit_law(law, points, bias, effects, has_intervals=False) for law in laws}
    fits = [fit for fit in results.values() if not isinstance(fit, str)]
    return fits, {name: reason for name, reason in results.items() if isinstance(reason, str)}


def check_points(points: CurvePoints, bias: float | None) -> tuple[CurvePoints, float | None]:
    """Return the points with velocity, with forces that have its sign, and the known bias with the same sign.

    Raises
    ------
    SceneError
        If they are too few, at one velocity, or of one direction without a known bias.
    HarnessError
        If the force does not reverse with the velocity, or with the known bias.
    """
    is_moving, name = points.v != 0.0, points.name
    for label, values, unit in (
        ("velocity", points.v, points.velocity_unit),
        ("force", points.force, points.force_unit),
    ):
        if (size := float(np.abs(values).max(initial=0.0))) and not MIN_SIZE <= size <= MAX_SIZE:
            span = f"{MIN_SIZE:g} to {MAX_SIZE:g}"
            raise SceneError(f"{name}: the largest {label} is {size:.3g} {unit}, outside {span}: check its unit")
    count = int((~is_moving).sum())
    notes = [f"{count} points have the velocity 0 and are left out."] if count else []
    points = points.select(is_moving)
    v, force = points.v, points.force
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
        points = replace(points, force=-force, slope=-points.slope)
        bias = None if bias is None else -bias
        notes.append("The force opposes the velocity; its sign is reversed, so that it drives the motion.")
    return replace(points, notes=(*points.notes, *notes)), bias


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


def leave_out_presliding(points: CurvePoints, bias: float | None) -> tuple[CurvePoints, tuple[Effect, ...], list[str]]:
    """Return the points beyond the distance in which the force builds up after a reversal, and their other effects.

    The last result is a remark, if there are such points.
    """
    distance, length = 0.0, points.velocity_unit.removesuffix("/s")
    for _ in range(MAX_EFFECTS):
        effects = find_effects(points, bias)
        reach = next((effect.reach for effect in effects if effect.reach), 0.0)
        is_beyond = points.travelled > max(REACHES * reach, distance) if reach else np.zeros(0, bool)
        if is_beyond.all() or is_beyond.sum() < len(points.v) / 2:
            break
        distance, points = max(REACHES * reach, distance), points.select(is_beyond)
    if not distance:
        return points, effects, []
    option = option_text("backlash", float(f"{distance:.2g}"))
    return (
        points,
        effects,
        [
            "After a reversal the force is lower than friction, as in presliding or backlash: points within "
            f"{distance:.2g} {length} are left out, as {option} does."
        ],
    )


def find_effects(points: CurvePoints, bias: float | None) -> tuple[Effect, ...]:
    """Return the effects on which the residuals of the best law, or of the best symmetric one, depend.

    A difference of the directions may be a drift.
    """
    results = []
    for laws in ([law for law in LAWS if law.is_symmetric], LAWS):
        effects: tuple[Effect, ...] = ()
        while fits := fit_laws(points, bias, effects, laws)[0]:
            best = min(fits, key=lambda fit: fit.bic)
            residuals, jacobian, _ = linearise(best, points)
            candidates = find_dependences(points, residuals, jacobian, effects)
            trials = [(fit_law(best.law, points, bias, (*effects, effect), False), effect) for effect in candidates]
            improvements = [
                (fit.bic, effect) for fit, effect in trials if isinstance(fit, LawFit) and fit.bic < best.bic
            ]
            if not improvements or len(effects) == MAX_EFFECTS:
                results.append((best.bic, effects))
                break
            effects = (*effects, min(improvements)[1])
    return min(results, default=(0.0, ()))[1]


def find_fitting_points(points: CurvePoints, bias: float | None, effects: Sequence[Effect]) -> np.ndarray:
    """Return the mask (n,) of the points without the outliers of the law that describes the points best.

    An outlier counts as further unknowns, so that a law that needs many outliers does not win.
    """
    n, best = len(points.v), (np.inf, np.ones(len(points.v), bool))
    for law in LAWS:
        result = find_outliers(law, points, bias, effects)
        if isinstance(result, str):
            continue
        fit, is_used = result
        count = len(fit.estimates) + OUTLIER_COST * (n - fit.points)
        criterion = float(n * np.log(fit.sum_of_squares / n) + count * np.log(n))
        if criterion < best[0]:
            best = criterion, is_used
    if not np.isfinite(best[0]):
        raise HarnessError(f"{points.name}: no law can be fitted to {n} points; measure at more velocities")
    return best[1]


def widen_by_neighbours(points: CurvePoints, residuals: np.ndarray) -> float:
    """Return the factor by which the variance grows, because residuals (n,) follow each other over velocity or time."""
    factor = 1.0
    for order in (points.v, points.elapsed):
        if len(order):
            e = residuals[np.argsort(order, kind="stable")]
            rho = float(e[:-1] @ e[1:]) / float(e @ e + 1e-300)
            is_visible = float(e @ e) > 4 * len(e) * points.precision**2
            if is_visible and rho > SIGNIFICANT_CORRELATION / np.sqrt(len(e)):
                factor = max(factor, (1 + rho) / (1 - rho))
    return factor


def widen_by_steps(
    fits: Sequence[LawFit], points: CurvePoints, bias: float | None, effects: Sequence[Effect]
) -> list[LawFit]:
    """Return fits whose intervals contain the values at other velocities that read the same.

    A velocity within its step is equally likely everywhere, and equal speeds are off by the same.  Each draw of the
    velocities is fitted by the law itself, and by the law that then describes the points best.
    """
    _, level = np.unique(np.round(np.abs(points.v) / (SAME_LEVEL * points.half_step)), return_inverse=True)
    shares = np.random.default_rng(1).uniform(-1.0, 1.0, (DRAWS, int(level.max()) + 1))
    sizes = points.half_step * np.sign(points.v)
    fits_of_draws = [fit_laws(replace(points, v=points.v + sizes * share[level]), bias, effects)[0] for share in shares]
    best = [min(others, key=lambda other: other.bic) for others in fits_of_draws if others]
    widened_fits = []
    for fit in fits:
        values = [other.values for others in fits_of_draws for other in others if other.name == fit.name]
        values += [fit.values, *(other.values for other in best)]
        estimates = []
        for item in fit.estimates:
            sample = [value[item.name] for value in values if item.name in value]
            error = float(np.hypot(item.error, np.std(sample)))
            estimates.append(replace(item, error=error, low=min(item.low, *sample), high=max(item.high, *sample)))
        widened_fits.append(replace(fit, estimates=tuple(estimates)))
    return widened_fits


def find_remarks(result: CurveIdentification, widening: float) -> list[str]:
    """Return the reasons to doubt a result."""
    best, points, is_used = result.best, result.points, result.used
    v = points.v[is_used]
    remarks = [describe_effect(result, effect) for effect in best.effects]
    outliers = np.flatnonzero(~is_used)
    if len(outliers):
        points_text = ", ".join(describe_point(result, int(i)) for i in outliers[:MAX_LISTED])
        ending = f", and {len(outliers) - MAX_LISTED} more" * (len(outliers) > MAX_LISTED)
        remarks.append(f"{len(outliers)} of {len(points.v)} points do not fit and are left out: {points_text}{ending}.")
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
    is_forward = points.v[np.argsort(points.elapsed)] > 0 if len(points.elapsed) else np.zeros(0, bool)
    if (np.diff(is_forward) != 0).sum() == 1 and (not best.law.is_symmetric or "bias" in best.values):
        remarks.append(
            "Each direction was measured once, at another time: a difference of the directions or a bias may be a "
            "drift of friction; measure the directions in turn."
        )
    if not best.law.is_symmetric:
        remarks.append(
            "The directions differ by more than a constant bias; half of the difference of their Coulomb friction may "
            "be a bias, which the points cannot separate."
        )
    if widening > 1:
        remarks.append(
            "Residuals of neighbouring points have the same sign: no law follows the curve. The intervals are "
            f"{np.sqrt(widening):.2g} times as wide as without; use the table."
        )
    return remarks


def describe_effect(result: CurveIdentification, effect: Effect) -> str:
    """Return the sentence on an effect that the fit contains."""
    points, values = result.points, result.best.values
    value = float(np.mean([values[name] for name in values if name.rstrip("+-") == effect.name]))
    constant = effect.name.removeprefix("drift of ")
    kind = effect.name if constant == effect.name else "drift"
    return EFFECTS[kind].format(
        constant=constant,
        value=value,
        change=value * float(np.ptp(points.elapsed)),
        unit=points.units[constant],
        length=f"{effect.reach:.2g} {points.velocity_unit.removesuffix('/s')}",
        mass=option_text("mass", float(f"{value:.3g}")),
        backlash=option_text("backlash", float(f"{REACHES * effect.reach:.2g}")),
    )


def describe_point(result: CurveIdentification, i: int) -> str:
    """Return the name of a point, with its values."""
    points = result.points
    return (
        f"{points.labels[i]} ({points.v[i]:.4g} {points.velocity_unit}, {points.force[i]:.4g} {points.force_unit}, "
        f"{result.residuals[i]:+.2g} {points.force_unit} from the law)"
    )
