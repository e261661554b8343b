"""Quantities: numbers with name, unit and description, measured or published; those of the step sizes of a solver."""

from dataclasses import dataclass
from math import ceil, isfinite, log10, pi

import numpy as np

# Units of published quantities: SI unit and size in it.
PUBLISHED_UNITS = {
    "ms": ("s", 1e-3),
    "deg": ("rad", pi / 180),
    "lbf.in": ("N.m", 0.45359237 * 9.80665 * 0.0254),
}

MAX_ASYMMETRY = 0.1  # relative to the width; more asymmetric intervals are written with both ends
MAX_DIGITS = 8  # of a value with an interval
EXTRA_DIGITS = 2  # of a value whose margins differ, for the smaller one


@dataclass(frozen=True)
class Quantity:
    """Measured number: `name` as in the [published] table of a scene, `value` in the SI `unit`, description `text`."""

    name: str
    value: float
    unit: str
    text: str

    def format(self) -> tuple[str, str]:
        """Return value and unit for display: five digits, times below a second in ms."""
        value, unit = self.value, self.unit
        if unit == "s" and abs(value) < 1:
            value, unit = 1e3 * value, "ms"
        return format_number(value), "" if unit == "1" else unit

    def to_unit(self, unit: str) -> float:
        """Return the value in another unit; raise KeyError if the unit has another dimension."""
        if unit == self.unit:
            return self.value
        base, size = PUBLISHED_UNITS[unit]
        if base != self.unit:
            raise KeyError(unit)
        return self.value / size


@dataclass(frozen=True)
class AnalysisResult:
    """Quantities that an analysis has measured."""

    quantities: tuple[Quantity, ...]


def display_unit(unit: str) -> tuple[str, float]:
    """Return the unit for display, degrees for angles and their derivatives, and its size in the given unit."""
    return (unit.replace("rad", "deg"), pi / 180) if unit in ("rad", "rad/s", "rad/s2") else (unit, 1.0)


def divide_units(top: str, bottom: str) -> str:
    """Return the unit of a derivative; the unit of a ratio is empty."""
    if not bottom:
        return top
    top, bottom = (f"({unit})" if {*unit} & {*"./"} else unit for unit in (top or "1", bottom))
    return f"{top}/{bottom}"


def format_number(value: float, digits: int = 5) -> str:
    """Return a number with the given digits; an integer with all of its digits."""
    return str(value) if isinstance(value, int) else f"{value:.{digits}g}"


def format_power(value: float) -> str:
    """Format a power of ten: 1e-6."""
    return f"{value:.0e}".replace("e-0", "e-")


def format_interval(value: float, low: float, high: float) -> str:
    """Return a value with its interval for display.

    The margin determines the digits, the smaller one if the interval is asymmetric. The interval is written as ± half
    of its width, or with both ends if it is asymmetric. Without an interval (NaN or infinity) only the value is
    returned.
    """
    lower_margin, upper_margin = value - low, high - value
    if not isfinite(upper_margin):
        return f"{value:.5g}"
    if value == 0:
        return f"< {high:.2g}"
    margin = max(lower_margin, upper_margin)
    digits = min(max(ceil(log10(abs(value) / margin)) + 1, 1), MAX_DIGITS) if margin > 0 else MAX_DIGITS
    if digits == MAX_DIGITS or abs(upper_margin - lower_margin) <= MAX_ASYMMETRY * (upper_margin + lower_margin):
        return f"{value:.{digits}g} ± {margin:.2g}"
    smaller = min(lower_margin, upper_margin)
    if smaller > 0:
        digits = min(ceil(log10(abs(value) / smaller)) + 1, digits + EXTRA_DIGITS)
    digits = max(digits, 2)
    return f"{value:.{digits}g} ({low:.{digits}g} to {high:.{digits}g})"


def step_size_quantities(h: np.ndarray, n_rejected: int, collapse: float | None = None) -> tuple[Quantity, ...]:
    """Return the statistics of step sizes.

    Parameters
    ----------
    h : numpy.ndarray
        Accepted step sizes (n,) in s.
    n_rejected : int
        Number of rejected steps.
    collapse : float, optional
        Reduction of the step size at reversals; None without reversals.
    """
    quantities = [
        Quantity("steps", len(h) + 1, "", "steps (time points)"),
        Quantity("mean_step", published_mean_step(h), "s", "mean step"),
        Quantity("smallest_step", float(h.min()), "s", "smallest step"),
        Quantity("largest_step", float(h.max()), "s", "largest step"),
        Quantity("refused", n_rejected / (n_rejected + len(h)), "1", "share of refused steps"),
    ]
    if collapse is not None:
        quantities.append(Quantity("collapse", collapse, "1", "collapse at reversals"))
    return tuple(quantities)


def published_mean_step(h: np.ndarray) -> float:
    """Return the mean step of h (n,) with the last one counted twice, as in the published values."""
    return float((h.sum() + h[-1]) / (len(h) + 1))
