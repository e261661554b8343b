"""A number with its name, unit and sentence, as measured or as published."""

from dataclasses import dataclass
from math import ceil, isfinite, log10, pi

# Units in which figures are published: the SI unit and the size of one in it.
PUBLISHED_UNITS = {
    "ms": ("s", 1e-3),
    "deg": ("rad", pi / 180),
    "lbf.in": ("N.m", 0.45359237 * 9.80665 * 0.0254),
}

MAX_ASYMMETRY = 0.1  # of an interval: beyond, its ends are told rather than its half
MAX_DIGITS = 8  # digits, in which ends that are nearer to each other are alike


@dataclass(frozen=True)
class Quantity:
    """One measured number: `name` as in a scene's [published], `value` in `unit` (SI), `text` for people."""

    name: str
    value: float
    unit: str
    text: str

    def formatted(self) -> tuple[str, str]:
        """Value and unit as people read them: five digits, times below a second in ms."""
        value, unit = self.value, self.unit
        if unit == "s" and abs(value) < 1:
            value, unit = 1e3 * value, "ms"
        return format_number(value), "" if unit == "1" else unit

    def to_unit(self, unit: str) -> float:
        """The value in another unit of the table; KeyError if it does not measure the same thing."""
        if unit == self.unit:
            return self.value
        base, size = PUBLISHED_UNITS[unit]
        if base != self.unit:
            raise KeyError(unit)
        return self.value / size


@dataclass(frozen=True)
class AnalysisResult:
    """What an analysis has found."""

    quantities: tuple[Quantity, ...]


def display_unit(unit: str) -> tuple[str, float]:
    """The unit in which people look at what is in a `unit`, degrees for angles and their rates, and its size in it."""
    return (unit.replace("rad", "deg"), pi / 180) if unit in ("rad", "rad/s", "rad/s2") else (unit, 1.0)


def format_number(value: float, digits: int = 5) -> str:
    """A number with so many digits; a count with all of its own."""
    return str(value) if isinstance(value, int) else f"{value:.{digits}g}"


def format_interval(value: float, low: float, high: float) -> str:
    """A value, with the digits that its interval leaves, and half of it; its ends where they are not alike; the value
    alone where there is none (NaN or infinity)."""
    below, above = value - low, high - value
    if not isfinite(above):
        return f"{value:.5g}"
    if value == 0:
        return f"< {high:.2g}"
    margin = max(below, above)
    digits = min(max(ceil(log10(abs(value) / margin)) + 1, 1), MAX_DIGITS) if margin > 0 else MAX_DIGITS
    if digits == MAX_DIGITS or abs(above - below) <= MAX_ASYMMETRY * (above + below):
        return f"{value:.{digits}g} ± {margin:.2g}"
    digits = max(digits, 2)
    return f"{value:.{digits}g} ({low:.{digits}g} to {high:.{digits}g})"
