"""Least-squares fit of one law, with 95 % intervals from its profile likelihood.

Given v_s, a law is linear, so that the best constants, their covariance and the sum of squares follow from a QR
decomposition. All of them are evaluated on a grid of v_s. A value of a constant is in its interval if some v_s gives a
sum of squares of at most the smallest one times 1 + t^2/(n - p), with Student's t. This is exact for the constants of a
linear law.
"""

from dataclasses import dataclass

import numpy as np

from ..estimation.estimate import Estimate, student_quantile
from .laws import BY_NAME, Law

COARSE, FINE = 64, 256  # values of v_s, in its range and in its interval
ZOOM, ZOOMS = 25, 3  # values of v_s about the best one, and number of repetitions
ROUNDOFF = 1e-12  # relative to the largest force: smaller residuals are rounding errors
MIN_FREEDOM = 2  # points beyond the number of constants
MIN_POINTS_PER_CONSTANT = 1.5  # with fewer, the BIC prefers laws with too many constants
MIN_SPEEDS = {0: 1, 1: 4, 2: 4}  # different speeds of one direction, by the exponent of the law
SAME_SPEED = 0.05  # relative distance of speeds that are one
TEXTS = {
    "F_c": "Coulomb friction",
    "F_s": "static friction",
    "F_v": "viscous friction",
    "v_s": "Stribeck velocity",
    "bias": "constant bias or gravity",
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
    """

    name: str
    estimates: tuple[Estimate, ...]
    known_bias: float
    sum_of_squares: float
    points: int
    bic: float

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


@dataclass
class Grid:
    """Fits of a law with each v_s (k,): constants and the diagonal of (X^T X)^-1 (k, p), and sums of squares (k,)."""

    v_s: np.ndarray
    constants: np.ndarray
    spread: np.ndarray
    squares: np.ndarray


class Part:
    """The points to which a law fits one set of constants: those of one direction, or of both."""

    def __init__(self, law: Law, v: np.ndarray, force: np.ndarray, direction: int, has_bias: bool) -> None:
        self.law, self.v, self.y, self.direction, self.has_bias = law, v, force, direction, has_bias
        self.symbols = (*law.symbols, *(["bias"] if has_bias else []))
        self.count = len(self.symbols) + bool(law.exponent)
        if law.exponent:
            self.low, self.high = law.stribeck_range(np.abs(v))
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

    def evaluate(self, v_s: np.ndarray) -> Grid:
        """Fit the law with each v_s (k,)."""
        design = self.law.design(self.v, v_s, self.has_bias)
        scale = np.linalg.norm(design, axis=1) + 1e-300
        q, r = np.linalg.qr(design / scale[:, None, :])
        diagonal = np.abs(np.einsum("kii->ki", r)).min(axis=1)
        inverse = np.linalg.inv(r + np.where(diagonal < 1e-13, 1.0, 0.0)[:, None, None] * np.eye(r.shape[1]))
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

    def estimates(self, margin: float, variance: float, units: dict[str, str]) -> list[Estimate]:
        """Return the constants with the intervals in which the sum of squares rises by at most `margin`."""
        values = dict(zip(self.symbols, self.best.constants[0], strict=True))
        if self.law.exponent:
            values["v_s"] = float(self.best.v_s[0])
        intervals = dict.fromkeys(values, (np.nan, np.nan)) if np.isnan(margin) else self.intervals(values, margin)
        errors = self.standard_errors(variance)
        order = [symbol for symbol in ("F_c", "F_s", "v_s", "F_v", "bias") if symbol in values]
        suffix, text = DIRECTIONS[self.direction]
        estimates = []
        for symbol in order:
            value, error, (low, high) = float(values[symbol]), float(errors[symbol]), map(float, intervals[symbol])
            estimates.append(Estimate(symbol + suffix, value, error, low, high, units[symbol], TEXTS[symbol] + text))
        return estimates

    def intervals(self, values: dict[str, float], margin: float) -> dict[str, tuple[float, float]]:
        """Return the interval of each constant; its ends are infinite, or 0, if a v_s out of the range is possible."""
        level = float(self.best.squares[0]) + margin
        grid = self.refine(level)
        inside = grid.squares <= level
        reach = np.sqrt(grid.spread * np.where(inside, level - grid.squares, 0.0)[:, None])
        low = np.where(inside[:, None], grid.constants - reach, np.inf).min(axis=0)
        high = np.where(inside[:, None], grid.constants + reach, -np.inf).max(axis=0)
        intervals = {
            symbol: (min(low[i], values[symbol]), max(high[i], values[symbol])) for i, symbol in enumerate(self.symbols)
        }
        if self.law.exponent:
            first, last = grid.v_s[inside][[0, -1]] if inside.any() else (values["v_s"], values["v_s"])
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
            inside = np.flatnonzero(grid.squares <= level)
            nearest = int(np.argmin(np.abs(grid.v_s - self.best.v_s)))
            first, last = min([nearest, *inside]), max([nearest, *inside])
            if last - first >= FINE // 4:
                break
            ends = grid.v_s[max(first - 1, 0)], grid.v_s[min(last + 1, len(grid.v_s) - 1)]
            grid = self.evaluate(np.union1d(np.geomspace(*ends, FINE), self.best.v_s))
        return grid

    def standard_errors(self, variance: float) -> dict[str, float]:
        """Return the standard errors of the constants from the linearised law."""
        v_s = self.best.v_s
        jacobian = self.law.design(self.v, v_s, self.has_bias)[0]
        symbols = self.symbols
        if self.law.exponent:
            step = 1e-5 * v_s
            ends = (self.law.design(self.v, v_s + sign * step, self.has_bias)[0] for sign in (1.0, -1.0))
            difference = next(ends) - next(ends)
            slope = difference @ self.best.constants[0] / (2 * step[0])
            jacobian, symbols = np.column_stack([jacobian, slope]), (*symbols, "v_s")
        scale = np.linalg.norm(jacobian, axis=0) + 1e-300
        covariance = np.linalg.pinv((jacobian / scale).T @ (jacobian / scale))
        return dict(zip(symbols, np.sqrt(variance * np.diag(covariance)) / scale, strict=True))


def fit_law(
    law: Law,
    v: np.ndarray,
    force: np.ndarray,
    known_bias: float | None,
    units: dict[str, str],
    has_intervals: bool = True,
) -> LawFit | str:
    """Fit a law to forces (n,) at velocities v (n,) that are not zero.

    Parameters
    ----------
    known_bias : float or None
        Constant force that is no friction; None to fit it, with a symmetric law.
    units : dict
        Units of F_c, F_s, F_v, v_s and bias.
    has_intervals : bool
        Whether intervals are calculated, which takes most of the time; otherwise they are NaN.

    Returns
    -------
    LawFit or str
        The fit, or the reason why the law cannot be fitted.
    """
    bias = 0.0 if known_bias is None else known_bias
    parts = build_parts(law, v, force - bias, known_bias is None)
    if isinstance(parts, str):
        return parts
    count = sum(part.count for part in parts)
    required = max(count + MIN_FREEDOM, int(np.ceil(MIN_POINTS_PER_CONSTANT * count)))
    if len(v) < required:
        return f"with {count} constants at least {required} points are required"
    if not all(part.is_valid for part in parts):
        return "friction does not fall with the speed"
    floor = len(v) * (ROUNDOFF * float(np.abs(force).max())) ** 2
    squares = max(sum(float(part.best.squares[0]) for part in parts), floor)
    variance = squares / (len(v) - count)
    margin = variance * student_quantile(len(v) - count) ** 2 if has_intervals else np.nan
    estimates = tuple(estimate for part in parts for estimate in part.estimates(margin, variance, units))
    return LawFit(law.name, estimates, bias, squares, len(v), information_criterion(squares, len(v), count))


def build_parts(law: Law, v: np.ndarray, force: np.ndarray, fits_bias: bool) -> list[Part] | str:
    """Return the parts of a law, or the reason why the points do not suffice for it."""
    directions = [direction for direction in (1, -1) if (direction * v > 0).any()]
    required = MIN_SPEEDS[law.exponent] + (law.is_viscous and not law.exponent)
    if law.is_symmetric:
        if count_speeds(v) < required:
            return f"points at {required} different speeds are required"
        return [Part(law, v, force, 0, fits_bias)]
    if len(directions) < 2:
        return "points of both directions are required"
    if fits_bias and not law.is_viscous:
        return "a bias in the law coulomb has the same effect"
    masks = [direction * v > 0 for direction in directions]
    if min(count_speeds(v[mask]) for mask in masks) < required:
        return f"points at {required} different speeds in each direction are required"
    return [
        Part(law, v[mask], force[mask], direction, False) for direction, mask in zip(directions, masks, strict=True)
    ]


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


def information_criterion(squares: float, points: int, constants: int) -> float:
    """Return the Bayesian information criterion of a fit with unknown noise."""
    return float(points * np.log(squares / points) + constants * np.log(points))
