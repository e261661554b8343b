"""What a recorded motion is between its samples, where nothing may be made up.

Between two samples a variable follows Hermite's cubic of values and rates where its rate was recorded too, otherwise
a cubic that never leaves the values of both ends (F. N. Fritsch, J. Butland, A method for constructing local monotone
piecewise cubic interpolants, SIAM J. Sci. Stat. Comput. 5 (1984) 300-304); a whole number, as a mode, holds until the
next.  Where it jumps, all between both sides is as good.
"""

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicHermiteSpline, PchipInterpolator

from ...running.trajectory import Trajectory
from .units import is_rate

LARGE, REDUCED = 1e150, 2.0**-600  # differences of larger values have no number: they are reckoned in a smaller unit
ALIKE = 0.02  # share of its way by which a variable may miss the integral of its rate


@dataclass(frozen=True)
class Sides:
    """Values between `low` and `high` (n,): equal where nothing jumps."""

    low: np.ndarray
    high: np.ndarray


def sides(path: Trajectory, name: str, at: np.ndarray, jumps: np.ndarray) -> Sides:
    """A variable at the times `at` (n,), which the trajectory covers; `jumps` (k, 2) are the stretches of time in each
    of which it jumps once, in s."""
    t, y = path.time, path.columns[name]
    if not np.isfinite(y).all():
        held = y[np.searchsorted(t, at, "right") - 1]
        held = np.where(np.isin(at, t), held, np.nan)  # nobody knows what lies between
        return Sides(held, held)
    scale = REDUCED if np.abs(y).max() > LARGE else 1.0
    smooth = follow(t, scale * y, rate(path, name, scale), at) / scale
    low, high = smooth.copy(), smooth.copy()

    def widen(begin: float, end: float, first: int, last: int) -> None:
        here = slice(int(np.searchsorted(at, begin, "left")), int(np.searchsorted(at, end, "right")))
        low[here] = np.minimum(low[here], y[first : last + 1].min())
        high[here] = np.maximum(high[here], y[first : last + 1].max())

    for begin, end in jumps:
        first = max(int(np.searchsorted(t, begin, "left")) - 1, 0)
        last = min(int(np.searchsorted(t, end, "left")), len(t) - 1)
        widen(np.nextafter(min(begin, t[first]), np.inf), max(end, np.nextafter(t[last], -np.inf)), first, last)
    for before in np.flatnonzero(np.diff(t) == 0).tolist():
        widen(t[before], t[before], before, before + 1)
    return Sides(low, high)


def follow(t: np.ndarray, y: np.ndarray, slope: np.ndarray | None, at: np.ndarray) -> np.ndarray:
    """The values at the times `at`, of the side that holds afterwards where t stands twice."""
    holds = np.append(np.diff(t) > 0, True)
    t, y = t[holds], y[holds]
    if len(t) < 2 or (y == np.rint(y)).all():
        return y[np.searchsorted(t, at, "right") - 1]
    if slope is None:
        return PchipInterpolator(t, y)(at)
    return CubicHermiteSpline(t, y, slope[holds])(at)


def rate(path: Trajectory, name: str, scale: float) -> np.ndarray | None:
    """The recorded rate (n,) of a variable: of a unit per second, with an integral that is the variable's own way; all
    values times the scale."""
    y = scale * path.columns[name]
    h, way = np.diff(path.time), np.diff(y)
    found = {}
    for other, slope in path.columns.items():
        if slope.dtype.kind != "U" and is_rate(path.units[other], path.units[name]) and np.isfinite(slope).all():
            slope = scale * slope
            missed = np.abs(way - h * (slope[1:] + slope[:-1]) / 2)[h > 0].sum()
            if missed <= ALIKE * np.abs(way).sum():
                found[missed] = slope
    return found[min(found)] if found else None
