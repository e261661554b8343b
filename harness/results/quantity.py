"""A number with its name, unit and sentence, as measured or as published."""

from dataclasses import dataclass
from math import pi

# Units in which figures are published: the SI unit and the size of one in it.
UNITS = {
    "ms": ("s", 1e-3),
    "deg": ("rad", pi / 180),
    "lbf.in": ("N.m", 0.45359237 * 9.80665 * 0.0254),
}


@dataclass(frozen=True)
class Quantity:
    """One measured number: `name` as in a scene's [published], `value` in `unit` (SI), `text` for people."""

    name: str
    value: float
    unit: str
    text: str

    def in_unit(self, unit: str) -> float:
        """The value in another unit of the table; KeyError if it does not measure the same thing."""
        if unit == self.unit:
            return self.value
        base, size = UNITS[unit]
        if base != self.unit:
            raise KeyError(unit)
        return self.value / size
