"""Friction laws over velocity, each linear in its forces once the Stribeck velocity v_s is given.

    F(v) = sign(v) (F_c + (F_s - F_c) g(|v|/v_s)) + F_v v + bias

The decrease g is exp(-r) (A. Tustin, IEE Journal 94 (1947) 143-151), or exp(-r^2) (B. Armstrong-Helouvry, Control of
Machines with Friction, Kluwer (1991)). In an asymmetric law each direction has its own constants, and a bias is part of
their Coulomb friction.

Least-squares fit of one law, with 95 % intervals from its profile likelihood.

Given v_s, a law is linear, so that the best constants, their covariance and the sum of squares follow from a QR
decomposition. All of them are evaluated on a grid of v_s. A value of a constant is in its interval if some v_s gives a
sum of squares of at most the smallest one times 1 + t^2/(n - p), with Student's t. This is exact for the constants of a
linear law.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..estimation.estimate import Estimate, student_quantile
from .points import CurvePoints, Effect

UNIT_WEIGHT = np.ones(1)
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

    def design(self, v: np.ndarray, v_s: np.ndarray, has_bias: bool, weights: np.ndarray = UNIT_WEIGHT) -> np.ndarray:
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


COARSE, FINE = 64, 256  # values of v_s, in its range and in its interval
ZOOM, ZOOMS = 25, 3  # values of v_s about the best one, and number of repetitions
MIN_FREEDOM = 2  # points beyond the number of constants
MIN_POINTS_PER_CONSTANT = 2.0  # with fewer, the BIC prefers laws with too many constants
MIN_SPEEDS = {0: 1, 1: 4, 2: 4}  # different speeds of one direction, by the exponent of the law
SAME_SPEED = 0.05  # relative distance of speeds that are one
TEXTS = {
    "F_c": "Coulomb friction",
    "F_s": "static friction",
    "v_s": "Stribeck velocity",
    "F_v": "viscous friction",
    "bias": "constant bias or gravity",
    "drift of F_c": "rate of the Coulomb friction",
    "drift of F_v": "rate of the viscous friction",
    "drift of bias": "rate of the bias",
    "lag": "lag of the force behind the velocity",
    "inertia": "inertia",
    "presliding": "loss of force after a reversal",
}
DIRECTIONS = {1: ("+", ", forward"), -1: ("-", ", backward"), 0: ("", "")}  # suffixes of a symbol and of its text


@dataclass(frozen=True)
class LawFit:
    """A fitted law.

    Attributes
    ----------
    name : str
        Name of the law.
    estimates : tuple of Estimate
        Its constants with 95 % intervals, in SI units. Those of one direction end with + or -.
    known_bias : float
        Force that was subtracted before the fit.
    sum_of_squares : float
        Sum of the squared residuals.
    points : int
        Number of fitted points.
    bic : float
        Bayesian information criterion.
    effects : tuple of Effect
        Other forces that were fitted.
    """

    name: str
    estimates: tuple[Estimate, ...]
    known_bias: float
    sum_of_squares: float
    points: int
    bic: float
    effects: tuple[Effect, ...] = ()

    @property
    def law(self) -> Law:
        """Return the law."""
        return BY_NAME[self.name]

    @property
    def values(self) -> dict[str, float]:
        """Return the constants by name."""
        return {estimate.name: estimate.value for estimate in self.estimates}

    @property
    def residual(self) -> float:
        """Return the standard deviation of the points about the law."""
        return float(np.sqrt(self.sum_of_squares / (self.points - len(self.estimates))))

    @property
    def bias(self) -> float:
        """Return the constant force that is no friction."""
        return self.known_bias + self.values.get("bias", 0.0)

    def friction(self, v: np.ndarray) -> np.ndarray:
        """Return the friction (n,) without bias at velocities v (n,), with the sign of the velocity."""
        law, values, result = self.law, self.values, np.zeros(len(v))
        for direction in (0,) if law.is_symmetric else (1, -1):
            suffix, mask = DIRECTIONS[direction][0], np.ones(len(v), bool) if not direction else direction * v > 0
            if f"F_c{suffix}" in values:
                v_s = np.array([values.get(f"v_s{suffix}", 1.0)])
                constants = np.array([values[f"{symbol}{suffix}"] for symbol in law.symbols])
                result[mask] = law.design(v[mask], v_s, False)[0] @ constants
        return result

    def force(self, v: np.ndarray) -> np.ndarray:
        """Return the force (n,) at velocities v (n,), with the bias."""
        return self.friction(v) + self.bias

    def effect_force(self, points: CurvePoints) -> np.ndarray:
        """Return the force (n,) of the other effects in points."""
        force, values = np.zeros(len(points.v)), self.values
        for suffix, sign in (("", 0), ("+", 1), ("-", -1)):
            for effect in self.effects:
                mask = sign * points.v >= 0
                force[mask] += values.get(effect.name + suffix, 0.0) * points.column(effect)[mask]
        return force


@dataclass
class Grid:
    """Fits of a law with each v_s (k,): constants and the diagonal of (X^T X)^-1 (k, p), and sums of squares (k,)."""

    v_s: np.ndarray
    constants: np.ndarray
    spread: np.ndarray
    squares: np.ndarray


class Part:
    """The points to which a law fits one set of constants: those of one direction, or of both."""

    def __init__(
        self,
        law: Law,
        points: CurvePoints,
        effects: Sequence[Effect],
        known_bias: float,
        direction: int,
        has_bias: bool,
    ) -> None:
        self.law, self.direction, self.has_bias = law, direction, has_bias
        self.v, self.y = points.v, points.force - known_bias
        self.nodes, self.weights = points.nodes
        self.effects = np.stack([points.column(effect) for effect in effects], axis=-1) if effects else None
        self.symbols = (*law.symbols, *(["bias"] if has_bias else []), *(effect.name for effect in effects))
        self.count = len(self.symbols) + bool(law.exponent)
        if law.exponent:
            self.low, self.high = law.stribeck_range(np.abs(self.v))
            coarse = self.evaluate(np.geomspace(self.low, self.high, COARSE))
            self.best = self.locate(coarse)
        else:
            self.low = self.high = 1.0
            coarse = self.best = self.evaluate(np.ones(1))
        self.coarse = coarse

    @property
    def is_valid(self) -> bool:
        """Return whether a v_s gives friction that falls from F_s to F_c."""
        return bool(np.isfinite(self.best.squares[0]))

    def design(self, v_s: np.ndarray) -> np.ndarray:
        """Return the matrices (k, n, symbols) of the linear constants with each v_s (k,)."""
        design = self.law.design(self.nodes, v_s, self.has_bias, self.weights)
        if self.effects is None:
            return design
        return np.concatenate([design, np.broadcast_to(self.effects, (len(v_s), *self.effects.shape))], axis=-1)

    def evaluate(self, v_s: np.ndarray) -> Grid:
        """Fit the law with each v_s (k,)."""
        design = self.design(v_s)
        scale = np.linalg.norm(design, axis=1) + 1e-300
        q, r = np.linalg.qr(design / scale[:, None, :])
        diagonal = np.abs(np.einsum("kii->ki", r)).min(axis=1)
        inverse = np.linalg.inv(np.where((diagonal < 1e-13)[:, None, None], np.eye(r.shape[1]), r))
        constants = np.einsum("kij,klj,l->ki", inverse, q, self.y) / scale
        residuals = self.y - np.einsum("kij,kj->ki", design, constants)
        squares = np.where(diagonal < 1e-13, np.inf, (residuals**2).sum(axis=1))
        return Grid(v_s, constants, (inverse**2).sum(axis=2) / scale**2, squares)

    def allowed_squares(self, grid: Grid) -> np.ndarray:
        """Return the sums of squares, infinite where friction would not fall from F_s to F_c >= 0."""
        if not self.law.exponent:
            return grid.squares
        coulomb, static = grid.constants[:, 0], grid.constants[:, 1]
        return np.where((static >= coulomb) & (coulomb >= 0.0), grid.squares, np.inf)

    def locate(self, coarse: Grid) -> Grid:
        """Return the fit with the best v_s."""
        squares = self.allowed_squares(coarse)
        i = int(np.argmin(squares))
        ends = coarse.v_s[max(i - 1, 0)], coarse.v_s[min(i + 1, COARSE - 1)]
        for _ in range(ZOOMS):
            grid = self.evaluate(np.geomspace(*ends, ZOOM))
            squares = self.allowed_squares(grid)
            i = int(np.argmin(squares))
            ends = grid.v_s[max(i - 1, 0)], grid.v_s[min(i + 1, ZOOM - 1)]
        if 0 < i < ZOOM - 1 and np.isfinite(squares[i - 1 : i + 2]).all():  # the vertex of the parabola
            before, at, after = squares[i - 1 : i + 2]
            shift = 0.5 * (before - after) / max(before - 2 * at + after, 1e-300)
            vertex = self.evaluate(grid.v_s[i : i + 1] * (grid.v_s[i + 1] / grid.v_s[i]) ** np.clip(shift, -1.0, 1.0))
            if self.allowed_squares(vertex)[0] <= at:
                return vertex
        item = slice(i, i + 1)
        return Grid(grid.v_s[item], grid.constants[item], grid.spread[item], squares[item])

    def estimates(self, margin: float, units: dict[str, str]) -> list[Estimate]:
        """Return the constants with the intervals in which the sum of squares rises by at most `margin`."""
        values = dict(zip(self.symbols, self.best.constants[0], strict=True))
        if self.law.exponent:
            values["v_s"] = float(self.best.v_s[0])
        intervals = dict.fromkeys(values, (np.nan, np.nan)) if np.isnan(margin) else self.intervals(values, margin)
        order = sorted(values, key=[*TEXTS].index)
        suffix, text = DIRECTIONS[self.direction]
        estimates = []
        for symbol in order:
            value, (low, high) = float(values[symbol]), map(float, intervals[symbol])
            estimates.append(Estimate(symbol + suffix, value, np.nan, low, high, units[symbol], TEXTS[symbol] + text))
        return estimates

    def intervals(self, values: dict[str, float], margin: float) -> dict[str, tuple[float, float]]:
        """Return the interval of each constant; its ends are infinite, or 0, if a v_s out of the range is possible."""
        level = float(self.best.squares[0]) + margin
        grid = self.refine(level)
        is_inside = grid.squares <= level
        reach = np.sqrt(grid.spread * np.where(is_inside, level - grid.squares, 0.0)[:, None])
        low = np.where(is_inside[:, None], grid.constants - reach, np.inf).min(axis=0)
        high = np.where(is_inside[:, None], grid.constants + reach, -np.inf).max(axis=0)
        intervals = {
            symbol: (min(low[i], values[symbol]), max(high[i], values[symbol])) for i, symbol in enumerate(self.symbols)
        }
        if self.law.exponent:
            first, last = grid.v_s[is_inside][[0, -1]] if is_inside.any() else (values["v_s"], values["v_s"])
            if first <= self.low * (1 + 1e-9):
                first, intervals["F_s"] = 0.0, (intervals["F_s"][0], np.inf)
            intervals["v_s"] = (min(first, values["v_s"]), np.inf if last >= self.high * (1 - 1e-9) else last)
        return intervals

    def refine(self, level: float) -> Grid:
        """Return a fine grid of the v_s whose sum of squares is at most `level`, with the best one."""
        if not self.law.exponent:
            return self.best
        grid = self.coarse
        for _ in range(ZOOMS):
            inner_points = np.flatnonzero(grid.squares <= level)
            nearest = int(np.argmin(np.abs(grid.v_s - self.best.v_s)))
            first, last = min([nearest, *inner_points]), max([nearest, *inner_points])
            if last - first >= FINE // 4:
                break
            ends = grid.v_s[max(first - 1, 0)], grid.v_s[min(last + 1, len(grid.v_s) - 1)]
            grid = self.evaluate(np.union1d(np.geomspace(*ends, FINE), self.best.v_s))
        return grid


def fit_law(
    law: Law,
    points: CurvePoints,
    known_bias: float | None,
    effects: Sequence[Effect] = (),
    has_intervals: bool = True,
    widening: float = 1.0,
) -> LawFit | str:
    """Fit a law to points.

    Parameters
    ----------
    known_bias : float or None
        Constant force that is no friction; None to fit it, with a symmetric law.
    effects : sequence of Effect
        Other forces that are fitted.
    has_intervals : bool
        Whether intervals are calculated, which takes most of the time; otherwise they are NaN.
    widening : float
        Factor of the variance, for residuals that are not independent.

    Returns
    -------
    LawFit or str
        The fit, or the reason why the law cannot be fitted.
    """
    n, bias = len(points.v), 0.0 if known_bias is None else known_bias
    parts = build_parts(law, points, effects, known_bias)
    if isinstance(parts, str):
        return parts
    count = sum(part.count for part in parts)
    min_points = max(count + MIN_FREEDOM, int(np.ceil(MIN_POINTS_PER_CONSTANT * count)))
    if n < min_points:
        return f"with {count} constants at least {min_points} points are required"
    if not all(part.is_valid for part in parts):
        return "friction does not fall with the speed"
    squares = max(sum(float(part.best.squares[0]) for part in parts), n * points.precision**2)
    variance = widening * squares / (n - count)
    margin = variance * student_quantile(n - count) ** 2 if has_intervals else np.nan
    estimates = tuple(estimate for part in parts for estimate in part.estimates(margin, points.units))
    criterion = float(n * np.log(squares / n) + count * np.log(n))
    fit = LawFit(law.name, estimates, bias, squares, n, criterion, tuple(effects))
    return with_errors(fit, points, variance) if has_intervals else fit


def with_errors(fit: LawFit, points: CurvePoints, variance: float) -> LawFit:
    """Return a fit with the standard errors of its linearised law."""
    _, jacobian, names = linearise(fit, points)
    scale = np.linalg.norm(jacobian, axis=0) + 1e-300
    covariance = np.linalg.pinv((jacobian / scale).T @ (jacobian / scale))
    errors = dict(zip(names, np.sqrt(variance * np.diag(covariance)) / scale, strict=True))
    return replace(fit, estimates=tuple(replace(item, error=float(errors[item.name])) for item in fit.estimates))


def build_parts(law: Law, points: CurvePoints, effects: Sequence[Effect], known_bias: float | None) -> list[Part] | str:
    """Return the parts of a law, or the reason why the points do not suffice for it."""
    v, bias = points.v, known_bias or 0.0
    min_speeds = MIN_SPEEDS[law.exponent] + (law.is_viscous and not law.exponent)
    if law.is_symmetric:
        if count_speeds(v) < min_speeds:
            return f"points at {min_speeds} different speeds are required"
        return [Part(law, points, effects, bias, 0, known_bias is None)]
    if len(set(np.sign(v))) < 2:
        return "points of both directions are required"
    if known_bias is None and not law.is_viscous:
        return "a bias in the law coulomb has the same effect"
    directions = [points.select(direction * v > 0) for direction in (1, -1)]
    if min(count_speeds(part.v) for part in directions) < min_speeds:
        return f"points at {min_speeds} different speeds in each direction are required"
    # in one direction, a drift of the bias is one of F_c
    part_effects = [
        effect for effect in effects if effect.name != "drift of bias" or Effect("drift of F_c") not in effects
    ]
    return [Part(law, part, part_effects, bias, sign, False) for part, sign in zip(directions, (1, -1), strict=True)]


def linearise(fit: LawFit, points: CurvePoints) -> tuple[np.ndarray, np.ndarray, list[str]]:
    """Return the residuals (n,) of a law, the derivatives (n, p) of its forces, and the names of its constants."""
    v, law, blocks, names = points.v, fit.law, [], list[str]()
    force = fit.known_bias + fit.effect_force(points)
    nodes, weights = points.nodes
    for suffix, sign in (("", 0),) if law.is_symmetric else (("+", 1), ("-", -1)):
        mask = sign * v >= 0
        constants = np.array([fit.values[name + suffix] for name in law.symbols])
        v_s = np.array([fit.values.get(f"v_s{suffix}", 1.0)])
        columns = [*law.design(nodes, v_s, False, weights)[0].T]
        names += [name + suffix for name in law.symbols]
        if "bias" in fit.values:
            names.append("bias")
            columns.append(np.ones(len(v)))
            constants = np.append(constants, fit.values["bias"])
        force = force + mask * (np.array(columns).T @ constants)
        if law.exponent:
            names.append(f"v_s{suffix}")
            step = 1e-5 * v_s
            ends = (law.design(nodes, v_s + side * step, False, weights)[0] for side in (1, -1))
            columns.append((next(ends) - next(ends)) @ constants[: len(law.symbols)] / (2 * step[0]))
        effects = [effect for effect in fit.effects if effect.name + suffix in fit.values]
        columns += [points.column(effect) for effect in effects]
        names += [effect.name + suffix for effect in effects]
        blocks.append(mask[:, None] * np.array(columns).T)
    return points.force - force, np.concatenate(blocks, axis=1), names


def count_speeds(v: np.ndarray) -> int:
    """Return the number of different speeds among velocities v (n,)."""
    return len(group_speeds(v))


def group_speeds(v: np.ndarray) -> list[np.ndarray]:
    """Return the indices of the velocities v (n,) whose speeds are nearly equal, by rising speed."""
    speeds = np.abs(v)
    order = np.argsort(speeds, kind="stable")
    groups: list[list[int]] = []
    for i in order:
        if groups and speeds[i] <= (1 + SAME_SPEED) * speeds[groups[-1][0]]:
            groups[-1].append(int(i))
        else:
            groups.append([int(i)])
    return [np.array(group) for group in groups]
