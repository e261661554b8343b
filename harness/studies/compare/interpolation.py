"""Interpolation between the samples of a trajectory.

If the rate of a variable was recorded, interpolation is by cubic Hermite polynomials of values and rates, otherwise by
monotone cubics (F. N. Fritsch, J. Butland, A method for constructing local monotone piecewise cubic interpolants, SIAM
J. Sci. Stat. Comput. 5 (1984) 300-304).  Held variables, such as modes, keep their last value.  Across a jump, every
value between both sides is accepted.
"""

from collections.abc import Set
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.interpolate import CubicHermiteSpline, PchipInterpolator

from ...records.units import is_rate_unit
from ...simulation.signals import Signals

TIME_ROUNDING = 8 * np.finfo(float).eps  # times that differ by this fraction are equal but for rounding
LARGE_VALUE, REDUCTION = 1e150, 2.0**-600  # larger values are scaled to avoid overflow
RATE_TOLERANCE = 0.02  # allowed deviation from the integral of the rate, relative to the total variation
N_PARTS, ROUNDING_FACTOR = 32, 1.01  # a coarse check over parts, with a factor for rounding


@dataclass(frozen=True)
class ValueBounds:
    """Bounds `low` and `high` (n,) of a variable; they are equal except across jumps."""

    low: np.ndarray
    high: np.ndarray


@dataclass(frozen=True)
class SignalInterpolant:
    """Interpolation of signals between its samples; the variables in `held_variables` keep their last value."""

    signals: Signals
    held_variables: Set[str] = frozenset()

    def bounds_at(self, name: str, at: np.ndarray, jumps: np.ndarray) -> ValueBounds:
        """Return the bounds of a variable at given times.

        Parameters
        ----------
        name : str
            Name of the variable.
        at : numpy.ndarray
            Times (n,) in s, within the trajectory.
        jumps : numpy.ndarray
            Time intervals (k, 2) in s, in each of which the variable jumps once.
        """
        t, y = self.signals.time, self.signals.columns[name]
        index = self.sample_indices(at)
        if not np.isfinite(y).all():
            values = np.where(index < 0, np.nan, y[index])  # unknown between samples
            return ValueBounds(values, values)
        if (index >= 0).all():
            smooth = y[index]
        elif name in self.held_variables:
            smooth = y[np.searchsorted(t, at, "right") - 1]
        else:
            scale = REDUCTION if np.abs(y).max() > LARGE_VALUE else 1.0
            smooth = interpolate(t, scale * y, self.rate(name, scale), at) / scale
        low, high = smooth.copy(), smooth.copy()

        def widen(begin: float, end: float, first: int, last: int) -> None:
            interval = slice(int(np.searchsorted(at, begin, "left")), int(np.searchsorted(at, end, "right")))
            low[interval] = np.minimum(low[interval], y[first : last + 1].min())
            high[interval] = np.maximum(high[interval], y[first : last + 1].max())

        for begin, end in jumps:
            first = max(int(np.searchsorted(t, begin, "left")) - 1, 0)
            last = min(int(np.searchsorted(t, end, "left")), len(t) - 1)
            widen(np.nextafter(min(begin, t[first]), np.inf), max(end, np.nextafter(t[last], -np.inf)), first, last)
        for before in np.flatnonzero(np.diff(t) == 0).tolist():
            widen(t[before], t[before], before, before + 1)
        return ValueBounds(low, high)

    def sample_indices(self, at: np.ndarray) -> np.ndarray:
        """Return the indices (n,) of the samples at given times in s, -1 between samples; at a jump, the second sample.

        The times of one grid may differ by rounding in two runs.
        """
        t = self.signals.time
        before = np.searchsorted(t, at, "right") - 1
        after = np.minimum(before + 1, len(t) - 1)
        nearest = np.where(np.abs(t[after] - at) < np.abs(t[before] - at), after, before)
        return np.where(np.abs(t[nearest] - at) <= TIME_ROUNDING * np.abs(at), nearest, -1)

    def rate(self, name: str, scale: float) -> np.ndarray | None:
        """Return the recorded rate (n,) of a variable times `scale`, or None.

        A rate has the unit of the variable per second, and its integral matches the change of the variable.
        """
        columns, units = self.signals.columns, self.signals.units
        h, change = np.diff(self.signals.time), np.diff(scale * columns[name])
        change = np.where(h > 0, change, 0.0)
        tolerance, changes = RATE_TOLERANCE * np.abs(change).sum(), np.add.reduceat(change, self.parts)
        candidates = {}
        for other, integrals in self.integrals.items():
            if (
                is_rate_unit(units[other], units[name])
                and not np.abs(changes - scale * integrals).sum() > ROUNDING_FACTOR * tolerance
            ):
                slope = scale * columns[other]
                deviation = np.abs(change - h * (slope[1:] + slope[:-1]) / 2).sum()
                if deviation <= tolerance:
                    candidates[deviation] = slope
        return candidates[min(candidates)] if candidates else None

    @cached_property
    def parts(self) -> np.ndarray:
        """Return the first indices (p,) of the parts over which integrals are compared first."""
        return np.unique(np.linspace(0, len(self.signals.time) - 1, N_PARTS, endpoint=False).astype(int))

    @cached_property
    def integrals(self) -> dict[str, np.ndarray]:
        """Return the integrals (p,) over the parts, for every column that may be a rate."""
        h = np.diff(self.signals.time)
        finite = {name: y for name, y in self.signals.columns.items() if y.dtype.kind != "U" and np.isfinite(y).all()}
        with np.errstate(over="ignore"):
            return {name: np.add.reduceat(h * (y[1:] / 2 + y[:-1] / 2), self.parts) for name, y in finite.items()}


def interpolate(t: np.ndarray, y: np.ndarray, slope: np.ndarray | None, at: np.ndarray) -> np.ndarray:
    """Interpolate at the times `at`; if a time occurs twice, its second value is used."""
    is_last = np.append(np.diff(t) > 0, True)
    t, y = t[is_last], y[is_last]
    if slope is None:
        return PchipInterpolator(t, y)(at)
    return CubicHermiteSpline(t, y, slope[is_last])(at)
