"""What a recorded motion is between its samples, where nothing may be made up.

Between two samples a variable follows Hermite's cubic of values and rates where its rate was recorded too, otherwise
a cubic that never leaves the values of both ends (F. N. Fritsch, J. Butland, A method for constructing local monotone
piecewise cubic interpolants, SIAM J. Sci. Stat. Comput. 5 (1984) 300-304); a whole number, as a mode, holds until the
next.  Where it jumps, all between both sides is as good.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.interpolate import CubicHermiteSpline, PchipInterpolator

from ...running.signals import Signals
from .units import is_rate_unit

LARGE, REDUCED = 1e150, 2.0**-600  # differences of larger values have no number: they are reckoned in a smaller unit
ALIKE = 0.02  # share of its way by which a variable may miss the integral of its rate
PARTS, FILTER = 32, 1.01  # a sum over parts misses no more than that over steps, but for rounding


@dataclass(frozen=True)
class ValueBounds:
    """Values between `low` and `high` (n,): equal where nothing jumps."""

    low: np.ndarray
    high: np.ndarray


@dataclass(frozen=True)
class Interpolant:
    """What a trajectory is between its samples."""

    path: Signals

    def bounds_at(self, name: str, at: np.ndarray, jumps: np.ndarray) -> ValueBounds:
        """A variable at the times `at` (n,), which the trajectory covers; `jumps` (k, 2) are the stretches of time in
        each of which it jumps once, in s."""
        t, y = self.path.time, self.path.columns[name]
        if not np.isfinite(y).all():
            held = y[np.searchsorted(t, at, "right") - 1]
            held = np.where(np.isin(at, t), held, np.nan)  # nobody knows what lies between
            return ValueBounds(held, held)
        if np.isin(at, t).all() or (y == np.rint(y)).all():
            smooth = y[np.searchsorted(t, at, "right") - 1]
        else:
            scale = REDUCED if np.abs(y).max() > LARGE else 1.0
            smooth = follow(t, scale * y, self.rate(name, scale), at) / scale
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
        return ValueBounds(low, high)

    def rate(self, name: str, scale: float) -> np.ndarray | None:
        """The recorded rate (n,) of a variable: of a unit per second, with an integral that is the variable's own way;
        all values times the scale."""
        columns, units = self.path.columns, self.path.units
        h, way = np.diff(self.path.time), np.diff(scale * columns[name])
        way = np.where(h > 0, way, 0.0)
        far, ways = ALIKE * np.abs(way).sum(), np.add.reduceat(way, self.parts)
        found = {}
        for other, integrals in self.integrals.items():
            if is_rate_unit(units[other], units[name]) and not np.abs(ways - scale * integrals).sum() > FILTER * far:
                slope = scale * columns[other]
                missed = np.abs(way - h * (slope[1:] + slope[:-1]) / 2).sum()
                if missed <= far:
                    found[missed] = slope
        return found[min(found)] if found else None

    @cached_property
    def parts(self) -> np.ndarray:
        """Where the parts (p,) begin over which integrals are compared first."""
        return np.unique(np.linspace(0, len(self.path.time) - 1, PARTS, endpoint=False).astype(int))

    @cached_property
    def integrals(self) -> dict[str, np.ndarray]:
        """Of every column that may be a rate its integrals (p,) over the parts."""
        h = np.diff(self.path.time)
        finite = {name: y for name, y in self.path.columns.items() if y.dtype.kind != "U" and np.isfinite(y).all()}
        with np.errstate(over="ignore"):
            return {name: np.add.reduceat(h * (y[1:] / 2 + y[:-1] / 2), self.parts) for name, y in finite.items()}


def follow(t: np.ndarray, y: np.ndarray, slope: np.ndarray | None, at: np.ndarray) -> np.ndarray:
    """The values at the times `at`, of the side that holds afterwards where t stands twice."""
    holds = np.append(np.diff(t) > 0, True)
    t, y = t[holds], y[holds]
    if slope is None:
        return PchipInterpolator(t, y)(at)
    return CubicHermiteSpline(t, y, slope[holds])(at)
